"""Lane coordinates of chains of straight and curved pieces, oriented boxes, signed gaps."""

import numpy as np
import pytest

from rss_shield.shield.geometry import half_extents, largest_half_extents, locate, make_road, signed_gap, wrap_angle

STRAIGHT, LEFT, RIGHT = 0.0, -1 / 40, 1 / 25  # curvatures [1/m]; positive turns right, y points right
ROADS = {
    "straight": [(STRAIGHT, 100.0)],
    "right arc": [(RIGHT, 35.0)],
    "left arc": [(LEFT, 60.0)],
    "straight, right arc, straight": [(STRAIGHT, 50.0), (RIGHT, 40.0), (STRAIGHT, 50.0)],
    "left arc, straight": [(LEFT, 60.0), (STRAIGHT, 30.0)],
    "s-curve": [(RIGHT, 30.0), (LEFT, 45.0)],
}


def build(pieces, x=3.0, y=-7.0, heading=0.4):
    """Chain of (curvature, length), smooth at the joints, in the complex plane: a heading is exp(i psi)."""
    position, arc, rows = complex(x, y), 0.0, []
    for kappa, length in pieces:
        rows.append((position.real, position.imag, heading, kappa, length, arc))
        turn = 1j * kappa * length
        position += np.exp(1j * heading) * (length if kappa == 0.0 else length * (np.exp(turn) - 1.0) / turn)
        heading, arc = heading + kappa * length, arc + length
    return make_road(rows)


def at(road, s, y):
    """Position and lane heading at arc length `s` and lateral offset `y`; straight on beyond both ends."""
    k = int(np.clip(np.searchsorted(road[:, 5], s, side="right") - 1, 0, len(road) - 1))
    x0, y0, heading, kappa, length, arc = road[k, :6]
    along = s - arc
    curved = float(np.clip(along, 0.0, length))
    position = complex(x0, y0)
    if kappa == 0.0:
        position += np.exp(1j * heading) * curved
    else:
        position += np.exp(1j * heading) * (np.exp(1j * kappa * curved) - 1.0) / (1j * kappa)
    heading += kappa * curved
    position += np.exp(1j * heading) * (along - curved + 1j * y)
    return position.real, position.imag, heading


# ---------------------------------------------------------------- lane coordinates


def test_a_straight_lane_by_hand():
    # along the y axis of the plane: what is right of it has smaller x
    road = make_road([[2.0, 0.0, np.pi / 2, 0.0, 100.0, 1000.0]])
    assert locate(road, -1.0, 30.0) == pytest.approx((1030.0, 3.0, np.pi / 2, 0.0))


def test_a_right_turn_around_the_origin_by_hand():
    # radius 50 about the origin, from (50, 0) towards (0, 50): the centre is on the right
    road = make_road([[50.0, 0.0, np.pi / 2, 1 / 50, 50.0 * np.pi, 0.0]])
    assert locate(road, 0.0, 51.0) == pytest.approx((25.0 * np.pi, -1.0, np.pi, 1 / 50))
    assert locate(road, 36.0, 36.0)[:2] == pytest.approx((12.5 * np.pi, 50.0 - 36.0 * np.sqrt(2.0)))


def test_a_left_turn_by_hand():
    # radius 50 about (0, -50), from the origin along x: the centre is on the left
    road = make_road([[0.0, 0.0, 0.0, -1 / 50, 60.0, 0.0]])
    x, y = 52.0 * np.sin(0.5), -50.0 + 52.0 * np.cos(0.5)
    assert locate(road, x, y) == pytest.approx((25.0, 2.0, -0.5, -1 / 50))


@pytest.mark.parametrize("name", ROADS)
def test_lane_coordinates_survive_a_round_trip(name):
    road = build(ROADS[name])
    total = road[-1, 5] + road[-1, 4]
    for s in np.linspace(-25.0, total + 25.0, 101):
        for y in (-6.0, -1.7, 0.0, 0.3, 5.5):
            px, py, heading = at(road, s, y)
            s_back, y_back, heading_back, _ = locate(road, px, py)
            assert (s_back, y_back) == pytest.approx((s, y), abs=1e-9)
            assert np.exp(1j * heading_back) == pytest.approx(np.exp(1j * heading), abs=1e-9)


@pytest.mark.parametrize("name", ROADS)
def test_curvature_is_that_of_the_piece_and_zero_beyond_the_ends(name):
    road = build(ROADS[name])
    for kappa, length, arc in road[:, [3, 4, 5]]:
        assert locate(road, *at(road, arc + 0.5 * length, 1.0)[:2])[3] == kappa
    assert locate(road, *at(road, -5.0, 1.0)[:2])[3] == 0.0
    assert locate(road, *at(road, road[-1, 5] + road[-1, 4] + 5.0, 1.0)[:2])[3] == 0.0


@pytest.mark.parametrize("name", ROADS)
@pytest.mark.parametrize("psi", [0.0, 0.3, -1.2])
def test_lane_speeds_are_the_speed_split_by_the_angle_to_the_lane(name, psi):
    # an inner metre is shorter: ds/dt = v cos(psi) / (1 - kappa y), dy/dt = v sin(psi)
    road, step = build(ROADS[name]), 1e-5
    for s in np.linspace(3.0, road[-1, 5] + road[-1, 4] - 3.0, 7):
        for y in (-2.0, 0.0, 3.0):
            px, py, heading = at(road, s, y)
            kappa = locate(road, px, py)[3]
            dx, dy = step * np.cos(heading + psi), step * np.sin(heading + psi)
            s_1, y_1 = locate(road, px - dx, py - dy)[:2]
            s_2, y_2 = locate(road, px + dx, py + dy)[:2]
            assert (s_2 - s_1) / (2 * step) == pytest.approx(np.cos(psi) / (1.0 - kappa * y), abs=1e-6)
            assert (y_2 - y_1) / (2 * step) == pytest.approx(np.sin(psi), abs=1e-6)


@pytest.mark.parametrize(
    ("turn", "s"),
    [(1.5 * np.pi, 25.0 * 1.2 * np.pi), (2.4, 25.0 * 2.4 + 25.0)],
    ids=["on the far side of three quarters of a circle", "25 m behind an arc of 137 degrees"],
)
def test_one_arc_may_turn_far(turn, s):
    road = build([(RIGHT, 25.0 * turn)])
    px, py, _ = at(road, s, 1.0)
    assert locate(road, px, py)[:2] == pytest.approx((s, 1.0))


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(0.5, 0.5), (3.5, 3.5 - 2 * np.pi), (-3.5, 2 * np.pi - 3.5), (7.0, 7.0 - 2 * np.pi)]
)
def test_angles_are_wrapped_around_zero(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)


# ---------------------------------------------------------------- boxes


def corners_reach(length, width, heading):
    """Farthest a corner of the turned box lies from its centre, along and across."""
    corners = np.array([complex(a * length / 2, b * width / 2) for a in (-1, 1) for b in (-1, 1)])
    turned = corners * np.exp(1j * heading)
    return turned.real.max(), turned.imag.max()


@pytest.mark.parametrize(
    ("heading", "along", "across"),
    [(0.0, 2.5, 1.0), (0.1, 2.58734383, 1.244587707), (np.pi / 4, 2.474873734, 2.474873734), (np.pi / 2, 1.0, 2.5)],
)
def test_half_extents_of_a_5_by_2_metre_box(heading, along, across):
    assert half_extents(5.0, 2.0, heading) == pytest.approx((along, across), abs=1e-9)


def test_half_extents_are_where_the_corners_are():
    rng = np.random.default_rng(1)
    for _ in range(200):
        length, width, heading = rng.uniform(0.5, 9.0), rng.uniform(0.5, 3.0), rng.uniform(-4.0, 4.0)
        assert half_extents(length, width, heading) == pytest.approx(corners_reach(length, width, heading), abs=1e-12)


@pytest.mark.parametrize("bound", [0.0, 0.05, 0.1, 0.3, 0.6, 1.5])
def test_the_largest_half_extents_hold_for_every_angle_up_to_the_bound_and_are_reached(bound):
    along, across = largest_half_extents(5.0, 2.0, np.sin(bound))
    reached = np.array([corners_reach(5.0, 2.0, angle) for angle in np.linspace(-bound, bound, 4001)])
    assert [along, across] == pytest.approx(reached.max(axis=0), abs=1e-6)
    assert (reached <= [along + 1e-12, across + 1e-12]).all()


def test_without_a_bound_no_half_extents_are_promised():
    assert largest_half_extents(5.0, 2.0, 1.0) == (0.0, 0.0)


@pytest.mark.parametrize(("distance", "gap"), [(10.0, 5.5), (-10.0, 5.5), (4.5, 0.0), (3.0, -1.5), (0.0, -4.5)])
def test_gaps_are_bumper_to_bumper_and_negative_where_boxes_overlap(distance, gap):
    assert signed_gap(distance, 2.5, 2.0) == gap
