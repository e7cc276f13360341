"""The table of environments: a row for each that highway-env registers, which says what happens when it is tried."""

import gymnasium as gym
import pytest
from places import ROOT

from bench.environments import TABLE, heading, line, reasons
from rss_shield.envs.supported import ACTIONS, AGENTS, DEFAULT, environments, probe, refused
from rss_shield.eval.pages import markdown

PAGE = (ROOT / TABLE).read_text(encoding="utf-8")


def test_every_environment_of_highway_env_has_a_row_and_nothing_else_has():
    registered = {name for name, spec in gym.registry.items() if str(spec.entry_point).startswith("highway_env")}
    assert len(registered) == 31 and set(environments()) == registered
    rows = [row.split(" | ")[0].strip("| `") for row in PAGE.splitlines() if row.startswith("| `")]
    assert rows == environments()
    assert markdown([heading()]).splitlines()[0] in PAGE


@pytest.mark.parametrize("env_id", environments())
def test_a_row_says_what_happens_when_it_is_tried(env_id):
    row = probe(env_id)
    assert set(row.shield) == {DEFAULT, *ACTIONS, AGENTS}
    assert markdown([line(row)]).splitlines()[0] in PAGE, (
        f"write the page again: bench/environments.py --table ({env_id})"
    )
    for reason in reasons(row):
        assert f"- {reason}:" in PAGE


def test_what_is_refused_says_why():
    assert refused("highway-v0") == ""
    assert "Telepathy" in refused("highway-v0", {"action": {"type": "Telepathy"}})
