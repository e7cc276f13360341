"""Pairs that are far apart are not looked at; the result must not show it."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.shield.lanes.anticipation import acceleration_cap, lateral_cap
from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.far_pairs import least_margin, own_share
from rss_shield.shield.lanes.memory import MEMORY, remember
from rss_shield.shield.lanes.pair import ROAD_USER, assess, leading_speed, least_cosine
from rss_shield.shield.params import PRESETS, Rules, Table

DT = 0.2
SIMULATOR = PRESETS["simulator"]
REACH = 40.0  # speeds are drawn up to it [m/s]


def anybody(rng):
    """A road user anywhere near, in any state."""
    user = np.zeros(1, ROAD_USER)[0]
    heading = rng.choice([0.0, rng.uniform(-0.2, 0.2), rng.uniform(-np.pi, np.pi)])
    user["s"], user["y"] = rng.uniform(-250, 250), rng.choice([0.0, 4.0, rng.uniform(-8, 8)])
    user["heading"], user["cos"], user["sin"] = heading, np.cos(heading), np.sin(heading)
    user["speed"] = rng.choice([0.0, rng.uniform(-5, REACH)])
    user["along"], user["u"] = user["speed"] * user["cos"], user["speed"] * user["sin"]
    user["half_length"], user["half_width"] = rng.uniform(1, 3), rng.uniform(0.5, 3)
    user["wreck"], user["in_own_lane"] = rng.random() < 0.1, rng.random() < 0.5
    return user


def bound_on(ego, user, table):
    """`least_margin` of a pair."""
    return least_margin(
        user["s"] - ego["s"],
        ego["half_length"] + user["half_length"],
        user["speed"],
        user["cos"],
        user["wreck"],
        own_share(ego["speed"], ego["cos"], table.ego, DT),
        leading_speed(ego, table.rules),
        least_cosine(table.rules),
        table,
    )


@pytest.mark.parametrize("preset", ["simulator", "slides", "rodionova-conservative"])
def test_the_quick_bound_is_never_above_the_margin(preset):
    rng = np.random.default_rng(0)
    known = 0
    for rules in (Rules(), Rules(heading_bound=1.0), Rules(discretisation_margin=False)):
        for _ in range(4000):
            ego, user = anybody(rng), anybody(rng)
            ego["wreck"] = False
            table = Table(*PRESETS[preset][:2], rules, DT)
            bound = bound_on(ego, user, table)
            pair = assess(ego, user, table)
            assert bound <= pair.margin_lon + 1e-9
            assert pair.safe_lon or not bound > 1e-6
            known += bound > 0.0
    assert known > 500


def test_a_quick_bound_without_the_response_time_would_be_caught():
    rng = np.random.default_rng(0)
    hasty = SIMULATOR.ego._replace(response_time=0.0)
    wrong = 0
    for _ in range(2000):
        ego, user = anybody(rng), anybody(rng)
        bound = bound_on(ego, user, Table(hasty, SIMULATOR.other, Rules(), DT))
        wrong += bound > assess(ego, user, Table(SIMULATOR.ego, SIMULATOR.other, Rules(), DT)).margin_lon + 1e-9
    assert wrong > 10


def episodes(env_id, count):
    """An environment after each of so many random episodes under a watching shield, and a generator."""
    env = make(env_id, shield="monitor", record=True)
    for seed in range(count):
        env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step(int(rng.integers(5)))
            ended = terminated or truncated
        yield env, rng


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "two-way-v0", "merge-v1"])
def test_memory_and_report_are_those_of_a_look_at_everybody(env_id):
    skipped = dangerous = anticipated = 0
    for env, _ in episodes(env_id, 4):
        quick, full = replay(env.frames, env.settings)
        for (memory, report), (thorough, nearest, ttc, caps) in zip(quick, full, strict=True):
            eased = report.eased
            assert (eased.a_upper, eased.left, eased.right) == caps
            anticipated += eased != report.bounds
            skipped += memory["skipped"].sum()
            dangerous += (memory["since"] > 0).sum()
            assert (memory["since"] == thorough["since"]).all()
            in_danger = memory["since"] > 0
            for field in MEMORY.names:
                if field != "age":
                    assert (memory[field][in_danger] == thorough[field][in_danger]).all(), field
            assert (report.margin_lon, report.margin_lat, report.ttc) == (*nearest, ttc)
    assert skipped > 100 and dangerous > 0 and anticipated > 10


def caps_of(pair, memory, settings):
    """What anticipation of one safe pair leaves: acceleration, lateral speed to the left and to the right."""
    table = settings.table
    cap = left = right = np.inf
    if pair.safe_lon and not pair.safe_lat and pair.ego_is_rear and not pair.opposite and pair.v_other >= 0.0:
        seen = pair.gap_lon, pair.margin_lon, pair.v_ego, pair.v_other, memory["acceleration_other"]
        cap = acceleration_cap(*seen, table.ego, table.other, table.rules.anticipation, table.dt)
    if pair.safe_lat and not pair.safe_lon:
        limit = lateral_cap(pair.margin_lat, pair.w_ego, pair.w_other, table.ego, table.rules.anticipation, table.dt)
        left, right = (left, limit) if pair.side > 0.0 else (limit, right)
    return cap, left, right


def replay(frames, settings):
    """What `find_danger` remembers and reports over a log, and what a look at every pair gives."""
    table = settings.table
    count = len(frames[0].users)
    memory, thorough = np.zeros(count, MEMORY), np.zeros(count, MEMORY)
    last = np.zeros(count + 1, ROAD_USER)
    quick, full = [], []
    for frame in frames:
        report = find_danger(frame.ego, frame.users, last[-1], last[:-1], memory, table)
        quick.append((memory.copy(), report))
        nearest, ttc = (np.inf, np.inf), np.inf
        bounds = report.bounds
        caps = [bounds.a_upper, bounds.left, bounds.right]
        for i, user in enumerate(frame.users):
            pair = assess(frame.ego, user, table)
            remember(thorough[i], pair, frame.ego, user, table.dt)
            if max(pair.margin_lon, pair.margin_lat) < max(nearest):
                nearest = pair.margin_lon, pair.margin_lat
            if pair.gap_lat < 0.0 and pair.ego_is_rear and pair.v_ego > pair.v_other:
                ttc = min(ttc, max(pair.gap_lon, 0.0) / (pair.v_ego - pair.v_other))
            if thorough[i]["since"] == 0:
                caps = np.minimum(caps, caps_of(pair, thorough[i], settings))
        full.append((thorough.copy(), nearest, ttc, tuple(caps)))
        last = np.append(frame.users, np.array([frame.ego], ROAD_USER))
    return quick, full


def test_who_is_of_no_interest_changes_nothing_else():
    """Only margins nearer, and collisions sooner, than those of before are asked for; those nearer stay the same."""
    nearer = farther = sooner = 0
    for env, rng in episodes("highway-fast-v0", 6):
        memory, bounded = (np.zeros(len(env.frames[0].users), MEMORY) for _ in range(2))
        last = np.zeros(len(memory) + 1, ROAD_USER)
        for frame in env.frames:
            common = frame.ego, frame.users, last[-1], last[:-1]
            limits = rng.uniform(-2.0, 8.0), rng.uniform(0.0, 20.0)
            free = find_danger(*common, memory, env.settings.table)
            found = find_danger(*common, bounded, env.settings.table, None, *limits)
            margins = free.margin_lon, free.margin_lat
            if max(margins) < limits[0]:
                nearer += 1
                assert (found.partner, found.margin_lon, found.margin_lat) == (free.partner, *margins)
            else:
                farther += 1
                assert (found.partner, found.margin_lon, found.margin_lat) == (-1, np.inf, np.inf)
            sooner += free.ttc < limits[1]
            assert found.ttc == min(free.ttc, limits[1])
            assert (found.bounds, found.dangerous, found.response) == (free.bounds, free.dangerous, free.response)
            assert found.eased == free.eased
            assert (memory["since"] == bounded["since"]).all()
            last = np.append(frame.users, np.array([frame.ego], ROAD_USER))
    assert min(nearer, farther, sooner) > 10
