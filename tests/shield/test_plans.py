"""Plans through a junction (Def. 17 pointwise, Def. 18): nobody is ever in the ego's way, whatever it wants."""

import numpy as np
import pytest
from junction_world import DT, EGO, RULED, TABLE, Duel, arms, crossing_pairs, junction, verdict_of

from rss_shield.envs.roads.ways import CAR_ON_ROAD, _fitting
from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.junctions.conflict_areas import CELL, FAR, cell_of
from rss_shield.shield.junctions.followers import sort_out
from rss_shield.shield.junctions.frame_by_frame import go_frame_by_frame, stop_frame_by_frame
from rss_shield.shield.junctions.memory import ASSERTIVE, CAUTIOUS, CROSSING, PRIORITY
from rss_shield.shield.junctions.plans import (
    NEVER,
    SLACK,
    Scene,
    Track,
    _rest,
    begin,
    go_plan,
    plan_conflict,
    stop_conflict,
    tail_conflict,
)
from rss_shield.shield.junctions.reach import THREAT, farthest

STARTS = [(s, v) for s in (70.0, 88.0, 97.0) for v in (0.0, 9.0)]
OTHERS = [(s, v) for s in (55.0, 80.0, 95.0) for v in (3.0, 9.0)]


# as if others could stop at once: whom the ego counts on to give way is then counted on for too long
HASTY = TABLE.other._replace(response_time=DT)


def drive(duel, rng, other="any", frames=160, overrides=True):
    """Play one duel; returns the frames in contact and the report's broken duties."""
    contacts = broken = 0
    nominal = a_other = 0.0
    for t in range(frames):
        if t % 8 == 0:
            nominal = rng.choice([-6.0, 0.0, 6.0])
            a_other = {"any": rng.choice([-6.0, 0.0, 6.0]), "throttle": 6.0}[other]
        duel.frame(nominal, a_other, overrides)
        broken += duel.report.broken
        contacts += duel.touch()
    return contacts, broken


def duels(assumed=TABLE.other, **options):
    """Contacts and broken duties over every pair of crossing paths and a grid of starts."""
    contacts = broken = starts = trapped = 0
    for n, (a, b) in enumerate(crossing_pairs()):
        rng = np.random.default_rng(n)
        for s, v in STARTS:
            s_other, v_other = OTHERS[rng.integers(len(OTHERS))]
            duel = Duel(a, b, s, v, s_other, v_other, CAUTIOUS, assumed)
            duel.frame(0.0, 0.0)
            if duel.report.trapped or duel.touch():
                continue  # in danger from the start
            starts += 1
            found = drive(duel, rng, **options)
            contacts += found[0] > 0
            broken += found[1]
            trapped += duel.report.trapped
    return contacts, broken, starts, trapped


def test_nobody_is_in_the_way_on_any_pair_of_crossing_paths():
    contacts, broken, starts, trapped = duels()
    assert starts > 100
    assert (contacts, broken, trapped) == (0, 0, 0)


def test_nor_when_the_other_never_lifts_its_foot():
    assert duels(other="throttle")[:2] == (0, 0)


def test_without_the_shield_they_meet():
    assert duels(overrides=False)[0] > 10


def test_whoever_trusts_that_nobody_accelerates_is_hit():
    """Mutation: arrival times without the other's throttle (item 3' believed too late)."""
    timid = TABLE.other._replace(a_max_accel=0.0)
    assert duels(assumed=timid, other="throttle")[0] > 0


def test_whoever_takes_the_right_of_way_is_hit_by_those_who_do_not_give_it():
    """Items 2 and 3 as printed: everybody who can stop is expected to."""
    contacts = 0
    for a, b in crossing_pairs():
        for s_other in range(60, 97, 3):
            contacts += contact(Duel(a, b, 80.0, 9.0, s_other, 9.0, ASSERTIVE, HASTY), 6.0, 6.0, overrides=True)
    assert contacts > 0


def test_whoever_swaps_the_priority_is_hit():
    """Mutation: the ego expects those to give way who have the right of way."""
    paths = junction().roads.paths
    lower = [(a, b) for a, b in crossing_pairs() if paths.priority[a, b] < 0]
    contacts = 0
    for a, b in lower:
        for s_other in range(60, 97, 3):
            duel = Duel(a, b, 80.0, 9.0, s_other, 9.0, PRIORITY, HASTY)
            duel.threats["priority"] = 1
            contacts += contact(duel, 6.0, 6.0, overrides=True)
    assert contacts > 0


def test_whoever_forgets_the_plan_is_hit():
    """Mutation: where no new plan is found, the agent's wish is carried out instead of the plan in force."""
    contacts = 0
    for n, (a, b) in enumerate(crossing_pairs()):
        duel = Duel(a, b, 88.0, 9.0, 80.0, 6.0)
        rng, wish = np.random.default_rng(n), 0.0
        for t in range(120):
            wish = rng.choice([-6.0, 6.0]) if t % 8 == 0 else wish
            before = duel.v
            duel.frame(wish, 6.0)
            duel.v = max(before + wish * DT, 0.0)
            contacts += duel.touch()
    assert contacts > 0


def test_a_go_is_not_broken_off():
    """Going on is a commitment: an ego that asks to brake inside the junction is carried through it."""
    a, b = next((a, b) for a, b in crossing_pairs() if arms(a) == ("o0", "o1") and arms(b) == ("o1", "o3"))
    duel = Duel(a, b, 104.0, 6.0, 30.0, 8.0)
    gone = 0
    for _ in range(110):
        duel.frame(-3.0, 6.0)
        gone += duel.report.acceleration > 0.0
        assert not duel.touch()
    assert gone > 0 and duel.s > 117.0  # out of the other path


def test_waiting_cars_let_the_ego_go_when_they_are_assumed_to_stand():
    a, b = crossing_pairs()[0]
    duel = Duel(a, b, 97.0, 0.0, 60.0, 0.0)
    for _ in range(120):
        duel.frame(6.0, 0.0)
    assert duel.s > 125.0 and not duel.touch()


@pytest.mark.parametrize("v", [0.0, 3.0, 9.0])
def test_behind_a_leader_a_plan_is_lemma_2(v):
    """On one lane the plan "brake now" is clear iff the gap is at least d_min with no response time."""
    roads = junction().roads
    path = next(p for p in range(12) if arms(p) == ("o0", "o2"))
    clear = []
    for gap in np.arange(0.0, 20.0, 0.25):
        duel = Duel(path, path, 20.0, v, 20.0 + 5.0 + gap, 6.0)
        scene = Scene(roads.paths, Track(path, 20.0, v, 2.5, -1, 0.0), duel.threats, RULED)
        clear.append(plan_conflict(scene, 0, -1, 0.0) == NEVER)
    nearest = np.arange(0.0, 20.0, 0.25)[clear.index(True)]
    d_min = max(v**2 / (2 * EGO.a_min_brake) - 6.0**2 / (2 * TABLE.other.a_max_brake), 0.0)
    assert clear[clear.index(True) :] == [True] * (len(clear) - clear.index(True))
    assert d_min <= nearest <= d_min + 2.5  # swept boxes, margins and cells


def test_braking_earlier_never_makes_a_clear_stop_unclear():
    rng = np.random.default_rng(1)
    for a, b in crossing_pairs()[::3]:
        duel = Duel(a, b, rng.uniform(60, 97), rng.uniform(0, 9), rng.uniform(40, 100), rng.uniform(0, 9))
        track = Track(a, duel.s, duel.v, 2.5, -1, 0.0)
        scene = Scene(duel.roads.paths, track, duel.threats, RULED)
        if stop_conflict(scene, 3.0, -1, False, 0.0) == NEVER and duel.s < 99.0:
            assert stop_conflict(scene, -3.0, -1, False, 0.0) == NEVER


# ---------------------------------------------------------------- blame


def contact(duel, nominal, a_other, overrides):
    for _ in range(200):
        duel.frame(nominal, a_other, overrides)
        if duel.touch():
            return True
    return False


def test_an_ego_that_drives_into_a_crossing_car_is_to_blame():
    for a, b in crossing_pairs():
        duel = Duel(a, b, 80.0, 9.0, 80.0, 9.0)
        if contact(duel, 0.0, 0.0, overrides=False):
            assert verdict_of(duel, float(duel.threats["v"][0])) == "ego"
            return
    pytest.fail("no contact")


def test_a_car_that_beats_its_bounds_is_to_blame():
    found = []
    for a, b in crossing_pairs():
        for s_other in (45.0, 55.0, 65.0):
            duel = Duel(a, b, 90.0, 6.0, s_other, 8.0)
            for t in range(90):
                duel.frame(6.0, 0.0)
                if duel.report.acceleration > 0.0 and duel.s > 99.0 and t > 3:
                    duel.threats["v"] = 25.0  # it jumps to a speed that nobody expects
                    break
            for _ in range(60):
                duel.frame(6.0, 0.0)
                if duel.touch():
                    found.append(verdict_of(duel, float(duel.threats["v"][0])))
                    break
    assert found and set(found) <= {"other"}


def test_a_car_that_was_counted_on_to_give_way_is_to_blame_when_it_does_not():
    found = []
    for a, b in crossing_pairs():
        if junction().roads.paths.priority[a, b] <= 0:
            continue
        for s_other in range(60, 97, 3):
            duel = Duel(a, b, 80.0, 9.0, s_other, 9.0, PRIORITY, HASTY)
            if contact(duel, 6.0, 6.0, overrides=True):
                found.append(verdict_of(duel, float(duel.threats["v"][0])))
    assert found and set(found) == {"other"}


def test_danger_that_was_there_at_first_sight_is_inherited():
    a, b = crossing_pairs()[0]
    paths = junction().roads.paths
    i = int(np.flatnonzero(np.isfinite(paths.conflicts[a, b, :, 0]))[0])
    duel = Duel(a, b, i * 0.5 - 2.0, 9.0, float(paths.conflicts[a, b, i, 0]) - 2.0, 9.0)
    assert contact(duel, 0.0, 0.0, overrides=True)
    assert verdict_of(duel, float(duel.threats["v"][0])) == "inherited"


def crowd(env_id, rng):
    """The ego and ten others anywhere on the paths of a network, sorted out."""
    roads = junction(env_id).roads
    paths = roads.paths
    path = int(rng.integers(len(paths.cells)))
    ego = Track(path, rng.uniform(0.0, paths.cells[path] * CELL), rng.uniform(0.0, 12.0), 2.5, -1, 0.0)
    threats = np.zeros(10, THREAT)
    threats["user"], threats["path"] = np.arange(10), rng.integers(len(paths.cells), size=10)
    threats["s"], threats["v"] = rng.uniform(0.0, 0.5 * paths.cells[threats["path"]]), rng.uniform(-1.0, 12.0, 10)
    threats["cap"], threats["half_length"], threats["wreck"] = roads.limit, 2.5, rng.random(10) < 0.1
    scene = Scene(paths, ego, threats, RULED)
    memory, stands = np.zeros(10, CROSSING), rng.random(10) < 0.2
    threats["v"][stands] = rng.uniform(-0.4, 0.45, stands.sum())
    memory["stood"], memory["counted_on"] = 1000, rng.integers(60, size=10)
    sort_out(scene, memory, CAUTIOUS)
    return scene


def conflicts(scene, a, only, slack):
    return stop_conflict(scene, a, only, False, slack), go_plan(scene, a, only, False, slack)


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_looking_ahead_saves_work_and_changes_nothing(env_id):
    rng = np.random.default_rng(0)
    far = changed_by_haste = 0
    for _ in range(400):
        scene = crowd(env_id, rng)
        a, only, slack = rng.choice([-6.0, -2.0, 0.0, 3.0]), int(rng.choice([-1, 3])), rng.choice([0.0, SLACK])
        foreseen = conflicts(scene, a, only, slack)
        free_until, joins = scene.threats["free_until"].copy(), scene.threats["joins"].copy()
        far += np.sum((free_until > 10) & (joins > 2 * scene.track.s + 10))
        scene.threats["free_until"] = 0
        assert conflicts(scene, a, only, slack) == foreseen
        scene.threats["free_until"] = free_until + 15  # a second too optimistic
        changed_by_haste += conflicts(scene, a, only, slack) != foreseen
    assert far > 200
    assert changed_by_haste > 0


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_whole_plans_are_judged_as_frame_by_frame(env_id):
    rng = np.random.default_rng(2)
    met = clear = gone = 0
    for _ in range(1500):
        scene = crowd(env_id, rng)
        only, slack = int(rng.choice([-1, 3])), rng.choice([0.0, SLACK])
        brake, n = rng.choice([EGO.a_min_brake, EGO.a_max_brake]), int(rng.choice([0, 1, 20]))
        v = rng.choice([0.0, 10 * brake * DT, rng.uniform(0.0, 12.0)])
        begin_of(scene)
        found = tail_conflict(scene, scene.track.s, v, n, brake, only, False, slack)
        scene.threats["left"] = NEVER
        expected = stop_frame_by_frame(scene, scene.track.s, v, n, brake, only, slack)
        assert (found == expected) if only < 0 else ((found == NEVER) == (expected == NEVER))
        met, clear = met + (expected < NEVER), clear + (expected == NEVER)
        a = rng.choice([-6.0, 0.0, 3.0])
        go = go_plan(scene, a, only, False, slack)[0]
        assert go == go_frame_by_frame(scene, a, only, slack)
        gone += go >= 0
    assert min(met, clear, gone) > 100


@compiled
def begin_of(scene):
    begin(scene)


@compiled
def rest_of(scene, s, v, n, brake, slack):
    return _rest(scene, s, v, n, brake, slack)


def test_where_a_plan_comes_to_rest_is_as_frame_by_frame():
    rng = np.random.default_rng(3)
    scene = crowd("intersection-v0", rng)
    cells = scene.paths.cells[scene.track.path]
    for _ in range(5000):
        brake, slack = rng.uniform(1.0, 9.0), rng.choice([0.0, SLACK])
        frames = rng.integers(60)
        v = rng.choice([frames * brake * DT, frames * brake * DT + 1e-9, rng.uniform(0.0, 20.0)])
        edge = CELL * rng.integers(200) + slack - 0.5 * v**2 / brake - 0.5 * v * DT  # it may come to rest at one
        place = rng.choice([edge, rng.uniform(0.0, 150.0)])
        found, n = rest_of(scene, place, v, 1, brake, slack)
        s, m = place, 1
        while v > 1e-9:
            s, v, m = s + v * DT, max(v - brake * DT, 0.0), m + 1
        assert n == m and abs(found - s) < 1e-9
        for side in (-slack, slack):
            assert cell_of(found + side, cells) == cell_of(s + side, cells)


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_nobody_comes_sooner_than_foreseen_nor_much_later(env_id):
    rng = np.random.default_rng(4)
    counted = 0
    for _ in range(300):
        scene = crowd(env_id, rng)
        paths, track = scene.paths, scene.track
        for threat in scene.threats:
            entry = paths.first[track.path, threat["path"], cell_of(track.s - SLACK, paths.cells[track.path])]
            until = int(threat["free_until"])
            if until < 1000:
                assert until == 0 or farthest(threat, (until - 1) * DT, scene.table.other) < entry
                assert farthest(threat, until * DT, scene.table.other) > entry - 1e-6
                counted += until > 10
            else:
                assert farthest(threat, 100.0, scene.table.other) < entry
    assert counted > 100


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_lanes_that_are_expected_are_asked_first_and_the_others_where_none_fits(env_id):
    rng = np.random.default_rng(5)
    roads = junction(env_id).roads
    left_out = surprised = 0
    for _ in range(300):
        path = int(rng.integers(len(roads.paths.cells)))
        box = roads.paths.boxes[path, int(rng.integers(roads.paths.cells[path]))]
        car = np.zeros(1, CAR_ON_ROAD)[0]
        car["x"], car["y"] = box[:2] + rng.uniform(-1.0, 1.0, 2)
        car["heading"] = np.arctan2(box[3], box[2]) + rng.uniform(-0.3, 0.3)
        everywhere = _fitting(roads, car, -1)
        expected = int(rng.integers(1 << len(roads.lanes)))
        left_out += everywhere & ~expected != 0
        surprised += everywhere & expected == 0
        assert _fitting(roads, car, expected) == (everywhere & expected or everywhere)
    assert min(left_out, surprised) > 20


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
def test_where_the_lanes_of_two_paths_join_is_found_in_advance(env_id):
    paths = junction(env_id).roads.paths
    for a in range(len(paths.cells)):
        for b in range(len(paths.cells)):
            shared = [i for i in range(paths.cells[a]) if np.isfinite(paths.offset[b, paths.lane[a, i]])]
            expected = [next((k for k in shared if k >= i), FAR) for i in range(paths.cells[a])]
            assert paths.joins[a, b, : paths.cells[a]].tolist() == expected
