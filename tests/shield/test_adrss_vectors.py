"""What the test suite of Intel's ad-rss-lib 5.0.0 states (tests/data/adrss-vectors.json), computed by this library.

Speeds and accelerations there are SI with braking negative, lateral values positive to the right; `wheel` is the
answer of the released library at full precision. Its comparisons have a precision of 1e-3. Where this library differs
on purpose, the difference is a test of its own below.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from places import DATA

from rss_shield.shield.definitions.kinematics import (
    reach,
    response_distance,
    speed_after_response,
    speed_envelope,
    stopping_distance,
    time_to_cover,
    time_to_stop,
    travel,
)
from rss_shield.shield.definitions.lateral import approach_no_credit, d_min_lateral
from rss_shield.shield.definitions.longitudinal import (
    d_min_longitudinal,
    d_min_opposite_direction,
    d_min_same_direction,
    is_safe_longitudinally,
)
from rss_shield.shield.definitions.occupancy import VEHICLE, Mover, occupied
from rss_shield.shield.definitions.response import (
    CORRECT,
    FRONT,
    LAT,
    LON,
    NEITHER,
    REAR,
    WRONG,
    braking_owed,
    lateral_response,
    lateral_speed_limit,
    step_threshold,
)
from rss_shield.shield.definitions.right_of_way import (
    CAN_STOP,
    IN_ORDER,
    IN_TIME,
    UNSEEN,
    Approach,
    can_stop_before,
    distances_to_area,
    gap_behind,
    is_ahead,
    junction_items,
    must_brake,
    step_junction,
)
from rss_shield.shield.definitions.unstructured import (
    BRAKE,
    DANGEROUS,
    DRIVE_AWAY,
    GO_ON,
    STAY,
    headings_away,
    proper_response,
    turn_to_drive_away,
    who_brakes,
    who_stays,
)
from rss_shield.shield.geometry import signed_gap
from rss_shield.shield.params import PRESETS, RSSParams

FILE = json.loads((DATA / "adrss-vectors.json").read_text())
VECTORS = {vector["id"]: vector for vector in FILE["vectors"]}
PRECISION = 1e-3

# vectors whose answer differs on purpose, and the test that pins the difference down
DIFFERENT = {
    "stopping_distance-005": "test_braking_of_zero_is_refused_with_the_parameters_not_by_each_formula",
    "speed_and_distance_profile-003": "test_nobody_accelerates_after_the_response_time",
    "safe_distance_lateral-011": "test_a_pair_that_drifts_apart_still_keeps_mu",
    "threshold_same_direction-011": "test_cars_that_reverse_have_a_distance_instead_of_an_error",
    "extraction_same_direction-003": "test_gaps_are_metric_not_smallest_over_lane_lengths",
    "threshold_same_direction-003": "test_danger_from_the_start_is_answered_on_both_axes",
    "threshold_same_direction-005": "test_danger_from_the_start_is_answered_on_both_axes",
    "threshold_same_direction-007": "test_danger_from_the_start_is_answered_on_both_axes",
    "response_lateral-003": "test_danger_from_the_start_is_answered_on_both_axes",
    "response_lateral-005": "test_danger_from_the_start_is_answered_on_both_axes",
    "intersection-001": "test_without_priority_all_must_be_able_to_stop_not_one",
    "intersection_world_sweep-003": "test_without_priority_all_must_be_able_to_stop_on_the_way_in_too",
    "intersection-011": "test_a_car_with_priority_brakes_too_if_both_could_have_stopped",
    "unstructured-001": "test_in_open_space_a_gap_too_short_to_stop_in_is_not_safe_but_the_front_car_goes_on",
    "unstructured-003": "test_of_two_that_stand_the_one_that_turns_less_drives_away",
}


def params(dynamics):
    return RSSParams.validated(
        response_time=dynamics["response_time"],
        a_max_accel=dynamics["lon_accel_max"],
        a_min_brake=-dynamics["lon_brake_min"],
        a_max_brake=-dynamics["lon_brake_max"],
        a_min_brake_correct=-dynamics["lon_brake_min_correct"],
        a_lat_max_accel=dynamics["lat_accel_max"],
        a_lat_min_brake=-dynamics["lat_brake_min"],
        mu=dynamics["lateral_fluctuation_margin"],
        standstill_gap=dynamics["min_longitudinal_safety_distance"],
        v_cap=dynamics["max_speed_on_acceleration"],
    )


def vectors(category, but=()):
    """Inputs and full-precision answers of one category, without those in DIFFERENT (or `but`)."""
    chosen = [v for name, v in VECTORS.items() if v["category"] == category and name not in {*DIFFERENT, *but}]
    assert chosen
    return pytest.mark.parametrize(
        ("given", "answer"), [(v["inputs"], v["wheel"]) for v in chosen], ids=[v["id"] for v in chosen]
    )


def close(value):
    return pytest.approx(value, rel=0.0, abs=PRECISION)


# ---------------------------------------------------------------- kinematics


@vectors("stopping_distance")
def test_stopping_distance(given, answer):
    assert stopping_distance(given["speed"], -given["deceleration"]) == close(answer["distance"])


@vectors("accelerated_limited_movement", but=["accelerated_limited_movement-009"])
def test_movement_accelerated_up_to_a_speed_cap(given, answer):
    v, cap, a, t = (float(given[name]) for name in ("speed", "max_speed_on_acceleration", "acceleration", "duration"))
    assert response_distance(v, t, a, cap) == close(answer["distance"])
    assert speed_after_response(v, t, a, cap) == close(answer["resulting_speed"])


def test_movement_braked_to_standstill():
    vector = VECTORS["accelerated_limited_movement-009"]
    v, b, t = float(vector["inputs"]["speed"]), -float(vector["inputs"]["acceleration"]), 3.0
    assert travel(t, v, 0.0, 0.0, b) == close(vector["wheel"]["distance"])
    assert speed_envelope(t, v, 0.0, 0.0, b) == close(vector["wheel"]["resulting_speed"])


@vectors("speed_and_distance_profile")
def test_speed_and_distance_after_a_time(given, answer):
    t, v, rho, cap, a, after = (
        float(given[name])
        for name in (
            "time",
            "speed",
            "response_time",
            "max_speed_on_acceleration",
            "accel_until_response",
            "accel_after_response",
        )
    )
    b = -after if after else 1.0  # without braking the time ends with the response time
    assert after or t == rho
    assert travel(t, v, rho, a, b, cap) == close(answer["distance"])
    assert speed_envelope(t, v, rho, a, b, cap) == close(answer["speed"])


@vectors("stated_braking_longitudinal")
def test_longitudinal_distance_of_the_stated_braking_pattern(given, answer):
    v, cap, rho, a, b = (
        float(given[name])
        for name in ("speed", "max_speed_on_acceleration", "response_time", "acceleration", "deceleration")
    )
    assert reach(v, rho, a, -b, cap) == close(answer["distance"])


@vectors("stated_braking_lateral")
def test_lateral_distance_of_the_stated_braking_pattern(given, answer):
    # beside a car that comes over so fast that nothing is clamped, a car's own approach is what is left
    own = PRESETS["ad-rss"].ego._replace(
        response_time=given["response_time"],
        a_lat_max_accel=given["acceleration"],
        a_lat_min_brake=-given["deceleration"],
        mu=0.0,
    )
    of_other = approach_no_credit(20.0, own)
    own_approach = d_min_lateral(given["speed"], -20.0, own, own, "pair") - of_other
    assert own_approach == close(answer["distance"])


@vectors("time_to_cover_distance")
def test_time_to_cover_a_distance(given, answer):
    inputs = {name: float(value) for name, value in given.items()}
    v, rho, cap = inputs["speed"], inputs["response_time"], inputs["max_speed_on_acceleration"]
    t = time_to_cover(inputs["distance"], v, rho, inputs["accel_until_response"], -inputs["accel_after_response"], cap)
    assert t == close(answer["time"])


@vectors("time_to_stop")
def test_time_to_stop(given, answer):
    inputs = {name: float(value) for name, value in given.items()}
    v, rho, cap = inputs["speed"], inputs["response_time"], inputs["max_speed_on_acceleration"]
    t = time_to_stop(v, rho, inputs["accel_until_response"], -inputs["accel_after_response"], cap)
    assert t == close(answer["time"])


# ---------------------------------------------------------------- safe distances


@vectors("safe_distance_same_direction")
def test_safe_longitudinal_distance(given, answer):
    rear, front = params(given["follow_dynamics"]), params(given["lead_dynamics"])
    assert d_min_same_direction(given["follow_speed"], given["lead_speed"], rear, front) == close(
        answer["safe_distance"]
    )


@vectors("safe_distance_lateral")
def test_safe_lateral_distance_in_the_pairwise_reading(given, answer):
    left, right = params(given["left_dynamics"]), params(given["right_dynamics"])
    d = d_min_lateral(given["left_speed_lat"], given["right_speed_lat"], left, right, "pair")
    assert d == close(answer["safe_distance"])


@vectors("extraction_same_direction")
def test_gaps_from_occupied_regions(given, answer):
    gap, length = {}, {"lon": given["lane"]["length"][0], "lat": given["lane"]["width"][0]}
    for axis in ("lon", "lat"):
        (a, b), (c, d) = given["ego_region"][axis], given["object_region"][axis]
        distance = length[axis] * ((a + b) / 2 - (c + d) / 2)
        gap[axis] = signed_gap(distance, length[axis] * (b - a) / 2, length[axis] * (d - c) / 2)
    assert gap["lon"] == close(answer["lon_distance"])
    assert gap["lat"] == close(answer["lat_distance"])


# ---------------------------------------------------------------- danger, threshold, response


def safe_axes(step, opposite):
    """(longitudinally safe, laterally safe on the side of the other, that side) in the pairwise reading."""
    ego, other = step["ego"], step["other"]
    ego_params, other_params = params(ego["dynamics"]), params(other["dynamics"])
    if opposite:
        correct, wrong = (ego, other) if ego["correct"] else (other, ego)
        d_lon = d_min_opposite_direction(
            correct["lon"], wrong["lon"], params(correct["dynamics"]), params(wrong["dynamics"])
        )
    elif step["lon_position"] == "InFront":
        d_lon = d_min_same_direction(other["lon"], ego["lon"], other_params, ego_params)
    else:
        d_lon = d_min_same_direction(ego["lon"], other["lon"], ego_params, other_params)
    other_on_the_right = step["lat_position"] in ("AtLeft", "OverlapLeft", "Overlap")
    if other_on_the_right:
        d_lat = d_min_lateral(ego["lat"], other["lat"], ego_params, other_params, "pair")
    else:
        d_lat = d_min_lateral(other["lat"], ego["lat"], other_params, ego_params, "pair")
    safe_lat = step["lat_position"] in ("AtLeft", "AtRight") and step["lat_distance"] >= d_lat
    return bool(is_safe_longitudinally(step["lon_distance"], d_lon)), bool(safe_lat), other_on_the_right


def responses(steps, opposite):
    """What the library asks of the ego at each step: braking name of each axis as the vectors write it."""
    axes, since, rows = NEITHER, 0, []
    for step in steps:
        safe_lon, safe_lat, on_the_right = safe_axes(step, opposite)
        axes, since = step_threshold(axes, since, safe_lon, safe_lat)
        owed = 0 if since == 0 else (LON | LAT if axes == NEITHER else axes)
        role = (CORRECT if step["ego"]["correct"] else WRONG) if opposite else REAR
        if not opposite and step["lon_position"] == "InFront":
            role = FRONT
        b = braking_owed(role, params(step["ego"]["dynamics"]))
        row = {"lon_safe": safe_lon, "lon": "None", "lat_left": "None", "lat_right": "None"}
        if owed & LON and b > 0.0:
            row["lon"] = "BrakeMinCorrect" if role == CORRECT else "BrakeMin"
        for side in ("lat_right", "lat_left"):
            beside = step["lat_position"] == "Overlap" or on_the_right == (side == "lat_right")
            if owed & LAT and beside:
                row[side] = "BrakeMin"
        rows.append(row)
    return rows


def answers(answer):
    columns = ("lon_safe", "lon", "lat_left", "lat_right")
    return [{name: step[name] for name in columns} for step in answer["steps"]]


@vectors("threshold_same_direction")
def test_responses_of_two_cars_that_drive_the_same_way(given, answer):
    assert responses(given["steps"], opposite=False) == answers(answer)


@vectors("threshold_opposite_direction")
def test_responses_of_two_cars_that_drive_at_each_other(given, answer):
    assert responses(given["steps"], opposite=True) == answers(answer)


@vectors("response_lateral")
def test_responses_of_two_cars_beside_each_other(given, answer):
    assert responses(given["steps"], opposite=False) == answers(answer)


@pytest.mark.parametrize(
    "name",
    [
        name
        for name, v in VECTORS.items()
        if v["category"].startswith(("threshold", "response"))
        and all("lon_safe_distance" in step for step in v["wheel"]["steps"])
    ],
)
def test_every_step_has_the_distance_of_the_released_library(name):
    vector = VECTORS[name]
    opposite = vector["inputs"]["constellation_type"] == "OppositeDirection"
    for step, answer in zip(vector["inputs"]["steps"], vector["wheel"]["steps"], strict=True):
        ego, other = params(step["ego"]["dynamics"]), params(step["other"]["dynamics"])
        v_ego, v_other = step["ego"]["lon"], step["other"]["lon"]
        if opposite:
            d = d_min_opposite_direction(v_ego, v_other, ego, other)
        elif step["lon_position"] == "InFront":
            d = d_min_same_direction(v_other, v_ego, other, ego)
        else:
            d = d_min_same_direction(v_ego, v_other, ego, other)
        assert d == close(answer["lon_safe_distance"])


# ---------------------------------------------------------------- right of way


def approach(state):
    """A car of the vectors, a point there, on its way into the intersection."""
    enter, leave, v = (float(state[name]) for name in ("enter", "leave", "lon"))
    return Approach(enter, leave, 0.0, v, float(state["has_priority"]))


def junction_steps(steps):
    """(items, must the ego brake?) after each step; steps are pairs of `Approach` with both drivers' parameters."""
    threshold, rows = UNSEEN, []
    for ego, other, ego_params, other_params in steps:
        items = junction_items(ego, other, ego_params, other_params)
        threshold = step_junction(threshold, ego, other, items)
        brakes = must_brake(threshold.items, threshold.priority > 0, threshold.order)
        rows.append((items, threshold.since > 0 and brakes))
    return rows


def intersection_steps(given):
    return [
        (
            approach(step["ego"]),
            approach(step["other"]),
            params(step["ego"]["dynamics"]),
            params(step["other"]["dynamics"]),
        )
        for step in given["steps"]
    ]


@vectors("intersection")
def test_safety_and_response_at_an_intersection(given, answer):
    rows = junction_steps(intersection_steps(given))
    expected = [(step["lon_safe"], step["lon"] == "BrakeMin") for step in answer["steps"]]
    assert [(items != 0, brakes) for items, brakes in rows] == expected


def test_every_item_of_an_intersection_has_the_distance_of_the_released_library():
    seen = set()
    for vector in VECTORS.values():
        if vector["category"] == "intersection":
            for step, answer in zip(intersection_steps(vector["inputs"]), vector["wheel"]["steps"], strict=True):
                ego, other, ego_params, other_params = step
                seen.add(answer["evaluator"])
                if answer["evaluator"] == "IntersectionEgoPriorityOtherAbleToStop":
                    needed, car, driver = answer["safe_distance"], other, other_params
                    assert can_stop_before(needed + PRECISION, car.v, driver)
                    assert not can_stop_before(needed - PRECISION, car.v, driver)
                elif answer["evaluator"] == "IntersectionEgoInFront":
                    assert d_min_same_direction(other.v, ego.v, other_params, ego_params) == close(
                        max(answer["safe_distance"], 0.0)
                    )
                    assert is_ahead(ego, other, ego_params, other_params)
    assert len(seen) == 3


@vectors("extraction_intersection")
def test_distances_to_the_intersection_from_occupied_regions(given, answer):
    start, end = given["approach_length"], given["approach_length"] + given["intersection_length"]
    cars = {}
    for name in ("ego", "object"):
        rear, front = (start * share for share in given[f"{name}_lon"])
        cars[name] = distances_to_area((rear + front) / 2, (front - rear) / 2, start, end), front - rear
    (enter, leave), length = cars["ego"]
    (other_enter, other_leave), other_length = cars["object"]
    assert (enter, leave) == (close(answer["ego_enter"]), close(answer["ego_leave"]))
    assert (other_enter, other_leave) == (close(answer["other_enter"]), close(answer["other_leave"]))
    ego, other = Approach(enter, math.inf, length, 0.0, 0.0), Approach(other_enter, math.inf, other_length, 0.0, 0.0)
    assert gap_behind(other, ego) == close(answer["lon_distance"])


def sweep(given):
    """Both cars for every position of the ego on the way in: lengths are ranges, the worst of each counts."""

    def on(road, segment, lon_range, v, priority):
        pieces = [piece["length"] for piece in road if "intersection" not in piece]
        before = [piece["id"] for piece in road].index(segment)
        shortest, longest = ([float(piece[k]) for piece in pieces] for k in (0, 1))
        rear = sum(shortest[:before]) + lon_range[0] * shortest[before]
        front = sum(longest[:before]) + lon_range[1] * longest[before]
        return Approach(sum(shortest) - front, math.inf, front - rear, v, priority)

    has_priority = float(given["constellation_type"] == "IntersectionEgoHasPriority")
    ego_params, other_params = params(given["ego_dynamics"]), params(given["object_dynamics"])
    other = on(given["object_road"], given["object_segment"], given["object_lon_range"], given["object_speed"], 0.0)
    for segment in (0, 3):
        for i in range(91):
            ego = on(given["ego_road"], segment, (0.01 * i, 0.01 * i + 0.1), given["ego_speed"], has_priority)
            yield ego, other, ego_params, other_params


def braking_positions(given):
    """(segment, i) at which the ego must brake."""
    places = [(segment, i) for segment in (0, 3) for i in range(91)]
    rows = junction_steps(sweep(given))
    return [place for place, (_, brakes) in zip(places, rows, strict=True) if brakes]


@vectors("intersection_world_sweep")
def test_a_car_that_drives_into_a_merge_brakes_from_the_same_place_on(given, answer):
    (segment, first), (_, last) = answer["first_brake"], answer["last_brake"]
    braking = braking_positions(given)
    assert braking[: answer["n"]] == [(segment, i) for i in range(first, last + 1)]


# ---------------------------------------------------------------- open space


@vectors("drive_away_heading")
def test_headings_in_which_one_may_drive_away(given, answer):
    headings = headings_away(*map(float, (*given["ego"], *given["other"])), given["max_angle"])
    for ours, theirs in zip(headings, (answer["begin"], answer["end"]), strict=True):
        assert math.remainder(ours - theirs, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def open_space_steps(name, steering):
    """(safe, responses of ego and other; safe and response of the ego there) at each step of an unstructured vector."""
    vector = VECTORS[name]
    car = params(vector["inputs"]["dynamics"])
    length, width = vector["inputs"]["object_dims"]
    last, rows = DANGEROUS, []
    for step, answer in zip(vector["inputs"]["steps"], vector["wheel"]["steps"], strict=True):
        theta = step.get("theta", 2.4)
        ego, other = (
            Mover(step[f"{who}_x"], 0.0, 0.0, step[f"{who}_speed"], 0.0, length / 2, width / 2)
            for who in ("ego", "other")
        )
        found = who_brakes(occupied(ego, car, steering), occupied(other, car, steering), 0.0, theta)
        last = last if found == DANGEROUS else found
        stand = ego.v == 0.0, other.v == 0.0
        turns = (
            turn_to_drive_away(ego.x, 0.0, 0.0, other.x, 0.0, theta),
            turn_to_drive_away(other.x, 0.0, 0.0, ego.x, 0.0, theta),
        )
        if found == DANGEROUS:
            last = who_stays(last, *stand, *turns)
        rows.append((found != DANGEROUS, proper_response(last, *stand), answer["safe"], answer["response"]))
    return rows


# ---------------------------------------------------------------- deliberate differences


def test_in_open_space_a_gap_too_short_to_stop_in_is_not_safe_but_the_front_car_goes_on():
    # 11 m behind the ego, which may stop at once, the other may come 14.2 m; there the pair is safe. Both say: go on
    (first, second) = open_space_steps("unstructured-001", VEHICLE._replace(yaw_acceleration=0.0))
    assert first == (True, (GO_ON, BRAKE), True, "ContinueForward")
    assert second == (False, (GO_ON, BRAKE), True, "ContinueForward")
    vector = VECTORS["unstructured-001"]["inputs"]
    step, car = vector["steps"][1], params(vector["dynamics"])
    gap = step["ego_x"] - step["other_x"] - vector["object_dims"][0]
    needed = d_min_same_direction(step["other_speed"], step["ego_speed"], car, car)
    assert gap == 11.0 < needed
    # 0.56 + 7 m in the response time, then 7.28^2 / 8; less the 0.005 m in which the ego may stop
    assert needed == pytest.approx(0.2777778 * 2 + 7.0 + 7.2777778**2 / 8 - 0.2777778**2 / 16)


def test_of_two_that_stand_the_one_that_turns_less_drives_away():
    # there the ego is told to drive away, which it may only backwards; here the other may, straight on, and the ego
    # stays. What it does all the same, drive off at 5 m/s, is not asked of it here, whichever way it steers
    rows = open_space_steps("unstructured-003", VEHICLE._replace(yaw_acceleration=0.0))
    assert [(safe, there) for safe, _, there, _ in rows] == [(True, True)] + [(False, False)] * 5
    assert [answer for *_, answer in rows][1:] == ["DriveAway", "Brake", "DriveAway", "DriveAway", "Brake"]
    first, *later = [response for _, response, *_ in rows]
    assert first == (BRAKE, GO_ON)
    stands, moves = (STAY, DRIVE_AWAY), (BRAKE, GO_ON)
    assert later == [stands, moves, stands, moves, moves]


def test_braking_of_zero_is_refused_with_the_parameters_not_by_each_formula():
    vector = VECTORS["stopping_distance-005"]
    assert vector["inputs"]["deceleration"] == 0.0 and not vector["wheel"]["valid"]
    with pytest.raises(ValueError, match="a_min_brake"):
        params(FILE["meta"]["base_dynamics"] | {"lon_brake_min": 0.0})


def test_nobody_accelerates_after_the_response_time():
    # there a driver may go on accelerating up to the cap; here the second phase is braking, never more than the first
    inputs = VECTORS["speed_and_distance_profile-003"]["inputs"]
    assert inputs["accel_after_response"] > 0.0
    v, rho, a = float(inputs["speed"]), float(inputs["response_time"]), float(inputs["accel_until_response"])
    speeds = speed_envelope(np.array([1.0, 2.0, 3.0]), v, rho, a, 1e-9, float(inputs["max_speed_on_acceleration"]))
    assert np.all(np.diff(speeds) <= 0.0)


def test_a_pair_that_drifts_apart_still_keeps_mu():
    # there the clamp at zero includes mu: a pair that separates fast enough may touch; here mu always stays
    vector = VECTORS["safe_distance_lateral-011"]
    assert vector["wheel"]["safe_distance"] == 0.0
    left, right = params(vector["inputs"]["left_dynamics"]), params(vector["inputs"]["right_dynamics"])
    d = d_min_lateral(vector["inputs"]["left_speed_lat"], vector["inputs"]["right_speed_lat"], left, right, "pair")
    assert d == left.mu == 0.1


def test_the_default_lateral_distance_never_credits_receding():
    # it is never below the distance there, and above it as soon as a car moves away
    seen = 0
    for vector in VECTORS.values():
        if vector["category"] == "safe_distance_lateral":
            inputs = vector["inputs"]
            left, right = params(inputs["left_dynamics"]), params(inputs["right_dynamics"])
            u_left, u_right = inputs["left_speed_lat"], inputs["right_speed_lat"]
            d, there = d_min_lateral(u_left, u_right, left, right), vector["wheel"]["safe_distance"]
            recedes = u_left < 0.0 or u_right > 0.0
            seen += recedes
            assert d > there + 0.1 if recedes else d == close(there)
    assert seen >= 4


def test_cars_that_reverse_have_a_distance_instead_of_an_error():
    vector = VECTORS["threshold_same_direction-011"]
    assert vector["wheel"]["steps"] == [{"valid": False}]
    step = vector["inputs"]["steps"][0]
    rear, front = params(step["ego"]["dynamics"]), params(step["other"]["dynamics"])
    v = step["ego"]["lon"]
    d = d_min_longitudinal(v, v, False, rear, front, rear.a_min_brake, front.a_min_brake)
    # both roll back at 50 km/h: the rear car away from the other, the front car toward it, by up to 89.3 m
    # 27.8 + 7 m in the response time, then (13.9 + 7)^2 / 8 m
    assert d == pytest.approx(13.88888889 * 2 + 7.0 + 20.88888889**2 / 8)


def test_gaps_are_metric_not_smallest_over_lane_lengths():
    # a lane piece there has a range of lengths and the smallest gap counts: 5 * 0.8 - 10 * 0.2 = 2 m. Here a gap is
    # measured along the centre line, between 5 * 0.6 and 10 * 0.6 m for the two lengths
    vector = VECTORS["extraction_same_direction-003"]
    assert vector["inputs"]["lane"]["length"] == [5, 10] and vector["wheel"]["lon_distance"] == close(2.0)
    for length in (5.0, 10.0):
        assert signed_gap(length * 0.75, length * 0.05, length * 0.1) == pytest.approx(0.6 * length)


def test_danger_from_the_start_is_answered_on_both_axes():
    # there a first sight in danger on one road counts as longitudinal; here as both: nobody knows which axis was lost
    seen = 0
    for name, test in DIFFERENT.items():
        if test == "test_danger_from_the_start_is_answered_on_both_axes":
            vector = VECTORS[name]
            (ours,), (theirs,) = responses(vector["inputs"]["steps"], opposite=False), answers(vector["wheel"])
            assert ours["lon_safe"] == theirs["lon_safe"] is False
            assert ours["lon"] == theirs["lon"] == "BrakeMin"
            assert (theirs["lat_left"], theirs["lat_right"]) == ("None", "None")
            assert "BrakeMin" in (ours["lat_left"], ours["lat_right"])
            seen += 1
    assert seen == 5


def test_a_gap_equal_to_the_safe_distance_is_safe():
    # there a gap must exceed the distance; the set of safe gaps here is closed, so that a last safe instant exists
    car = params(FILE["meta"]["base_dynamics"])
    d = d_min_same_direction(20.0, 20.0, car, car)
    assert is_safe_longitudinally(d, d)


def test_lateral_braking_is_asked_only_of_a_car_that_moves_toward_the_other():
    # there the response is the same whichever way the car moves
    car = params(FILE["meta"]["base_dynamics"])
    assert lateral_response(-1.0, 3.0, 0.3, car)[1] == -0.8
    assert lateral_response(-1.0, 3.0, -0.3, car)[:2] == (-math.inf, math.inf)
    assert lateral_speed_limit(100, 0.0, car, 1 / 15) == 0.0


def test_without_priority_all_must_be_able_to_stop_not_one():
    # there one car that can stop is enough, and the other one, which cannot, need not even brake
    vector = VECTORS["intersection-001"]
    steps = intersection_steps(vector["inputs"])
    assert vector["wheel"]["steps"][1]["lon_safe"]
    ego, other, ego_params, other_params = steps[1]
    assert can_stop_before(other.enter, other.v, other_params) and not can_stop_before(ego.enter, ego.v, ego_params)
    (first, brakes_first), (second, brakes_second) = junction_steps(steps)
    assert (first & CAN_STOP, second) == (0, 0)
    assert not brakes_first and brakes_second


def test_without_priority_all_must_be_able_to_stop_on_the_way_in_too():
    # there the ego brakes from i = 55 on, where it can no longer stop; here from 11 on, as with priority: the other
    # could not stop all along, and from there on it is too near to be followed
    vector = VECTORS["intersection_world_sweep-003"]
    places = list(sweep(vector["inputs"]))[91:]
    could_stop = [i for i, (ego, _, car, _) in enumerate(places) if can_stop_before(ego.enter, ego.v, car)]
    assert could_stop[-1] == 54 and vector["wheel"]["first_brake"] == [3, 55]
    assert not any(can_stop_before(other.enter, other.v, car) for _, other, _, car in places)
    assert braking_positions(vector["inputs"])[0] == (3, 11)


def test_whoever_was_behind_brakes_until_it_is_safe_even_if_it_has_come_out_in_front():
    # there the order of the moment counts: the ego brakes up to i = 64, where it gets ahead
    vector = VECTORS["intersection_world_sweep-001"]
    assert vector["wheel"]["last_brake"] == [3, 64]
    assert braking_positions(vector["inputs"])[-1] == (3, 90)


def test_a_car_with_priority_brakes_too_if_both_could_have_stopped():
    # there it does nothing, because the other should have stopped; here every item that was true is answered
    vector = VECTORS["intersection-011"]
    assert vector["wheel"]["steps"][1]["lon"] == "None"
    (first, brakes_first), (second, brakes_second) = junction_steps(intersection_steps(vector["inputs"]))
    assert (first, second) == (CAN_STOP | IN_TIME, 0)
    assert not brakes_first and brakes_second
    assert (
        must_brake(CAN_STOP | IN_TIME, True, -1.0)
        and not must_brake(CAN_STOP, True, -1.0)
        and must_brake(IN_ORDER, True, -1.0)
    )


# ---------------------------------------------------------------- nothing is forgotten


def test_every_category_is_computed_or_differs_throughout():
    source = Path(__file__).read_text()
    for category in {v["category"] for v in VECTORS.values()}:
        different = all(name in DIFFERENT for name, v in VECTORS.items() if v["category"] == category)
        assert (f'@vectors("{category}"' in source) != different, category


def test_every_difference_names_a_test_and_a_vector():
    assert set(DIFFERENT) <= set(VECTORS)
    assert all(callable(globals().get(test)) for test in DIFFERENT.values())


def test_the_released_library_agrees_with_what_its_tests_state():
    assert all(vector["wheel_agrees"] for vector in VECTORS.values())
    assert len(VECTORS) == FILE["meta"]["count"]
