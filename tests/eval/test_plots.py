"""The figures exist, open as images, show something, and do not change for the same data."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from result_tables import episodes_of

from rss_shield.eval import frontier
from rss_shield.eval.frontier import limits_of
from rss_shield.eval.metrics import summarise
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


def frontier_rows(*seeds: tuple[float, float]) -> pd.DataFrame:
    values = np.arange(len(seeds), dtype=float)
    frame = pd.DataFrame({"value": values, "low": values - 0.5, "high": values + 0.5})
    return frame.assign(seed_low=[low for low, _ in seeds], seed_high=[high for _, high in seeds])


def test_whiskers_of_the_frontier_are_within_its_axes():
    low, high = limits_of(frontier_rows((-0.7, 0.7), (0.2, 1.8)), "return")
    assert low < -0.7 and high > 1.8


def test_an_interval_over_seeds_that_would_hide_the_points_is_cut_at_the_frame():
    # over episodes -0.5 to 1.5; at most as much on either side, and a margin of 6 % of all
    low, high = limits_of(frontier_rows((-50.0, 50.0), (np.nan, np.nan)), "return")
    assert (low, high) == (pytest.approx(-2.5 - 0.36), pytest.approx(3.5 + 0.36))


def test_where_nothing_is_known_an_axis_has_ends():
    unknown = frontier_rows((np.nan, np.nan)).assign(value=np.nan, low=np.nan, high=np.nan)
    assert limits_of(unknown, "crash") == (0.0, 1.0)
    assert limits_of(unknown.iloc[:0], "crash") == (0.0, 1.0)


@pytest.mark.slow
def test_every_whisker_over_episodes_is_drawn_to_its_end(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(frontier, "save", lambda figure, stem: drawn.append(figure))
    episodes = [episodes_of(["ego"] * (4 * k) + [""] * (30 - 4 * k), name, test)
                for k, name in enumerate(("off", "on", "lazy")) for test in ("off", "on")]  # fmt: skip
    frontier.plot_frontier(summarise(pd.concat(episodes, ignore_index=True)), tmp_path, "a road")
    for axes in drawn[0].axes:
        ends = np.concatenate([line for bars in axes.collections for line in bars.get_segments()])
        for values, (low, high) in zip(ends.T, (axes.get_xlim(), axes.get_ylim()), strict=True):
            assert low < values.min() and values.max() < high
