"""Where pedestrians may be on a car's way, and from when on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.definitions.pedestrians import WALKS, reach_disc
from rss_shield.shield.junctions.conflict_areas import CELL
from rss_shield.shield.people.reach import note_reach, note_route, sampled_room

WALK, DT = WALKS["paper"], 1 / 15
HALF = 1.2  # half the width of the way [m]
BODY = 0.36


def arrivals(s, y, heading, v, radius=BODY):
    out = np.full(200, np.inf)
    note_reach(out, s, y, heading, v, HALF, radius, WALK, DT)
    return out


def test_who_stands_owns_half_a_metre():
    # 0.25 + 0.25 m (worked number of the definition), the body's 0.36 m and what frames add: 0.5 / 15 + 2 / 15^2 / 8
    room = 0.5 + BODY + 0.5 / 15 + 2 / 225 / 8
    assert sampled_room(0.0, WALK, DT) == pytest.approx(0.5 / 15 + 2 / 225 / 8)
    assert np.isinf(arrivals(50.0, HALF + room + 0.001, 0.0, 0.0)).all()
    near = arrivals(50.0, HALF + room - 0.01, 0.0, 0.0)
    # it touches the way at one place only, 50 m along it: cells 99 and 100
    assert np.flatnonzero(np.isfinite(near)).tolist() == [99, 100]
    # t^2 = 0.25 takes 0.5 s, then 1 m/s until it stands, and a frame is taken off
    assert near[99] > 0.5


def test_who_is_on_the_way_is_there_now():
    on = arrivals(50.0, 0.5, 0.0, 0.0)
    assert on[100] == 0.0


def test_a_runner_comes_by_its_own_speed():
    # 2.78 m/s from 2.00 m beside the way: x(t) = 2.78 t + t^2 = 2.00 - 0.36 - 0.128 after 0.461 s
    t = arrivals(50.0, HALF + 2.0, -np.pi / 2, 2.78)
    assert 0.461 - 2.5 * DT < t[100] <= 0.461
    # 1 m to the side it cannot be as soon
    assert t[102] > t[100]


def test_at_the_end_it_is_what_the_definition_says():
    ahead, radius = reach_disc(1.5, WALK)
    room = sampled_room(1.5, WALK, DT)
    found = arrivals(50.0, 0.0, 0.0, 1.5, 0.0)  # it walks along the middle of the way
    last = np.flatnonzero(np.isfinite(found))[-1]
    assert last == int(np.floor((50.0 + ahead + radius + room) / CELL))


@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.0, 3.0), st.floats(-np.pi, np.pi), st.floats(1.7, 6.0), st.floats(0.0, 2.0), st.floats(-np.pi, np.pi),
    st.floats(0.0, 4.0),
)  # fmt: skip
def test_nobody_who_keeps_the_definition_is_there_sooner(v, heading, y, a, turn, brake):
    """Any acceleration during the response time, then any braking from b_min on, frame by frame."""
    times = arrivals(50.0, y, heading, v)
    position, velocity = np.array([50.0, y]), v * np.array([np.cos(heading), np.sin(heading)])
    push = a * np.array([np.cos(turn), np.sin(turn)])
    n_response = round(WALK.response_time / DT)
    for n in range(60):
        if abs(position[1]) < HALF + BODY:
            i = int(position[0] / CELL)
            assert times[i] <= n * DT
        position = position + velocity * DT
        if n < int(WALK.response_time / DT):
            velocity = velocity + push * DT
        elif n >= n_response:
            speed = np.hypot(*velocity)
            slower = max(speed - max(brake, WALK.a_min_brake) * DT, 0.0)
            velocity = velocity * (slower / speed) if speed > 0.0 else velocity


def test_on_a_crossing_the_whole_strip_counts():
    out = np.full(200, np.inf)
    # from rest, 1 m takes 1 s at 2 m/s^2; a frame is taken off
    note_route(out, 40.0, 44.0, 1.0, 0.0, 2.78, WALK, DT)
    assert np.flatnonzero(np.isfinite(out)).tolist() == list(range(80, 89))
    assert out[80] == pytest.approx(1.0 - DT)


def test_nobody_accelerates_on_a_crossing_beyond_what_is_reasonable():
    out = np.full(200, np.inf)
    # 1.78 m/s^2 ... at 2 m/s already and 2 m/s at most: 4 m take 2 s
    note_route(out, 40.0, 44.0, 4.0, 2.0, 2.0, WALK, DT)
    assert out[80] == pytest.approx(2.0 - DT)
