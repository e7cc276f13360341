"""Hole H23: danger freezes what is owed. Role, axis and side of Defs. 3-10 are those of the threshold, for as long as
the danger lasts; so the ego also owes what the situation asks for as it is now, with a response time of its own."""

import numpy as np
import pytest
from adversary import OVERTAKES, play, world
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.response import CORRECT, FRONT, LAT, LON, REAR
from rss_shield.shield.lanes.judge import audit_command
from rss_shield.shield.lanes.memory import MEMORY, Bounds, merge, owes_braking, owes_no_approach, remember
from rss_shield.shield.lanes.pair import ROAD_USER, Pair
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.verdicts import KEPT, TOO_WEAK, TOWARD, VERDICTS

DT = 0.1
CAR = PRESETS["slides"].ego._replace(response_time=0.3)  # brakes 4 to 8; lateral 0.2 and 0.8 m/s^2
FREE = Bounds(-8.0, 3.5, 9.0, 9.0, 9.0, 9.0, 0.0)


def seen(ahead, side=1.0, gap_lon=-1.0, gap_lat=0.2, safe_lon=False, safe_lat=False, w_ego=0.0, opposite=False):
    """What one sample says of a pair; in danger unless told otherwise."""
    return Pair(
        safe_lon, safe_lat, -1.0, -1.0, gap_lon, gap_lat, ahead, opposite, side, 20.0, 20.0, w_ego, 0.0, False, 0.0
    )


def user(own_lane=True):
    record = np.zeros(1, ROAD_USER)[0]
    record["half_length"], record["half_width"], record["speed"], record["cos"] = 2.5, 1.0, 20.0, 1.0
    record["in_own_lane"] = own_lane
    return record


def remembered(*samples, own_lane=True):
    memory = np.zeros(1, MEMORY)[0]
    for sample in samples:
        remember(memory, sample, user(), user(own_lane), DT)
    return memory


SAFE_BEHIND_EGO = seen(False, safe_lon=True, gap_lon=30.0)
SAFE_BESIDE = seen(False, safe_lat=True, gap_lat=3.0)


def test_the_clock_of_a_role_starts_when_the_ego_falls_behind():
    # the other comes too close from behind: for two frames the ego is in front, then it is passed
    memory = remembered(SAFE_BEHIND_EGO, seen(False), seen(False), seen(True))
    assert (memory["axes"], memory["since"], memory["ego_is_rear"]) == (LON, 3, False)
    assert (memory["role_now"], memory["role_for"]) == (REAR, 0)
    assert owes_braking(memory, Rules()) == 2
    assert owes_braking(memory, Rules(present_duties=False)) == 0


def test_where_nothing_has_changed_the_clock_is_that_of_the_threshold():
    memory = remembered(seen(True, safe_lon=True), seen(True), seen(True))
    assert memory["role_for"] == memory["side_for"] == memory["since"] == 2


def test_at_first_sight_danger_has_lasted_for_a_frame():
    memory = remembered(seen(True))
    assert memory["role_for"] == memory["side_for"] == memory["since"] == 1


def test_the_clock_of_a_side_starts_with_the_speed_that_the_ego_then_has_toward_it():
    memory = remembered(SAFE_BESIDE, seen(False, side=1.0), seen(False, side=-1.0, w_ego=0.7), seen(False, side=-1.0))
    assert (memory["side"], memory["side_now"], memory["side_for"], memory["w_side"]) == (1.0, -1.0, 1, 0.7)


def test_who_keeps_half_a_metre_aside_is_not_in_the_way():
    aside = seen(True, gap_lat=0.31)
    assert remembered(SAFE_BEHIND_EGO, seen(False), aside)["role_now"] == FRONT
    assert remembered(SAFE_BEHIND_EGO, seen(False), aside._replace(gap_lat=0.29))["role_now"] == REAR
    assert remembered(SAFE_BEHIND_EGO, seen(False), aside._replace(w_other=0.11))["role_now"] == REAR


def test_who_is_squarely_ahead_is_on_no_side():
    # half widths 1 m: squarely from an overlap of 1 m on, and only where apart along the lane
    assert remembered(seen(True, gap_lon=4.0, gap_lat=-1.1))["side_now"] == 0.0
    assert remembered(seen(True, gap_lon=4.0, gap_lat=-0.9))["side_now"] == 1.0
    assert remembered(seen(True, gap_lon=-0.1, gap_lat=-1.1))["side_now"] == 1.0


def test_who_comes_toward_the_ego_asks_for_the_braking_of_its_lane():
    ahead = seen(True, opposite=True)
    assert remembered(SAFE_BESIDE, ahead, own_lane=False)["role_now"] == CORRECT
    assert remembered(SAFE_BESIDE, seen(False, opposite=True))["role_now"] == FRONT  # it has passed


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        # in front and beside since the threshold: as fast as 0.2 * rho in the response time, then slower by 0.8
        ((SAFE_BESIDE, seen(False)), (3.5, 9.0, 0.04)),
        ((SAFE_BEHIND_EGO, seen(False)), (3.5, 9.0, 0.04)),  # Def. 10 asks for nothing here
        ((SAFE_BEHIND_EGO, seen(False), seen(True)), (-4.0, 9.0, 0.06)),
        ((SAFE_BEHIND_EGO, seen(False), seen(True, side=-1.0, w_ego=0.5)), (-4.0, 0.52, 9.0)),
        ((SAFE_BEHIND_EGO, *3 * [seen(True)]), (-4.0, 9.0, 0.06)),
        ((SAFE_BEHIND_EGO, *4 * [seen(True)]), (-4.0, 9.0, 0.0)),
        ((SAFE_BEHIND_EGO, seen(False, gap_lon=2.0, gap_lat=-1.5)), (3.5, 9.0, 9.0)),  # squarely behind
        ((seen(True, safe_lon=True, gap_lat=-1.5), seen(True, gap_lon=9.0, gap_lat=-1.5)), (-4.0, 9.0, 9.0)),
        ((seen(False), seen(True)), (-4.0, 9.0, 0.06)),  # inherited, then passed
        ((seen(True),), (-8.0, 9.0, 0.04)),  # inherited, behind from the start
    ],
)
def test_bounds_by_hand(samples, expected):
    bounds = merge(FREE, remembered(*samples), CAR, Rules(), DT)
    assert (bounds.a_upper, bounds.left, bounds.right) == pytest.approx(expected)
    assert bounds.a_lower == -8.0


def test_duties_never_contradict_and_those_of_now_only_tighten():
    rng = np.random.default_rng(0)
    for _ in range(300):
        bounds = before = FREE
        for _ in range(rng.integers(1, 5)):  # road users
            memory = np.zeros(1, MEMORY)[0]
            for _ in range(rng.integers(1, 12)):
                flags = rng.random(5) < 0.3
                sample = seen(
                    bool(flags[0]),
                    side=rng.choice([-1.0, 1.0]),
                    gap_lon=rng.uniform(-3.0, 3.0),
                    gap_lat=rng.uniform(-2.0, 1.0),
                    safe_lon=bool(flags[1]),
                    safe_lat=bool(flags[2]),
                    w_ego=rng.uniform(0.0, 2.0),
                    opposite=bool(flags[3]),
                )
                remember(memory, sample, user(), user(bool(flags[4])), DT)
            bounds = merge(bounds, memory, CAR, Rules(), DT)
            before = merge(before, memory, CAR, Rules(present_duties=False), DT)
        assert bounds.a_lower <= bounds.a_upper
        assert min(bounds[2:6]) >= 0.0
        assert all(now <= then for now, then in zip(bounds[1:6], before[1:6], strict=True))


@pytest.mark.parametrize(
    ("samples", "command", "expected"),
    [
        ((SAFE_BEHIND_EGO, seen(False), seen(True)), Command(3.5, 0.0), KEPT),  # it has just been passed
        ((SAFE_BEHIND_EGO, seen(False), *4 * [seen(True)]), Command(0.0, 0.0), TOO_WEAK),
        ((SAFE_BEHIND_EGO, seen(False), *4 * [seen(True)]), Command(-4.0, 0.0), KEPT),
        ((SAFE_BEHIND_EGO, *9 * [seen(False)]), Command(0.0, 0.01), TOWARD),  # 0.2 m/s into a car beside it
        ((SAFE_BEHIND_EGO, *9 * [seen(False)]), Command(0.0, -0.01), KEPT),
        ((SAFE_BEHIND_EGO, *9 * [seen(False, gap_lon=2.0, gap_lat=-1.5)]), Command(0.0, 0.01), KEPT),
    ],
)
def test_the_judge_knows_the_same_duties(samples, command, expected):
    assert audit_command(remembered(*samples), user(), command, 0.0, CAR, DT)[0] == expected


# ---------------------------------------------------------------- who uses the hole


def overtaken(dt, start_safe, **rules):
    """Episodes among drivers who overtake."""
    w = world(dt=dt, frames=int(30 / dt), lawful=False, start_safe=start_safe, vice=OVERTAKES, rules=rules)
    return play(1000, w, seed=5)


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
@pytest.mark.parametrize("start_safe", [True, False], ids=["safe at first sight", "in danger at first sight"])
def test_who_overtakes_without_distance_and_then_slows_gently_is_never_touched(dt, start_safe):
    episodes = overtaken(dt, start_safe)
    assert (episodes["contact"] == -1).all()
    assert episodes["broken"].sum() == 0
    assert (episodes["answered_now"] > 0).sum() > 50


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
@pytest.mark.parametrize("start_safe", [True, False], ids=["safe at first sight", "in danger at first sight"])
def test_by_the_letter_of_the_definitions_they_are_rammed_and_the_judge_knows_by_whom(dt, start_safe):
    episodes = overtaken(dt, start_safe, present_duties=False)
    hit = episodes[episodes["contact"] >= 0]
    assert len(hit) > 10
    assert {VERDICTS[v] for v in hit["verdict"]} <= {"ego", "both"}


class Beside(Vehicle):
    """Comes from behind in the gap between two lanes and then drives beside the ego, steadily."""

    ego: Vehicle

    def act(self, action=None):
        behind = self.ego.position[0] - self.position[0]
        wanted = min(self.ego.speed + 9, 39) if behind > 40 else self.ego.speed + np.clip(0.4 * behind, -3, 3)
        super().act({"acceleration": np.clip((wanted - self.speed) / 0.4, -3.0, 3.0), "steering": 0.0})


@pytest.mark.parametrize(("side", "offset", "wait"), [(1, 3.05, 30), (-1, 3.0, 40), (1, 2.9, 50), (-1, 2.95, 33)])
def test_an_ego_does_not_change_lanes_into_a_car_that_has_long_been_beside_it(side, offset, wait):
    config = {"vehicles_count": 1, "duration": 80, "lanes_count": 3}
    env = make("highway-fast-v0", config=config, record=True)
    env.reset(seed=8)
    base = env.unwrapped
    ego, lane = base.vehicle, base.road.network.get_lane(("0", "1", 1))
    ego.position = np.array(lane.position(lane.local_coordinates(ego.position)[0], 0))
    ego.lane_index = ego.target_lane_index = ("0", "1", 1)
    ego.lane = lane
    other = Beside(base.road, ego.position + np.array([-140, side * offset]), 0.0, 30.0)
    other.ego = ego
    base.road.vehicles[:] = [ego, other]
    change = 2 if side > 0 else 0
    for k in range(wait + 8):
        *_, terminated, _, info = env.step(1 if k < wait else change)
        assert not terminated
    assert abs(ego.position[0] - other.position[0]) < 5.0
    assert info["blame"] == ""
    assert info["shield"]["response"] != ""
    assert info["episode_broken_duties"] == 0
    assert not env.audit().duty.any()


@pytest.mark.parametrize("rules", [Rules(), Rules(present_duties=False)], ids=["shielded", "by the letter"])
def test_no_approach_is_owed_to_who_is_on_a_side_only(rules):
    aside, square = remembered(seen(True)), remembered(seen(True, gap_lon=3.0, gap_lat=-1.5))
    assert owes_no_approach(aside, rules) == rules.present_duties
    assert not owes_no_approach(square, rules)


def test_axes_of_a_cut_in_are_lateral_and_the_ego_brakes_all_the_same():
    # hole H6 is the special case: the last safe axis was the lateral one
    memory = remembered(seen(True, safe_lat=True, gap_lat=2.0), seen(True))
    assert memory["axes"] == LAT
    assert owes_braking(memory, Rules()) == 2
