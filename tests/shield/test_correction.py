"""The nearest permitted command is the nearest: all others on a grid are farther away."""

import numpy as np
import pytest

from rss_shield.shield.command import Command
from rss_shield.shield.lanes.controller import Danger, Response, respond
from rss_shield.shield.lanes.correction import in_full
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import Bounds
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body, restrict
from rss_shield.shield.params import PRESETS, Rules

DT = 0.2
CAR = PRESETS["simulator"].ego._replace(response_time=0.2)
RULES = Rules()
BODY = Body(2.5, 0.5, 0.0)


def car(speed, heading):
    ego = np.zeros(1, ROAD_USER)[0]
    ego["speed"], ego["heading"], ego["cos"], ego["sin"] = speed, heading, np.cos(heading), np.sin(heading)
    ego["half_length"], ego["half_width"], ego["around"], ego["in_own_lane"] = 2.5, 1.0, np.inf, True
    ego["u"] = speed * np.sin(heading)
    return ego


def is_permitted(a, slip, ego, bounds):
    """May a car on a straight lane do this for a frame? All bounds, one by one."""
    v, psi = ego["speed"], ego["heading"]
    v_next, psi_next = v + a * DT, psi + v * np.sin(slip) / 2.5 * DT
    return (
        (bounds.a_lower <= a)
        & (a <= bounds.a_upper)
        & (v_next >= 0.0)
        & (abs(slip) <= BODY.max_slip)
        & (-bounds.left <= v * np.sin(psi + slip))
        & (v * np.sin(psi + slip) <= bounds.right)
        & (-bounds.left_next <= v_next * np.sin(psi_next))
        & (v_next * np.sin(psi_next) <= bounds.right_next)
        & (abs(np.sin(psi + slip)) <= RULES.heading_bound)
        & (abs(np.sin(psi_next)) <= RULES.heading_bound)
    )


def scenes(count):
    """Random egos that keep their bounds so far, with duties on either axis or both, and wishes."""
    rng = np.random.default_rng(0)
    for _ in range(count):
        ego = car(rng.uniform(3.0, 35.0), rng.uniform(-0.04, 0.04))
        free = always_on(ego, CAR, RULES, DT)
        braking = rng.random() < 0.5
        left, right = (min(side, rng.uniform(0.3, 1.5)) for side in (free.left, free.right))
        drift = ego["speed"] * np.sin(ego["heading"])
        left, right = max(left, -drift, 0.0), max(right, drift, 0.0)
        bounds = Bounds(free.a_lower, -5.0 if braking else free.a_upper, left, right, left, right, free.v_lower)
        yield ego, bounds, Command(rng.uniform(-12.0, 8.0), rng.uniform(-0.3, 0.3))


def test_the_acceleration_changes_least_and_with_it_the_slip():
    """Against every command on a grid: none that is permitted has a nearer acceleration; of those with the same, none
    has a nearer slip."""
    accelerations, slips = np.linspace(-7.0, 4.0, 56), np.linspace(-0.3, 0.3, 2001)
    compared = 0
    for ego, bounds, wish in scenes(120):
        command = restrict(wish, bounds, ego, BODY, RULES, DT)
        reachable = np.array([is_permitted(a, slips, ego, bounds).any() for a in accelerations])
        nearest = abs(accelerations[reachable] - wish.acceleration).min()
        assert abs(command.acceleration - wish.acceleration) <= nearest + 1e-9
        permitted = slips[is_permitted(command.acceleration, slips, ego, bounds)]
        if not len(permitted):
            continue
        compared += 1
        assert is_permitted(command.acceleration, command.slip + 1e-9 * np.array([-1, 0, 1]), ego, bounds).any()
        assert abs(command.slip - wish.slip) <= abs(permitted - wish.slip).min() + 1e-9
    assert compared > 90


@pytest.mark.parametrize("metres", [1.0, 10.0])
def test_no_permitted_command_is_nearer_in_both_axes_together(metres):
    """The projection in the plane, whatever a radian of slip is worth: how much nearer could a command be?

    The axes are coupled by the speed after the frame alone, so it is all but the same.
    """
    accelerations, slips = np.linspace(-6.0, 3.0, 181), np.linspace(-0.3, 0.3, 1201)
    grid_a, grid_slip = np.meshgrid(accelerations, slips, indexing="ij")
    worst = 0.0
    for ego, bounds, wish in scenes(40):
        command = restrict(wish, bounds, ego, BODY, RULES, DT)
        permitted = is_permitted(grid_a, grid_slip, ego, bounds)
        if not permitted.any() or not is_permitted(command.acceleration, command.slip, ego, bounds):
            continue
        far = np.hypot(grid_a - wish.acceleration, metres * (grid_slip - wish.slip))[permitted].min()
        own = np.hypot(command.acceleration - wish.acceleration, metres * (command.slip - wish.slip))
        worst = max(worst, own - far)
    assert worst < 0.01


def danger_of(ego, bounds):
    inf = float("inf")
    return Danger(always_on(ego, CAR, RULES, DT), bounds, bounds, inf, inf, True, 0, 0.0, 0.0, 1, inf)


def test_in_full_the_car_brakes_as_asked_and_straightens():
    ego = car(20.0, 0.02)
    free = always_on(ego, CAR, RULES, DT)
    danger = danger_of(ego, free._replace(a_upper=-5.0))
    near = respond(Command(1.0, 0.005), danger, ego, BODY, RULES, DT)
    assert near.command == Command(-5.0, 0.005)
    full = in_full(near, danger, ego, BODY, RULES, DT)
    assert full.command.acceleration == -5.0
    # 20 m/s * 0.2 s / 2.5 m = 1.6 times the slip is what the heading turns by: straight after this frame
    assert 0.02 + 1.6 * np.sin(full.command.slip) == pytest.approx(0.0, abs=1e-9)


def test_in_full_a_duty_to_the_side_leaves_the_acceleration():
    ego = car(20.0, 0.0)
    free = always_on(ego, CAR, RULES, DT)
    danger = danger_of(ego, free._replace(right=0.0, right_next=0.0))
    near = respond(Command(1.0, 0.01), danger, ego, BODY, RULES, DT)
    assert near.overridden
    assert in_full(near, danger, ego, BODY, RULES, DT).command == pytest.approx((1.0, 0.0))


def test_in_full_nothing_changes_where_no_duty_does():
    ego = car(20.0, 0.0)
    danger = danger_of(ego, always_on(ego, CAR, RULES, DT))
    response = respond(Command(9.0, 0.0), danger, ego, BODY, RULES, DT)
    assert (
        in_full(response, danger, ego, BODY, RULES, DT) == response == Response(Command(3.0, 0.0), False, False, True)
    )
