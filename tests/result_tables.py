"""Episodes as a run writes them, made up by hand."""

import numpy as np
import pandas as pd


def episodes_of(blames: list[str], train: str = "off", test: str = "off", crashed=None) -> pd.DataFrame:
    n = len(blames)
    return pd.DataFrame(
        {
            "seed": range(n),
            "train_seed": 0,
            "train": train,
            "test": test,
            "blame": [blame or "no contact" for blame in blames],
            "crashed": [bool(b) for b in blames] if crashed is None else crashed,
            "return": np.arange(n, dtype=float),
            "speed": 25.0,
            "length": 10,
            "override_share": 0.25,
            "anticipation_share": 0.5,
            "mean_acceleration_change": 1.5,
            "rms_jerk": np.arange(n, dtype=float),
            "hard_braking_share": 0.125,
            "comfortable_share": 0.75,
            "min_time_gap": np.arange(n, dtype=float),
            "min_ttc": np.arange(n, dtype=float),
        }
    )
