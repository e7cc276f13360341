"""Who is to blame where roads cross: flags of the frame before, executed commands, followers, wrecks."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from highway_env.vehicle.behavior import IDMVehicle
from junction_world import DT, EGO, TABLE, Duel, arms, crossing_pairs, junction

from rss_shield import make, make_vec
from rss_shield.envs.roads.ways import CAR_ON_ROAD, list_threats
from rss_shield.shield.junctions.conflict_areas import cell_of
from rss_shield.shield.junctions.judge import judge_crossing
from rss_shield.shield.junctions.memory import CROSSING, SAMPLE
from rss_shield.shield.junctions.plans import ANY, Track
from rss_shield.shield.junctions.reach import THREAT, farthest
from rss_shield.shield.table import below
from rss_shield.shield.verdicts import (
    ACCELERATED,
    CUT_IN,
    DUTIES,
    INHERITED,
    KEPT,
    LEFT_NO_PLAN,
    NOBODY,
    OTHER,
    TOO_FAR,
    TOO_HARD,
)
from rss_shield.shield.verdicts import EGO as AT_FAULT

FASTER = DUTIES[ACCELERATED]
EVERY_FRAME = {"policy_frequency": 15, "duration": 11 * 15}


def verdict_of(duel):
    sample = np.zeros(1, SAMPLE)
    sample["speed"] = duel.threats["v"]
    return judge_crossing(sample[0], duel.memory[0], False, TABLE.other, DT)


# ---------------------------------------------------------------- off all ways


@pytest.mark.parametrize(("speed", "verdict"), [(10.0, OTHER), (3.0, OTHER), (0.2, OTHER), (0.0, NOBODY)])
def test_who_drives_on_where_no_way_leads_has_left_them_also_if_it_was_never_on_any(speed, verdict):
    """A wrong-way driver is off all ways from first sight on (J12). One that stands is where plans expect it.

    One that creeps is not, and that counts where nothing else explains a contact (J14).
    """
    sample, memory = np.zeros(1, SAMPLE)[0], np.zeros(1, CROSSING)[0]
    sample["astray"] = memory["astray"] = True
    sample["speed"] = memory["speed"] = speed
    memory["age"], memory["items"], memory["since"] = 5, 1, 3
    found = judge_crossing(sample, memory, False, TABLE.other, DT)
    assert found.verdict == verdict
    assert DUTIES[found.other_duty] == ("left every path it could take" if verdict == OTHER else "")


def test_a_breach_that_nobody_would_see_counts_only_where_nothing_else_does():
    sample, memory = np.zeros(1, SAMPLE)[0], np.zeros(1, CROSSING)[0]
    sample["speed"] = memory["speed"] = -0.05  # rolls back
    memory["age"], memory["items"], memory["since"], memory["ego_broke"] = 5, 1, 3, LEFT_NO_PLAN
    assert judge_crossing(sample, memory, False, TABLE.other, DT).verdict == AT_FAULT
    memory["ego_broke"] = KEPT
    assert judge_crossing(sample, memory, False, TABLE.other, DT).verdict == OTHER


# ---------------------------------------------------------------- speed limits


@pytest.mark.parametrize(
    ("before", "now", "duty"),
    [(9.0, 9.3, ""), (9.9, 10.0, ""), (9.9, 10.2, FASTER), (12.0, 12.0, ""), (12.0, 12.2, FASTER)],
)
def test_nobody_speeds_up_beyond_the_limit_of_the_roads(before, now, duty):
    """J13. Whoever comes too fast may stay so: plans count on that."""
    other = below(TABLE, 10.0).other
    sample, memory = np.zeros(1, SAMPLE)[0], np.zeros(1, CROSSING)[0]
    memory["age"], memory["items"], memory["since"] = 5, 1, 3
    memory["speed"], sample["speed"] = before, now
    found = judge_crossing(sample, memory, False, other, DT)
    assert DUTIES[found.other_duty] == duty
    assert found.verdict == (OTHER if duty else NOBODY)


@pytest.mark.parametrize("lateral", [False, True])
def test_an_agent_with_a_throttle_keeps_to_the_limit_of_the_roads(lateral):
    config = {"action": {"type": "ContinuousAction", "lateral": lateral}, "duration": 8, "destination": "o2"}
    env, fastest = make("intersection-v0", entry="assertive", config=config), 0.0
    for seed in range(6):
        env.reset(seed=seed)
        over = False
        while not over:
            *_, terminated, truncated, _ = env.step(np.eye(1, 1 + lateral, dtype=np.float32)[0])
            fastest, over = max(fastest, env.unwrapped.vehicle.speed), terminated or truncated
    assert fastest == pytest.approx(10.0, abs=1e-9)


# ---------------------------------------------------------------- flags


@pytest.mark.parametrize("env_id", ["intersection-v0", "intersection-v2", "roundabout-v0"])
def test_only_who_had_crashed_on_an_earlier_frame_has_crashed_before(env_id):
    """highway-env flags both cars at a contact."""
    count = 96
    env = make_vec(env_id, count, "monitor", config=EVERY_FRAME, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=[1000 + i for i in range(count)])
    rng, over, contacts, earlier = np.random.default_rng(1), np.zeros(count, bool), 0, 0
    for frame in range(11 * 15):
        before = env.engine.batch.cars["crashed"].copy()
        if frame % 15 == 0:
            actions = rng.integers(env.single_action_space.n, size=count)
        *_, terminated, truncated, info = env.step(actions)
        for i in np.flatnonzero(~over & (info["blame"] != "")):
            evidence = {key: info["blame_evidence"][key][i] for key in ("partner", "other_duty")}
            contacts += 1
            if evidence["other_duty"] == "crashed before":
                earlier += 1
                assert before[i, int(evidence["partner"])]
        over |= terminated | truncated | (info["blame"] != "")
    env.close()
    assert contacts > 10


# ---------------------------------------------------------------- commands


def test_the_command_that_is_executed_is_judged_and_not_what_the_table_permits():
    """A driver of meta-actions accelerates by up to 15 m/s^2."""
    found = 0
    for ego_path, other_path in crossing_pairs()[::7]:
        for s in np.arange(84.0, 104.0, 0.25):
            for v in (4.0, 8.0):
                broken = []
                for nominal in (EGO.a_max_accel, 13.0):
                    duel = Duel(ego_path, other_path, s, v, 88.0, 8.0)
                    duel.frame(nominal, 0.0, overrides=False)
                    assert duel.report.acceleration == nominal
                    assert not duel.report.overridden
                    broken.append(duel.report.broken)
                assert broken[1] >= broken[0]
                found += broken == [0, 1]
                if broken == [0, 1]:
                    assert duel.memory["ego_broke"][0] == LEFT_NO_PLAN
    assert found >= 3


@pytest.mark.parametrize(("nominal", "verdict", "duty"), [(-13.0, AT_FAULT, TOO_HARD), (-5.0, OTHER, KEPT)])
def test_who_brakes_harder_than_permitted_in_front_of_a_follower_is_to_blame(nominal, verdict, duty):
    path = crossing_pairs()[0][0]
    duel = Duel(path, path, 90.0, 9.0, 40.0, 9.0)
    duel.frame(0.0, 0.0, overrides=False)
    assert duel.memory["behind"][0]
    duel.threats["s"] = duel.s - 12.0
    duel.frame(nominal, 0.0, overrides=False)
    assert duel.report.broken == (nominal < -TABLE.ego.a_max_brake)
    assert duel.memory["ego_broke"][0] == duty
    assert verdict_of(duel).verdict == verdict


# ---------------------------------------------------------------- followers


def merging_pairs():
    """Ordered pairs of paths from different arms to the same arm."""
    count = len(junction().roads.paths.cells)
    return [(a, b) for a in range(count) for b in range(count) if arms(a)[0] != arms(b)[0] and arms(a)[1] == arms(b)[1]]


def merged(ego_path, other_path, gap, speed=9.0):
    """Both are on the lane where their ways lead, the other so far behind the ego."""
    paths = junction().roads.paths
    lane = paths.lane[ego_path, paths.cells[ego_path] - 1]
    start, other_start = paths.offset[ego_path, lane], paths.offset[other_path, lane]
    return Duel(ego_path, other_path, start + gap + 5.0 + 3.0, speed, other_start + 3.0, speed)


@pytest.mark.parametrize("pair", merging_pairs()[::5])
@pytest.mark.parametrize("gap", [1.0, 4.0, 9.0])
def test_who_comes_to_be_behind_the_ego_at_less_than_its_distance_is_no_follower(pair, gap):
    """Whoever of the two has merged: the ego goes on staying clear of it."""
    duel = merged(*pair, gap)
    duel.memory["age"] = 5
    duel.frame(0.0, 0.0, overrides=False)  # it neither brakes nor goes on
    assert not duel.threats["follows"][0] and not duel.memory["behind"][0]
    assert duel.report.pairs == 1
    assert duel.report.broken == 1


@pytest.mark.parametrize("pair", merging_pairs()[::5])
def test_at_a_safe_distance_it_is_one_and_the_ego_may_brake(pair):
    duel = merged(*pair, 40.0)
    duel.memory["age"] = 5
    duel.frame(-EGO.a_min_brake, 0.0, overrides=False)
    assert duel.threats["follows"][0] and duel.memory["behind"][0]
    assert duel.report.pairs == duel.report.broken == 0
    assert verdict_of(duel).verdict == OTHER
    duel.threats["s"] += 30.0  # it comes too close, which is its own doing
    duel.frame(-EGO.a_min_brake, 0.0, overrides=False)
    assert duel.threats["follows"][0] and duel.memory["behind"][0]
    assert verdict_of(duel)[:1] == (OTHER,)
    assert duel.memory["other_broke"][0] == TOO_FAR


@pytest.mark.parametrize("gap", [1.0, 6.0, 12.0])
def test_who_was_too_close_behind_at_first_sight_is_nobodys_doing(gap):
    path = merging_pairs()[0][0]
    duel = Duel(path, path, 60.0 + gap, 9.0, 55.0, 9.0)
    for _ in range(3):
        duel.frame(-2.0, 0.0, overrides=False)
    assert duel.threats["follows"][0] and not duel.memory["behind"][0]
    assert verdict_of(duel).verdict == INHERITED


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        ("roundabout-v0", {}),
        ("roundabout-v1", {"intent": "known"}),
        ("intersection-v0", {}),
        ("intersection-v2", {"intent": "known"}),
    ],
)
def test_no_contact_of_an_ego_that_is_only_watched_is_without_a_culprit(env_id, options):
    count = 256
    env = make_vec(env_id, count, "monitor", autoreset_mode=AutoresetMode.DISABLED, **options)
    env.reset(seed=list(range(count)))
    rng, over = np.random.default_rng(0), np.zeros(count, bool)
    while not over.all():
        *_, terminated, truncated, info = env.step(rng.integers(env.single_action_space.n, size=count))
        over |= terminated | truncated
    env.close()
    verdicts = info["blame"].tolist()
    assert verdicts.count("none") == 0
    assert verdicts.count("ego") > 10


def test_a_lane_change_that_leaves_no_plan_is_a_cut_in():
    count = 384
    env = make_vec("roundabout-v0", count, "monitor", intent="known", autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=list(range(count)))
    rng, over, duties = np.random.default_rng(3), np.zeros(count, bool), []
    while not over.all():
        *_, terminated, truncated, info = env.step(rng.integers(5, size=count))
        ended = ~over & (terminated | truncated)
        duties += list(info["blame_evidence"]["ego_duty"][ended]) if "blame_evidence" in info else []
        over |= ended
    env.close()
    assert DUTIES[CUT_IN] in duties


# ---------------------------------------------------------------- wrecks


@pytest.mark.parametrize("speed", [2.0, 6.0, 9.5])
@pytest.mark.parametrize("path", [0, 4, 7])
def test_a_wreck_is_in_the_way_of_everything_that_it_may_roll_to(path, speed):
    """It is played in highway-env until it rests."""
    roads = junction().roads
    paths = roads.paths
    env = gym.make("intersection-v0").unwrapped
    env.reset(seed=0)
    lane = env.road.network.get_lane(junction().walks[path][0])
    wreck = IDMVehicle(env.road, lane.position(50.0, 0.0), lane.heading_at(50.0), speed)
    wreck.crashed = True
    cars = np.zeros(1, CAR_ON_ROAD)
    cars["x"], cars["y"] = wreck.position
    cars["heading"], cars["speed"], cars["length"], cars["width"], cars["wreck"] = wreck.heading, speed, 5.0, 2.0, True
    track, threats, box = Track(path, 20.0, 8.0, 2.5), np.zeros(8, THREAT), np.zeros(6)
    samples, memory = np.zeros(1, SAMPLE), np.zeros(1, CROSSING)
    assert list_threats(roads, track, cars, memory, ANY, 10.0, samples, threats, box) == 1
    for _ in range(15 * 8):
        wreck.step(DT)
    s = lane.local_coordinates(wreck.position)[0]
    assert s > 50.0 + 0.9 * speed
    assert threats["path"][0] == -1
    assert threats["from_cell"][0] <= cell_of(50.0 - 5.0, paths.cells[path])
    assert threats["to_cell"][0] >= cell_of(s + 5.0, paths.cells[path])
    assert threats["to_cell"][0] <= cell_of(s + 5.0 + 2.0, paths.cells[path])
    on_path = np.zeros(1, THREAT)[0]
    on_path["s"], on_path["v"], on_path["wreck"] = 50.0, speed, True
    assert s - 1e-6 <= farthest(on_path, 100.0, TABLE.other) < s + 1.0
