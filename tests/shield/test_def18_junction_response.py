"""Def. 18: the response at a junction, and that it keeps two cars on crossing or merging routes from ever meeting."""

import math

import numpy as np
import pytest
from crossing import (
    AREA,
    AS_A_MERGE,
    FORGETFUL,
    LATE,
    NEW_PRIORITY,
    NO_ITEM_3,
    NO_MARGIN,
    QUICK,
    SLOW,
    SOUND,
    SWAPPED,
    at_random,
    drive_many,
    go_many,
    on_a_grid,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.definitions.right_of_way import (
    CAN_STOP,
    IN_ORDER,
    IN_TIME,
    UNSEEN,
    Approach,
    junction_response,
    must_brake,
    step_junction,
    would_strand,
)
from rss_shield.shield.params import PRESETS

CAR = PRESETS["slides"].ego  # rho 1 s, acceleration 3.5, braking 4 to 8 m/s^2
BRAKING, FREE = (-8.0, -4.0), (-8.0, math.inf)
RANKS = {"first has priority": (1.0, 0.0), "second has priority": (0.0, 1.0), "nobody has priority": (0.0, 0.0)}

# ---------------------------------------------------------------- the table


@pytest.mark.parametrize(
    ("items", "with_priority", "without"),
    [
        # each as (in front, behind)
        (CAN_STOP, (False, False), (True, True)),
        (IN_ORDER, (False, True), (False, True)),
        (IN_TIME, (True, True), (True, True)),
        (CAN_STOP | IN_ORDER, (False, True), (True, True)),
        (CAN_STOP | IN_TIME, (True, True), (True, True)),
        (0, (True, True), (True, True)),  # never was safe
    ],
)
def test_a_driver_brakes_if_any_item_that_was_true_asks_for_it(items, with_priority, without):
    assert tuple(must_brake(items, True, order) for order in (1.0, -1.0)) == with_priority
    assert tuple(must_brake(items, False, order) for order in (1.0, -1.0)) == without


def test_somebody_brakes_whatever_was_lost():
    for items in range(8):
        for ranks in RANKS.values():
            for order in (1.0, -1.0):
                one = must_brake(items, ranks[0] > ranks[1], order)
                assert one or must_brake(items, ranks[1] > ranks[0], -order)


def test_bounds_are_those_of_a_rear_car_for_who_brakes_and_of_a_front_car_for_who_does_not():
    assert junction_response(IN_TIME, True, 1.0, 0.9, 10.0, CAR, False) == (-8.0, 3.5)
    assert junction_response(IN_TIME, True, 1.0, 1.0, 10.0, CAR, False) == BRAKING
    assert junction_response(IN_TIME, True, 1.0, 1.0, 0.0, CAR, False) == (0.0, 0.0)
    assert junction_response(CAN_STOP, True, 1.0, 1.0, 10.0, CAR, False) == FREE


def test_a_car_with_priority_may_brake_for_a_runner_unless_that_strands_it():
    assert junction_response(CAN_STOP, True, 1.0, 1.0, 10.0, CAR, True) == BRAKING
    # 10 m/s comes to rest after 12.5 m
    for enter, leave, strands in ((13.0, 28.0, False), (5.0, 20.0, True), (-5.0, 12.6, True), (-5.0, 12.4, False)):
        assert would_strand(Approach(enter, leave, 5.0, 10.0, 1.0), CAR) == strands


def test_the_threshold_is_the_last_sample_at_which_any_item_held():
    near, far = Approach(5.0, 20.0, 5.0, 10.0, 0.0), Approach(50.0, 65.0, 5.0, 10.0, 1.0)
    samples = [
        (near, far, CAN_STOP | IN_ORDER),
        (far, near, IN_TIME),
        (near, far, 0),
        (near, near, 0),
        (near, near, CAN_STOP),
    ]
    memory, rows = UNSEEN, []
    for one, two, items in samples:
        memory = step_junction(memory, one, two, items)
        rows.append(tuple(memory))
    assert rows == [
        (CAN_STOP | IN_ORDER, 1, -1, 0),
        (IN_TIME, -1, 1, 0),
        (IN_TIME, -1, 1, 1),
        (IN_TIME, -1, 1, 2),
        (CAN_STOP, 0, 0, 0),
    ]
    assert tuple(step_junction(UNSEEN, near, far, 0)) == (0, 0, 0, 1)


# ---------------------------------------------------------------- the theorem, sampled

DRIVERS = {"quick, slow": (QUICK, SLOW), "slow, quick": (SLOW, QUICK), "slow, slow": (SLOW, SLOW)}
AREAS = {"crossing": AREA, "merge": math.inf}


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS.keys())
@pytest.mark.parametrize("ranks", RANKS.values(), ids=RANKS.keys())
@pytest.mark.parametrize("drivers", DRIVERS.values(), ids=DRIVERS.keys())
def test_started_safe_two_lawful_cars_never_meet(drivers, ranks, area):
    rng = np.random.default_rng(1)
    safe, overlaps, lost, through = drive_many(on_a_grid(area), ranks, area, *drivers, SOUND, rng)
    assert overlaps == 0
    more_safe, overlaps, more_lost, more_through = drive_many(
        at_random(20_000, area, rng), ranks, area, *drivers, SOUND, rng
    )
    assert overlaps == 0
    # nobody was tame: many were safe, many got through, and each item was once all that had held
    assert safe + more_safe > 8000 and through + more_through > 3000
    alone = IN_ORDER if ranks[0] == ranks[1] else CAN_STOP | IN_ORDER
    assert (lost | more_lost) & alone == alone
    assert area == math.inf or (lost | more_lost) & IN_TIME


@pytest.mark.parametrize("drivers", DRIVERS.values(), ids=DRIVERS.keys())
def test_lights_that_change_at_once_harm_nobody_if_priority_is_remembered_too(drivers):
    rng = np.random.default_rng(1)
    starts = at_random(20_000, AREA, rng)
    safe, overlaps, _, _ = drive_many(starts, (1.0, 0.0), AREA, *drivers, SOUND, rng, 20)
    assert safe > 8000 and overlaps == 0
    assert drive_many(starts, (1.0, 0.0), AREA, *drivers, NEW_PRIORITY, rng, 20)[1] > 10


@settings(max_examples=300, deadline=None)
@given(
    st.floats(-12.0, 80.0),
    st.floats(0.0, 25.0),
    st.floats(-12.0, 80.0),
    st.floats(0.0, 25.0),
    st.sampled_from(sorted(RANKS.values())),
    st.sampled_from(sorted(AREAS.values())),
    st.integers(0, 2**32 - 1),
)
def test_no_start_can_be_found_from_which_lawful_cars_meet(d_1, v_1, d_2, v_2, ranks, area, seed):
    starts = np.tile([d_1, v_1, d_2, v_2], (10, 1))
    _, overlaps, _, _ = drive_many(starts, ranks, area, QUICK, SLOW, SOUND, np.random.default_rng(seed))
    assert overlaps == 0


MUTATIONS = {
    "the car with priority yields, the other one does not": (SWAPPED, "first has priority"),
    "losing item 3 is not answered": (NO_ITEM_3, "second has priority"),
    "which item held is forgotten, item 1 is assumed": (FORGETFUL, "first has priority"),
    "item 2 on a crossing as on a merge": (AS_A_MERGE, "nobody has priority"),
    "no margin for frames": (NO_MARGIN, "second has priority"),
    "one frame late": (LATE, "second has priority"),
}


@pytest.mark.parametrize(("change", "who"), MUTATIONS.values(), ids=MUTATIONS.keys())
def test_without_it_they_meet(change, who):
    rng = np.random.default_rng(1)
    starts = at_random(40_000, AREA, rng)
    assert drive_many(starts, RANKS[who], AREA, QUICK, SLOW, SOUND, rng)[1] == 0
    assert drive_many(starts, RANKS[who], AREA, QUICK, SLOW, change, rng)[1] > 10


# ---------------------------------------------------------------- item 3'


@pytest.mark.parametrize("a_go", [0.0, 1.0, QUICK.a_max_accel])
def test_a_car_that_goes_by_item_3_prime_is_out_before_any_other_comes_in(a_go):
    rng = np.random.default_rng(1)
    starts = at_random(40_000, AREA, rng)
    allowed, overlaps = go_many(starts, a_go, 0.0, QUICK, SLOW, rng)
    assert allowed > 5000 and overlaps == 0
    # 2 m taken off its way is enough to be caught
    assert go_many(starts, a_go, 2.0, QUICK, SLOW, rng)[1] > 0


def test_item_3_prime_lets_a_standing_car_go_where_item_3_as_printed_does_not():
    starts = np.array([[0.5, 0.0, d, 15.0] for d in np.linspace(30.0, 120.0, 50)])
    allowed, overlaps = go_many(starts, 3.0, 0.0, QUICK, SLOW, np.random.default_rng(1))
    assert allowed > 10 and overlaps == 0
