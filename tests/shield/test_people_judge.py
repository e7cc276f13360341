"""Who is to blame for a contact with a pedestrian, by hand-made samples."""

import numpy as np
import pytest

from rss_shield.shield.definitions.pedestrians import WALKS
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.people.judge import (
    WATCHED,
    Seen,
    judge_caution,
    note_exposure,
    remember_person,
    stay_uncautious,
    watch_person,
)
from rss_shield.shield.verdicts import (
    DUTIES,
    HURRIED,
    KEPT,
    LEAPED,
    LEFT_CROSSING,
    LEFT_NO_PLAN,
    NO_CAUTION,
    UNREASONABLE,
    WALKED_IN,
)

WALK, DT = WALKS["paper"], 1 / 15
STANDS = Seen(10.0, 5.0, -np.pi / 2, 0.0, 2.78, False, False, False, False, False, False)


def watched(*samples: tuple[Seen, int]) -> int:
    """Duty that a pedestrian has broken after samples, each with the frames since the last plan."""
    memory, crossing = np.zeros(1, WATCHED)[0], np.zeros(1, CROSSING)[0]
    for seen, since in samples:
        # several samples without a plan in between are one here
        crossing["since"] = max(since - 1, 0)
        watch_person(memory, crossing, seen, WALK, DT)
        crossing["since"], crossing["age"] = since, crossing["age"] + 1  # as `judge_user` does
        remember_person(memory, crossing, seen)
    return int(crossing["other_broke"])


def test_who_stays_in_its_disc_has_done_nothing():
    assert watched((STANDS, 0), (STANDS._replace(y=4.55), 5)) == KEPT


def test_who_gets_farther_than_its_reach_has_leaped():
    # 0.5 m from rest, and 0.034 m for frames
    assert watched((STANDS, 0), (STANDS._replace(y=4.44), 5)) == LEAPED


def test_while_there_is_a_plan_the_reach_goes_along():
    steps = [(STANDS._replace(y=5.0 - 0.3 * k), 0) for k in range(5)]
    assert watched(*steps) == KEPT


def test_on_a_crossing_it_may_go_as_fast_as_is_reasonable():
    walks = STANDS._replace(has_way=True, on_crossing=True, v=1.0)
    later = walks._replace(y=3.0)
    assert watched((walks, 0), (later._replace(v=2.7), 15)) == KEPT
    assert watched((walks, 0), (later._replace(v=2.9), 15)) == HURRIED
    # 2 m/s^2 for 3 frames are 0.4 m/s
    assert watched((walks, 0), (later._replace(v=1.5), 3)) == HURRIED
    assert watched((walks, 0), (later._replace(on_crossing=False), 3)) == LEFT_CROSSING


def test_who_comes_where_the_car_is_already_has_walked_into_it():
    beside = STANDS._replace(in_way=True, beside=True)
    assert watched((STANDS, 0), (beside._replace(near=True), 0)) == WALKED_IN
    ahead = STANDS._replace(in_way=True)
    # it was on the way before the front came: that it is beside it now says nothing
    assert watched((STANDS, 0), (ahead, 0), (beside._replace(near=True), 0)) == KEPT


def test_who_walks_into_a_standing_car_is_to_blame():
    assert watched((STANDS, 0), (STANDS._replace(in_way=True, near=True, stands=True), 0)) == WALKED_IN


@pytest.mark.parametrize(("v", "other"), [(2.0, KEPT), (2.8, KEPT), (4.0, UNREASONABLE)])
def test_who_comes_out_of_hiding_too_fast_is_unreasonable(v, other):
    crossing = np.zeros(1, CROSSING)[0]
    note_exposure(crossing, v, 0.0, 2.78)
    assert crossing["other_broke"] == other
    assert DUTIES[UNREASONABLE]


@pytest.mark.parametrize(
    ("items", "age", "other", "ego"),
    [
        (0, 1, KEPT, NO_CAUTION),  # reasonable, and the ego has no plan
        (0, 1, UNREASONABLE, KEPT),
        (1, 1, KEPT, KEPT),  # a plan: nothing has happened
        (0, 2, KEPT, KEPT),  # not the first sample
    ],
)
def test_toward_who_comes_out_of_hiding_the_ego_has_a_plan(items, age, other, ego):
    crossing = np.zeros(1, CROSSING)[0]
    crossing["items"], crossing["age"], crossing["other_broke"] = items, age, other
    judge_caution(crossing)
    assert crossing["ego_broke"] == ego
    assert DUTIES[NO_CAUTION]


@pytest.mark.parametrize(
    ("since", "other", "before", "after"),
    [
        (1, KEPT, KEPT, NO_CAUTION),  # no plan toward them, and nobody else has broken anything
        (0, KEPT, KEPT, KEPT),  # there is one
        (3, HURRIED, KEPT, KEPT),  # they broke something
        (3, KEPT, LEFT_NO_PLAN, LEFT_NO_PLAN),  # the ego has broken something else already
    ],
)
def test_who_was_not_cautious_answers_for_what_it_gets_into(since, other, before, after):
    crossing = np.zeros(1, CROSSING)[0]
    crossing["since"], crossing["other_broke"], crossing["ego_broke"] = since, other, before
    stay_uncautious(crossing)
    assert crossing["ego_broke"] == after
