"""Anticipation: worked numbers, and what it promises as long as others go on as they do."""

import numpy as np
import pytest
from adversary import play, world

from rss_shield.shield.lanes.anticipation import (
    ROOM,
    acceleration_cap,
    farthest_bound,
    lateral_cap,
    share_kept,
    speed_cap_credit,
)
from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.params import PRESETS, Rules, Table
from rss_shield.shield.sampling import frames_for

DTS = (1 / 30, 1 / 20, 1 / 15, 1 / 10, 1 / 5)
ROUND = PRESETS["slides"].ego._replace(  # numbers to reckon with by hand
    response_time=1.0, a_max_accel=2.0, a_min_brake=4.0, a_max_brake=5.0, standstill_gap=0.0, mu=0.0
)
SIDE = ROUND._replace(a_lat_max_accel=1.0, a_lat_min_brake=2.0)


def test_a_share_of_the_margin_is_kept_and_the_last_decimetre_whole():
    assert share_kept(10.1, 2.0, 0.1) == pytest.approx(8.1)
    assert share_kept(0.06, 2.0, 0.1) == pytest.approx(0.06)
    assert share_kept(10.0, 20.0, 0.1) == pytest.approx(ROOM)  # at once, if the rate is that high


@pytest.mark.parametrize(
    ("gap", "v", "v_front", "a_front", "cap"),
    [
        # after 0.5 s at 11.5 behind 10 m/s: 28.975 - 0.75 = 28.225 m, of which 0.1 are kept and 4 * 0.5^2 / 8 are
        # Euler's: 28 m. 12 m/s take 12 + 1 + 14^2 / 8 = 37.5 m to rest and 2 * 0.25 m more, the leader 10^2 / 10
        (28.975, 11.5, 10.0, 0.0, 1.0),
        (28.225, 10.0, 10.0, 0.0, np.inf),  # 4 m/s^2 would do, full throttle is 2
        (19.225, 10.0, 10.0, 0.0, 0.0),  # 10 m/s take 10 + 1 + 12^2 / 8 = 29 m
        (22.825, 10.0, 10.0, -4.0, None),  # the leader will be at 8 m/s
        (19.225, 10.0, 10.0, 3.0, 0.0),  # no credit for one that speeds up
        (0.3, 10.0, 10.0, 0.0, -4.0),  # never less than a_min_brake
    ],
)
def test_worked_caps_behind_a_leader(gap, v, v_front, a_front, cap):
    found = acceleration_cap(gap, 5.0, v, v_front, a_front, ROUND, ROUND, 2.0, 0.5)
    if cap is None:  # 22.6 m and 8^2 / 10 = 6.4 m are there; 10 m/s take 29 m and more for what is faster than 8
        # v': v' + 1 + (v' + 2)^2 / 8 + (v' - 8) / 4 = 29: v'^2 + 14 v' - 236 = 0
        cap = (-7.0 + np.sqrt(49.0 + 236.0) - 10.0) / 0.5
    assert found == pytest.approx(cap)


def test_a_worked_lateral_cap():
    # 0.5 m/s toward a neighbour that stands: E = 1.5^2 / 4 + 0.5 * (1 + 0.25) = 1.1875 m, and 0.4 m of the margin may
    # go: 1.5875 m. u = 0.5: 1.5^2 / 4 + 0.5 * 1.75 = 1.4375; u = 0.6: 1.6^2 / 4 + 0.6 * 1.75 = 1.69
    cap = lateral_cap(0.5, 0.5, 0.0, SIDE, 2.0, 0.5)
    assert 0.5 < cap < 0.6
    assert (cap + 1.0) ** 2 / 4 + cap * 1.75 == pytest.approx(1.5875)
    assert lateral_cap(0.0, 0.0, 1.0, SIDE, 2.0, 0.5) == 0.0  # it comes nearer: all that can be done is to stop


def whole_frames(params, dt):
    return params._replace(response_time=float(frames_for(max(params.response_time, dt), dt) * dt))


def car(rng, s, y, speed, heading):
    user = np.zeros(1, ROAD_USER)[0]
    user["s"], user["y"], user["speed"], user["heading"] = s, y, speed, heading
    user["half_length"], user["half_width"] = rng.uniform(1, 5), rng.uniform(0.5, 1.5)
    user["in_own_lane"] = True
    return turned(user, heading)


def turned(user, heading):
    user["heading"], user["cos"], user["sin"] = heading, np.cos(heading), np.sin(heading)
    user["along"], user["u"] = user["speed"] * user["cos"], user["speed"] * user["sin"]
    return user


def worst_next_margins(n, more=0.0, deaf=False, seed=0):
    """Smallest margin less what was to be kept of it, behind `n` leaders that go on as they do; and how many bound."""
    rng, worst, bound = np.random.default_rng(seed), np.inf, 0
    tables = list(PRESETS.values())
    done = 0
    while done < n:
        preset, dt = tables[rng.integers(len(tables))], DTS[rng.integers(len(DTS))]
        rear, front = whole_frames(preset.ego, dt), whole_frames(preset.other, dt)
        rules = Rules(anticipation=rng.choice([0.5, 2.0, 5.0]))
        v = rng.uniform(0.0, min(40.0, rear.v_cap))
        ego = car(rng, 0.0, 0.0, v, 0.0)
        lead = car(rng, 0.0, rng.uniform(-1, 1), max(v + rng.normal(0, 6), 0.0), rng.uniform(-0.1, 0.1))
        if rng.random() < 0.3:
            lead["speed"] = 0.0
            turned(lead, 0.0)
        lead["s"] = 1e-3
        margin = assess(ego, lead, Table(rear, front, rules, dt)).margin_lon
        lead["s"] += -margin + abs(rng.choice([rng.normal(0, 0.1), rng.uniform(0, 20)]))
        pair = assess(ego, lead, Table(rear, front, rules, dt))
        if not (pair.safe_lon and pair.ego_is_rear):
            continue
        done += 1
        a = rng.choice([0.0, rng.uniform(-front.a_max_brake, front.a_max_accel), -front.a_max_brake])
        a = max(a, -lead["speed"] / dt)
        heard = 0.0 if deaf else a
        cap = acceleration_cap(
            pair.gap_lon, pair.margin_lon, pair.v_ego, pair.v_other, heard, rear, front, rules.anticipation, dt
        )
        cap += more
        assert cap >= -rear.a_min_brake
        bound += cap < np.inf
        command = max(min(rear.a_max_accel, cap, max(rear.v_cap - v, 0.0) / dt), -v / dt)
        ego["s"], lead["s"] = ego["s"] + v * dt, lead["s"] + lead["along"] * dt
        ego["speed"], lead["speed"] = v + command * dt, lead["speed"] + a * dt
        after = assess(turned(ego, 0.0), turned(lead, lead["heading"]), Table(rear, front, rules, dt))
        credit = speed_cap_credit(v, rear)  # near its highest speed, all the ego can do is brake
        if pair.margin_lon >= credit:
            kept = share_kept(pair.margin_lon - credit, rules.anticipation, dt)
            worst = min(worst, after.margin_lon - kept, after.margin_lon)
    return worst, bound


def test_a_leader_that_goes_on_as_it_does_never_makes_a_pair_dangerous():
    worst, bound = worst_next_margins(20_000)
    assert worst >= -1e-9
    assert bound > 3000


def test_a_cap_that_does_not_see_the_leader_brake_would_be_caught():
    assert worst_next_margins(2000, deaf=True)[0] < -0.1


def test_a_cap_a_little_too_high_would_be_caught():
    assert worst_next_margins(2000, more=0.2)[0] < -1e-3


def test_a_neighbour_that_goes_on_as_it_does_makes_no_pair_dangerous_that_stopping_can_save():
    rng, saved = np.random.default_rng(0), 0
    tables = list(PRESETS.values())
    for _ in range(20_000):
        preset, dt = tables[rng.integers(len(tables))], DTS[rng.integers(len(DTS))]
        me, you = whole_frames(preset.ego, dt), whole_frames(preset.other, dt)
        rules = Rules(anticipation=rng.choice([0.5, 2.0, 5.0]))
        side = rng.choice([-1.0, 1.0])
        ego, other = car(rng, 0.0, 0.0, 20.0, side * rng.uniform(-0.02, 0.1)), car(rng, 0.5, side, 20.0, 0.0)
        turned(other, side * rng.choice([0.0, rng.uniform(-0.1, 0.05)]))
        other["y"] -= side * (assess(ego, other, Table(me, you, rules, dt)).margin_lat - abs(rng.normal(0.0, 0.5)))
        pair = assess(ego, other, Table(me, you, rules, dt))
        if not pair.safe_lat or pair.side != side:
            continue
        limit = lateral_cap(pair.margin_lat, pair.w_ego, pair.w_other, me, rules.anticipation, dt)
        assert limit >= 0.0
        ego["y"], other["y"] = ego["y"] + side * limit * dt, other["y"] + other["u"] * dt
        ego["speed"] = 20.0
        after = assess(turned(ego, side * np.arcsin(min(limit / 20.0, 1.0))), other, Table(me, you, rules, dt))
        kept = share_kept(pair.margin_lat, rules.anticipation, dt)
        assert limit == 0.0 or after.margin_lat >= kept - 1e-9
        saved += limit > 0.0
    assert saved > 5000


@pytest.mark.parametrize("preset", PRESETS)
def test_who_is_farther_than_the_bound_leaves_full_throttle(preset):
    rng, near = np.random.default_rng(0), 0
    for _ in range(3000):
        dt = DTS[rng.integers(len(DTS))]
        rear, front = (whole_frames(params, dt) for params in PRESETS[preset][:2])
        rules = Rules(anticipation=rng.choice([0.3, 2.0, 9.0]))
        ego = car(rng, 0.0, 0.0, rng.choice([0.0, rng.uniform(0.0, 45.0)]), 0.0)
        lead = car(rng, rng.uniform(5.0, 400.0), 0.0, rng.choice([0.0, rng.uniform(0.0, 45.0)]), 0.0)
        pair = assess(ego, lead, Table(rear, front, rules, dt))
        within, horizon = farthest_bound(pair.v_ego, rear, front, rules.anticipation, dt)
        if pair.safe_lon and pair.margin_lon >= within + horizon * lead["speed"]:
            a = rng.choice([0.0, -front.a_max_brake])
            common = pair.gap_lon, pair.margin_lon, pair.v_ego, pair.v_other, a, rear, front, rules.anticipation, dt
            assert acceleration_cap(*common) == np.inf
        else:
            near += 1
    assert near > 100


@pytest.mark.parametrize(
    ("s", "y", "capped"),
    [
        (1, 0.0, {"a_upper"}),
        (-1, 0.0, set()),
        (1, 4.0, set()),
        (0, 2.9, {"right", "right_next"}),
        (0, -2.9, {"left", "left_next"}),
    ],
)
def test_it_is_about_who_is_ahead_in_the_way_and_who_is_beside(s, y, capped):
    rng = np.random.default_rng(0)
    preset, dt = PRESETS["simulator"], 1 / 15
    rear, front = whole_frames(preset.ego, dt), whole_frames(preset.other, dt)
    ego, other = car(rng, 0.0, 0.0, 25.0, 0.0), car(rng, 1e-3 * s, y, 20.0, 0.0)
    for user in (ego, other):
        user["half_length"], user["half_width"] = 2.5, 1.0
    if s:  # half a metre to spare
        other["s"] += s * (0.5 - assess(ego, other, Table(rear, front, Rules(), dt)).margin_lon)
    else:  # nothing
        other["y"] -= np.sign(y) * (assess(ego, other, Table(rear, front, Rules(), dt)).margin_lat - 1e-9)
    users, last = np.array([other], ROAD_USER), np.zeros(1, ROAD_USER)
    on, off = (
        find_danger(ego, users, last[0], last, np.zeros(1, MEMORY), Table(rear, front, Rules(anticipation=rate), dt))
        for rate in (2.0, 0.0)
    )
    assert {name for name in on.bounds._fields if getattr(on.eased, name) != getattr(on.bounds, name)} == capped
    assert off.eased == off.bounds == on.bounds


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
@pytest.mark.parametrize("others", [1, 2], ids=["pairs", "triples"])
def test_with_anticipation_adversaries_inside_the_bounds_never_touch(others, dt):
    w = world(dt=dt, frames=120, bare=dt == 1 / 5, others=others, published=dict(anticipation=2.0))
    episodes = play(3000, w, seed=3)
    assert (episodes["contact"] == -1).all()
    assert episodes["broken"].sum() == 0
    plain = play(3000, w._replace(rules=w.rules._replace(anticipation=0.0)), seed=3)
    assert episodes["danger_lon"].sum() < plain["danger_lon"].sum()


def test_anticipation_is_no_substitute_for_the_duties():
    w = world(dt=1 / 5, frames=150, bare=True, rules=dict(longitudinal=False, present_duties=False, anticipation=2.0))
    assert (play(1000, w, seed=1)["contact"] >= 0).any()
