"""Models that come with the sources: each drives as its card says, and all of them are small."""

import json

import pandas as pd
import pytest
from places import ROOT

import rss_shield.test
from rss_shield.eval.arms import ARMS
from rss_shield.shield.verdicts import AT_FAULT

MODELS = sorted((ROOT / "models").glob("*/*/model.zip"))
MOST = 5_000_000  # bytes of all


def test_all_together_are_small_and_are_arms():
    assert len(MODELS) > 20
    assert sum(path.stat().st_size for path in MODELS) < MOST
    assert {path.parent.name for path in MODELS} <= set(ARMS)


@pytest.mark.slow
@pytest.mark.parametrize("path", MODELS, ids=lambda path: f"{path.parents[1].name}-{path.parent.name}")
def test_it_drives_as_its_card_says(path, tmp_path, capsys):
    """The mean of a few episodes is near the card's mean of a thousand, and behind the shield no fault is the ego's."""
    card = json.loads((path.parent / "card.json").read_text())
    assert (card["env_id"], card["arm"]) == (path.parents[1].name, path.parent.name)
    rss_shield.test.main([str(path), "--episodes", "20", "--tests", "on", "--out", str(tmp_path)])
    episodes = pd.read_csv(tmp_path / "episodes.csv", keep_default_na=False)
    assert not episodes["blame"].isin(AT_FAULT).any()
    told, deviation = card["results"]["on"]["return"], episodes["return"].std() / 20**0.5
    assert abs(episodes["return"].mean() - told["value"]) < 4 * deviation + 0.5
