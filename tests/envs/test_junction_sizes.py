"""Where roads cross, everybody has a length and a width: trucks, wide cars, motorcycles."""

import warnings

import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import make
from rss_shield.envs.fast.config import Unsupported, compile_scenario
from rss_shield.envs.fast.engine import DISABLED, Engine
from rss_shield.envs.fast.replay import read
from rss_shield.envs.roads.paths import STOCK, Size, size_of
from rss_shield.envs.roads.ways import junction_of
from rss_shield.shield.junctions.conflict_areas import HALF_LENGTH, HALF_WIDTH

FASTER = {"intersection-v0": 2, "intersection-v2": 2, "roundabout-v0": 3}


class Truck(IDMVehicle):
    LENGTH, WIDTH = 12.0, 2.5


class Bus(IDMVehicle):
    LENGTH, WIDTH = 9.3, 2.6


class Van(IDMVehicle):
    LENGTH, WIDTH = 6.0, 2.3


class Wide(IDMVehicle):
    LENGTH, WIDTH = 4.5, 3.0


class Motorcycle(IDMVehicle):
    LENGTH, WIDTH = 2.2, 0.8


def meet(env_id, kind, lane, s, speed, decisions=12, seed=0, route="o1", **options):
    """Play full throttle with one other road user on the road; returns the last info, and the two."""
    env = make(env_id, config={"duration": decisions}, **options)
    env.reset(seed=seed)
    base = env.unwrapped
    base.config["spawn_probability"] = 0
    network, ego = base.road.network, base.vehicle
    index = ego.lane_index if lane is None else lane
    if lane is None:
        s += ego.lane.local_coordinates(ego.position)[0]
    place = network.get_lane(index)
    other = kind(
        base.road,
        place.position(s, 0.0),
        place.heading_at(s),
        speed,
        target_lane_index=index,
        target_speed=speed,
        enable_lane_change=False,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other.plan_route_to(route)
    base.road.vehicles[:] = [ego, other]
    for _ in range(decisions):
        *_, terminated, truncated, info = env.step(FASTER[env_id])
        if terminated or truncated:
            break
    return info, ego, other


@pytest.mark.parametrize("kind", [Truck, Bus, Wide, Motorcycle])
@pytest.mark.parametrize(("ahead", "speed"), [(21.0, 0.0), (24.0, 1.0), (30.0, 4.0)])
def test_the_ego_does_not_drive_into_whoever_is_ahead_on_its_lane(kind, ahead, speed):
    info, _, _ = meet("intersection-v0", kind, None, ahead, speed)
    assert info["blame"] == ""
    assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize("kind", [Truck, Van, Motorcycle])
def test_nor_into_a_leader_of_any_size_on_the_way_to_a_ring(kind):
    info, _, _ = meet("roundabout-v0", kind, None, 24.0, 3.0, route="nxs")
    assert info["blame"] == ""
    assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize("kind", [Truck, Bus, Wide])
@pytest.mark.parametrize("arm", [1, 2, 3])
def test_nor_into_whoever_crosses(kind, arm):
    lane = (f"o{arm}", f"ir{arm}", 0)
    info, _, _ = meet("intersection-v0", kind, lane, 62.0, 8.0, route=f"o{(arm + 2) % 4}", intent="known")
    assert info["blame"] == ""
    assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize("route", ["o0", "o2", "o3"])
@pytest.mark.parametrize(("s", "speed"), [(50.0, 12.0), (62.0, 8.0), (75.0, 4.0), (90.0, 4.0)])
def test_nor_before_whoever_may_swing_wide_where_it_stops_early(s, speed, route):
    """A long truck may reach across the ego's lane as it leaves: the ego has no sure plan, long before the truck comes.

    It has to wait where the truck is in its way on one of its ways, and not to drive on to where it is on all of them.
    """
    lane = ("o1", "ir1", 0)
    _, ego, _ = meet("intersection-v0", Truck, lane, s, speed, 4, route=route)
    assert ego.position[1] > 20.0  # the junction begins at 11 m
    info, _, _ = meet("intersection-v0", Truck, lane, s, speed, route=route)
    assert not info["crashed"]
    assert info["episode_broken_duties"] == 0


def test_behind_a_truck_the_ego_stops_behind_its_rear():
    """Where it cannot be sure that a long one needs no room behind as it turns, it goes no nearer than it has to."""

    def gap(kind, ahead):
        _, ego, other = meet("roundabout-v0", kind, None, ahead, 0.0, route="nxs")
        return np.hypot(*(other.position - ego.position)) - 2.5 - 0.5 * kind.LENGTH

    for kind in (Truck, Bus, Motorcycle, IDMVehicle):
        assert 0.2 < gap(kind, 13.0 + 0.5 * kind.LENGTH) < 4.0


def test_sizes_are_rounded_up_and_those_on_the_grid_are_exact():
    assert size_of(5.0, 2.0) == STOCK == Size(5.0, 5.0, 2.0)
    assert size_of(12.0, 2.5) == Size(12.0, 12.0, 2.5)
    assert size_of(4.4, 1.8) == Size(4.0, 5.0, 2.0)
    assert size_of(0.6, 0.4) == Size(1.0, 1.0, 0.5)
    for length, width in np.random.default_rng(0).uniform((1.0, 0.3), (20.0, 3.9), (200, 2)):
        size = size_of(length, width)
        assert size.shortest <= length <= size.longest <= size.shortest + 1.0
        assert width <= size.width < width + 0.5 + 1e-9


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_longer_and_wider_cars_sweep_more(env_id):
    env = make(env_id)
    env.reset(seed=0)
    network, dt = env.unwrapped.road.network, 1 / 15
    sizes = STOCK, size_of(12.0, 2.5), size_of(5.0, 3.0), size_of(2.2, 0.8)
    paths = junction_of(network, dt=dt, sizes=sizes).roads.paths
    count = len(paths.boxes)
    stock, truck, wide, small = (paths.swept[k * count : (k + 1) * count] for k in range(4))
    driven = np.arange(stock.shape[1]) < paths.cells[:count, None]
    assert (truck[driven][:, HALF_LENGTH] >= stock[driven][:, HALF_LENGTH] + 2.0).all()
    assert np.allclose(wide[driven][:, HALF_WIDTH] - stock[driven][:, HALF_WIDTH], 0.5, atol=0.2)
    assert (small[driven][:, HALF_WIDTH] < stock[driven][:, HALF_WIDTH]).all()
    alone = junction_of(network, dt=dt).roads.paths
    assert np.array_equal(alone.swept, stock)
    assert np.array_equal(alone.conflicts, paths.conflicts[:, :count])
    reached = [np.isfinite(paths.conflicts[:, k * count : (k + 1) * count, :, 0]).sum() for k in range(4)]
    assert reached[3] < reached[0] < reached[1]


def test_a_freely_steered_ego_of_another_size_is_refused():
    env = make("intersection-v1", shield=None)
    env.reset(seed=0)
    kind = type(env.unwrapped.vehicle)
    before = kind.LENGTH
    kind.LENGTH = 8.0
    try:
        with pytest.raises(ValueError, match=r"vehicle of 8 m x 2 m: expected 5 m x 2 m"):
            make("intersection-v1")
    finally:
        kind.LENGTH = before


def test_the_engine_refuses_cars_of_another_size(monkeypatch):
    engine = Engine(compile_scenario("intersection-v0"), 1, autoreset=DISABLED)
    engine.seed([0])  # without a generator the traffic of an intersection is drawn for ever
    engine.reset()
    env = make("intersection-v0", shield=None)
    env.reset(seed=0)
    base = env.unwrapped
    base.road.vehicles.append(Truck(base.road, [2.0, 60.0], -np.pi / 2, 5.0))
    batch = engine.batch
    with pytest.raises(ValueError, match=r"vehicle of 12 m x 2.5 m: expected 5 m x 2 m"):
        read(base, batch.cars[0], batch.episodes[0], batch.order[0], engine.scenario.network)
    monkeypatch.setattr(IDMVehicle, "LENGTH", 7.0)
    with pytest.raises(Unsupported, match=r"vehicles of 7 m x 2 m; expected 5 m x 2 m"):
        compile_scenario("intersection-v0")
