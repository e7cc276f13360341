"""Roads and frame rates that plans through junctions hold for, and those that are refused."""

from itertools import pairwise

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.envs.roads.paths import STOCK, _starts, drive
from rss_shield.envs.roads.ways import CAR_ON_ROAD, junction_of, list_threats, track_of
from rss_shield.shield.junctions.conflict_areas import cell_of, reach_beyond
from rss_shield.shield.junctions.memory import CROSSING, SAMPLE
from rss_shield.shield.junctions.plans import ANY
from rss_shield.shield.junctions.reach import THREAT

GENERIC = "roundabout-generic-v0"


@pytest.mark.parametrize("config", [{"roundabout_lanes": 3}, {"roundabout_lanes": 4, "roundabout_radius": 30}])
@pytest.mark.parametrize("policy", ["faster", "random"])
def test_a_roundabout_of_many_lanes_works(config, policy):
    env = make(GENERIC, config=config)
    for seed in range(2):
        env.reset(seed=seed)
        rng, over = np.random.default_rng(seed), False
        while not over:
            action = 3 if policy == "faster" else int(rng.integers(5))
            *_, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        assert info["blame"] in ("", "other", "inherited")
        assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize("lanes", [1, 2, 3, 5])
def test_every_lane_of_a_ring_leads_to_every_exit(lanes):
    env = make(GENERIC, shield=None, config={"roundabout_lanes": lanes})
    env.reset(seed=0)
    junction = junction_of(env.unwrapped.road.network)
    for index in junction.number:
        if index[:2] == ("se", "ex"):
            ends = {walk[-1][1] for walk in junction.walks if index in walk}
            assert ends == {"exr", "nxr", "wxr", "sxr"}


def test_who_changes_lanes_may_come_to_every_lane_of_the_roads_that_follow():
    env = make(GENERIC, shield=None, config={"roundabout_lanes": 3})
    env.reset(seed=0)
    junction, graph = junction_of(env.unwrapped.road.network), env.unwrapped.road.network.graph
    for index, k in junction.number.items():
        roads = {index[:2], *(lane[:2] for lane, j in junction.number.items() if junction.following[k] >> j & 1)}
        expected = {(*road, i) for road in roads for i in range(len(graph[road[0]][road[1]]))}
        assert {lane for lane, j in junction.number.items() if junction.reachable[k] >> j & 1} == expected


@pytest.mark.parametrize("lanes", [6, 8])
def test_more_lanes_than_sets_hold_are_refused(lanes):
    with pytest.raises(ValueError, match=rf"road network with {8 * lanes + 16} lanes: expected at most 63"):
        make(GENERIC, config={"roundabout_lanes": lanes})


@pytest.mark.parametrize("maker", [make, lambda env_id, **options: make_vec(env_id, 1, **options)])
@pytest.mark.parametrize(
    ("env_id", "frequency"), [("intersection-v0", 3), ("roundabout-v0", 4), ("intersection-v2", 1)]
)
def test_frames_too_long_for_plans_are_refused(maker, env_id, frequency):
    with pytest.raises(ValueError, match=rf"simulation_frequency = {frequency}: expected >= 5 where roads cross"):
        maker(env_id, config={"simulation_frequency": frequency})


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
@pytest.mark.parametrize("frequency", [5, 10, 15, 30])
def test_cars_stay_inside_what_they_sweep_at_the_frame_rate_in_force(env_id, frequency):
    """At a low frequency drivers weave; they may begin their turn anywhere between two frames."""
    env = make(env_id, shield=None)
    env.reset(seed=0)
    dt = 1 / frequency
    junction = junction_of(env.unwrapped.road.network, dt=dt, sizes=(STOCK,))
    roads, rng = junction.roads, np.random.default_rng(frequency)
    paths, lanes = roads.paths, roads.lanes
    number = junction.number
    most = -np.inf
    for p, walk in enumerate(junction.walks):
        way = np.array([number[index] for index in walk])
        start = _starts(lanes, way)
        for _ in range(3):
            speed = rng.uniform(0.3, 1.0) * junction.limit
            track = np.zeros((4000, 4))
            driven = drive(lanes, way, start, speed, dt, track, 5.0, rng.uniform(0.0, speed * dt))
            for s, x, y, heading in track[:driven]:
                i = cell_of(s, paths.cells[p])
                if 0.0 <= s < start[-1] and paths.crossed[p, i]:
                    most = max(most, *reach_beyond(paths.swept[p, i], x, y, heading, 2.5, 1.0))
    assert most < 0.1  # beyond the margin of this car; that of the other has room for it


def test_it_is_the_frequency_that_counts():
    """The check above would fail with the paths of another frequency."""
    env = make("roundabout-v0", shield=None)
    env.reset(seed=0)
    at = [junction_of(env.unwrapped.road.network, dt=1 / f).roads.paths.swept for f in (5, 15)]
    assert (at[0][..., 5] - at[1][..., 5]).max() > 0.1


def follow(env_id, car, frames):
    """Ways and strays of one car on every frame, as the ego reads them, while `car(frame)` says where it is."""
    env = make(env_id, shield=None)
    env.reset(seed=0)
    junction = junction_of(env.unwrapped.road.network)
    roads, number = junction.roads, junction.number
    ego, other = np.zeros((2, 1), CAR_ON_ROAD)
    start = env.unwrapped.road.network.get_lane(("ser", "ses", 0))
    ego["x"], ego["y"] = start.position(2.0, 0.0)
    ego["heading"], ego["length"], ego["width"] = start.heading_at(2.0), 5.0, 2.0
    ego["on"] = ego["lane"] = number[("ser", "ses", 0)]
    ego["choice"] = junction.choice(("ser", "ses", 0), None)
    track = track_of(roads, ego[0], -1)
    memory, samples, threats, box = np.zeros(1, CROSSING), np.zeros(1, SAMPLE), np.zeros(64, THREAT), np.zeros(6)
    seen = []
    for frame in range(frames):
        lane, s = car(env.unwrapped.road.network, frame)
        other["x"], other["y"] = lane.position(s, 0.0)
        other["heading"], other["speed"], other["length"], other["width"] = lane.heading_at(s), 10.0, 5.0, 2.0
        other["lane"] = other["choice"] = -1
        count = list_threats(roads, track, other, memory, ANY, 20.0, samples, threats, box)
        seen.append((set(threats["path"][:count]), bool(samples["strays"][0])))
        for name in ("lanes", "ways", "reachable", "path"):
            memory[name] = samples["next_lanes" if name == "lanes" else name]
        memory["age"] += 1
    return junction, seen


def around(network, frame):
    """A car that drives along the inner lane of a ring for ever, a metre on each frame."""
    ring = [(a, b, 1) for a, b in pairwise(["ee", "nx", "ne", "wx", "we", "sx", "se", "ex", "ee"])]
    lengths = [network.get_lane(index).length for index in ring]
    s = frame % sum(lengths)
    for index, length in zip(ring, lengths, strict=True):
        if s < length:
            return network.get_lane(index), s
        s -= length
    raise AssertionError


def test_ways_on_a_ring_never_lead_further_than_before_and_who_goes_around_once_more_has_left_them():
    lap = 150  # frames of a metre: the inner lane has a radius of 24 m
    junction, seen = follow("roundabout-v0", around, 2 * lap)
    strays = [frame for frame, (_, astray) in enumerate(seen) if astray]
    assert strays and lap * 0.6 < strays[0] <= lap  # at the exit that closes the lap
    ends = [{junction.walks[path][-1] for path in ways} for ways, _ in seen[: strays[0]]]
    assert len(ends[0]) == 4
    for before, now in pairwise(ends):
        assert now <= before
    assert len(ends[-1]) == 1


@pytest.mark.parametrize("seed", [473, 14365])
def test_an_ego_that_waits_to_enter_a_ring_is_not_trapped_by_a_second_lap(seed):
    """Both ended in a contact that broke nobody's duty."""
    env = make("roundabout-v0")
    env.reset(seed=seed)
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(3)
        over = terminated or truncated
    assert info["blame"] == ""
    assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize(
    ("env_id", "seed", "actions", "duty"),
    [
        # a car changed lanes and so trapped the ego, which another one hit later that had done nothing wrong
        ("roundabout-v0", 9791, "02412401321", "none: somebody else had trapped the ego"),
        # a car that stood off every path set off again
        ("intersection-v2", 11830, "0200201120100", "left every path it could take"),
    ],
)
def test_whoever_brought_it_about_is_named(env_id, seed, actions, duty):
    env = make(env_id)
    env.reset(seed=seed)
    for action in actions:
        *_, info = env.step(int(action))
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == duty
    assert info["episode_broken_duties"] == 0
