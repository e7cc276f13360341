"""ShieldWrapper: what users of gymnasium and stable-baselines3 rely on."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium_env
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from rss_shield import PRESETS, RSSParams, Rules, ShieldWrapper, make

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
DISCRETE = {"action": {"type": "DiscreteAction"}}
ACTION_CONFIGS = [{}, CONTINUOUS, DISCRETE]


def make_shielded():
    return make("highway-fast-v0")


def play(env, rng, steps):
    trace = []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(int(rng.integers(5)))
        trace.append((observation.tobytes(), reward, info["override_share"], info["min_ttc"]))
        if terminated or truncated:
            break
    return trace


@pytest.mark.parametrize("config", ACTION_CONFIGS, ids=["meta", "continuous", "discrete"])
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "exit-v0"])
def test_monitoring_leaves_the_trajectory_bit_identical(env_id, config):
    bare, monitored = make(env_id, shield=None, config=config), make(env_id, shield="monitor", config=config)
    for seed in range(2):
        observation, _ = bare.reset(seed=seed)
        observation_monitored, _ = monitored.reset(seed=seed)
        np.testing.assert_array_equal(observation, observation_monitored)
        bare.action_space.seed(seed)
        done = False
        while not done:
            action = bare.action_space.sample()
            observation, *outcome, _ = bare.step(action)
            observation_monitored, *outcome_monitored, _ = monitored.step(action)
            np.testing.assert_array_equal(observation, observation_monitored)
            assert outcome == outcome_monitored
            for car, car_monitored in zip(bare.unwrapped.road.vehicles, monitored.unwrapped.road.vehicles, strict=True):
                assert (*car.position, car.heading, car.speed) == (
                    *car_monitored.position,
                    car_monitored.heading,
                    car_monitored.speed,
                )
            done = outcome[1] or outcome[2]


@pytest.mark.filterwarnings("error")
def test_an_earlier_version_of_an_environment_is_made_without_a_warning():
    make("intersection-v0")


def test_it_passes_both_environment_checkers():
    check_env(make_shielded())
    check_gymnasium_env(make_shielded(), skip_render_check=True)


def test_it_runs_in_every_kind_of_vector_environment():
    actions = np.array([3, 0])
    for vector in (DummyVecEnv([make_shielded] * 2), SubprocVecEnv([make_shielded] * 2)):
        vector.reset()
        infos = vector.step(actions)[3]
        assert all(0 <= info["shield"]["override_fraction"] <= 1 for info in infos)
        vector.close()
    for vector in (gym.vector.SyncVectorEnv([make_shielded] * 2), gym.vector.AsyncVectorEnv([make_shielded] * 2)):
        vector.reset(seed=0)
        infos = vector.step(actions)[4]
        assert infos["shield"]["override_fraction"].shape == (2,)
        assert list(infos["blame"]) == ["", ""]
        vector.close()


def test_monitor_of_stable_baselines_can_log_the_verdict(tmp_path):
    keywords = ("blame", "cost", "override_share", "episode_cost", "min_ttc")
    env = Monitor(make("highway-fast-v0", shield="monitor"), str(tmp_path / "log"), info_keywords=keywords)
    env.reset(seed=0)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(3)
        done = terminated or truncated
    assert info["episode"]["blame"] == "ego"  # flat out into the car ahead
    assert info["episode"]["episode_cost"] >= 1.0


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_clone_carries_its_own_shield_along(clone):
    env = make_shielded()
    env.reset(seed=3)
    play(env, np.random.default_rng(0), 4)
    cloned = clone(env)
    original_trace = play(env, np.random.default_rng(1), 8)
    assert play(cloned, np.random.default_rng(1), 8) == original_trace
    assert original_trace[-1][2] > 0.0


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        ("highway-fast-v0", {}),
        ("highway-fast-v0", {"shield": "monitor"}),
        ("highway-fast-v0", {"shield": "monitor", "sensing": {"latency": 0.2}}),
        ("intersection-v0", {"shield": "monitor"}),
        ("crosswalk-v0", {}),
        ("parking-v0", {}),
        ("intersection-multi-agent-v0", {}),
    ],
)
def test_a_clone_tells_what_its_original_tells(clone, env_id, options):
    env = make(env_id, **options)
    env.reset(seed=3)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(12)]
    for action in actions[:3]:
        env.step(action)
    cloned = clone(env)
    for action in actions[3:]:
        *_, over, late, info = env.step(action)
        assert str(cloned.step(action)[-1]) == str(info)
        if np.any(over) or np.any(late):
            break


def test_vehicles_are_shielded_anew_after_every_reset():
    env = make_shielded()
    for seed in (0, 1):
        _, info = env.reset(seed=seed)
        assert info["override_share"] == 0.0
        first = env.unwrapped.vehicle
        env.step(3)
        assert env.unwrapped.vehicle is first
        assert "act" in vars(first)


def test_every_info_has_the_documented_keys():
    env = make_shielded()
    _, info = env.reset(seed=0)
    shield_keys = {
        "intervened",
        "override_fraction",
        "anticipation_fraction",
        "limited_fraction",
        "acceleration_change",
        "steering_change",
        "mean_acceleration_change",
        "mean_steering_change",
        "lane_change_refused",
        "dangerous",
        "dangerous_pairs",
        "broken_duties",
        "min_margin_lon",
        "min_margin_lat",
        "partner",
        "response",
    }
    of_decisions = {"proposed_action", "executed_action", "action_replaced"}
    for step_info, more in ((info, set()), (env.step(3)[4], of_decisions)):
        assert set(step_info["shield"]) == shield_keys | more
        assert all(np.ndim(value) == 0 for value in step_info["shield"].values())
        assert {"cost", "blame", "blame_evidence", "override_share", "episode_cost", "min_ttc"} <= set(step_info)


def test_the_penalty_is_the_share_of_overridden_frames_and_the_raw_reward_stays():
    rules = Rules(anticipation=0.0)  # there is more danger without
    plain, penalised = (
        make("highway-fast-v0", rules=rules),
        make("highway-fast-v0", rules=rules, intervention_penalty=0.5),
    )
    plain.reset(seed=0)
    penalised.reset(seed=0)
    overridden = 0
    for _ in range(10):
        _, reward, _, _, info = plain.step(3)
        _, reward_penalised, _, _, info_penalised = penalised.step(3)
        assert info_penalised["raw_reward"] == reward
        assert reward_penalised == pytest.approx(reward - 0.5 * info["shield"]["override_fraction"], abs=1e-12)
        overridden += info["shield"]["intervened"]
    assert overridden > 0


def test_the_penalty_may_be_charged_by_the_size_of_the_change():
    plain, penalised = make_shielded(), make("highway-fast-v0", intervention_penalty=0.5, penalty_on="change")
    plain.reset(seed=0)
    penalised.reset(seed=0)
    for _ in range(10):
        _, reward, _, _, info = plain.step(3)
        _, reward_penalised, *_ = penalised.step(3)
        assert reward_penalised == pytest.approx(reward - 0.5 * info["shield"]["mean_acceleration_change"], abs=1e-12)
    assert info["mean_acceleration_change"] > 0.0


def test_every_frame_counts_once_by_the_strongest_reason():
    for rules in (Rules(), Rules(anticipation=0.0)):
        env = make("highway-fast-v0", rules=rules)
        env.reset(seed=0)
        for action in (3, 3, 0, 2, 3, 3, 2, 3):
            *_, info = env.step(action)
            shield = info["shield"]
            shares = [shield[f"{name}_fraction"] for name in ("override", "anticipation", "limited")]
            assert sum(shares) <= 1.0 + 1e-12
            assert shield["intervened"] == (shares[0] > 0.0)
            assert shield["mean_acceleration_change"] <= shield["acceleration_change"] + 1e-12
        assert (info["anticipation_share"] > 0.0) == (rules.anticipation > 0.0)


def test_an_agent_that_drives_into_the_car_ahead_is_blamed_with_evidence():
    env = make("highway-fast-v0", shield="monitor")
    env.reset(seed=0)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(3)
        done = terminated or truncated
    assert info["crashed"]
    assert info["blame"] == "ego"
    assert info["cost"] == 1.0
    evidence = info["blame_evidence"]
    assert evidence["verdict"] == "ego"
    assert evidence["ego_duty"]
    assert evidence["ego_excess"] > 0.0
    assert env.unwrapped.road.vehicles[evidence["partner"]].crashed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"shield": "mask"}, r"shield = 'mask': expected 'override', 'monitor' or None"),
        ({"env_id": "nowhere-v0"}, r"env_id = 'nowhere-v0'"),
        ({"entry": "bold"}, r"entry = 'bold': expected one of cautious, priority, assertive"),
        ({"intent": "none"}, r"intent = 'none': expected one of known, straight, any"),
        ({"waiting": "inside"}, r"waiting = 'inside': expected one of line, anywhere"),
        ({"config": {"controlled_vehicles": 2}}, r"controlled_vehicles = 2: expected exactly 1"),
        ({"config": {"action": {"type": "ContinuousAction", "dynamical": True}}}, r"dynamical = True"),
        ({"penalty_on": "frames"}, r"penalty_on = 'frames': expected one of response, change"),
        ({"rules": Rules(anticipation=-1.0)}, r"rules.anticipation = -1.0: expected a finite number >= 0"),
        ({"intervention_penalty": -1.0}, r"intervention_penalty = -1.0: expected a finite number >= 0"),
        ({"params": PRESETS["simulator"].ego}, r"expected a Preset, a pair of RSSParams"),
    ],
)
def test_bad_input_is_named_with_its_range(arguments, message):
    with pytest.raises(ValueError, match=message):
        make(**({"env_id": "highway-fast-v0"} | arguments))


def test_an_unknown_mode_is_refused_where_it_enters():
    with pytest.raises(ValueError, match="mode = 'mask': expected one of override, monitor"):
        ShieldWrapper(make("highway-fast-v0", shield=None), mode="mask")


def test_a_response_time_below_one_frame_is_refused():
    slow = PRESETS["simulator"].ego._replace(mu=0.2)  # 2/15 s, but a frame of highway-fast-v0 lasts 1/5 s
    with pytest.raises(ValueError, match=r"response_time = 0\.133333 s .* expected >= 0\.2 s"):
        make("highway-fast-v0", params=(slow, slow))
    assert make("highway-v0", params=(slow, slow)).settings.table.ego.response_time == pytest.approx(2 / 15)


def test_response_times_are_rounded_up_to_whole_frames():
    fields = PRESETS["slides"].ego._asdict() | {"response_time": 0.31}
    env = make("highway-fast-v0", params=(RSSParams.validated(**fields), PRESETS["slides"].other))
    assert env.settings.table.ego.response_time == pytest.approx(0.4)
    assert env.settings.table.other.response_time == pytest.approx(2.0)


def test_a_new_simulation_frequency_at_reset_is_taken_up():
    env = make_shielded()
    env.reset(seed=0, options={"config": {"simulation_frequency": 15}})
    assert env.settings.table.dt == pytest.approx(1 / 15)
    assert env.settings.table.ego.response_time == pytest.approx(2 / 15)


def test_recorded_frames_must_be_asked_for():
    env = make_shielded()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="record = False: expected True"):
        env.audit()


def test_the_audit_of_a_recorded_episode_agrees_with_the_judge_on_the_spot():
    for mode in ("override", "monitor"):
        env = make("highway-fast-v0", shield=mode, record=True)
        env.reset(seed=1)
        rng = np.random.default_rng(1)
        pairs = broken = 0
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(int(rng.integers(5)))
            pairs += info["shield"]["dangerous_pairs"]
            broken += info["shield"]["broken_duties"]
            done = terminated or truncated
        audit = env.audit()
        assert audit.dangerous.sum() == pairs > 0
        assert (audit.duty > 0).sum() == broken
        assert broken == 0 if mode == "override" else broken > 0


def test_the_audit_of_distances_is_refused_where_roads_cross():
    env = make("intersection-v0", record=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected an environment without junctions"):
        env.audit()
