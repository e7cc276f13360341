"""Defs. 14 and 15: lateral safety and response of two cars on routes of different geometry."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.definitions.lateral import d_min_lateral
from rss_shield.shield.definitions.right_of_way import (
    is_safe_across_routes,
    lateral_interval,
    route_lateral_response,
    strip_gap,
)
from rss_shield.shield.params import PRESETS

CAR = PRESETS["slides"].ego  # rho 1 s, lateral 0.2 and 0.8 m/s^2, mu 0.1 m
LATE = PRESETS["slides"].other  # rho 2 s

positions = st.floats(-0.5, 0.5)
speeds = st.floats(-1.5, 1.5)


def test_the_interval_by_hand():
    # 0.5 m/s for 1 s at 0.2: 0.6 m, then from 0.7 m/s at 0.8: 0.30625 m; to the other side it never gets back
    assert lateral_interval(0.3, 0.5, CAR) == pytest.approx((0.3, 1.20625))
    assert lateral_interval(0.3, -0.5, CAR) == pytest.approx((0.3 - 0.90625, 0.3))
    # from rest 0.1 m and 0.2^2 / 1.6 m to either side
    assert lateral_interval(0.0, 0.0, CAR) == pytest.approx((-0.125, 0.125))


@settings(deadline=None)  # compiles on the first call
@given(x=positions, u=speeds, seed=st.integers(0, 2**32 - 1))
def test_no_lawful_car_leaves_its_interval(x, u, seed):
    rng, dt = np.random.default_rng(seed), 0.01
    low, high = lateral_interval(x, u, CAR)
    for frame in range(400):
        a = rng.choice([-0.2, 0.2, rng.uniform(-0.2, 0.2)])
        if frame >= 100:  # brakes to a stop sideways, as weakly as it may
            a = -math.copysign(min(CAR.a_lat_min_brake, abs(u) / dt), u)
        x, u = x + u * dt + 0.5 * a * dt**2, u + a * dt
        assert low - 1e-9 <= x <= high + 1e-9
    assert u == pytest.approx(0.0, abs=1e-9)


@settings(deadline=None)  # compiles on the first call
@given(x=positions, y=positions, u=speeds, w=speeds)
def test_on_parallel_routes_strips_give_no_less_than_no_credit_and_the_same_to_cars_that_close_in(x, y, u, w):
    gap = strip_gap(4.0, lateral_interval(x, u, CAR), lateral_interval(y, w, LATE), 1.0, 1.0)
    between, d_min = 4.0 + y - x - 2.0, d_min_lateral(u, w, CAR, LATE)
    assert between < d_min or is_safe_across_routes(gap, CAR, LATE)
    if u >= 0.0 >= w and gap > 0.0:
        assert gap - 0.1 == pytest.approx(between - d_min)


def test_strips_that_meet_are_not_safe():
    one, two = lateral_interval(0.0, 0.0, CAR), lateral_interval(0.0, 0.0, LATE)
    # the second car may come over by 0.4 + 0.4^2 / 1.6 m
    assert strip_gap(4.0, one, two, 1.0, 1.0) == pytest.approx(2.0 - 0.125 - 0.5)
    assert strip_gap(-4.0, one, two, 1.0, 1.0) == pytest.approx(2.0 - 0.125 - 0.5)
    assert strip_gap(2.5, one, two, 1.0, 1.0) == pytest.approx(-0.125)
    for gap, safe in ((-0.125, False), (0.0, False), (0.0999, False), (0.1, True)):
        assert is_safe_across_routes(gap, CAR, LATE) == safe
    bare = CAR._replace(mu=0.0)
    assert not is_safe_across_routes(0.0, bare, bare)


def test_on_its_own_route_a_car_stops_sideways_whichever_way_it_moves():
    inf = math.inf
    assert route_lateral_response(0.5, 0.3, CAR) == (-0.2, 0.2, -inf, inf)
    # slows down to 0 and not beyond
    assert route_lateral_response(1.0, 0.3, CAR) == (-inf, -0.8, 0.0, inf)
    assert route_lateral_response(1.0, -0.3, CAR) == (0.8, inf, -inf, 0.0)
    assert route_lateral_response(1.0, 0.0, CAR) == (-inf, inf, 0.0, 0.0)
