"""What is proved is what the shield computes: its formulas and frames beside compiled functions, in numbers."""

import numpy as np
import pytest

z3 = pytest.importorskip("z3", reason="z3-solver is not installed: pip install 'rss-shield[proofs]'")

import model  # noqa: E402
from invariants import limited, safe_before, safe_behind, safe_beside, w_ego, w_other  # noqa: E402
from model import C4, TABLE, front, rear  # noqa: E402
from symbolic import at, symbolic  # noqa: E402

from rss_shield.shield import sampling  # noqa: E402
from rss_shield.shield.command import Command  # noqa: E402
from rss_shield.shield.definitions import kinematics, lateral, longitudinal, response, right_of_way  # noqa: E402
from rss_shield.shield.lanes import anticipation  # noqa: E402
from rss_shield.shield.lanes.limits import always_on  # noqa: E402
from rss_shield.shield.lanes.memory import MEMORY, merge  # noqa: E402
from rss_shield.shield.lanes.pair import ROAD_USER, assess  # noqa: E402
from rss_shield.shield.lanes.restriction import Body, restrict  # noqa: E402
from rss_shield.shield.params import RSSParams, Rules, Table  # noqa: E402

FRAME = 1 / 8  # a number of binary digits: sums of frames are exact [s]
a, b, c, d, e, f = z3.Reals("a b c d e f")
gap, v_rear, v_front = z3.Reals("gap v_rear v_front")


def drawn_driver(rng) -> RSSParams:
    """Parameters of a driver; the leader's hardest braking is above the follower's weakest (C4)."""
    return RSSParams(
        response_time=FRAME * rng.integers(1, 9),
        a_max_accel=rng.choice([0.0, rng.uniform(0.5, 6.0)]),
        a_min_brake=rng.uniform(3.0, 6.0),
        a_max_brake=rng.uniform(6.0, 9.0),
        a_min_brake_correct=rng.uniform(1.0, 3.0),
        a_lat_max_accel=rng.uniform(0.1, 2.0),
        a_lat_min_brake=rng.uniform(0.5, 2.0),
        mu=rng.uniform(0.0, 0.2),
        standstill_gap=rng.uniform(0.0, 2.0),
        v_cap=rng.uniform(5.0, 45.0),
    )


def values_of(rng):
    """(values of the variables of both drivers, the drivers)."""
    drivers = drawn_driver(rng), drawn_driver(rng)
    values = {model.dt: FRAME}
    for unknown, known in zip((rear, front), drivers, strict=True):
        values |= dict(zip(unknown, known, strict=True))
    return values, drivers


SPEED, SIGNED = (0.0, 40.0), (-10.0, 40.0)
LATERAL = (-3.0, 3.0)
FUNCTIONS = {
    "reach": (kinematics.reach, [a, b, c, d, e], [SPEED, (0.0, 2.0), (0.5, 6.0), (1.0, 8.0), (5.0, 45.0)]),
    "forward_reach": (kinematics.forward_reach, [a, b, c, d, e], [SIGNED, (0, 2.0), (0.5, 6), (1.0, 8.0), (5.0, 45.0)]),
    "stopping_distance": (kinematics.stopping_distance, [a, b], [SPEED, (1.0, 8.0)]),
    "euler_margin": (sampling.euler_margin, [a, b, c], [SIGNED, (1.0, 8.0), (0.05, 0.2)]),
    "lateral_euler_margin": (sampling.lateral_euler_margin, [a, rear, c], [LATERAL, None, (0.05, 0.2)]),
    "sampling_margin": (sampling.sampling_margin, [a, rear, c], [LATERAL, None, (0.05, 0.2)]),
    "d_min_no_credit": (lateral.d_min_no_credit, [a, b, rear, front], [LATERAL, LATERAL, None, None]),
    "d_min_of_pair": (lateral.d_min_of_pair, [a, b, rear, front], [LATERAL, LATERAL, None, None]),
    "d_min_following": (longitudinal.d_min_following, [a, b, rear, front], [SPEED, SPEED, None, None]),
    "can_stop_before": (right_of_way.can_stop_before, [a, b, rear], [(0.0, 150.0), SPEED, None]),
    "acceleration_cap": (
        anticipation.acceleration_cap,
        [a, b, c, d, e, rear, front, f, model.dt],
        [(0.0, 150.0), (0.0, 20.0), SPEED, SPEED, (-8.0, 4.0), None, None, (0.5, 4.0), (FRAME, FRAME)],
    ),
    "lateral_cap": (
        anticipation.lateral_cap,
        [a, b, c, rear, d, model.dt],
        [(0.0, 2.0), (0.0, 2.0), (0.0, 2.0), None, (0.5, 4.0), (FRAME, FRAME)],
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_formula_has_the_values_of_the_compiled_function(name):
    function, unknown, ranges = FUNCTIONS[name]
    expression = symbolic(function, *TABLE, *C4)(*unknown)
    rng, infinite = np.random.default_rng(1), 1e6
    for _ in range(25):
        values, drivers = values_of(rng)
        known = []
        for variable, limits in zip(unknown, ranges, strict=True):
            if limits is None:
                known.append(drivers[0] if variable is rear else drivers[1])
            else:
                known.append(rng.uniform(*limits))
                values[variable] = known[-1]
        values[z3.Real("infinity")] = infinite
        expected = function(*known)
        expected = infinite if expected == np.inf else expected
        assert at(expression, values) == pytest.approx(expected, rel=1e-9, abs=1e-9), known


@pytest.mark.parametrize("facing", [False, True])
def test_the_distance_for_any_signs_of_speed_has_the_values_of_the_compiled_one(facing):
    expression = symbolic(longitudinal.d_min_longitudinal, *TABLE, *C4)(a, b, facing, rear, front, c, d)
    rng = np.random.default_rng(2)
    for _ in range(25):
        values, drivers = values_of(rng)
        numbers = rng.uniform((-10.0, -10.0, 1.0, 1.0), (40.0, 40.0, 6.0, 6.0))
        values |= dict(zip((a, b, c, d), numbers, strict=True))
        expected = longitudinal.d_min_longitudinal(numbers[0], numbers[1], facing, *drivers, numbers[2], numbers[3])
        assert at(expression, values) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def road_user(s, y, speed, u):
    user = np.zeros(1, ROAD_USER)[0]
    user["s"], user["y"], user["speed"], user["along"], user["u"] = s, y, speed, speed, u
    user["cos"], user["around"], user["half_length"], user["half_width"] = 1.0, np.inf, 2.5, 1.0
    return user


def test_the_predicates_are_those_of_the_shield():
    """Of `assess`: along the lane, without turning (`heading_bound` 0), and across it, without room for predictions."""
    rules = Rules(heading_bound=0.0, overlap_margin=0.0)
    behind, beside = safe_behind(gap, v_rear, v_front), safe_beside(gap, w_ego, w_other)
    rng, outcomes = np.random.default_rng(3), []
    for _ in range(40):
        values, drivers = values_of(rng)
        table = Table(*drivers, rules, FRAME)
        v, v_ahead = rng.uniform(0.0, 40.0, 2)
        needed = longitudinal.d_min_following(v, v_ahead, *drivers)
        room = max(needed + rng.uniform(-4.0, 4.0), 0.1)
        pair = assess(road_user(0.0, 0.0, v, 0.0), road_user(room + 5.0, 0.0, v_ahead, 0.0), table)
        assert at(behind, values | {gap: pair.gap_lon, v_rear: v, v_front: v_ahead}) == pair.safe_lon
        w, w_theirs = rng.uniform(0.0, 2.0, 2)
        room = lateral.d_min_no_credit(w, w_theirs, *drivers) + rng.uniform(-0.5, 1.5)
        pair = assess(road_user(0.0, 0.0, 20.0, w), road_user(0.0, room + 2.0, 20.0, -w_theirs), table)
        assert at(beside, values | {gap: pair.gap_lat, w_ego: w, w_other: w_theirs}) == pair.safe_lat
        outcomes.append((pair.safe_lon, pair.safe_lat))
    assert len(set(outcomes)) > 1


def test_a_frame_of_the_shield_is_one_that_the_proof_allows():
    """Whatever the agent asks for: in safe frames by the limits, in danger by what is owed."""
    s, v, v_next = z3.Reals("s v v_next")
    kept = model.keeps_its_response(v, v_next, s, rear, rear.a_min_brake)
    led = model.leads(v, v_next, rear)
    rng, rules = np.random.default_rng(4), Rules()
    for _ in range(60):
        values, (driver, _) = values_of(rng)
        ego = road_user(0.0, 0.0, rng.choice([0.0, 0.2, rng.uniform(0.0, 45.0)]), 0.0)
        memory = np.zeros(1, MEMORY)[0]
        memory["since"], memory["axes"] = rng.integers(0, 10), response.LON
        memory["ego_is_rear"], memory["role_now"] = True, response.FRONT
        bounds = merge(always_on(ego, driver, rules, FRAME), memory, driver, rules, FRAME)
        command = restrict(Command(rng.uniform(-30.0, 30.0), 0.0), bounds, ego, Body(2.5, 1.0, 0.0), rules, FRAME)
        after = ego["speed"] + command.acceleration * FRAME
        # duties come at once, response times are for others: nothing is left of it once there is danger
        left = driver.response_time if memory["since"] == 0 else 0.0
        state = values | {s: left, v: float(ego["speed"]), v_next: after - 1e-9}
        assert at(kept, state), (ego["speed"], command, memory["since"])
        assert at(led, state | {v_next: after + 1e-9})


def test_the_limits_across_the_lane_are_those_of_the_shield():
    limit, u, limit_next, s = z3.Reals("limit u limit_next s")
    of_frame, of_next = (one.arg(1) for one in limited(limit, u, limit_next, s).children())
    rng = np.random.default_rng(5)
    for _ in range(10):
        values, (driver, _) = values_of(rng)
        w = rng.uniform(0.0, 1.0)
        before, left = w, driver.response_time
        for frame in range(14):
            now = response.lateral_speed_limit(frame, w, driver, FRAME)
            following = now if left > 0.0 else response.lateral_speed_limit(frame + 1, w, driver, FRAME)
            state = values | {limit: before, s: left}
            assert at(of_frame, state) == pytest.approx(now, abs=1e-9)
            assert at(of_next, state) == pytest.approx(following, abs=1e-9)
            before, left = following, max(left - FRAME, 0.0)


def test_item_1_of_def_17_is_that_of_the_shield():
    expression = safe_before(a, b)
    rng, outcomes = np.random.default_rng(6), set()
    for _ in range(40):
        values, (driver, _) = values_of(rng)
        v = rng.uniform(0.0, 30.0)
        enter = kinematics.reach(v, driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap)
        enter += rng.uniform(-3.0, 6.0)
        car = right_of_way.Approach(enter, enter + 20.0, 5.0, v, 0.0)
        moved = sampling.with_euler_margin(car, driver, FRAME)
        expected = right_of_way.can_stop_before(moved.enter, moved.v, driver)
        assert at(expression, values | {a: enter, b: v}) == expected
        outcomes.add(expected)
    assert outcomes == {True, False}
