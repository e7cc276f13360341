"""Def. 11: where a car is if its acceleration stays."""

import numpy as np
import pytest

from rss_shield.shield.definitions.evasion import naive


def integrated(p, v, a, t, both_ways=False, dt=1e-4):
    """By small steps: a car that has come to rest by braking stays there."""
    for _ in range(round(t / dt)):
        v_next = v + a * dt
        if v * v_next < 0.0 or (v != 0.0 and v_next == 0.0) or (v == 0.0 and a < 0.0 and not both_ways):
            a, v_next = 0.0, 0.0
        p += 0.5 * (v + v_next) * dt
        v = v_next
    return p, v


@pytest.mark.parametrize("both_ways", [False, True])
@pytest.mark.parametrize(
    ("v", "a"), [(20.0, -4.0), (10.0, 2.0), (0.0, -1.0), (0.0, 1.5), (-5.0, 1.0), (-2.0, -1.0), (7.0, 0.0)]
)
def test_it_is_what_small_steps_lead_to(v, a, both_ways):
    for t in (0.0, 1.0, 4.0, 7.0):
        assert naive(3.0, v, a, t, both_ways) == pytest.approx(integrated(3.0, v, a, t, both_ways), abs=2e-3)


def test_a_braking_car_stops_and_does_not_back_up():
    p, v = naive(0.0, 12.0, -3.0, np.linspace(0.0, 10.0, 101))
    assert np.all(np.diff(p) >= 0.0) and p[-1] == pytest.approx(24.0) and v[-1] == 0.0
    # continuous at the halt, after 4 s
    before, after = naive(0.0, 12.0, -3.0, 4.0 - 1e-9), naive(0.0, 12.0, -3.0, 4.0 + 1e-9)
    assert before == pytest.approx(after, abs=1e-7)


def test_across_the_lane_both_sides_are_alike():
    for v, a in ((0.5, -0.4), (0.0, -1.0), (0.0, 1.0), (-0.7, 0.2)):
        p, u = naive(0.0, v, a, 2.5, True)
        assert naive(0.0, -v, -a, 2.5, True) == pytest.approx((-p, -u))
    assert naive(0.0, 0.0, -1.0, 2.0) == (0.0, 0.0)
    assert naive(0.0, 0.0, -1.0, 2.0, True) == (-2.0, -2.0)


def test_whole_arrays_of_times_give_what_single_times_do():
    times = np.array([0.0, 0.7, 3.0, 9.0])
    p, v = naive(1.0, 8.0, -2.0, times)
    for k, t in enumerate(times):
        assert (p[k], v[k]) == naive(1.0, 8.0, -2.0, float(t))
