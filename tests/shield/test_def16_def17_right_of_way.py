"""Defs. 16 and 17: who is in front, and which items make two cars at a junction safe."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.definitions.right_of_way import (
    CAN_STOP,
    IN_ORDER,
    IN_TIME,
    Approach,
    are_apart,
    can_stop_before,
    clears_before,
    distances_to_area,
    first_arrival,
    gap_behind,
    is_ahead,
    junction_items,
    last_departure,
    longitudinal_order,
    non_priority_can_stop,
)
from rss_shield.shield.params import PRESETS

# rho 1 s, acceleration 3.5, braking 4 to 8 m/s^2
CAR = PRESETS["slides"].ego._replace(standstill_gap=0.0)
LATE = CAR._replace(response_time=2.0, v_cap=20.0)
INF = math.inf

distances = st.floats(-20.0, 120.0)
inside = st.floats(-14.99, -0.01)  # of a crossing 10 m long, with a car of 5 m
speeds = st.floats(0.0, 30.0)
ranks = st.sampled_from([0.0, 1.0])


def crossing(enter, v, rank=0.0, area=10.0, length=5.0):
    return Approach(float(enter), enter + area + length, length, float(v), float(rank))


def merge(enter, v, rank=0.0):
    return crossing(enter, v, rank, area=INF)


def test_distances_run_from_the_front_to_the_start_and_from_the_rear_to_the_end():
    assert distances_to_area(10.0, 2.5, 30.0, 40.0) == (17.5, 32.5)
    assert distances_to_area(35.0, 2.5, 30.0, 40.0) == (-7.5, 7.5)
    assert distances_to_area(43.0, 2.5, 30.0, 40.0) == (-15.5, -0.5)


def test_the_nearer_car_is_in_front_and_inside_the_one_that_is_farther_in():
    assert longitudinal_order(3.0, 4.0) == 1
    assert longitudinal_order(-3.0, -4.0) == -1
    assert longitudinal_order(2.0, 2.0) == 0


# ---------------------------------------------------------------- item 1


def test_a_car_can_stop_if_its_reach_and_the_standstill_gap_fit():
    # 10 m/s: 11.75 m, then 13.5^2 / 8 m: 34.53125 m
    assert can_stop_before(34.53125, 10.0, CAR) and not can_stop_before(34.53, 10.0, CAR)
    assert not can_stop_before(34.54, 10.0, CAR._replace(standstill_gap=1.0))


@pytest.mark.parametrize(
    ("rank_one", "rank_two", "holds"),
    [(1, 0, False), (0, 1, True), (0, 0, False), (1, 1, False)],
)
def test_only_cars_without_priority_must_be_able_to_stop_and_of_equals_all(rank_one, rank_two, holds):
    # the first car can stop, the second one cannot
    one, two = crossing(40.0, 10.0, rank_one), crossing(30.0, 10.0, rank_two)
    assert non_priority_can_stop(one, two, CAR, CAR) == holds
    assert non_priority_can_stop(two, one, CAR, CAR) == holds
    assert bool(junction_items(one, two, CAR, CAR) & CAN_STOP) == holds


def test_a_car_without_priority_that_is_inside_is_not_excused_by_item_1():
    one, two = crossing(-2.0, 0.0, 0), crossing(50.0, 10.0, 1)
    assert not junction_items(one, two, CAR, CAR) & CAN_STOP


# ---------------------------------------------------------------- item 2


def test_the_gap_runs_through_the_merge_point_or_from_the_way_out_of_a_crossing():
    assert gap_behind(merge(60.0, 12.0), merge(5.0, 10.0)) == 50.0
    assert gap_behind(merge(-3.0, 12.0), merge(-20.0, 10.0)) == 12.0
    # 15 m until the first car is out: 10 m of area and 5 m of car, 5 m before it
    assert gap_behind(crossing(60.0, 12.0), crossing(5.0, 10.0)) == 40.0


def test_on_a_crossing_the_first_car_may_stop_inside_so_the_second_stays_out():
    # both at 10 m/s need 34.53125 - 6.25 = 28.28125 m
    assert d_min_same_direction(10.0, 10.0, CAR, CAR) == 28.28125
    front = crossing(5.0, 10.0)
    assert is_ahead(front, crossing(48.3, 10.0), CAR, CAR)
    assert not is_ahead(front, crossing(48.2, 10.0), CAR, CAR)
    # on a merge 28.28125 m behind its rear are enough
    assert is_ahead(merge(5.0, 10.0), merge(38.3, 10.0), CAR, CAR)
    assert not is_ahead(front, crossing(38.3, 10.0), CAR, CAR)


def test_two_cars_equally_near_have_no_order():
    assert not junction_items(merge(-50.0, 30.0), merge(-50.0, 0.0), CAR, CAR) & IN_ORDER


# ---------------------------------------------------------------- item 3


def test_times_by_hand():
    # 15 m/s: 2 m in 0.1313 s, full braking covers 12 m in 1.1569 s
    car = Approach(2.0, 12.0, 5.0, 15.0, 0.0)
    assert first_arrival(car, CAR) == pytest.approx(0.131321381)
    assert last_departure(car, CAR) == pytest.approx(1.156929669)


def test_inside_a_car_has_arrived_and_outside_again_it_has_left():
    inside, gone = crossing(-3.0, 20.0), crossing(-15.0, 20.0)
    assert first_arrival(inside, CAR) == 0.0 and math.isfinite(last_departure(inside, CAR))
    assert last_departure(gone, CAR) == -INF
    assert are_apart(gone, crossing(-1.0, 0.0), CAR, CAR) and are_apart(crossing(-1.0, 0.0), gone, CAR, CAR)
    assert not are_apart(inside, inside, CAR, CAR)


def test_one_that_would_stop_is_not_enough_while_the_other_may_linger():
    # 10 m/s stops within 34.53 m; full braking from 10 m/s ends after 6.25 m, before the first car is out
    stops, lingers = crossing(40.0, 10.0), crossing(5.0, 10.0)
    assert first_arrival(stops, CAR) == INF == last_departure(lingers, CAR)
    assert not are_apart(stops, lingers, CAR, CAR) and not are_apart(lingers, stops, CAR, CAR)
    assert are_apart(stops, stops, CAR, CAR)


def test_below_9_metres_per_second_only_cars_that_would_stop_are_apart():
    # full braking from 8.9 m/s ends after 4.95 m, within the car's own length
    near, far = crossing(0.0, 8.9, area=0.0), crossing(60.0, 20.0, area=0.0)
    assert last_departure(near, CAR) == INF
    assert not are_apart(near, far, CAR, CAR)


def test_each_car_has_its_own_speed_cap():
    slow = CAR._replace(v_cap=10.0)
    car = crossing(20.0, 10.0)
    assert first_arrival(car, slow) > first_arrival(car, CAR)
    other = crossing(30.0, 10.0)
    assert are_apart(car, other, CAR, slow) == are_apart(other, car, slow, CAR)


# ---------------------------------------------------------------- item 3'


def test_a_car_that_goes_clears_before_the_other_can_arrive_flat_out():
    # from rest 15 m at 3 m/s^2 take 3.162 s; the other: 20 m/s and 3.5 m/s^2, capped at 30 m/s
    # has that after 20/7 s and 71.43 m, and covers 80.58 m in all
    ego, slower = crossing(0.0, 0.0), CAR._replace(v_cap=30.0)
    near, far = crossing(80.5, 20.0), crossing(80.7, 20.0)
    assert clears_before(ego, far, 3.0, CAR, slower)
    assert not clears_before(ego, near, 3.0, CAR, slower)
    assert not clears_before(ego, far, 3.0, CAR, CAR)  # would be faster still
    assert not clears_before(ego, far, 2.9, CAR, slower)
    # item 3 as printed gives up, because the car might stop inside
    assert not are_apart(ego, far, CAR, slower)


def test_a_car_that_has_left_is_clear_and_one_that_cannot_move_is_not():
    assert clears_before(crossing(-15.0, 5.0), crossing(-1.0, 5.0), 3.0, CAR, CAR)
    assert not clears_before(crossing(0.0, 0.0), crossing(1000.0, 5.0), 0.0, CAR, CAR)
    assert clears_before(crossing(0.0, 5.0), crossing(1000.0, 0.0), 0.0, CAR, CAR._replace(a_max_accel=0.0))


# ---------------------------------------------------------------- all items


@settings(deadline=None)  # compiles on the first call
@given(distances, speeds, ranks, distances, speeds, ranks, st.booleans())
def test_the_items_do_not_depend_on_who_is_called_first(d_1, v_1, rank_1, d_2, v_2, rank_2, merges):
    route = merge if merges else crossing
    one, two = route(d_1, v_1, rank_1), route(d_2, v_2, rank_2)
    assert junction_items(one, two, CAR, LATE) == junction_items(two, one, LATE, CAR)


@settings(deadline=None)  # compiles on the first call
@given(inside, speeds, ranks, inside, speeds, ranks)
def test_two_cars_inside_at_once_are_never_safe(d_1, v_1, rank_1, d_2, v_2, rank_2):
    assert junction_items(crossing(d_1, v_1, rank_1), crossing(d_2, v_2, rank_2), CAR, LATE) == 0


@settings(deadline=None)  # compiles on the first call
@given(distances, speeds, distances, speeds, st.floats(0.0, 50.0))
def test_a_car_without_priority_farther_away_is_no_less_able_to_stop(d_1, v_1, d_2, v_2, farther):
    one, two = crossing(d_1, v_1, 0), crossing(d_2, v_2, 1)
    away = crossing(d_1 + farther, v_1, 0)
    assert non_priority_can_stop(one, two, CAR, CAR) <= non_priority_can_stop(away, two, CAR, CAR)
    assert first_arrival(one, CAR) <= first_arrival(away, CAR)
    assert last_departure(one, CAR) <= last_departure(away, CAR)


@settings(deadline=None)  # compiles on the first call
@given(st.floats(0.0, 120.0), speeds)
def test_a_car_arrives_exactly_if_it_cannot_stop(d, v):
    reached = reach(v, CAR.response_time, CAR.a_max_accel, CAR.a_min_brake, CAR.v_cap)
    if abs(reached - d) > 1e-9:
        assert math.isinf(first_arrival(crossing(d, v), CAR)) == can_stop_before(d, v, CAR)


@settings(deadline=None)  # compiles on the first call
@given(distances, speeds, distances, speeds)
def test_both_able_to_stop_is_item_1_without_priority_and_item_3(d_1, v_1, d_2, v_2):
    one, two = crossing(d_1, v_1), crossing(d_2, v_2)
    if junction_items(one, two, CAR, LATE) & CAN_STOP:
        assert junction_items(one, two, CAR, LATE) & IN_TIME
