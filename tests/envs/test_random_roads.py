"""Whatever the road, the ego is never to blame; without its shield it would be."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.worlds.random_roads import KINDS, RADII, build, draw_plan

FASTER = 3


def play(seed, policy, mode, kind=None, **config):
    env = make("random-roads-v0", shield=mode, config={"kind": kind, **config})
    env.reset(seed=seed)
    rng, done = np.random.default_rng(seed), False
    while not done:
        *_, terminated, truncated, info = env.step(int(rng.integers(5)) if policy == "random" else FASTER)
        done = terminated or truncated
    return info


@pytest.mark.parametrize("seed", range(500, 520))
def test_on_any_road_the_ego_keeps_its_duties_and_is_never_to_blame(seed):
    info = play(seed, ("random", "faster")[seed % 2], "override", KINDS[seed % 3])
    assert info["blame"] not in ("ego", "both", "none")
    assert info["episode_broken_duties"] == 0


def test_without_its_shield_the_ego_crashes_there_and_every_contact_has_a_culprit():
    blame = [play(seed, "faster", "monitor", KINDS[seed % 3])["blame"] for seed in range(500, 509)]
    assert sum(verdict in ("ego", "both") for verdict in blame) >= 3
    assert "none" not in blame


@pytest.mark.parametrize(("kind", "seed"), [("ring", 7), ("fork", 11), ("chain", 2)])
def test_on_bends_at_a_low_frequency_the_ego_is_not_to_blame_either(kind, seed):
    info = play(seed, "random", "override", kind, simulation_frequency=10, vehicles_count=9)
    assert info["blame"] not in ("ego", "both", "none")


@pytest.mark.parametrize(("kind", "seed"), [("ring", 43), ("ring", 77), ("fork", 34), ("chain", 38)])
def test_the_audit_of_the_record_counts_what_the_shield_counted(kind, seed):
    env = make("random-roads-v0", config={"kind": kind}, record=True)
    env.reset(seed=seed)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(FASTER)
        done = terminated or truncated
    audit = env.audit()
    assert audit.dangerous.sum() == info["episode_dangerous_pairs"] > 0
    assert (audit.duty > 0).sum() == info["episode_broken_duties"] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_networks_are_as_different_as_they_should_be(kind):
    lanes, radii, lengths, oncoming, ends = set(), [], [], set(), 0
    for seed in range(60):
        plan = draw_plan(np.random.default_rng(seed), kind)
        network = build(plan)
        lanes |= {section.lanes for section in plan.sections}
        oncoming.add(plan.oncoming > 0)
        radii += [lane.radius for lane in network.lanes_list() if hasattr(lane, "radius")]
        lengths += [lane.length for lane in network.lanes_list()]
        ends += len({section.end for section in plan.sections} - {section.origin for section in plan.sections})
    assert lanes == {1, 2, 3, 4}
    assert RADII[0] - 1e-9 <= min(radii) < 50 and 180 < max(radii) <= RADII[1] + 16
    assert min(lengths) < 10 and max(lengths) > 40
    assert oncoming == ({True, False} if kind != "fork" else {False})
    assert (ends == 0) if kind == "ring" else (ends == 60) if kind == "chain" else (ends >= 120)
