"""Others who creep, sneak past the tolerances or move as no car does: whoever they touch, somebody is to blame."""

import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make
from rss_shield.shield.verdicts import ACCELERATED, DUTIES, JUMPED, LEFT_PATHS, REVERSED, TOO_CLOSE, TOO_FAR, TOO_SHORT

EMPTY = {"initial_vehicle_count": 0, "spawn_probability": 0.0, "duration": 60}
ROADS = {
    "intersection-v0": EMPTY,
    "signalised-intersection-v0": EMPTY,
    "crosswalk-v0": {"vehicles_count": 0, "pedestrians": 0, "unreasonable": 0.0},
}
FASTER = 2


class Creeper(Vehicle):
    """Holds a small speed, wheels straight."""

    route, want = (), 0.0

    def act(self, action=None):
        super().act({"steering": 0.0, "acceleration": float(np.clip((self.want - self.speed) / 0.2, -3.0, 3.0))})


class Racer(Vehicle):
    """Gains 0.0199 m/s on every frame at 60 Hz."""

    route = ()

    def act(self, action=None):
        super().act({"steering": 0.0, "acceleration": 1.194})


def facing(env_id, kind, ahead, aside=0.0, turned=0.0, speed=0.0):
    """An environment with the ego and one other, so far ahead and to the right, turned against it [m], [rad], [m/s]."""
    env = make(env_id, config=ROADS[env_id])
    env.reset(seed=2)
    road, ego = env.unwrapped.road, env.unwrapped.vehicle
    forward = ego.direction
    right = np.array([-forward[1], forward[0]])
    other = kind(road, ego.position + ahead * forward + aside * right, ego.heading + turned, speed)
    other.want, other.route = speed, []
    road.vehicles[:] = [ego, other]
    return env, other


def to_the_end(env, change=lambda k: None, action=FASTER):
    done, k = False, 0
    while not done:
        change(k)
        *_, terminated, truncated, info = env.step(action)
        done, k = terminated or truncated, k + 1
    return info


@pytest.mark.parametrize("env_id", ROADS)
@pytest.mark.parametrize(
    ("ahead", "aside", "turned", "speed", "duty"),
    [
        (22.0, 0.0, np.pi, 0.45, LEFT_PATHS),  # against the lane
        (22.0, 0.0, np.pi, 0.2, LEFT_PATHS),
        (24.0, 4.0, -2.4, 0.45, LEFT_PATHS),  # aslant
        (22.0, 0.0, 0.0, -0.095, REVERSED),  # straight back
    ],
)
def test_who_creeps_into_a_standing_ego_is_to_blame(env_id, ahead, aside, turned, speed, duty):
    env, _ = facing(env_id, Creeper, ahead, aside, turned, speed)
    info = to_the_end(env)
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[duty]


def test_who_speeds_up_little_by_little_beyond_the_limit_is_to_blame():
    often = {"simulation_frequency": 60, "policy_frequency": 5, "duration": 20, "destination": "o1"}
    env = make("intersection-v0", config=EMPTY | often)
    env.reset(seed=2)
    road, ego = env.unwrapped.road, env.unwrapped.vehicle
    lane = road.network.get_lane(("o1", "ir1", 0))
    other = Racer(road, lane.position(lane.length - 65.924, 0.0), lane.heading_at(0.0), 7.9766)
    road.vehicles[:] = [ego, other]
    info = to_the_end(env)
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[ACCELERATED]


@pytest.mark.parametrize("env_id", ROADS)
def test_who_is_suddenly_in_front_of_the_ego_is_to_blame(env_id):
    env, other = facing(env_id, Creeper, 30.0)

    def jump(k):
        if k == 2:
            other.position = env.unwrapped.vehicle.position + 8.0 * env.unwrapped.vehicle.direction

    info = to_the_end(env, jump)
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[JUMPED]


@pytest.mark.parametrize("sudden", [True, False])
def test_who_moves_on_a_car_park_without_driving_is_to_blame(sudden):
    env = make("parking-v0", config={"duration": 30})
    env.reset(seed=1)
    road, ego = env.unwrapped.road, env.unwrapped.vehicle
    ego.position, ego.heading, ego.speed = np.zeros(2), 0.0, 0.0
    other = Vehicle(road, np.array([20.0, 0.0]), np.pi, 0.0)
    road.vehicles.append(other)

    def move(k):
        if sudden and k == 8:
            other.position = ego.position + np.array([6.2, 0.0])
        if not sudden:
            other.position = other.position - np.array([0.6, 0.0])

    info = to_the_end(env, move, np.array([0.6, 0.0], np.float32))
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[JUMPED]


def test_a_target_that_is_not_on_the_road_is_no_target():
    env, other = facing("intersection-v0", Creeper, 30.0, speed=1.0)
    other.target_lane_index = ("nowhere", "at all", 0)
    assert to_the_end(env)["blame"] in ("", "other")


class Coasting(Vehicle):
    """Holds its speed and its lane, and grows once."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.frames, self.growth = 0, {}

    def act(self, action=None):
        super().act({"steering": 0.0, "acceleration": 0.0})
        self.frames += 1
        if self.frames == 12:
            for name, more in self.growth.items():
                setattr(self, name, getattr(self, name) + more)
            self.diagonal = float(np.hypot(self.LENGTH, self.WIDTH))


@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize(
    ("ahead", "lane", "growth", "duty"),
    [
        (32.0, 0, {"LENGTH": 60.0}, TOO_SHORT),
        (-60.0, 0, {"LENGTH": 120.0}, TOO_FAR),
        (0.0, 1, {"WIDTH": 5.0}, TOO_CLOSE),
        (0.0, 1, {"WIDTH": 30.0}, TOO_CLOSE),
    ],
    ids=["ahead", "behind", "beside", "beside, by far"],
)
def test_who_grows_into_the_ego_is_to_blame(ahead, lane, growth, duty, kept):
    env = make("highway-fast-v0", shield="override" if kept else "monitor", config={"vehicles_count": 0})
    env.reset(seed=1)
    road, ego = env.unwrapped.road, env.unwrapped.vehicle
    start, end, own = ego.lane_index
    beside = road.network.get_lane((start, end, own + lane if own == 0 else own - lane))
    s, _ = beside.local_coordinates(ego.position)
    other = Coasting(road, beside.position(s + ahead, 0.0), ego.heading, ego.speed)
    other.growth = growth
    road.vehicles[:] = [ego, other]
    info = to_the_end(env, action=1)
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[duty]
