"""The engine has the trajectories of highway-env, step by step."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from lockstep import POLICIES, compare

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
LONG = int(os.environ.get("PARITY_EPISODES", "2"))  # episodes per case
BARE = [
    "highway-fast-v0",
    "merge-v0",
    "merge-v1",
    "two-way-v0",
    "exit-v0",
    "exit-v1",
    "roundabout-v0",
    "roundabout-v1",
    "intersection-v0",
    "intersection-v2",
]
SHIELDED = ["highway-fast-v0", "merge-v0", "two-way-v0", "exit-v0"]


def _agree(comparison):
    assert comparison.discrete == []
    assert comparison.state < 1e-8
    assert comparison.reward < 1e-8
    assert comparison.observation_ulps <= 1


@pytest.mark.parametrize("env_id", BARE)
@pytest.mark.parametrize("policy", POLICIES)
def test_bare_episodes_agree(env_id, policy):
    _agree(compare(env_id, range(LONG), policy))


@pytest.mark.parametrize("policy", POLICIES)
def test_highway_v0_agrees(policy):
    _agree(compare("highway-v0", range(1), policy, max_steps=6))


def test_continuous_actions_agree():
    _agree(compare("highway-fast-v0", range(LONG), config=CONTINUOUS))


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
    _agree(compare("highway-fast-v0", range(LONG), config=config))


@pytest.mark.parametrize("env_id", SHIELDED)
@pytest.mark.parametrize("mode", ["override", "monitor"])
def test_shielded_episodes_agree(env_id, mode):
    _agree(compare(env_id, range(LONG), shield=mode))


@pytest.mark.parametrize("mode", ["override", "monitor"])
def test_shielded_continuous_actions_agree(mode):
    _agree(compare("highway-fast-v0", range(LONG), config=CONTINUOUS, shield=mode))


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0"])
def test_without_vector_instructions_of_numpy_episodes_agree_to_the_last_bit(env_id):
    """numpy's AVX-512 functions differ from the C library's by one unit in the last place."""
    script = (
        "from lockstep import compare\n"
        f"c = compare('{env_id}', range({LONG}))\n"
        "assert c.discrete == [] and c.state == c.reward == c.observation_ulps == 0, c"
    )
    here = Path(__file__).parent
    environment = os.environ | {
        "NPY_DISABLE_CPU_FEATURES": "X86_V4",
        "PYTHONPATH": f"{here}{os.pathsep}{here.parent.parent}",
    }
    subprocess.run([sys.executable, "-W", "ignore", "-c", script], env=environment, check=True)
