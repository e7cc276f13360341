"""The engine has the trajectories of highway-env, step by step."""

import os
import subprocess
import sys
from pathlib import Path

import lockstep
import numpy as np
import pytest
from lockstep import POLICIES, compare
from parity import BARE

import rss_shield

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
ENVIRONMENTS = [env_id for env_id in BARE if env_id != "highway-v0"]
EPISODES = os.environ.get("PARITY_EPISODES", "2")  # per case
CASES = {
    "every environment": [],
    "shielded": ["--shield", "override", "monitor", "--policies", "random", "faster"],
    "continuous": ["--continuous", "--shield", "none", "override", "monitor", "--policies", "random"],
}


def _agree(comparison):
    assert comparison.discrete == []
    assert comparison.equal == comparison.episodes


@pytest.mark.parametrize("switched_off", ["", "X86_V4"], ids=["all of numpy", "without AVX-512"])
@pytest.mark.parametrize("options", CASES.values(), ids=CASES)
def test_episodes_agree_to_the_last_bit(options, switched_off):
    """With numpy's AVX-512 functions and with the C library's, which differ from them in the last place."""
    environments = ["highway-fast-v0"] if "--continuous" in options else ENVIRONMENTS
    here = Path(__file__).parent
    environment = os.environ | {
        "NPY_DISABLE_CPU_FEATURES": switched_off,
        "PYTHONPATH": f"{here}{os.pathsep}{here.parent.parent}",
    }
    command = [sys.executable, "-W", "ignore", str(here / "parity.py"), "--strict", "--episodes", EPISODES]
    done = subprocess.run(
        [*command, "--envs", *environments, *options], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("env_id", "seeds"), [("roundabout-v0", [12664, 4400]), ("roundabout-v1", [67, 0]), ("intersection-v0", [0, 1])]
)
def test_known_routes_are_read_at_the_same_moment(env_id, seeds):
    """On a roundabout the ego decides first, before others head for their next lanes; at an intersection last."""
    _agree(compare(env_id, seeds, "faster", shield="override", intent="known"))


def test_who_drives_around_a_ring_is_expected_to_leave_it():
    tallies = []
    for backend in ("fast", "highway-env"):
        env = rss_shield.make_vec("roundabout-v0", 1, backend=backend, intent="known")
        env.reset(seed=4400)
        infos = [env.step(np.array([action]))[4] for action in (1, 0, 0, 1, 3, 1, 0, 2, 1, 2)]
        tallies.append([(i["episode_dangerous_pairs"].item(), i["episode_broken_duties"].item()) for i in infos])
    assert tallies[0] == tallies[1]


@pytest.mark.parametrize("policy", POLICIES)
def test_highway_v0_agrees(policy):
    _agree(compare("highway-v0", range(1), policy, max_steps=6))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("shield", ["override", "monitor"])
def test_on_the_way_to_the_exit_both_look_along_the_same_road(first, shield, monkeypatch):
    """Also where the ego heads for a road that its own lane does not lead to."""
    right, faster = 2, 3
    actions = iter([right, right, faster] * 200)
    if first:
        next(actions)
    monkeypatch.setattr(lockstep, "actions_of", lambda *_: next(actions))
    _agree(compare("exit-v0", range(4), config={"vehicles_count": 4}, shield=shield))


def test_overridden_defaults_agree():
    config = {
        "observation": {
            "type": "Kinematics",
            "vehicles_count": 8,
            "features": ["presence", "y", "x", "vx", "cos_h", "heading"],
            "absolute": True,
            "see_behind": True,
            "clip": False,
        },
        "action": {"type": "DiscreteMetaAction", "target_speeds": [15, 20, 25, 30]},
        "lanes_count": 5,
        "vehicles_count": 30,
        "vehicles_density": 1.5,
        "initial_lane_id": 2,
        "policy_frequency": 2,
        "offroad_terminal": True,
        "reward_speed_range": [15, 30],
    }
    _agree(compare("highway-fast-v0", range(2), config=config))
