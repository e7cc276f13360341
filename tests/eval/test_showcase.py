"""Which episodes are shown, and the pages on which they play."""

import functools

import pandas as pd
import pytest

from rss_shield import make, make_vec
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.run_folder import pages_of
from rss_shield.eval.suite.showcase import show, worth_watching

# seed, blame, time of the end [s], smallest time to collision [s], return
EPISODES = [
    (10, "no contact", 30.0, 0.4, 20.0),
    (11, "other", 2.0, 0.0, 3.0),
    (12, "ego", 9.0, 0.0, 8.0),
    (13, "both", 5.0, 0.0, 6.0),
    (14, "no contact", 30.0, 0.9, 21.0),
]


def episodes(rows):
    frame = pd.DataFrame(rows, columns=["seed", "blame", "time", "min_ttc", "return"])
    return frame.assign(crashed=frame["blame"] != "no contact")


@pytest.mark.parametrize(
    "left, worst",
    [
        ((10, 11, 12, 13, 14), 13),  # the ego's fault, soonest
        ((10, 11, 14), 11),  # a contact at all
        ((10, 14), 10),  # nearest in time
    ],
)
def test_the_worst_is_what_a_reader_would_ask_for(left, worst):
    assert worth_watching(episodes([row for row in EPISODES if row[0] in left]))["worst"] == worst


def test_the_typical_one_has_the_median_return():
    assert worth_watching(episodes(EPISODES))["typical"] == 12  # of 3, 6, 8, 20, 21


def test_pages_are_written_once_and_found_again(tmp_path):
    played = {
        test: evaluate(
            functools.partial(make_vec, "highway-fast-v0", shield=mode, autoreset_mode="Disabled"),
            lambda seen: [3] * len(seen),  # FASTER
            range(3),
            n_envs=3,
        )
        for test, mode in (("off", "monitor"), ("on", "override"))
    }
    modes = {"off": "monitor", "on": "override"}
    counted: list[int] = []
    made = show(
        played,
        lambda test: functools.partial(make, "highway-fast-v0", modes[test]),
        tmp_path,
        "lazy",
        "T",
        counted.append,
    )
    assert tuple(sorted(made)) == pages_of(tmp_path) and len(made) == 2
    assert counted == [2, 4]
    text = (tmp_path / "pages" / "lazy-worst.html").read_text(encoding="utf-8")
    assert f"T: worst episode, seed {worth_watching(played['off'])['worst']}" in text
    written = [path.stat().st_mtime_ns for path in made]

    def must_not_play(test):
        raise AssertionError(test)

    show(played, must_not_play, tmp_path, "lazy", "T")
    assert [path.stat().st_mtime_ns for path in made] == written
