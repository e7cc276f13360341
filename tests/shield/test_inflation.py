"""Road users who are known within bounds: what is safe of the inflated record is safe of all that it stands for."""

import numpy as np
import pytest

from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.inflation import Accuracy, inflate, spread_of
from rss_shield.shield.lanes.memory import MEMORY, remember
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for

DT = 1 / 15
TABLE = table_for(PRESETS["simulator"], Rules(), DT)
EXACT = Accuracy(0.0, 0.0, 0.0, 0.0)


def record(s, y, speed, heading=0.0, u=None):
    user = np.zeros(1, ROAD_USER)[0]
    user["s"], user["y"], user["speed"], user["heading"] = s, y, speed, heading
    user["cos"], user["sin"] = np.cos(heading), np.sin(heading)
    user["along"], user["u"] = speed * np.cos(heading), speed * np.sin(heading) if u is None else u
    user["around"] = np.inf
    along = 0.5 * (5.0 * abs(user["cos"]) + 2.0 * abs(user["sin"]))
    across = 0.5 * (5.0 * abs(user["sin"]) + 2.0 * abs(user["cos"]))
    user["half_length"], user["half_width"] = max(along, 2.58), max(across, 1.24)
    user["in_own_lane"] = True
    return user


def copy_of(user):
    return np.array([user], ROAD_USER)[0]


def inflated(user, ego, accuracy, age=0.0):
    worst = copy_of(user)
    inflate(worst, ego, accuracy, age, TABLE)
    return worst


def drawn(rng):
    """Somebody near the ego, driving either way, perhaps across the lane or in reverse."""
    heading = rng.choice([0.0, np.pi]) + rng.choice([0.0, 0.15, np.pi / 2]) * rng.uniform(-1.0, 1.0)
    speed = rng.choice([0.0, rng.uniform(0.0, 35.0), rng.uniform(-2.0, 2.0)])
    u = speed * np.sin(heading) + rng.choice([0.0, 0.5]) * rng.uniform(-1.0, 1.0)
    user = record(rng.uniform(-80.0, 80.0), rng.uniform(-7.0, 7.0), speed, heading, u)
    user["in_own_lane"], user["wreck"] = rng.random() < 0.5, rng.random() < 0.1
    return user


def measured(user, accuracy, rng):
    """What a sensor of this accuracy may say of a road user."""
    along, across, speed, turn = (bound * rng.choice([rng.uniform(-1.0, 1.0), -1.0, 1.0]) for bound in accuracy)
    cos, sin, heading = user["cos"], user["sin"], user["heading"] + turn
    s, y = user["s"] + along * cos - across * sin, user["y"] + along * sin + across * cos
    seen = record(s, y, user["speed"] + speed, heading, user["u"] + speed * sin)
    seen["in_own_lane"], seen["wreck"] = rng.random() < 0.5, user["wreck"]
    return seen


def test_what_is_safe_of_the_inflated_record_is_safe_of_every_state_within_the_bounds():
    rng = np.random.default_rng(3)
    safe = dangerous = 0
    for _ in range(6000):
        user, ego = drawn(rng), record(0.0, 0.0, rng.uniform(0.0, 35.0), rng.uniform(-0.08, 0.08))
        accuracy = Accuracy(*(rng.uniform(0.0, most) for most in (2.0, 0.6, 2.0, 0.1)))
        worst = assess(ego, inflated(measured(user, accuracy, rng), ego, accuracy), TABLE)
        truth = assess(ego, user, TABLE)
        assert truth.safe_lon or not worst.safe_lon, (ego, user, accuracy)
        assert truth.safe_lat or not worst.safe_lat, (ego, user, accuracy)
        safe += worst.safe_lon or worst.safe_lat
        dangerous += not (truth.safe_lon or truth.safe_lat)
    assert safe > 1000 and dangerous > 500


@pytest.mark.parametrize("weaker", range(4))
def test_less_than_the_true_errors_is_not_enough(weaker):
    # bounds that are a tenth of what the sensor does: each of the four matters
    rng = np.random.default_rng(4)
    missed = 0
    for _ in range(4000):
        user, ego = drawn(rng), record(0.0, 0.0, rng.uniform(0.0, 35.0))
        accuracy = Accuracy(*(bound * (k == weaker) for k, bound in enumerate((2.0, 0.6, 2.0, 0.1))))
        assumed = Accuracy(*(0.1 * bound for bound in accuracy))
        worst = assess(ego, inflated(measured(user, accuracy, rng), ego, assumed), TABLE)
        truth = assess(ego, user, TABLE)
        missed += (worst.safe_lon and not truth.safe_lon) or (worst.safe_lat and not truth.safe_lat)
    assert missed > 0


def test_wider_bounds_never_make_a_margin_larger():
    rng = np.random.default_rng(5)
    for _ in range(2000):
        user, ego = drawn(rng), record(0.0, 0.0, rng.uniform(0.0, 35.0))
        narrow = Accuracy(*(rng.uniform(0.0, most) for most in (1.0, 0.5, 1.0, 0.05)))
        wide = Accuracy(*(bound * rng.uniform(1.0, 1.8) for bound in narrow))
        age = rng.uniform(0.0, 0.3)
        first = assess(ego, inflated(user, ego, narrow, age), TABLE)
        second = assess(ego, inflated(user, ego, wide, age * rng.uniform(1.0, 2.0)), TABLE)
        assert second.margin_lat <= first.margin_lat + 1e-9
        assert not second.safe_lon or first.safe_lon


def test_an_exact_measurement_of_now_stays_as_it_is():
    user, ego = record(40.0, 0.5, 20.0, 0.02), record(0.0, 0.0, 25.0)
    same = inflated(user, ego, EXACT)
    assert assess(ego, same, TABLE) == assess(ego, user, TABLE)


def test_by_hand_a_leader_is_nearer_and_slower():
    # straight ahead: 1 m nearer, 1 m/s slower; the ego at 20 m/s needs 20^2 / (2 6) less than behind 20 m/s
    accuracy = Accuracy(1.0, 0.3, 1.0, 0.0)
    ego, leader = record(0.0, 0.0, 20.0), record(60.0, 0.0, 20.0)
    exact, worst = assess(ego, leader, TABLE), assess(ego, inflated(leader, ego, accuracy), TABLE)
    least = np.sqrt(1 - 0.1**2)
    credit = ((20.0 * least) ** 2 - (19.0 * least) ** 2) / (2 * 6.0)
    euler = DT / 2 * ((20.0 - 19.0 * least) - (20.0 - 20.0 * least))
    assert exact.margin_lon - worst.margin_lon == pytest.approx(1.0 + credit + euler)
    assert exact.gap_lat - worst.gap_lat == pytest.approx(0.3)


def test_by_hand_what_was_measured_a_while_ago_may_have_braked_meanwhile():
    # 0.2 s at up to 6 m/s^2: 0.12 m and 1.2 m/s; across the lane 1.5 m/s^2: 0.03 m and 0.3 m/s
    spread = spread_of(record(30.0, 4.0, 10.0), EXACT, 0.2, TABLE.other)
    assert spread == pytest.approx((0.12, 0.03, 1.2, 0.0, 0.3))


def test_who_may_be_ahead_is_ahead():
    ego, beside = record(0.0, 0.0, 20.0), record(-0.5, 2.5, 20.0)
    assert not assess(ego, beside, TABLE).ego_is_rear
    assert assess(ego, inflated(beside, ego, Accuracy(1.0, 0.0, 0.0, 0.0)), TABLE).ego_is_rear


def test_danger_with_somebody_vague_is_answered_on_both_axes():
    # it cuts in: by exact records only the lateral axis was safe, by vague ones it may have been either
    ego = record(0.0, 0.0, 20.0)
    for vague, axes in ((False, 2), (True, 3)):
        memory = np.zeros(1, MEMORY)[0]
        for y in (4.0, 2.5):
            user = record(10.0, y, 20.0)
            user["vague"] = vague
            remember(memory, assess(ego, user, TABLE), ego, user, DT)
        assert (memory["since"], memory["axes"]) == (1, axes)


@pytest.mark.parametrize("vague", [False, True])
def test_whoever_is_ahead_in_danger_is_braked_for_if_he_is_vague(vague):
    # beside the lane, not coming closer: exactly known it is enough not to approach
    ego, memory = record(0.0, 0.0, 20.0), np.zeros(1, MEMORY)
    last = np.zeros(2, ROAD_USER)
    for y in (4.0, 2.9):
        users = np.array([record(8.0, y, 20.0, u=0.0)], ROAD_USER)
        users["vague"] = vague
        danger = find_danger(ego, users, last[0], last[1:], memory, TABLE)
        last = np.array([ego, users[0]], ROAD_USER)
    assert danger.dangerous
    assert (danger.bounds.a_upper == -TABLE.ego.a_min_brake) == vague
