"""The option `evasion`: the same in both simulators, and never to blame."""

import sys

import numpy as np
import pytest
from places import ROOT

sys.path.insert(0, str(ROOT / "tests" / "fast"))
from lockstep import compare

from bench.evasion import KINDS, offence
from rss_shield import make
from rss_shield.envs.roads.hostile import HOSTILE
from rss_shield.eval.suite.scenarios.stage import play as stage
from rss_shield.eval.suite.scripted import play

CROWD = {"duration": 12, "vehicles_count": 8, "vehicles_density": 1.5}


@pytest.mark.parametrize("driver", ["squeezer", "brakechecker", "stopper", "mixed", "bounded-wrongway"])
def test_the_engine_evades_like_the_shield_on_highway_env(driver):
    config = CROWD | {"other_vehicles_type": HOSTILE[driver]}
    found = compare("highway-fast-v0", range(2), "random", config=config, shield="override", evasion=True, max_steps=12)
    assert found.discrete == []
    assert found.equal == found.episodes


def test_on_other_common_roads_too():
    for env_id in ("merge-v0", "two-way-v0"):
        config = {"other_vehicles_type": HOSTILE["mixed"]}
        found = compare(env_id, range(2), "random", config=config, shield="override", evasion=True, max_steps=12)
        assert found.discrete == []
        assert found.close == found.episodes


def test_it_is_never_to_blame_for_what_it_does():
    contacts = 0
    for driver in ("squeezer", "brakechecker", "bounded-reverser"):
        evading = play("highway-fast-v0", "faster", {"others": driver, "evasion": True}, range(64))
        assert not evading["blame"].isin(["ego", "both", "none"]).any()
        assert evading["broken_duties"].sum() == 0
        contacts += int((evading["blame"] != "no contact").sum())
    assert contacts > 30  # they are hostile indeed


def test_it_avoids_what_one_driver_does_once():
    rng, avoided, new = np.random.default_rng(5), 0, 0
    for kind in KINDS:
        for _ in range(3):
            scene = offence(kind, rng)
            alone, evading = (stage(scene, True, evasion=on) for on in (False, True))
            avoided += bool(alone.verdict and not evading.verdict)
            new += bool(evading.verdict and not alone.verdict)
            assert evading.verdict in ("", "other") and evading.broken == 0
    assert avoided >= 3
    assert new == 0


def test_it_is_for_common_roads_and_this_shield_only():
    with pytest.raises(ValueError, match="evasion = True: expected False where roads cross"):
        make("intersection-v0", evasion=True)
    with pytest.raises(ValueError, match="evasion = True with filter = 'ttc'"):
        make("highway-fast-v0", evasion=True, filter="ttc")
    with pytest.raises(ValueError, match="evasion = 'yes': expected True or False"):
        make("highway-fast-v0", evasion="yes")
