"""Pages of results, from small files made up by hand."""

import json

import pandas as pd
import pytest

from bench import evidence, junctions
from rss_shield.eval import pages

BLAME = {
    "override": ["no contact", "no contact", "other", "no contact"],
    "monitor": ["ego", "ego", "both", "no contact"],
}


def episodes(blame):
    return pd.DataFrame(
        {
            "blame": blame,
            "crashed": [verdict != "no contact" for verdict in blame],
            "return": [20.0, 21.0, 22.0, 23.0],
            "override_share": [0.25, 0.25, 0.5, 0.5],
            "broken_duties": [0, 0, 0, 0],
            "dangerous_pairs": [1000, 2000, 3000, 4000],
        }
    )


@pytest.fixture
def root(tmp_path):
    """A folder with a README, and in out/ two cases in the engine and one on highway-env."""
    out = tmp_path / "out"
    out.mkdir()
    for name, mode in (
        ("fast-random-override-4", "override"),
        ("fast-random-monitor-4", "monitor"),
        ("roundabout-v1-faster-known-override-4", "override"),
        ("merge-random-override", "override"),
        ("somebody-elses", "override"),
    ):
        episodes(BLAME[mode]).to_csv(out / f"{name}.csv", index=False)
    text = "before\n<!-- results -->\nold\n<!-- /results -->\nafter\n"
    (tmp_path / "README.md").write_text(text, encoding="utf-8")
    return tmp_path


def test_a_row_says_whose_doing_contacts_were(root):
    played = {one.mode: one for one in evidence.found(root / "out") if one.name == "fast-random"}
    row = evidence.page_row(played["override"])
    assert row[:3] == ["`highway-fast-v0`, random", "4", "1, others'"]
    # Wilson's upper end for 0 of 4: z^2 / (4 + z^2) = 3.841 / 7.841 = 0.49
    assert row[3:7] == ["0 (49 %)", "0", "0 / 10 000", "38 %"]
    assert row[7].startswith("21.50 [")
    assert evidence.page_row(played["monitor"])[2] == "3, the ego's"


def test_contacts_of_several_kinds_are_told_apart():
    assert evidence.contacts_of(0, {}) == "0"
    assert evidence.contacts_of(1438, {"the ego's": 1437, "others'": 1}) == "1 438: 1 437 the ego's, 1 others'"


@pytest.mark.parametrize(("share", "text"), [(3.84e-5, "0.0038 %"), (0.013, "1.3 %"), (0.0965, "10 %"), (1.0, "100 %")])
def test_percentages_have_two_digits(share, text):
    assert evidence.percent(share) == text


def test_engine_and_highway_env_and_kinds_of_road_stand_apart(root):
    evidence.write(root / "out", root)
    page = (root / evidence.PAGE).read_text(encoding="utf-8")
    headings = [line for line in page.splitlines() if line.startswith("##")]
    assert headings == [
        "## Motorways",
        "### Motorways in the engine",
        "### Motorways in the engine, without the shield",
        "### Motorways on highway-env",
        "## Where roads cross",
        "### Where roads cross in the engine",
    ]
    assert "| `roundabout-v1`, always FASTER, routes known | 4 |" in page
    assert "python bench/evidence.py --backend fast --modes monitor --episodes 4 --cases fast-random\n" in page
    assert "python bench/evidence.py --episodes 4 --cases merge-random\n" in page


def test_what_was_not_played_is_left_out(root):
    for path in (root / "out").glob("*.csv"):
        if path.stem != "merge-random-override":
            path.unlink()
    evidence.write(root / "out", root)
    page = (root / evidence.PAGE).read_text(encoding="utf-8")
    assert page.count("\n| `") == 1 and "Where roads cross" not in page


def test_of_several_files_of_a_case_the_largest_counts(root):
    pd.concat([episodes(BLAME["override"])] * 3).to_csv(root / "out" / "fast-random-override-12.csv", index=False)
    sizes = [len(one.frame) for one in evidence.found(root / "out") if one[:3] == ("fast-random", "override", "fast")]
    assert sizes == [12]


def test_the_table_of_the_readme_is_replaced_and_nothing_else(root):
    evidence.write(root / "out", root)
    lines = (root / "README.md").read_text(encoding="utf-8").splitlines()
    assert lines[:2] == ["before", "<!-- results -->"] and lines[-2:] == ["<!-- /results -->", "after"]
    assert lines[2].startswith("| road and driver |") and "old" not in lines
    assert lines[4:-2] == ["| `highway-fast-v0`, random | 75 % of 4 | **0** (49 %) | 4 | 38 % |"]
    evidence.write(root / "out", root)
    assert (root / "README.md").read_text(encoding="utf-8").splitlines() == lines


@pytest.mark.parametrize("text", ["", "<!-- results -->\n", "<!-- /results -->\n<!-- results -->\n"])
def test_a_file_without_its_markers_is_left_alone(tmp_path, text):
    path = tmp_path / "README.md"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="once each"):
        pages.fill(path, "results", "new")
    assert path.read_text(encoding="utf-8") == text


def test_a_bar_in_a_cell_stays_in_it():
    assert pages.markdown([("a", "b"), ("x|y", 1)]) == "| a | b |\n| --- | --- |\n| x\\|y | 1 |"


def test_the_page_of_junctions_has_the_cases_that_were_played(tmp_path):
    frame = episodes(BLAME["override"]).assign(
        seed=range(4),
        length=10,
        arrived=[True, True, False, True],
        in_way=False,
        evidence="{}",
        frames=100,
        trapped_frames=0,
        pairs_examined=200,
        pairs_possible=800,
    )
    config = junctions.Config(out=tmp_path, episodes=4, paired=4)
    for case in (junctions.Case(), junctions.Case(examine="all", duration=30)):
        frame.to_csv(tmp_path / f"{case.name}-4.csv", index=False)
    junctions.write(config, tmp_path)
    page = (tmp_path / junctions.PAGE).read_text(encoding="utf-8")
    assert "| faster | 13 s | cautious | line | 75.0 [" in page
    assert "| all | 2.00 |" in page
    assert page.count("| faster |") == 1 and "Intent" not in page


def test_the_page_of_trained_agents_has_a_table_per_run(tmp_path):
    run = tmp_path / "runs" / "mine"
    run.mkdir(parents=True)
    numbers = {"value": 0.5, "low": 0.4, "high": 0.6, "seed_low": None, "seed_high": None}
    cells = [{"train": "off", "test": "on", "metric": "crash", "n": 4, **numbers}]
    config = {
        "env_id": "intersection-v0",
        "total_timesteps": 50000,
        "seeds": [0, 1],
        "parameters": {"roads_cross": True},
        "intent": "known",
        "entry": "cautious",
        "waiting": "line",
        "intervention_penalty": 0.0,
    }
    (run / "results.json").write_text(json.dumps({"config": config, "cells": cells, "replays": []}), encoding="utf-8")
    (run / "table.md").write_text("PPO on intersection-v0\n\n| ... |\n", encoding="utf-8")
    text = "\n\n".join(pages.ppo_page([tmp_path / "unfinished", run]))
    assert "## `intersection-v0`, mine\n\nPPO on intersection-v0." in text
    assert (
        "rss-shield train --env-id intersection-v0 --total-timesteps 50000 --seeds 0 1 --intent known --entry cautious"
        in text
    )
    assert "| train / test | off / on |\n| --- | --- |\n| n | 4 |\n| crash [%] | 50 [40, 60] (–) |" in text
