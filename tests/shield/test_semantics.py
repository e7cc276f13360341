"""Semantic actions: how many there are, and that their trajectories reach their goals."""

import numpy as np
import pytest

from rss_shield.shield.definitions.semantics import (
    AHEAD,
    BEHIND,
    LANE,
    LIMITS,
    NEIGHBOUR,
    NONE,
    PUSH,
    RELATION,
    ROLLOUT_FIELDS,
    SPEED,
    A,
    Goals,
    S,
    U,
    V,
    Y,
    number_of_actions,
    rollout,
    semantic_actions,
    value,
)

DT = 0.1
FREE = Goals(0.0, 20.0, NONE, 0.0, 0.0, 0.0, 0.0, np.inf, 0.0)


def drive(goals, v=20.0, y=0.0, push="brisk", seconds=30.0, u=0.0):
    out = np.zeros((round(seconds / DT), ROLLOUT_FIELDS))
    rollout(0.0, v, y, u, 0.0, goals, LIMITS[push], DT, out)
    return out


def test_the_number_of_actions_is_linear_in_neighbours_and_in_lanes():
    counts = [len(semantic_actions(3, n, (0.5, 1.0), 2)) for n in range(6)]
    assert counts == [number_of_actions(3, n, 2, 2) for n in range(6)]
    assert len(set(np.diff(counts))) == 1 and counts[0] == 12
    lanes = [len(semantic_actions(lanes, 4, (1.0,), 1)) for lanes in range(1, 5)]
    assert lanes == [9, 18, 27, 36]


def test_every_combination_is_there_once():
    actions = semantic_actions(2, 3, (0.6, 0.8, 1.0), 2)
    assert len(np.unique(actions, axis=0)) == len(actions) == 2 * 7 * 3 * 2
    assert set(actions[:, LANE]) == {0, 1} and set(actions[:, SPEED]) == {0.6, 0.8, 1.0}
    assert set(actions[:, PUSH]) == {0, 1}
    assert {(r, j) for r, j in actions[:, [RELATION, NEIGHBOUR]]} == {
        (NONE, -1), *((side, j) for side in (BEHIND, AHEAD) for j in range(3))
    }  # fmt: skip


@pytest.mark.parametrize("push", LIMITS)
@pytest.mark.parametrize(("v", "wanted"), [(10.0, 25.0), (30.0, 12.0), (20.0, 0.0)])
def test_a_speed_goal_is_reached(push, v, wanted):
    out = drive(FREE._replace(v_wanted=wanted), v=v, push=push, seconds=60.0)
    assert out[-1, V] == pytest.approx(wanted, abs=0.05)
    assert out[:, V].min() >= 0.0


@pytest.mark.parametrize("push", LIMITS)
@pytest.mark.parametrize("y", [4.0, -3.5, 0.3])
def test_the_lateral_goal_is_reached_without_overshooting(push, y):
    out = drive(FREE._replace(y=y), push=push)
    assert out[-1, Y] == pytest.approx(y, abs=1e-3) and out[-1, U] == pytest.approx(0.0, abs=1e-3)
    assert np.all(out[:, Y] * np.sign(y) <= abs(y) + 1e-6)


@pytest.mark.parametrize("push", LIMITS)
def test_no_trajectory_pushes_harder_than_its_limits(push):
    limits = LIMITS[push]
    for goals in (FREE._replace(y=4.0, v_wanted=30.0), FREE._replace(relation=BEHIND, s_other=15.0, v_other=10.0)):
        out = drive(goals, push=push)
        assert out[:, A].max() <= limits.a_accel + 1e-9 and out[:, A].min() >= -limits.a_brake - 1e-9
        assert np.abs(np.diff(out[:, A])).max() <= limits.jerk * DT + 1e-9
        assert np.abs(np.diff(out[:, U])).max() <= limits.a_lat * DT + 1e-9
        np.testing.assert_allclose(np.diff(out[:, Y]), out[1:, U] * DT, atol=1e-12)


@pytest.mark.parametrize("headway", [1.0, 2.0])
@pytest.mark.parametrize("v_other", [15.0, 20.0])
def test_a_headway_behind_somebody_converges_and_so_does_one_ahead(headway, v_other):
    goals = FREE._replace(v_wanted=30.0, s_other=40.0, v_other=v_other, gap=7.0, headway=headway)
    behind = drive(goals._replace(relation=BEHIND), seconds=60.0)
    s_other = 40.0 + v_other * 60.0
    assert s_other - behind[-1, S] == pytest.approx(7.0 + headway * v_other, abs=0.1)
    assert behind[-1, V] == pytest.approx(v_other, abs=0.05)
    ahead = drive(goals._replace(relation=AHEAD), seconds=60.0)
    assert ahead[-1, S] - s_other == pytest.approx(7.0 + headway * v_other, abs=0.1)
    assert ahead[-1, V] == pytest.approx(v_other, abs=0.05)
    # who may not drive faster never gets ahead
    slow = drive(goals._replace(relation=AHEAD, v_wanted=v_other), v=v_other, seconds=60.0)
    assert slow[-1, S] < s_other


@pytest.mark.parametrize("push", LIMITS)
@pytest.mark.parametrize("v_place", [0.0, 8.0])
def test_a_place_is_passed_no_faster_than_it_allows(push, v_place):
    out = drive(FREE._replace(s_place=250.0, v_place=v_place), push=push, seconds=90.0)
    passing = np.flatnonzero(out[:, S] >= 250.0)
    if v_place == 0.0:
        assert len(passing) == 0 and out[-1, S] > 249.0 and out[-1, V] < 0.1
    else:
        assert out[passing[0], V] <= v_place + 0.3
        assert out[-1, V] == pytest.approx(20.0, abs=0.1)  # and after it the speed goal counts again


def test_the_value_is_the_mean_reward():
    assert value(np.array([1.0, 2.0, 6.0])) == 3.0
