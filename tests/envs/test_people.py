"""Driving among pedestrians and past what hides them: `crosswalk-v0`, `parked-row-v0`, `occluded-intersection-v0`."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.worlds.crosswalk import BESIDE, CrosswalkEnv
from rss_shield.envs.worlds.occluded import PLACE, ROW
from rss_shield.envs.worlds.streets import KERB, START, Person
from rss_shield.envs.worlds.walkers import DASHES, JUMPS, RUNS_OUT, UNREASONABLE_ERRANDS, Errand, Walker
from rss_shield.shield.definitions.occlusion import REASONABLE
from rss_shield.shield.trace import load, save
from rss_shield.shield.verdicts import AT_FAULT, DUTIES, HURRIED, LEAPED, NO_CAUTION, UNREASONABLE, WALKED_IN

FASTER = 2
ALONE = {"vehicles_count": 0, "pedestrians": 0, "unreasonable": 0.0}
WORLDS = ("crosswalk-v0", "parked-row-v0", "occluded-intersection-v0")


def drive(env, rng=None):
    """To the end of an episode that has begun, always FASTER or at random; returns the last info and the mean speed."""
    inner, done, info = env.unwrapped, False, {}
    while not done:
        _, _, terminated, truncated, info = env.step(FASTER if rng is None else int(rng.integers(3)))
        done = terminated or truncated
    return info, (inner.vehicle.position[0] - START) / inner.time


def put(env, x, y, errand, place) -> Walker:
    """A pedestrian who walks to smaller y."""
    road = env.unwrapped.road
    walker = Walker(road, (x, y), -np.pi / 2)
    walker.errand, walker.place = errand, place
    road.objects.append(walker)
    return walker


def with_child(env, when_near, speed=None, kind=RUNS_OUT):
    """An episode in which a child runs out of the fourth gap; returns the info and the child."""
    env.reset(seed=1)
    start, end = env.unwrapped._gaps()[3]
    v = REASONABLE[PLACE].v_high if speed is None else speed
    child = put(env, 0.5 * (start + end), ROW + 2.2, Errand(kind, v, 0.0, when_near, -KERB), PLACE)
    return drive(env)[0], child


@pytest.mark.parametrize("world", WORLDS)
def test_the_ego_touches_nobody_reasonable_and_is_never_at_fault(world):
    config = {} if world == WORLDS[2] else {"unreasonable": 0.0}
    for policy in ("faster", "random"):
        env = make(world, config=config)
        for seed in range(3 if policy == "faster" else 1):
            env.reset(seed=seed)
            info, _ = drive(env, None if policy == "faster" else np.random.default_rng(seed))
            assert info["blame"] not in (*AT_FAULT, "none"), (world, policy, seed)
            assert info["episode_broken_duties"] == 0
            if info["blame"]:
                road, k = env.unwrapped.road, info["blame_evidence"]["partner"]
                assert not isinstance([*road.vehicles, *road.objects][k], Walker)


def test_a_child_that_is_expected_is_not_hit_and_one_that_is_not_expected_is():
    """The mutation: without ghosts the same children are hit, and by the ego's fault."""
    distances = np.arange(14.0, 27.0, 1.5)
    env = make("parked-row-v0", config=ALONE)
    assert [with_child(env, d)[0]["blame"] for d in distances] == [""] * len(distances)
    blind = make("parked-row-v0", config=ALONE | {"ghosts": False})
    infos = [with_child(blind, d)[0] for d in distances]
    verdicts = [info["blame"] for info in infos if info["blame"]]
    assert verdicts and set(verdicts) == {"ego"}
    assert {info["blame_evidence"]["ego_duty"] for info in infos if info["blame"]} == {DUTIES[NO_CAUTION]}


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["override", "monitor"])
def test_a_plan_for_a_moment_does_not_make_up_for_a_want_of_caution(mode):
    """J15: a car comes out, the ego has no plan; braking it finds one toward that car alone, loses it, and is hit."""
    env = make("occluded-intersection-v0", mode, config={"ghosts": False})
    env.reset(seed=900196)
    info, done = {}, False
    while not done:
        *_, terminated, truncated, info = env.step(2)
        done = terminated or truncated
    assert info["blame"] == "ego" and info["blame_evidence"]["other_duty"] == ""
    if mode == "override":
        assert info["blame_evidence"]["ego_duty"] == DUTIES[NO_CAUTION]


def test_a_child_that_comes_faster_than_is_reasonable_is_to_blame():
    env = make("parked-row-v0", config=ALONE)
    infos = [with_child(env, d, 6.0, DASHES)[0] for d in np.arange(1.0, 6.0, 1.0)]
    hits = [info["blame_evidence"] for info in infos if info["blame"]]
    assert hits and {hit["verdict"] for hit in hits} == {"other"}
    assert {hit["other_duty"] for hit in hits} <= {DUTIES[d] for d in (UNREASONABLE, WALKED_IN, HURRIED, LEAPED)}
    assert all(info["episode_broken_duties"] == 0 for info in infos)


def test_who_jumps_onto_the_road_farther_than_a_pedestrian_may_is_to_blame():
    hits = []
    for near in (2.0, 3.0, 4.0, 5.0):
        env = make("crosswalk-v0", config=ALONE | {"occluders": False})
        env.reset(seed=0)
        put(env, 40.0, KERB, Errand(JUMPS, 7.0, 0.0, near, -KERB), ("pedestrian", "roadside"))
        info, _ = drive(env)
        hits += [info["blame_evidence"]] if info["blame"] else []
    assert hits and {hit["verdict"] for hit in hits} == {"other"}
    assert {hit["other_duty"] for hit in hits} <= {DUTIES[d] for d in (LEAPED, HURRIED, WALKED_IN)}


def test_without_the_shield_the_same_pedestrians_are_hit_by_the_egos_fault():
    env = make("crosswalk-v0", "monitor", config={"vehicles_count": 0, "unreasonable": 0.0, "pedestrians": 8})
    verdicts = []
    for seed in range(6):
        env.reset(seed=seed)
        verdicts.append(drive(env)[0]["blame"])
    assert set(verdicts) <= {"", "ego"} and verdicts.count("ego") >= 2


def test_removing_an_occluder_never_lowers_the_mean_speed():
    env = make("parked-row-v0", config=ALONE)
    road_of = lambda: env.unwrapped.road  # noqa: E731  a reset makes a new one
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    boxes, speeds = list(road_of().surroundings.boxes), []
    while True:
        env.reset(seed=0)
        surroundings = road_of().surroundings._replace(boxes=tuple(boxes))
        road_of().begin(env.unwrapped.vehicle, surroundings, road_of().dt)
        info, speed = drive(env)
        assert info["is_success"]
        speeds.append(speed)
        if not boxes:
            break
        for _ in range(3):
            if boxes:
                boxes.pop(int(rng.integers(len(boxes))))
    assert (np.diff(speeds) >= -1e-9).all()
    assert speeds[-1] > 1.5 * speeds[0]


def test_nobody_is_observed_before_being_seen():
    env = make("parked-row-v0", config={"vehicles_count": 0, "unreasonable": 0.0})
    observation, _ = env.reset(seed=0)
    hidden = [w for w in env.unwrapped.road.walkers if not env.unwrapped.road.is_known(w)]
    assert hidden and not observation[1:].any()
    drive(env)
    assert all(env.unwrapped.road.was_hidden(w) for w in hidden if env.unwrapped.road.is_known(w))


def test_pedestrians_are_rows_of_the_observation_with_their_velocity():
    env = make("crosswalk-v0", config=ALONE | {"occluders": False})
    env.reset(seed=0)
    put(env, 30.0, KERB, Errand(JUMPS, 2.0, 0.0, np.inf, -KERB), ("pedestrian", "roadside"))
    observation, *_ = env.step(1)
    seen, velocity = observation[1], observation[1, 4] * 20.0 + observation[0, 4] * 20.0
    assert seen[0] == 1.0 and velocity == pytest.approx(-2.0, abs=1e-5)


def test_a_trace_says_who_the_pedestrians_are(tmp_path):
    env = make("crosswalk-v0", config={"unreasonable": 1.0})
    trace = record_trace(env, lambda _: FASTER, seed=3)
    save(trace, tmp_path / "people.npz")
    read = load(tmp_path / "people.npz")
    people = read.meta["pedestrians"]
    assert len(people) == 5 and sum(not one["reasonable"] for one in people) == 1
    assert all(read.users.kinds[one["row"]] == "pedestrian" for one in people)
    assert any(one["first_seen"] >= 0 for one in people)


@pytest.mark.parametrize("x", [53.0, 56.0, 57.0, 57.7])
def test_who_jumps_out_between_the_van_and_the_crossing_is_counted_on(x):
    """Once people stood inside the van, where nobody expects any, and the ego was to blame when one jumped out."""
    env = make("crosswalk-v0", config=ALONE)
    for when_near in (4.0, 8.0, 12.0):
        env.reset(seed=0)
        person = env.unwrapped._at(x, Errand(JUMPS, 5.5, 0.0, when_near, 0.0), ("pedestrian", "roadside"))
        assert person.y < 0.0 or not 49.0 < person.x < 56.0
        put(env, max(person.x, 56.0), KERB, person.errand._replace(until=-KERB), person.place)
        info, _ = drive(env)
        assert info["blame"] not in AT_FAULT


def test_who_hurried_and_trapped_the_ego_is_alone_to_blame(monkeypatch):
    """Once what a pedestrian broke was noted after the ego was judged on it: a frame late to say who trapped it (H24).

    The jumper is put where nobody is counted on, so that the ego finds itself without a plan.
    """
    people, surround = CrosswalkEnv._people, CrosswalkEnv._surround

    def with_jumper(env):
        *others, last = people(env)
        x = 56.0 + np.random.default_rng(25).uniform(0.0, 2.0)
        return [*others, Person(x, KERB, last.errand._replace(until=-KERB), BESIDE)]

    def without_ghosts_beside_the_van(env):
        surroundings, parked = surround(env)
        return surroundings._replace(columns=surroundings.columns[:2]), parked

    monkeypatch.setattr(CrosswalkEnv, "_people", with_jumper)
    monkeypatch.setattr(CrosswalkEnv, "_surround", without_ghosts_beside_the_van)
    env = make("crosswalk-v0", config={"unreasonable": 1.0, "pedestrians": 2})
    env.reset(seed=25)
    info, _ = drive(env)
    assert info["blame"] == "other"
    assert info["blame_evidence"]["other_duty"] == DUTIES[HURRIED]


def test_masks_look_at_pedestrians_and_change_nothing():
    env = make("parked-row-v0", config=ALONE)
    env.reset(seed=0)
    for _ in range(4):
        env.step(FASTER)
    before = env.unwrapped.vehicle.speed
    assert env.action_masks().shape == (3,)
    assert not env.action_masks()[FASTER]  # between parked cars it would be held back
    assert env.unwrapped.vehicle.speed == before


def test_streets_are_drawn():
    env = make("crosswalk-v0", config=ALONE, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.vehicle.position[0] = 50.0
    picture = env.render()
    assert ((picture == 240).all(axis=-1)).sum() > 100  # stripes
    env.close()


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"occluders": 1}, "config.occluders = 1: expected true or false"),
        ({"pedestrians": -1}, "config.pedestrians = -1: expected a whole number >= 0"),
        ({"unreasonable": 2.0}, "config.unreasonable = 2.0: expected a number from 0 to 1"),
    ],
)
def test_bad_configurations_are_refused(config, message):
    with pytest.raises(ValueError, match=message):
        make("crosswalk-v0", config=config)


def test_compliant_traffic_is_refused():
    with pytest.raises(ValueError, match="traffic = 'compliant': expected 'stock'"):
        make("crosswalk-v0", traffic="compliant").reset()


def test_errands_that_nobody_need_expect_are_named():
    assert UNREASONABLE_ERRANDS == (JUMPS, DASHES)
