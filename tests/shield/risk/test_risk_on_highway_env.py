"""The measure on highway-env."""

import copy

import numpy as np
import pytest
from examples import CASES, EXAMPLES, MODES, rounded
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import MultiAgentShield, ShieldWrapper, make
from rss_shield.envs.roads.lines import line_beside
from rss_shield.shield.risk import STATES, RiskSettings, band_risk

EPISODE = (
    "max_rdsi",
    "max_total_rdsi",
    "time_known_safe",
    "time_unknown",
    "time_known_unsafe",
    "band_risk",
    "min_thw",
    "max_drac",
)


def first_frame(name, mode, lane=1, side=0):
    """What the measure says about a case, laid on a motorway of four lanes; y = 0 is the middle of a lane.

    Args:
      side: of the lane that the ego changes to.
    """
    one_frame = {"simulation_frequency": 1, "policy_frequency": 1}
    env = make("highway-v0", shield="monitor", risk=RiskSettings.validated(mode=mode), config=one_frame)
    env.reset(seed=0)
    case, base = CASES[name], env.unwrapped
    road, ego = base.road, base.vehicle

    def place(vehicle, who):
        vehicle.position = np.array([300.0 + who["x"], 4.0 * lane + who["y"]])
        vehicle.heading, vehicle.speed = np.arctan2(who["vy"], who["vx"]), float(np.hypot(who["vx"], who["vy"]))
        vehicle.lane_index = road.network.get_closest_lane_index(vehicle.position, vehicle.heading)
        vehicle.lane = road.network.get_lane(vehicle.lane_index)

    other = IDMVehicle(road, [0.0, 0.0], speed=10.0)
    place(ego, case["ego"])
    place(other, case["source"])
    ego.target_lane_index = (*ego.lane_index[:2], ego.lane_index[2] + side)
    road.vehicles = [ego, other]
    env.step(1)
    assert len(env.risk_frames) == 1
    return env.risk_frames[0]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("name", "lane"), [("F1", 1), ("F3", 0), ("F4", 2), ("F7", 3), ("C0", 1), ("C1", 2)])
def test_worked_cases_laid_on_its_road_have_the_digits_given(name, lane, mode):
    frame, expected = first_frame(name, mode, lane), CASES[name][mode]
    assert rounded(frame.rdsi) == expected["RDSI"]
    assert rounded(frame.lower) == expected["RDSI1_star"]
    assert frame.partner == 1
    assert STATES[frame.state] == expected["state"]


@pytest.mark.parametrize("mode", MODES)
def test_a_lane_change_has_thresholds_of_its_own_and_comes_near_a_line(mode):
    frame, expected = first_frame("L1", mode, lane=1, side=1), CASES["L1"][mode]
    assert rounded(frame.rdsi) == expected["RDSI"]
    assert (rounded(frame.lower), rounded(frame.upper)) == (expected["RDSI1_star"], expected["RDSI2_star"])
    assert frame.total - frame.rdsi == pytest.approx(EXAMPLES["lane_marking_L1"]["RDSI_L"])
    assert first_frame("L1", mode).upper == 1.0


def test_usual_measures_count_bumper_gaps_to_the_leader():
    # 25 m between bumpers, 20 behind 15 m/s; the shield's boxes are 0.09 m longer, as at the largest angle to the lane
    frame = first_frame("F1", "iso")
    assert (frame.ttc, frame.thw, frame.drac) == pytest.approx((5.0, 1.25, 0.5), rel=0.01)


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v0", "roundabout-v0"])
@pytest.mark.parametrize("mode", ["override", "monitor"])
def test_measuring_changes_nothing(env_id, mode):
    traces = []
    for risk in (False, True):
        env, trace = make(env_id, shield=mode, risk=risk), []
        rng = np.random.default_rng(4)
        trace.append(env.reset(seed=4)[0])
        for _ in range(6):
            observation, reward, terminated, truncated, info = env.step(int(rng.integers(env.action_space.n)))
            trace.append((observation, reward, terminated, truncated, info["shield"], info["min_ttc"], info["blame"]))
            assert ("risk" in info) == risk == ("max_rdsi" in info)
            if terminated or truncated:
                break
        traces.append(trace)
    np.testing.assert_equal(traces[1], traces[0])


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "two-way-v0", "intersection-v0"])
def test_infos_sum_up_the_frames_of_the_episode(env_id):
    env = make(env_id, shield="monitor", risk=True)
    for seed in (1, 2):
        _, info = env.reset(seed=seed)
        assert (info["risk"]["state"], info["risk"]["partner"], info["max_rdsi"]) == ("known_safe", -1, 0.0)
        seen, step, done = 0, [], False
        while not done and seen < 90:
            *_, terminated, truncated, info = env.step(1)
            step, seen = env.risk_frames[seen:] or step, len(env.risk_frames)
            done = terminated or truncated
            assert info["risk"]["state"] == STATES[max(frame.state for frame in step)]
            assert info["risk"]["total"] == max(frame.total for frame in step)
            assert info["risk"]["thw"] == min(frame.thw for frame in step)
        times, rdsi, lower, upper, states = np.array(env.risk_frames)[:, :5].T
        dt = env.settings.table.dt
        assert np.diff(times) == pytest.approx(dt)
        assert info["max_rdsi"] == max(frame.largest for frame in env.risk_frames) >= rdsi.max() > 0.0
        assert info["max_total_rdsi"] == max(frame.total for frame in env.risk_frames)
        assert [info[f"time_{name}"] for name in STATES] == pytest.approx(
            [dt * np.sum(states == state) for state in range(3)]
        )
        assert info["band_risk"] == band_risk(times, rdsi, lower, upper).total
        assert info["min_thw"] == min(100.0, *(frame.thw for frame in env.risk_frames))
        assert info["max_drac"] == max(frame.drac for frame in env.risk_frames)


def test_several_agents_have_a_measure_each():
    env = make("intersection-multi-agent-v0", risk=True)
    _, info = env.reset(seed=3)
    for _ in range(3):
        *_, info = env.step(env.action_space.sample())
    first, second = (agent["max_rdsi"] for agent in info["agents"])
    assert first != second
    assert all({"risk", *EPISODE} <= agent.keys() for agent in info["agents"])


def test_a_copy_goes_on_by_itself():
    env = make("highway-fast-v0", risk=True)
    env.reset(seed=0)
    env.step(1)
    twin = copy.deepcopy(env)
    infos = [one.step(0)[-1] for one in (env, twin)]
    assert infos[0]["risk"] == infos[1]["risk"]
    assert twin.risk_frames == env.risk_frames
    env.step(1)
    assert len(env.risk_frames) > len(twin.risk_frames)


@pytest.mark.parametrize(
    ("lane", "sides"), [(0, ("edge", "striped")), (1, ("striped", "striped")), (2, ("striped", "edge"))]
)
def test_lines_are_read_from_both_lanes_that_they_part(lane, sides):
    env = make("highway-fast-v0", shield=None)
    env.reset(seed=0)
    vehicle = env.unwrapped.vehicle
    vehicle.lane_index = (*vehicle.lane_index[:2], lane)
    vehicle.lane = vehicle.road.network.get_lane(vehicle.lane_index)
    network, lane = vehicle.road.network, vehicle.lane_index
    assert (line_beside(network, lane, -1), line_beside(network, lane, 1)) == sides


@pytest.mark.parametrize("risk", ["yes", 1, None])
def test_the_option_is_a_truth_value_or_settings(risk):
    with pytest.raises(ValueError, match=rf"^risk = {risk!r}: expected True, False or RiskSettings$"):
        make("highway-fast-v0", risk=risk)


def test_bad_settings_are_refused_where_they_enter():
    with pytest.raises(ValueError, match=r"^nearest = -1.0 is out of range"):
        make("highway-fast-v0", risk=RiskSettings(nearest=-1.0))
    with pytest.raises(ValueError, match=r"^risk = True: expected False without a shield"):
        make("highway-fast-v0", shield=None, risk=True)


def test_frames_are_there_only_if_measured():
    env = make("highway-fast-v0")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^risk = False: expected True to measure"):
        _ = env.risk_frames


def test_cars_beyond_the_wave_speed_are_an_error():
    env = make("highway-fast-v0", risk=RiskSettings(wave_speed=15.0))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^speed = .* is out of range: expected < wave_speed = 15 m/s$"):
        env.step(1)


def test_wrappers_remember_the_option():
    for env_id, wrapper in (("highway-fast-v0", ShieldWrapper), ("intersection-multi-agent-v0", MultiAgentShield)):
        env = make(env_id, risk=True)
        assert isinstance(env, wrapper)
        assert env.spec.additional_wrappers[-1].kwargs["risk"] is True
