"""UN R157's situations and the drivers that it is measured by, with numbers worked by hand."""

import numpy as np
import pytest

from rss_shield.eval.suite.scenarios.drivers_of_r157 import (
    View,
    careful_sees_risk,
    critical_metric,
    fuzzy_deceleration,
    proactive_metric,
)
from rss_shield.eval.suite.scenarios.r157 import (
    DRIVERS,
    TABLES,
    Cases,
    cut_ins,
    cut_outs,
    decelerations,
    drive,
    drive_shield,
)
from rss_shield.eval.suite.scenarios.r157_page import page_of


def cases(v=20.0, v_other=10.0, gap=60.0, lateral=0.0, braking=0.0, hidden=0.0):
    return Cases(*(np.array([float(value)]) for value in (v, v_other, gap, lateral, braking, hidden)))


def one(**changes):
    given = dict(gap=30.0, v=20.0, a=0.0, v_other=10.0, aside=-1.0, toward=0.0, in_lane=True, perceived=1.0) | changes
    return View(**{name: np.array([value]) for name, value in given.items()})


def test_the_proactive_metric_goes_from_gentle_to_hard_braking():
    # v = u = 20: safe 15 + 400/8 - 400/14 + 2 = 38.43 m, unsafe 15 + 400/12 - 400/14 = 19.76 m, 2 m always
    assert proactive_metric(40.5, 20.0, 20.0) == 0.0
    assert proactive_metric(21.7, 20.0, 20.0) == 1.0
    assert proactive_metric(2.0 + 29.0952, 20.0, 20.0) == pytest.approx(0.5, abs=1e-3)


def test_the_critical_metric_is_about_a_leader_that_keeps_its_speed():
    # closing with 10 m/s: 7.5 m during the delay, then 100/8 = 12.5 m gently or 100/12 = 8.33 m hard
    assert critical_metric(20.1, 20.0, 10.0, 0.0) == 0.0
    assert critical_metric(15.8, 20.0, 10.0, 0.0) == 1.0
    assert critical_metric(17.9167, 20.0, 10.0, 0.0) == pytest.approx(0.5, abs=1e-3)
    assert critical_metric(1.0, 10.0, 10.0, 0.0) == 0.0
    assert fuzzy_deceleration(one(gap=17.9167)) == pytest.approx(5.0, abs=1e-2)


def test_the_careful_driver_needs_time_to_see_a_risk():
    assert careful_sees_risk(one(perceived=0.5))
    assert not careful_sees_risk(one(perceived=0.3))
    assert careful_sees_risk(one(in_lane=False, gap=19.9, perceived=0.5))  # time to collision 1.99 s
    assert not careful_sees_risk(one(in_lane=False, gap=20.1, perceived=0.5))


def test_the_careful_driver_stops_in_so_many_metres():
    # brakes from 0.4 + 0.75 s on, after 23 m at 20 m/s; 0.6 s of onset are 11 m, then 17.7^2 / 15.2 = 20.7 m
    far, near = (drive(cases(20.0, 0.0, gap), "careful driver")[0] for gap in (60.0, 48.0))
    assert not far and near


def test_nobody_brakes_means_that_whoever_is_slower_is_touched_unless_it_is_passed():
    assert drive(cases(lateral=1.0), "nobody brakes")
    assert not drive(cases(gap=1.0, lateral=0.3), "nobody brakes")  # past after 1 s, over after 5 s
    assert not drive(cases(v_other=20.0), "nobody brakes")
    with pytest.raises(ValueError, match="driver = 'bold': expected one of nobody brakes"):
        drive(cases(), "bold")


def test_the_shield_with_the_careful_drivers_brakes_is_touched_less():
    for made in (cut_ins, decelerations, cut_outs):
        some = made().chosen(np.arange(len(made().v)) % 17 == 0)
        careful, shield = drive(some, "careful driver"), drive_shield(some, TABLES["careful"])
        assert shield.sum() < careful.sum()
        # and with evasive effort never more
        assert not (drive_shield(some, TABLES["careful"], True) & ~shield).any()


def test_the_page_counts_who_avoids_what():
    hits = {name: np.array([True, True, False, False]) for name in (*DRIVERS, *map("shield, {}".format, TABLES))}
    hits["careful driver"] = np.array([True, False, True, False])
    hits["shield, careful + evasion"] = np.zeros(4, bool)
    page = page_of({"cut-in": hits})
    assert "| careful driver | 2 (50.0%) | - | - |" in page
    assert "| shield, careful | 2 (50.0%) | 1 | 1 |" in page
    assert "Of the 1 cut-ins that the careful driver avoids" in page
