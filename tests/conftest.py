"""Applies to every test: a floating-point error that numpy would only warn about is a failure.

And an intersection, which changes the class of all traffic in the process, changes it for its own test only.
"""

import numpy as np
import pytest
from places import ROOT

from rss_shield.envs.stock import drivers_unchanged

# whole episodes, many of them, or new processes: left out by `make test-fast`
SLOW = frozenset(
    [
        "agents/test_baselines",
        "agents/test_ppo",
        "agents/test_semantic_dqn",
        "agents/test_slim",
        "envs/test_arguments",
        "envs/test_backing_up",
        "envs/test_bends",
        "envs/test_compliant_traffic",
        "envs/test_conditions",
        "envs/test_configuration",
        "envs/test_decisions",
        "envs/test_egos",
        "envs/test_evasion",
        "envs/test_faults",
        "envs/test_findings",
        "envs/test_free_steering",
        "envs/test_hostile",
        "envs/test_judge",
        "envs/test_junction_roads",
        "envs/test_junction_sizes",
        "envs/test_lane_changes",
        "envs/test_measured",
        "envs/test_multi_agent",
        "envs/test_parallel_env",
        "envs/test_parking",
        "envs/test_people",
        "envs/test_random_roads",
        "envs/test_recorder",
        "envs/test_resets",
        "envs/test_roads",
        "envs/test_semantic_actions",
        "envs/test_sensing",
        "envs/test_several_contacts",
        "envs/test_shielded_traffic",
        "envs/test_signalised",
        "envs/test_sliding",
        "envs/test_standing",
        "envs/test_stock",
        "envs/test_supported",
        "envs/test_taken_back",
        "envs/test_tracks",
        "envs/test_understood",
        "envs/test_unlikely_motion",
        "envs/test_wrapper",
        "eval/test_adversary_bench",
        "eval/test_assault",
        "eval/test_backends",
        "eval/test_crossings",
        "eval/test_human_traffic",
        "eval/test_judge_risk",
        "eval/test_killed",
        "eval/test_learning_curve",
        "eval/test_noisy_logs",
        "eval/test_offline_judge",
        "eval/test_paper",
        "eval/test_r157",
        "eval/test_replay",
        "eval/test_replay_page",
        "eval/test_risk_study",
        "eval/test_road_direction",
        "eval/test_rollout",
        "eval/test_scenarios",
        "eval/test_showcase",
        "eval/test_stats_coverage",
        "eval/test_stress",
        "eval/test_trace_risk",
        "eval/test_trajectories",
        "fast/test_action_masks",
        "fast/test_adapter",
        "fast/test_agents",
        "fast/test_floats",
        "fast/test_hostile_traffic",
        "fast/test_intersection",
        "fast/test_linear_drivers",
        "fast/test_make_vec",
        "fast/test_neighbours",
        "fast/test_parity",
        "fast/test_recording",
        "fast/test_risk",
        "fast/test_sensed",
        "fast/test_ufuncs",
        "fast/test_vector",
        "fast/test_views",
        "proofs/test_counterexamples",
        "proofs/test_proofs",
        "shield/test_adrss_oracle",
        "shield/test_anticipation",
        "shield/test_anything",
        "shield/test_blame",
        "shield/test_comfort",
        "shield/test_compiled",
        "shield/test_def12_def13_evasion",
        "shield/test_def18_junction_response",
        "shield/test_def22_open_space",
        "shield/test_easing",
        "shield/test_examined",
        "shield/test_far_pairs",
        "shield/test_held_back",
        "shield/test_indices",
        "shield/test_junction_blame",
        "shield/test_mutations",
        "shield/test_open_space_shield",
        "shield/test_plans",
        "shield/test_present_duties",
        "shield/test_theorems",
        "test_campaign",
        "test_install",
        "test_pages",
        "test_test_command",
        "test_train_cli",
    ]
)

np.seterr(divide="raise", over="raise", invalid="raise")


@pytest.fixture(autouse=True, scope="module")
def _modules_leave_drivers_unchanged():
    with drivers_unchanged():
        yield


@pytest.fixture(autouse=True)
def _tests_leave_drivers_unchanged():
    with drivers_unchanged():
        yield


def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.relative_to(ROOT / "tests").with_suffix("").as_posix() in SLOW:
            item.add_marker(pytest.mark.slow)
