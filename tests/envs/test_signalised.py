"""The intersection with traffic lights: what it shows, who waits, and the shield at red."""

import gymnasium as gym
import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import make
from rss_shield.envs.worlds.signalised import COLOURS, ENV_ID, LINE, compile_signal
from rss_shield.shield.definitions.signals import GREEN, RED, YELLOW, SignalPlan, time_to_change, time_to_green
from rss_shield.shield.junctions.reach import THREAT, farthest
from rss_shield.shield.params import PRESETS

SIGNAL = {"green": 8.0, "yellow": 3.0, "all_red": 2.0}
CYCLE = 26.0
RED_AT_FIRST, GREEN_AT_FIRST = 13.0, 0.0  # offsets, for the ego on o0


def bare(seed=0, offset=GREEN_AT_FIRST, **config):
    env = gym.make(ENV_ID, config={"signal": {**SIGNAL, "offset": offset}, **config})
    env.reset(seed=seed)
    return env


def alone(env):
    """Leave only the ego on the road, and let nobody else come."""
    env.unwrapped.road.vehicles = [env.unwrapped.vehicle]
    env.unwrapped.config["spawn_probability"] = 0.0
    return env.unwrapped.vehicle


def add_car(road, approach, distance, speed=9.0, turn=2):
    """A car of traffic, `distance` before its line, that takes the exit `turn` arms on: 1 left, 2 straight, 3 right."""
    index = (f"o{approach}", f"ir{approach}", 0)
    car = IDMVehicle.make_on_lane(road, index, LINE - distance - IDMVehicle.LENGTH / 2, speed)
    car.target_speed = 9.0
    car.plan_route_to(f"o{(approach + turn) % 4}")
    road.vehicles.append(car)
    return car


def drive(road, seconds):
    """Positions to the line and speeds of all vehicles, frame by frame."""
    for _ in range(round(seconds / road.dt)):
        road.act()
        road.step(road.dt)
        yield [(road.distance_to_line(v), v.speed) for v in road.vehicles]


# ---------------------------------------------------------------- the environment


def test_gymnasium_and_the_shield_find_it():
    assert gym.spec(ENV_ID).id == ENV_ID
    env = make(ENV_ID, intent="known", entry="priority")
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert info["signal"] in ("green", "yellow", "red")
    assert info["ran_red_light"] is False
    env.step(2)


def test_the_same_seed_shows_the_same_lights_and_traffic():
    runs = []
    for seed in (5, 5, 6):
        env = gym.make(ENV_ID)
        rows = [env.reset(seed=seed)[0]]
        rows += [env.step(1)[0] for _ in range(3)]
        runs.append((env.unwrapped.road.start, np.array(rows)))
    assert runs[0][0] == runs[1][0] != runs[2][0]
    np.testing.assert_array_equal(runs[0][1], runs[1][1])


def test_an_episode_starts_where_the_offset_says():
    assert bare(offset=4.0).unwrapped.road.clock == 4.0


@pytest.mark.parametrize(
    ("offset", "signal", "left"), [(0.0, GREEN, 8.0), (9.0, YELLOW, 2.0), (11.5, RED, 14.5), (20.0, RED, 6.0)]
)
def test_the_last_row_of_the_observation_is_about_the_light(offset, signal, left):
    env = bare(offset=offset)
    row = env.unwrapped.observation_type.observe()[-1]
    assert row.tolist()[:3] == [float(k == signal) for k in range(3)]
    assert row[3] == pytest.approx(left / CYCLE)
    assert row[4] == pytest.approx(env.unwrapped.road.distance_to_line(env.unwrapped.vehicle) / 100.0)
    assert not row[5:].any()


def test_behind_the_line_there_is_no_light():
    env = bare()
    ego = alone(env)
    ego.position = np.array([2.0, 5.0])
    ego.on_state_update()
    observation, _, _, _, info = env.step(1)
    assert not observation[-1].any()
    assert info["signal"] == ""


def test_the_kinematics_alone_can_be_had_too():
    config = bare().unwrapped.config["observation"]
    assert bare(observation={**config, "type": "Kinematics"}).observation_space.shape == (15, 7)


@pytest.mark.parametrize(
    ("offset", "vertical", "horizontal"), [(1.0, GREEN, RED), (9.0, YELLOW, RED), (12.0, RED, RED), (14.0, RED, GREEN)]
)
def test_the_lights_are_drawn_at_the_lines(offset, vertical, horizontal):
    config = {"signal": {**SIGNAL, "offset": offset}, "scaling": 4.0, "centering_position": [0.5, 0.75]}
    env = gym.make(ENV_ID, render_mode="rgb_array", config=config)
    env.reset(seed=0)
    alone(env)  # a car could stand on a line
    picture = env.render()
    surface = env.unwrapped.viewer.sim_surface
    for approach, signal in zip(range(4), (vertical, horizontal) * 2, strict=True):
        lane = env.unwrapped.road.network.get_lane((f"o{approach}", f"ir{approach}", 0))
        x, y = surface.vec2pix(lane.position(LINE + 0.4, 0.5))
        assert tuple(picture[y, x]) == COLOURS[signal]
    env.close()


# ---------------------------------------------------------------- configuration


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        ({"yellow": 1.0}, r"yellow \+ all-red of phase 0 = 3 s is out of range: expected at least 4.9 s"),
        ({"yellow": (3.0, 2.0)}, r"yellow \+ all-red of phase 1 = 4 s"),
        ({"green": 0.0}, "green of phase 0 = 0.0 is out of range: expected a finite number > 0"),
        ({"green": "long"}, "signal.green = 'long': expected a number of seconds, or two"),
        ({"all_red": [1.0, 2.0, 3.0]}, r"signal.all_red = \[1.0, 2.0, 3.0\]: expected a number of seconds, or two"),
        ({"amber": 3.0}, "signal has an unknown key 'amber': expected green, yellow, all_red, offset"),
        ({"offset": 26.0}, r"signal.offset = 26.0: expected None \(random\), or 0 <= offset < 26 s"),
        ({"offset": "now"}, "signal.offset = 'now'"),
        (7.0, "signal = 7.0: expected a dict"),
    ],
)
def test_a_bad_signal_is_refused(signal, message):
    with pytest.raises(ValueError, match=message):
        gym.make(ENV_ID, config={"signal": signal})


def test_a_row_about_the_light_needs_five_features():
    observation = {"type": "KinematicsWithSignal", "features": ["x", "y"]}
    with pytest.raises(ValueError, match="expected at least 5"):
        gym.make(ENV_ID, config={"observation": observation})


def test_each_group_has_its_own_times():
    plan = compile_signal({"green": (4.0, 9.0)})
    assert plan.durations.tolist() == [[4.0, 3.0, 2.0], [9.0, 3.0, 2.0]]


@pytest.mark.parametrize(
    ("time", "change", "green"),
    [(0.0, 8.0, 0.0), (7.5, 0.5, 0.0), (8.0, 3.0, 18.0), (11.0, 15.0, 15.0), (25.0, 1.0, 1.0), (26.0, 8.0, 0.0)],
)
def test_times_until_the_light_changes(time, change, green):
    plan = compile_signal(SIGNAL)
    assert time_to_change(plan, 0, time) == pytest.approx(change)
    assert time_to_green(plan, 0, time) == pytest.approx(green)


def test_a_light_that_is_always_green_never_changes():
    plan = SignalPlan(np.ones((1, 1), bool), np.array([[60.0, 0.0, 0.0]]))
    assert time_to_change(plan, 0, 5.0) == np.inf


# ---------------------------------------------------------------- traffic


@pytest.mark.parametrize("distance", [12.0, 22.0, 40.0, 80.0])
@pytest.mark.parametrize("speed", [2.0, 10.0])
def test_traffic_stops_at_red_and_goes_on_at_green(distance, speed):
    if speed + speed**2 / 10 > distance:
        pytest.skip("it could not stop")
    road = bare(offset=RED_AT_FIRST).unwrapped.road
    road.vehicles = []
    car = add_car(road, 0, distance, speed)
    for [(left, v)] in drive(road, CYCLE - RED_AT_FIRST - 0.1):
        assert left > 0.5
        assert v >= 0.0
    assert left < 2.0
    *_, [(left, _)] = drive(road, 5.0)
    assert left < 0.0
    assert not car.ran_red_light


def test_a_car_that_could_not_stop_keeps_its_right():
    road = bare(offset=7.9).unwrapped.road
    road.vehicles = []
    passes, stops = add_car(road, 0, 12.0, 9.0), add_car(road, 2, 30.0, 9.0)
    list(drive(road, 4.0))
    assert road.distance_to_line(passes) < 0.0 < road.distance_to_line(stops)
    assert not passes.ran_red_light
    assert road.has_right(passes) and not road.has_right(stops)


def test_who_drives_on_at_red_is_seen():
    env = bare(offset=RED_AT_FIRST)
    ego = alone(env)
    for _ in range(6):
        *_, info = env.step(2)
    assert info["ran_red_light"]
    assert ego.ran_red_light


def test_a_car_with_green_does_not_wait_for_one_at_red():
    road = bare(offset=RED_AT_FIRST).unwrapped.road
    road.vehicles = []
    waits, goes = add_car(road, 0, 2.0, 0.0), add_car(road, 1, 25.0, 8.0)
    speeds = [rows[1][1] for rows in drive(road, 4.0)]
    assert min(speeds) > 7.5
    assert road.distance_to_line(waits) > 0.0 > road.distance_to_line(goes)


def test_who_turns_left_lets_oncoming_traffic_pass():
    road = bare(offset=GREEN_AT_FIRST).unwrapped.road
    road.vehicles = []
    left, straight = add_car(road, 0, 5.0, 3.0, turn=1), add_car(road, 2, 25.0, 9.0)
    for rows in drive(road, 3.0):
        assert rows[0][0] > 0.0
    assert road.distance_to_line(straight) < 0.0
    list(drive(road, 5.0))
    assert road.distance_to_line(left) < 0.0
    assert not left.crashed and not straight.crashed


def test_left_turns_from_both_sides_pass_at_once():
    road = bare(offset=GREEN_AT_FIRST).unwrapped.road
    road.vehicles = []
    cars = [add_car(road, approach, 5.0, 3.0, turn=1) for approach in (0, 2)]
    list(drive(road, 4.0))
    assert all(road.distance_to_line(car) < 0.0 and not car.crashed for car in cars)


def test_nobody_runs_a_light_rolls_back_or_crashes_in_dense_traffic():
    env = bare(seed=3, spawn_probability=1.0)
    road = env.unwrapped.road
    road.vehicles.remove(env.unwrapped.vehicle)
    for _ in range(40):
        env.unwrapped._spawn_vehicle(spawn_probability=1.0)
        for rows in drive(road, 1.0):
            assert all(v >= 0.0 for _, v in rows)
        env.unwrapped._clear_vehicles()
        assert not any(car.crashed or car.ran_red_light for car in road.vehicles)


# ---------------------------------------------------------------- the shield


def shielded(offset, entry="priority", mode="override"):
    env = make(ENV_ID, shield=mode, intent="known", entry=entry, config={"signal": {**SIGNAL, "offset": offset}})
    env.reset(seed=1)
    return env


@pytest.mark.parametrize("entry", ["cautious", "priority"])
def test_under_the_shield_the_ego_stops_at_red_and_goes_at_green(entry):
    env = shielded(RED_AT_FIRST, entry)
    ego = alone(env)
    road = env.unwrapped.road
    for _ in range(12):
        *_, info = env.step(2)
        assert road.distance_to_line(ego) > 0.0
        assert not info["ran_red_light"]
    assert road.distance_to_line(ego) < 1.0
    assert ego.speed < 0.1
    for _ in range(4):
        *_, info = env.step(2)
    assert road.distance_to_line(ego) < 0.0
    assert not info["ran_red_light"]


@pytest.mark.parametrize("offset", np.arange(4.0, 8.0, 0.5))
def test_when_its_green_ends_the_ego_stops_at_the_line_or_passes_by_right(offset):
    env = shielded(offset)
    ego = alone(env)
    for _ in range(8):
        *_, info = env.step(2)
    assert not info["ran_red_light"]
    assert env._ego.frames_trapped == 0
    assert env.unwrapped.road.distance_to_line(ego) != 0.0


def test_an_unshielded_ego_that_only_goes_runs_the_light():
    env = shielded(RED_AT_FIRST, mode="monitor")
    alone(env)
    assert any(env.step(2)[-1]["ran_red_light"] for _ in range(6))


def test_with_priority_the_ego_passes_cars_that_wait_at_red_and_without_it_does_not():
    passed = []
    for entry in ("priority", "cautious"):
        env = shielded(GREEN_AT_FIRST, entry)
        ego = alone(env)
        ego.position, ego.speed = np.array([2.0, 16.5]), 0.0
        for approach in (1, 3):
            add_car(env.unwrapped.road, approach, 1.5, 0.0)
        for _ in range(6):
            env.step(2)
        passed.append(bool(ego.position[0] < -3.0))  # well into its left turn
    assert passed == [True, False]


@pytest.mark.parametrize("offset", [1.0, 4.0, 6.0, 7.0])
def test_a_light_that_changes_leaves_the_ego_no_danger_without_blame(offset):
    """The ego dawdles into the area while cars wait at red, and then they get green."""
    env = shielded(offset)
    alone(env)
    road = env.unwrapped.road
    for approach in (1, 3):
        for behind in (1.5, 10.0):
            add_car(road, approach, behind, 0.0)
    for second in range(16):
        *_, terminated, truncated, info = env.step(1 if second % 3 else 2)
        assert not info["ran_red_light"]
        assert info["episode_broken_duties"] == 0
        if terminated or truncated:
            break
    assert info["blame"] == ""
    assert env._ego.frames_trapped == 0


def test_how_far_a_car_can_come_that_waits_for_green():
    other = PRESETS["intersection"].other  # 6 and 5 m/s^2
    car = np.zeros(1, THREAT)[0]
    car["path"], car["s"], car["v"], car["cap"] = 0, 80.0, 0.0, 10.0
    car["red_for"], car["line"] = 4.0, 95.5
    # at 6 m/s^2 it would be at 80 + 12 after 2 s (and cut the corners by 5 %), at 80 + 31.7 after 4 s
    assert farthest(car, 2.0, other) == pytest.approx(80.0 + 11.667 + 0.583, abs=0.01)
    assert farthest(car, 4.0, other) == pytest.approx(95.5 + 0.775)
    # 1 s later 5.5 m more: 5 m/s at 2.5 m before the line is the worst
    assert farthest(car, 5.0, other) == pytest.approx(95.5 + 5.5 + 1.0)
    worst = np.max([v + 0.5 * 6.0 - v**2 / 10.0 for v in np.linspace(0.0, 10.0, 101)])
    assert worst == pytest.approx(5.5)
