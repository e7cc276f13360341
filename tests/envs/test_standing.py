"""Rule J9: who has stood for long has to notice first that somebody counts on that."""

import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from junction_world import DT, Duel, crossing_pairs, junction, verdict_of

from rss_shield import make
from rss_shield.shield.junctions.conflict_areas import cell_of
from rss_shield.shield.junctions.memory import ASSERTIVE, CAUTIOUS
from rss_shield.shield.junctions.plans import PATIENCE, START_UP
from rss_shield.shield.junctions.reach import STANDING


def stood(duel, frames):
    """The other has stood for some frames, while the ego waits."""
    duel.frame(-6.0, 0.0)
    duel.memory["stood"] = frames
    return duel


def waiting_duels(entry):
    """Pairs of crossing paths, both before the area: the ego waits where it could not go in front of the other."""
    paths = junction().roads.paths
    for a, b in crossing_pairs():
        line = int(np.argmax(paths.crossed[a])) * 0.5 - 3.0
        for s_other in (92.0, 95.0):
            # the ego has never been in its way, and it never goes unless it counts on the other to stand
            if paths.first[b, a, cell_of(s_other, paths.cells[b])] > line:
                yield Duel(a, b, line, 0.0, s_other, 0.0, entry)


def goes(duel, frames=90):
    for _ in range(frames):
        duel.frame(6.0, 0.0)
        if duel.memory["counted_on"][0] > 0:
            return True
    return False


@pytest.mark.parametrize("entry", [CAUTIOUS, ASSERTIVE])
def test_it_is_counted_on_once_it_has_stood_for_long_and_not_before(entry):
    frames = round(PATIENCE[entry] / DT)
    early = sum(goes(stood(duel, 0), frames - 30) for duel in waiting_duels(entry))
    late = sum(goes(stood(duel, frames)) for duel in waiting_duels(entry))
    assert early == 0 and late > 10


def play(duel, rng, may_start, dawdles=False):
    """The other creeps at times, and moves off for good as soon as it may.

    Args:
      may_start: of the frame, for how many frames the ego counts on the other, and for how many it has at most.

    Returns:
      Whether they were in touch, and for how many frames the ego counted on the other.
    """
    relied, creep, wish = 0, 0.0, 6.0
    for t in range(150):
        v = float(duel.threats["v"][0])
        if t % 5 == 0:
            creep = rng.choice([0.0, 0.9 * STANDING])
        if t % 8 == 0 and dawdles:
            wish = rng.choice([-3.0, 0.0, 6.0])
        duel.frame(wish, (creep - v) / DT)
        count = int(duel.memory["counted_on"][0])
        relied = max(relied, count)
        if v >= STANDING or may_start(t, count, relied):
            duel.threats["v"] = min(v + 6.0 * DT, duel.roads.limit)
        if duel.touch():
            return True, relied
    return False, relied


@pytest.mark.parametrize("dawdles", [False, True], ids=["at full throttle", "an ego that dawdles"])
def test_nobody_is_touched_who_starts_no_sooner_than_the_rule_lets_them(dawdles):
    rng, frames, gone = np.random.default_rng(0), round(PATIENCE[CAUTIOUS] / DT), 0
    notices = int(np.ceil(START_UP / DT))
    for duel in waiting_duels(CAUTIOUS):
        stood(duel, frames)
        touched, relied = play(duel, rng, lambda t, count, relied: relied > 0 and not 0 < count < notices, dawdles)
        assert not touched and duel.memory["ego_broke"][0] == 0
        gone += relied > 0
    assert gone > 20


def test_who_moves_off_at_any_other_time_finds_an_ego_that_waits_or_has_gone():
    rng, frames, left = np.random.default_rng(1), round(PATIENCE[CAUTIOUS] / DT), 0
    for duel in waiting_duels(CAUTIOUS):
        for at in (0, 2, 4):
            other = Duel(duel.path, int(duel.threats["path"][0]), duel.s, 0.0, float(duel.threats["s"][0]), 0.0)
            stood(other, frames - 10)  # starts before it has stood for long
            touched, _ = play(other, rng, lambda t, count, relied, at=at: t >= at)
            assert not touched and other.memory["ego_broke"][0] == 0
            left += 1
    assert left > 30


def test_who_starts_sooner_did_not_give_way():
    rng, frames, contacts = np.random.default_rng(2), round(PATIENCE[CAUTIOUS] / DT), 0
    for duel in waiting_duels(CAUTIOUS):
        for after in (3, 6, 12):
            other = Duel(duel.path, int(duel.threats["path"][0]), duel.s, 0.0, float(duel.threats["s"][0]), 0.0)
            stood(other, frames)
            touched, _ = play(other, rng, lambda t, count, relied, after=after: count >= after)
            assert other.memory["ego_broke"][0] == 0
            if touched:
                contacts += 1
                assert verdict_of(other, float(other.threats["v"][0])) == "other"
    assert contacts > 0


def broken_down(entry, intent, destination, arm, to, back):
    """An ego alone with a car that has broken down before its line."""
    config = dict(initial_vehicle_count=0, spawn_probability=0, duration=60, destination=destination)
    env = make("intersection-v0", intent=intent, entry=entry, config=config)
    env.reset(seed=0)
    road, ego = env.unwrapped.road, env.unwrapped.vehicle
    lane = road.network.get_lane((arm, f"ir{arm[1]}", 0))
    s = lane.length - back
    car = IDMVehicle(road, lane.position(s, 0.0), lane.heading_at(s), 0.0, target_speed=0.0)
    car.plan_route_to(to)
    road.vehicles[:] = [ego, car]
    return env


@pytest.mark.parametrize("entry", ["cautious", "priority", "assertive"])
@pytest.mark.parametrize(
    ("intent", "destination", "arm", "to", "back"),
    [
        ("known", "o1", "o1", "o2", 7.0),
        ("known", "o3", "o2", "o0", 14.0),
        ("any", "o1", "o2", "o1", 5.0),
        ("any", "o2", "o3", "o1", 8.0),
        ("straight", "o2", "o1", "o3", 6.0),
    ],
)
def test_a_car_that_has_broken_down_at_its_line_holds_nobody_for_ever(entry, intent, destination, arm, to, back):
    env = broken_down(entry, intent, destination, arm, to, back)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(2)
        done = terminated or truncated
    assert info["is_success"] and info["blame"] == ""
    assert info["time"] < PATIENCE[0] + 15.0


def test_nobody_counts_on_another_shield_to_stand():
    """Two who count on each other would go at once."""
    env = make("intersection-multi-agent-v1", config=dict(initial_vehicle_count=0, spawn_probability=0, duration=40))
    env.reset(seed=0)
    egos = [vehicle.act.__self__ for vehicle in env.unwrapped.controlled_vehicles]
    assert len(egos) > 1
    done, longest = False, 0
    while not done:
        *_, terminated, truncated, _info = env.step(tuple(0 for _ in egos))  # both stand
        done = terminated or truncated
        longest = max(longest, *(int(ego.crossings["stood"].max(initial=0)) for ego in egos))
    assert longest == 0
