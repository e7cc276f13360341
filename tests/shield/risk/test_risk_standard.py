"""DSI*, RDSI and their thresholds."""

import numpy as np
import pytest
from examples import CASES, EXAMPLES, MODES, rounded, scene, user
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rss_shield.shield.risk import RiskSettings, risk_of
from rss_shield.shield.risk.standard import lane_change_distances, standard_distance

RISK = {mode: RiskSettings.validated(mode=mode) for mode in MODES}
components = st.floats(-30.0, 30.0)


@st.composite
def scenes(draw):
    r, theta = draw(st.floats(2.0, 150.0)), draw(st.floats(-np.pi, np.pi))
    ego = user(0.0, 0.0, draw(components), draw(components))
    return ego, user(r * np.cos(theta), r * np.sin(theta), draw(components), draw(components))


def rdsi(ego, source, risk):
    return risk_of(ego, source, False, risk).rdsi


@settings(max_examples=200, deadline=None)
@given(scenes())
def test_the_lower_threshold_of_the_exact_energy_is_8_17ths_always(scene):
    # alpha / (alpha + (1 - alpha) (k1 - 1) / TTC) = 0.1 / (0.1 + 0.9 * 0.5 / 4)
    risk = risk_of(*scene, False, RISK["radial"])
    assert risk.lower == pytest.approx(8 / 17, rel=1e-12)
    assert risk.upper == 1.0


@pytest.mark.parametrize("speed", EXAMPLES["RDSI1_iso_following"])
def test_the_lower_threshold_of_following_has_the_digits_given(speed):
    lower = risk_of(user(0.0, 0.0, 20.0), user(40.0, 0.0, float(speed)), False, RISK["iso"]).lower
    assert rounded(lower) == EXAMPLES["RDSI1_iso_following"][speed]


def distance_at(threshold, v_lead, v_ego):
    """Where the RDSI of a leader crosses a threshold, by halving [m]."""
    near, far = 1.0, 500.0
    for _ in range(80):
        middle = 0.5 * (near + far)
        over = rdsi(user(0.0, 0.0, v_ego), user(middle, 0.0, v_lead), RISK["radial"]) > threshold
        near, far = (middle, far) if over else (near, middle)
    return near


@pytest.mark.parametrize("name", EXAMPLES["equivalent_distances_radial"])
def test_thresholds_are_crossed_at_the_distances_given(name):
    expected = EXAMPLES["equivalent_distances_radial"][name]
    v_lead, v_ego = (float(part.split("=")[1]) for part in name.split(", "))
    for threshold, number in ((8 / 17, 1), (1.0, 2)):
        r = distance_at(threshold, v_lead, v_ego)
        assert r == pytest.approx(expected[f"r_at_RDSI{number}"], rel=5e-6)
        assert r / v_ego == pytest.approx(expected[f"THW_at_RDSI{number}"], rel=5e-6)
        if v_lead < v_ego:
            assert r / (v_ego - v_lead) == pytest.approx(expected[f"TTC_at_RDSI{number}"], rel=5e-6)


@pytest.mark.parametrize(("v_ego", "v_lead", "angle"), [(20.0, 15.0, 0.0), (13.0, 6.0, 1.1), (31.0, 0.0, -2.0)])
@pytest.mark.parametrize("mode", MODES)
def test_headway_1_s_alone_is_the_lower_threshold_and_with_ttc_4_s_the_upper(mode, v_ego, v_lead, angle):
    cos, sin = np.cos(angle), np.sin(angle)

    def lead(speed):
        return user(v_ego * cos, v_ego * sin, speed * cos, speed * sin)

    ego = user(0.0, 0.0, v_ego * cos, v_ego * sin)
    apart = risk_of(ego, lead(v_ego), False, RISK[mode])
    assert apart.rdsi == pytest.approx(apart.lower, rel=1e-12)
    both = risk_of(ego, lead(0.75 * v_ego), False, RISK[mode])  # v_ego * 1 s closing at v_ego / 4: TTC = 4 s
    assert both.rdsi == pytest.approx(both.upper, rel=1e-12)


@settings(max_examples=100, deadline=None)
@given(scenes(), st.floats(0.1, 10.0))
@pytest.mark.parametrize("mode", MODES)
def test_units_cancel(mode, scene, factor):
    ego, source = scene
    scaled = RISK[mode]._replace(field_constant=factor * 0.1)
    roads = RISK[mode]._replace(reference_road=factor * RISK[mode].reference_road)
    heavy = source.copy()
    heavy.mass = factor * source.mass
    for lane_change in (False, True):
        before = risk_of(ego, source, lane_change, RISK[mode])
        for after in (risk_of(ego, source, lane_change, scaled), risk_of(ego, heavy, lane_change, RISK[mode])):
            assert after[:3] == pytest.approx(before[:3], rel=1e-9)
        both = [body.copy() for body in scene]
        for body in both:
            body.road = factor * body.road
        assert risk_of(*both, lane_change, roads)[:3] == pytest.approx(before[:3], rel=1e-9)


@settings(max_examples=200, deadline=None)
@given(scenes())
@pytest.mark.parametrize("mode", MODES)
def test_thresholds_are_in_order(mode, scene):
    ego, source = scene
    for lane_change in (False, True):
        risk = risk_of(ego, source, lane_change, RISK[mode])
        assert 0.0 < risk.lower <= risk.upper


@settings(max_examples=200, deadline=None)
@given(scenes(), st.floats(0.3, 4.4))
@pytest.mark.parametrize("lane_change", [False, True])
def test_who_opens_quickly_is_safe_with_the_sign_kept(lane_change, scene, seconds):
    """Radial: negative where distance / opening speed < (1 - alpha)(k1 - 1) / alpha = 4.5 s."""
    ego, source = scene
    ego.x, ego.y = source.x + seconds * (ego.vx - source.vx), source.y + seconds * (ego.vy - source.vy)
    risk = risk_of(ego, source, lane_change, RISK["radial"])
    assume(risk.distance > 0.5)
    assert risk.closing == pytest.approx(-risk.distance / seconds)
    assert risk.rdsi < 0.0 < risk.lower


def test_the_closed_form_straight_ahead():
    # DSI = SPE (alpha + (1 - alpha)(k1 - 1) / TTC), radial: 0.2125 SPE at 4 s, 0.325 SPE at 2 s, 0.1 SPE at infinity
    for v_lead, distance, factor in ((15.0, 20.0, 0.2125), (10.0, 20.0, 0.325), (20.0, 33.0, 0.1)):
        risk = risk_of(user(0.0, 0.0, 20.0), user(distance, 0.0, v_lead), False, RISK["radial"])
        assert risk.dsi / risk.energy == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_the_standard_car_makes_a_truck_as_risky_as_it_is_heavy(mode):
    ego, truck = scene(CASES["F6"])
    as_car = RISK[mode]._replace(standard=RiskSettings.validated(standard="car").standard)
    # 10 t * 1.443 / 1.5 t = 9.62
    assert rdsi(ego, truck, as_car) == pytest.approx(9.62 * rdsi(ego, truck, RISK[mode]), rel=1e-12)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["F5", "W1"])
def test_the_standard_as_observed_takes_no_notice_of_roads_and_drivers(mode, name):
    same = RISK[mode]._replace(standard=RiskSettings.validated(standard="same").standard)
    assert rdsi(*scene(CASES[name]), same) == pytest.approx(CASES["F1"][mode]["RDSI"], rel=5e-6)


def test_a_slow_ego_has_a_standard_distance_all_the_same():
    assert standard_distance(user(0.0, 0.0, 2.0), RISK["iso"]) == 5.0
    assert standard_distance(user(0.0, 0.0, 3.0, -4.0), RISK["iso"]._replace(headway=2.0)) == 10.0


@pytest.mark.parametrize("mode", MODES)
def test_with_a_length_offset_headway_and_ttc_count_bumper_gaps(mode):
    # 20 m/s, a gap of 20 m, closing at 5 m/s, between centres that are 5 m farther apart
    risk = risk_of(user(0.0, 0.0, 20.0), user(25.0, 0.0, 15.0), False, RISK[mode]._replace(length_offset=5.0))
    assert risk.rdsi == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("ego", "source", "expected"),
    [
        # rear 28 m/s, front 22 m/s: 28 + 300/6 + 7 and 14 + 300/14 + 7
        ((22.0, 0.0), (-20.0, 0.0, 28.0, 0.0), (85.0, 42.42857142857143)),
        ((28.0, 0.0), (20.0, 4.0, 22.0, 0.0), (85.0, 42.42857142857143)),
        ((0.0, -28.0), (4.0, -30.0, 0.0, -22.0), (85.0, 42.42857142857143)),
        # a slower rear car needs its response only: 10 + 7 and 5 + 7
        ((30.0, 0.0), (-15.0, -4.0, 10.0, 0.0), (17.0, 12.0)),
    ],
)
def test_lane_changes_need_distances_by_who_is_behind(ego, source, expected):
    spacing = lane_change_distances(user(0.0, 0.0, *ego), user(*source), RISK["iso"])
    assert spacing == pytest.approx(expected, rel=1e-12)


def test_who_is_beside_weighs_less_if_wanted():
    ego, weighed = user(0.0, 0.0, 25.0), RISK["iso"]._replace(lateral_exponent=1.0)
    for y, factor in ((0.0, 1.0), (2.0, 1.0), (4.0, 0.5), (-8.0, 0.25)):
        source = user(10.0, y, 25.0)
        assert rdsi(ego, source, weighed) == pytest.approx(factor * rdsi(ego, source, RISK["iso"]), rel=1e-12)
    steep = weighed._replace(lateral_exponent=2.0)
    assert rdsi(ego, user(10.0, 4.0, 25.0), steep) == pytest.approx(
        0.25 * rdsi(ego, user(10.0, 4.0, 25.0), RISK["iso"])
    )
