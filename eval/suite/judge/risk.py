"""What the driving safety field says of the users of a log, beside what RSS says: a measure, never a verdict."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from rss_shield.eval.trace_risk import risk_of_trace
from rss_shield.shield.risk import STATES
from rss_shield.shield.trace import Trace


def risk_table(trace: Trace, users: Iterable[int]) -> pd.DataFrame:
    """One row a user: id, largest RDSI of one source, seconds in each class, least TTC and THW [s], largest DRAC.

    DRAC in m/s^2. NaN where it never had a leader. See `eval.trace_risk.risk_of_trace`.
    """
    rows = []
    for user in users:
        risk = risk_of_trace(trace, user)
        times = {f"time_{name}": float((risk.state == k).sum() * trace.dt) for k, name in enumerate(STATES)}
        ttc, thw, drac = (np.where(np.isfinite(series), series, np.nan) for series in (risk.ttc, risk.thw, risk.drac))
        rows.append(
            {
                "user": trace.users.ids[user],
                "max_rdsi": float(np.nanmax(risk.largest)),
                **times,
                "min_ttc": _least(ttc),
                "min_thw": _least(thw),
                "max_drac": -_least(-drac),
            }
        )
    return pd.DataFrame(rows)


def risk_lines(table: pd.DataFrame) -> list[str]:
    """The same for people, a line a user."""
    return [
        f"{row['user']}: RDSI up to {row['max_rdsi']:.2f}; "
        + ", ".join(f"{row[f'time_{name}']:.1f} s {name.replace('_', ' ')}" for name in STATES)
        + f"; least TTC {row['min_ttc']:.1f} s, least THW {row['min_thw']:.1f} s"
        for row in table.to_dict("records")
    ]


def _least(series: np.ndarray) -> float:
    known = series[~np.isnan(series)]
    return float(known.min()) if len(known) else float("nan")
