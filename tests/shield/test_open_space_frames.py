"""Open space in whole frames: what a car of highway-env may occupy, what it has in mind, and Def. 22 on one line."""

import math

import numpy as np
import pytest
from highway_env.utils import are_polygons_intersecting
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.shield.definitions.longitudinal import d_min_opposite_direction, d_min_same_direction
from rss_shield.shield.definitions.occupancy import MAX_STEPS, ROW_FIELDS
from rss_shield.shield.definitions.separation import extent
from rss_shield.shield.definitions.unstructured import BOTH_BRAKE, DANGEROUS, FIRST_BRAKES, who_brakes
from rss_shield.shield.open_space.frames import (
    CAR,
    FIXED,
    LOT,
    MAX_SLIP,
    PEDESTRIAN,
    USER,
    WHEELS,
    fastest,
    sampled_occupancy,
    slowest,
)
from rss_shield.shield.params import PRESETS

DT = 1 / 15
CAR_PARK = PRESETS["parking"].other


def user(x=0.0, y=0.0, heading=0.0, speed=0.0, kind=CAR, length=5.0, width=2.0):
    record = np.zeros(1, USER)[0]
    record["x"], record["y"], record["heading"], record["speed"] = x, y, heading, speed
    record["half_length"], record["half_width"], record["kind"] = length / 2, width / 2, kind
    return record


def occupancy(one, driver=CAR_PARK, dt=DT):
    braking, going_on = np.zeros((2, MAX_STEPS, ROW_FIELDS))
    return sampled_occupancy(one, driver, dt, braking, going_on)


def motions(one, driver, brakes, rng, n, frames, dt=DT):
    """`[frames + 1, n, 4]` x, y, heading, speed of a car under random commands, by highway-env's equations."""
    x, y, heading, v = (np.full(n, float(one[name])) for name in ("x", "y", "heading", "speed"))
    track = [np.stack([x, y, heading, v], -1)]
    response = round(driver.response_time / dt)
    wheels = np.zeros(n)
    for k in range(frames):
        free = not brakes or k < response
        if free and k % 2 == 0:
            choice = rng.random(n)
            wheels = np.where(choice < 0.4, WHEELS, np.where(choice < 0.8, -WHEELS, rng.uniform(-WHEELS, WHEELS, n)))
        elif not free and k == response:
            wheels = np.where(rng.random(n) < 0.5, wheels, rng.choice([-WHEELS, 0.0, WHEELS], n))
        gear = np.where(v < 0.0, -1.0, np.where(v > 0.0, 1.0, rng.choice([-1.0, 1.0], n)))
        low = np.array([slowest(g * s, driver, dt) for g, s in zip(gear, v, strict=True)])
        high = np.array([fastest(g * s, driver, dt) for g, s in zip(gear, v, strict=True)])
        if not free:
            low = np.maximum(gear * v - driver.a_max_brake * dt, 0.0)
            high = np.maximum(gear * v - driver.a_min_brake * dt, 0.0)
        share = rng.random(n)
        share = np.where(share < 0.35, 0.0, np.where(share < 0.75, 1.0, share))
        slip = np.arctan(0.5 * np.tan(wheels))
        x, y = x + v * np.cos(heading + slip) * dt, y + v * np.sin(heading + slip) * dt
        heading = heading + v * np.sin(slip) / float(one["half_length"]) * dt
        v = gear * (low + share * (high - low))
        track.append(np.stack([x, y, heading, v], -1))
    return np.array(track)


def beyond(one, driver, brakes, rng, assumed=None, n=200, ahead=0.0):
    """How far boxes get out of the occupancy at worst [m]; `ahead`: frames that a test of contact looks ahead."""
    found = occupancy(one, assumed or driver)
    rows, steps = (found.braking if brakes else found.going_on), min(found.bounds.steps, 40)
    track = motions(one, driver, brakes, rng, n, steps)
    worst = -np.inf
    half, width = float(one["half_length"]), float(one["half_width"])
    for angle in np.arange(12) * np.pi / 6 + 0.05:
        nx, ny = math.cos(angle), math.sin(angle)
        for k in range(steps):
            start, end = extent(found, rows, k, nx, ny)
            for pose, bound in ((track[k], start), (track[k + 1], end)):
                x, y, heading, _ = pose.T
                along, across = nx * np.cos(heading) + ny * np.sin(heading), ny * np.cos(heading) - nx * np.sin(heading)
                reach = (x - found.mover.x) * nx + (y - found.mover.y) * ny
                reach = reach + half * np.abs(along) + width * np.abs(across)
                worst = max(worst, float((reach - bound).max()))
    return worst


STATES = [(0.0, 0.0), (0.3, 1.0), (2.5, -2.0), (5.0, 0.4), (-1.5, 2.5), (-3.5, -0.7)]


@pytest.mark.parametrize("brakes", [True, False])
def test_no_car_leaves_its_occupancy_whatever_it_does(brakes):
    rng = np.random.default_rng(1)
    for speed, heading in STATES:
        assert beyond(user(2.0, -1.0, heading, speed), CAR_PARK, brakes, rng) < 1e-6


WORSE = {
    "responds later": CAR_PARK._replace(response_time=0.8),
    "accelerates harder": CAR_PARK._replace(a_max_accel=4.0),
    "brakes less": CAR_PARK._replace(a_min_brake=2.0),
}


@pytest.mark.parametrize("name", WORSE)
def test_a_car_that_does_what_nobody_may_leaves_it(name):
    # boxes are widened for the simulator's test of contact; at rest, where it matters, by nothing
    rng = np.random.default_rng(2)
    assert max(beyond(user(0.0, 0.0, 0.3, v), WORSE[name], True, rng, CAR_PARK) for v in (0.0, 3.0, -3.0)) > 0.02


def test_a_pedestrian_may_walk_anywhere_and_a_wall_nowhere():
    walker = occupancy(user(speed=1.0, kind=PEDESTRIAN, length=0.6, width=0.6), LOT.pedestrian)
    wall = occupancy(user(kind=FIXED, length=20.0, width=1.0))
    # 1 m/s and 2 m/s^2 up to 2 m/s: 1 + 2/15 + ... in frames until the cap is reached, then 2
    covered, v = 0.0, 1.0
    for _ in range(20):
        covered, v = covered + v * DT, min(v + 2.0 * DT, 2.0)
    for angle in np.linspace(-3.0, 3.0, 7):
        nx, ny = math.cos(angle), math.sin(angle)
        corner, widened = math.hypot(0.3, 0.3), 0.5 * 2.0 * DT
        assert extent(walker, walker.going_on, 19, nx, ny)[1] == pytest.approx(covered + corner + widened)
        assert extent(wall, wall.braking, 19, nx, ny)[1] == pytest.approx(10.0 * abs(nx) + 0.5 * abs(ny))


# ---------------------------------------------------------------- on one line it is Defs. 1 and 2


def smallest_safe_gap(pair_at):
    low, high = 0.0, 60.0
    assert pair_at(high) != DANGEROUS
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pair_at(middle) == DANGEROUS else (low, middle)
    return high


# a car that can't turn is as long as it likes: its circle is as long as it is. Here wheels are kept straight
def straight(found):
    for rows in (found.braking, found.going_on):
        rows[:, 2:8] = [0.0, 0.0, 1.0, 0.0, 1.0, 0.0]
        rows[:, 0] = np.where(rows[:, 0] > 0.0, rows[:, 0] / math.cos(MAX_SLIP), rows[:, 0])
    return found


@pytest.mark.parametrize(("v_rear", "v_front"), [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (5.0, 5.0), (1.0, 4.0)])
def test_behind_one_another_frames_cost_no_more_than_a_frames_way(v_rear, v_front):
    # who is ahead may back up within its response time as well, which Def. 1 does not know
    rear = CAR_PARK
    back = 0.0 if v_front > CAR_PARK.a_max_brake * 0.4 else 0.6

    def pair_at(gap):
        one, two = user(speed=v_rear), user(x=gap + 5.0, speed=v_front)
        return who_brakes(straight(occupancy(one)), straight(occupancy(two)), 0.0, 1.0)

    needed = d_min_same_direction(v_rear, v_front, rear, rear)
    found = smallest_safe_gap(pair_at)
    assert needed - 1e-9 <= found <= needed + back + 2.0 * (v_rear + v_front + 1.0) * DT + 0.1


@pytest.mark.parametrize(("v_1", "v_2"), [(0.0, 0.0), (4.0, 0.0), (3.0, 2.0), (5.0, 5.0)])
def test_head_on_frames_cost_no_more_than_a_frames_way(v_1, v_2):
    driver = CAR_PARK._replace(a_min_brake_correct=CAR_PARK.a_min_brake)

    def pair_at(gap):
        one, two = user(speed=v_1), user(x=gap + 5.0, heading=np.pi, speed=v_2)
        return who_brakes(straight(occupancy(one)), straight(occupancy(two)), 0.0, 1.0)

    needed = d_min_opposite_direction(v_1, v_2, driver, driver)
    found = smallest_safe_gap(pair_at)
    assert needed - 1e-9 <= found <= needed + 2.0 * (v_1 + v_2 + 1.0) * DT + 0.1
    assert pair_at(found + 1e-6) == BOTH_BRAKE


def test_the_rear_car_has_to_brake_for_the_one_that_drives_ahead():
    rear, front = user(speed=4.0), user(x=14.0, speed=4.5)
    assert who_brakes(straight(occupancy(rear)), straight(occupancy(front)), 0.0, 1.0) == FIRST_BRAKES


# ---------------------------------------------------------------- the simulator's test of contact


@pytest.mark.slow
def test_what_is_apart_is_never_flagged_by_the_simulators_test_of_contact():
    """Two boxes that keep their widened distance for a frame: highway-env sees no contact coming, however they move."""
    rng = np.random.default_rng(3)
    flagged, close = 0, 0
    for _ in range(4000):
        cars = []
        for _ in range(2):
            car = Vehicle(None, rng.uniform(-4.0, 4.0, 2), rng.uniform(-np.pi, np.pi), rng.uniform(-5.0, 5.0))
            cars.append(car)
        states = [user(*car.position, car.heading, car.speed) for car in cars]
        one, two = (occupancy(state) for state in states)
        gap = -np.inf
        for angle in np.arange(72) * np.pi / 36:
            nx, ny = math.cos(angle), math.sin(angle)
            between = (two.mover.x - one.mover.x) * nx + (two.mover.y - one.mover.y) * ny
            reach = max(extent(one, one.braking, 0, nx, ny)) + max(extent(two, two.braking, 0, -nx, -ny))
            gap = max(gap, between - reach)
        moves = [car.velocity * DT for car in cars]
        touching, will_touch, _ = are_polygons_intersecting(*(car.polygon() for car in cars), *moves)
        if gap > 0.0:
            assert not touching and not will_touch
            close += gap < 0.3
        flagged += touching or will_touch
    assert flagged > 500 and close > 30
