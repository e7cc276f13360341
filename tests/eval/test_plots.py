"""The figures exist, open as images, show something, and do not change for the same data."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from result_tables import episodes_of

from rss_shield.eval.plots import plot_blame, plot_learning_curve


def a_curve(n: int) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        {
            "arm": ["unshielded", "shielded"] * n,
            "train_seed": 0,
            "timesteps": np.repeat(np.arange(n) * 10 + 5, 2),
            "started": np.repeat(np.arange(n) * 10, 2),
            "length": 5,
            "cut": rng.integers(0, 4, 2 * n) == 0,
            "return": rng.normal(10, 2, 2 * n),
            "crashed": rng.integers(0, 2, 2 * n),
            "blame": rng.choice(["no contact", "ego", "other"], 2 * n),
            "override_share": rng.random(2 * n),
        }
    )


def some_episodes() -> pd.DataFrame:
    blames = ["ego", "both", "other", "inherited", "none", ""] * 5
    cells = [(train, test) for train in ("off", "on") for test in ("off", "on")]
    return pd.concat([episodes_of(blames, train, test) for train, test in cells])


def assert_is_a_picture(path):
    with Image.open(path) as image:
        image.load()
        assert image.width > 1000
        assert len(np.unique(np.asarray(image.convert("L")))) > 10


@pytest.mark.slow
@pytest.mark.parametrize("n", [0, 1, 100])
def test_learning_curves_of_any_length_are_drawn(n, tmp_path):
    plot_learning_curve(a_curve(n), tmp_path, "a road")
    assert_is_a_picture(tmp_path / "learning_curve.png")
    assert (tmp_path / "learning_curve.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
@pytest.mark.parametrize("episodes", [some_episodes(), episodes_of(["", ""])], ids=["crashes", "no crash"])
def test_blame_is_drawn(episodes, tmp_path):
    plot_blame(episodes, tmp_path, "a road")
    assert_is_a_picture(tmp_path / "blame.png")
    assert (tmp_path / "blame.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
def test_the_same_data_give_the_same_files(tmp_path):
    pictures = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        plot_blame(some_episodes(), tmp_path / name, "a road")
        pictures.append([(tmp_path / name / f"blame.{kind}").read_bytes() for kind in ("png", "pdf")])
    assert pictures[0] == pictures[1]
