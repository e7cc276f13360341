"""What must hold of the field, whatever its numbers."""

import numpy as np
import pytest
from examples import MODES, user
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.risk import RiskSettings, field
from rss_shield.shield.risk.field import bearing

RISK = {mode: RiskSettings.validated(mode=mode) for mode in MODES}
positions = st.floats(-120.0, 120.0)
speeds = st.floats(0.0, 40.0)
angles = st.floats(-np.pi, np.pi)


def moving(x, y, speed, heading, **more):
    return user(x, y, speed * np.cos(heading), speed * np.sin(heading), **more)


@st.composite
def scenes(draw):
    """Ego and source at least 2 m apart."""
    r, theta = draw(st.floats(2.0, 150.0)), draw(angles)
    ego = moving(0.0, 0.0, draw(speeds), draw(angles))
    return ego, moving(r * np.cos(theta), r * np.sin(theta), draw(speeds), draw(angles))


@pytest.mark.parametrize(("distance", "speed"), [(8.0, 5.0), (25.0, 20.0), (90.0, 38.0)])
@pytest.mark.parametrize("heading", [0.0, 0.7, 2.0, np.pi])
def test_radial_energy_is_what_the_force_does_from_infinity(distance, speed, heading):
    risk = RISK["radial"]
    source = moving(0.0, 0.0, speed, heading)

    def force(r):
        return field(user(r, 0.0, 10.0, 0.0), source, risk).force

    # r = distance / s^2 turns the way from infinity into s from 0 to 1, and r^-1.5 dr into a constant
    s = (np.arange(400) + 0.5) / 400
    work = sum(force(distance / x**2) * 2 * distance / x**3 for x in s) / 400
    assert work == pytest.approx(field(user(distance, 0.0, 10.0, 0.0), source, risk).energy, rel=1e-9)


@pytest.mark.parametrize(("heading", "speed"), [(0.5, 15.0), (1.8, 30.0), (3.0, 40.0)])
def test_published_energy_is_work_too_along_a_line_of_equal_field_and_then_straight_ahead(heading, speed):
    r, v, k3 = 30.0, speed, RISK["iso"].wave_speed
    source = moving(0.0, 0.0, v, 0.0)
    here = field(user(r * np.cos(heading), r * np.sin(heading), 10.0, 0.0), source, RISK["iso"])
    ahead = r * ((k3 - v * np.cos(heading)) / (k3 - v)) ** (1 / 1.5)
    there = field(user(ahead, 0.0, 10.0, 0.0), source, RISK["radial"])
    assert there.strength == pytest.approx(here.strength, rel=1e-12)  # the line is one of equal field
    assert here.energy == pytest.approx(there.energy, rel=1e-12)


@settings(max_examples=200, deadline=None)
@given(scenes())
def test_both_energies_agree_straight_ahead_and_published_is_never_less(scene):
    ego, source = scene
    iso, radial = field(ego, source, RISK["iso"]), field(ego, source, RISK["radial"])
    assert iso.energy >= radial.energy * (1 - 1e-12)
    assert iso.force == radial.force
    standing = source.copy()
    standing.vx = standing.vy = 0.0
    assert field(ego, standing, RISK["iso"]).energy == pytest.approx(
        field(ego, standing, RISK["radial"]).energy, rel=1e-12
    )


@settings(max_examples=100, deadline=None)
@given(scenes(), angles, positions)
@pytest.mark.parametrize("mode", MODES)
def test_it_does_not_matter_where_the_scene_lies_and_which_way_it_is_turned(mode, scene, angle, shift):
    def turned(body):
        cos, sin = np.cos(angle), np.sin(angle)
        return user(
            cos * body.x - sin * body.y + shift,
            sin * body.x + cos * body.y - shift,
            cos * body.vx - sin * body.vy,
            sin * body.vx + cos * body.vy,
        )

    before, after = field(*scene, RISK[mode]), field(*map(turned, scene), RISK[mode])
    for name in ("strength", "force", "energy"):
        assert getattr(after, name) == pytest.approx(getattr(before, name), rel=1e-9)
    scale = before.force * 80.0  # the closing speed may be a difference of large ones
    assert after.rate == pytest.approx(before.rate, abs=1e-9 * scale)
    assert np.hypot(after.force_x, after.force_y) == pytest.approx(before.force, rel=1e-9)


@settings(max_examples=100, deadline=None)
@given(scenes(), st.floats(1.05, 3.0))
@pytest.mark.parametrize("mode", MODES)
def test_farther_is_weaker(mode, scene, factor):
    ego, source = scene
    away = source.copy()
    away.x, away.y = source.x * factor, source.y * factor
    near, far = field(ego, source, RISK[mode]), field(ego, away, RISK[mode])
    assert far.force < near.force
    assert far.energy < near.energy


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [3.0, 20.0, 39.0])
def test_the_field_is_stronger_ahead_of_a_moving_source_than_beside_and_behind(mode, speed):
    source = user(0.0, 0.0, speed, 0.0)
    strength = [
        field(user(20 * np.cos(a), 20 * np.sin(a), 0.0, 0.0), source, RISK[mode]).strength
        for a in np.linspace(0.0, np.pi, 9)
    ]
    assert (np.diff(strength) < 0.0).all()


def test_behind_a_car_published_energy_grows_with_its_speed_and_the_exact_one_falls():
    # of the follower of a car at 54 km/h, relative to a standing one of the same virtual mass: factors by hand,
    # (k3/(k3+v))^(1/3) (k3/(k3-v))^(2/3) = 1.194 and k3/(k3+v) = 0.748
    ego = user(0.0, 0.0, 20.0, 0.0)
    for mode, factor in (("iso", 1.194), ("radial", 0.748)):
        risk = RISK[mode]._replace(slowest_loss=15.0)
        slow, fast = (field(ego, user(30.0, 0.0, v, 0.0), risk).energy for v in (0.0, 15.0))
        assert fast / slow == pytest.approx(factor, abs=5e-4)


@settings(max_examples=100, deadline=None)
@given(scenes())
def test_the_rate_is_what_radial_energy_gains_on_a_fixed_bearing(scene):
    ego, source = scene
    sight = bearing(ego, source, RISK["radial"])
    dt = 1e-4
    closer = ego.copy()
    closer.x, closer.y = ego.x - sight.closing * dt * sight.to_ego_x, ego.y - sight.closing * dt * sight.to_ego_y
    farther = ego.copy()
    farther.x, farther.y = ego.x + sight.closing * dt * sight.to_ego_x, ego.y + sight.closing * dt * sight.to_ego_y
    here = field(ego, source, RISK["radial"])
    gained = (field(closer, source, RISK["radial"]).energy - field(farther, source, RISK["radial"]).energy) / (2 * dt)
    assert gained == pytest.approx(here.rate, rel=1e-5, abs=1e-6 * here.energy)


@pytest.mark.parametrize("mode", MODES)
def test_each_driver_and_each_road_counts_in_proportion(mode):
    plain, road = field(user(), user(30.0, 1.0), RISK[mode]), RISK[mode].reference_road
    for ego, source, factor in (
        (dict(driver=0.5), {}, 1.5),
        ({}, dict(driver=0.2), 1.2),
        (dict(driver=0.5), dict(driver=0.2), 1.8),
        (dict(road=2 * road), {}, 2.0),
        ({}, dict(road=3 * road), 3.0),
        (dict(mass=3000.0), dict(mass=750.0), 1.0),
        (dict(kind="truck"), {}, 1.443),
    ):
        changed = field(user(**ego), user(30.0, 1.0, **source), RISK[mode])
        assert changed.force == pytest.approx(factor * plain.force, rel=1e-12)
        assert changed.energy == pytest.approx(factor * plain.energy, rel=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_at_the_same_place_everything_is_finite(mode):
    here = field(user(3.0, 4.0, 20.0, 1.0), user(3.0, 4.0, -10.0, 0.0), RISK[mode])
    assert np.isfinite(here).all()
    assert here.rate == 0.0
