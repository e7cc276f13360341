"""Settings and factors: bad values are refused where they enter, and what is assumed says so."""

import inspect
import math
import re

import pytest
from examples import EXAMPLES, rounded

from rss_shield.shield.risk import Factors, RiskSettings, assumed, driver_factor, road_factor, road_users
from rss_shield.shield.risk.factors import CURVES, SLOPES, TYPES, VISIBILITIES, friction_loss, type_factor
from rss_shield.shield.risk.field import loss, virtual_mass
from rss_shield.shield.risk.settings import ASSUMED, CAR, ISO, KMH, RADIAL


def test_defaults_are_the_paper_s_numbers():
    settings = RiskSettings.validated()
    assert settings == RiskSettings()
    assert settings[:4] == (0.1, 1.5, 1.0, pytest.approx(160 / 3.6))
    assert (settings.energy_weight, settings.headway, settings.ttc, settings.mode) == (0.1, 1.0, 4.0, ISO)


@pytest.mark.parametrize("table", [RiskSettings, Factors])
def test_a_field_says_assumed_where_it_is_defined_exactly_if_the_list_has_it(table):
    lines = re.findall(r"^    (\w+): (?:float|int) = .*$", inspect.getsource(table), re.MULTILINE)
    assert tuple(lines) == table._fields
    for line in inspect.getsource(table).splitlines():
        if found := re.match(r"    (\w+): (?:float|int) = ", line):
            assert line.endswith("assumed") == (found[1] in ASSUMED), line


def test_a_report_can_name_what_is_assumed_with_the_values_in_force():
    named = assumed(RiskSettings(nearest=0.7), Factors(motorcycle=0.5))
    assert (named["nearest"], named["motorcycle"], named["solid_marking"]) == (0.7, 0.5, 0.10)
    assert not {"distance_exponent", "truck", "wave_speed"} & named.keys()


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("distance_exponent", 1.0, "> 1"),
        ("distance_exponent", 0.9, "> 1"),
        ("energy_weight", 0.0, "> 0 and <= 1"),
        ("energy_weight", 1.1, "> 0 and <= 1"),
        ("wave_speed", math.inf, "> 0"),
        ("nearest", 0.0, "> 0"),
        ("headway", -1.0, "> 0"),
        ("lateral_exponent", -0.5, ">= 0"),
        ("slowest_loss", 3.0, ">= 3.63889"),
        ("road_edge", math.nan, ">= 0"),
    ],
)
def test_values_out_of_range_name_field_value_and_range(name, value, expected):
    with pytest.raises(ValueError, match=rf"^{name} = {value!r} is out of range: expected a finite number {expected}$"):
        RiskSettings.validated(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("headway", "soon"), ("ttc", None)])
def test_what_is_no_number_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"^{name} = {value!r} is not a number"):
        RiskSettings.validated(**{name: value})


def test_modes_and_standards_go_by_name_or_index():
    assert RiskSettings.validated(mode="radial", standard="car")[5] == RADIAL
    assert RiskSettings.validated(standard="car").standard == CAR
    assert RiskSettings.validated(mode=RADIAL).mode == RADIAL
    for value in ("elliptic", 2, -1, 0.5):
        with pytest.raises(ValueError, match=r"^mode = .*: expected one of iso, radial$"):
            RiskSettings.validated(mode=value)
    with pytest.raises(ValueError, match=r"^standard = 'own': expected one of frozen, same, car$"):
        RiskSettings.validated(standard="own")


def test_what_has_to_be_in_order_is():
    with pytest.raises(ValueError, match=r"^emergency_response = 1.5 .* at most comfortable_response = 1$"):
        RiskSettings.validated(emergency_response=1.5)
    with pytest.raises(ValueError, match=r"^comfortable_brake = 8 .* at most emergency_brake = 7$"):
        RiskSettings.validated(comfortable_brake=8.0)
    with pytest.raises(ValueError, match=r"^slowest_loss = 40 .* at most fastest_loss"):
        RiskSettings.validated(slowest_loss=40.0)


def test_unknown_fields_are_refused_by_name():
    with pytest.raises(ValueError, match=r"^unknown risk setting 'headwey'; expected one of .*headway"):
        RiskSettings.validated(headwey=1.0)
    with pytest.raises(ValueError, match=r"^unknown risk factor 'lorry'; expected one of car, truck"):
        Factors.validated(lorry=1.0)
    with pytest.raises(ValueError, match=r"^truck = 0.0 is out of range: expected a finite number > 0$"):
        Factors.validated(truck=0.0)
    assert Factors.validated(truck=2, driver=0.0)[1] == 2.0


@pytest.mark.parametrize("speed", EXAMPLES["g_check"])
def test_losses_have_the_digits_given(speed):
    assert rounded(loss(float(speed) * KMH, RiskSettings())) == EXAMPLES["g_check"][speed]


@pytest.mark.parametrize("friction", EXAMPLES["phi_check"])
def test_friction_has_the_digits_given(friction):
    assert rounded(friction_loss(float(friction))) == EXAMPLES["phi_check"][friction]


def test_losses_are_clipped_to_where_they_are_fitted():
    settings = RiskSettings()
    assert loss(0.0, settings) == loss(20 * KMH, settings) > 0.0
    assert loss(150 * KMH, settings) == loss(120 * KMH, settings) == pytest.approx(113_437, abs=1)


def test_a_truck_destroys_more_than_a_car_of_its_mass():
    # 10 t at 54 km/h: 1.443 * 10 000 kg * 4530.96 yuan
    assert virtual_mass(10_000.0, type_factor("truck"), 15.0, RiskSettings()) == pytest.approx(6.53818e7, rel=1e-6)


def test_the_reference_road_is_dry_clear_flat_and_straight():
    assert RiskSettings().reference_road == road_factor(Factors(), 0.9, "above_200", "flat", "straight")
    assert road_factor() == pytest.approx(7310.63, abs=0.005)  # 1.457 * 5017.59


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("curve", CURVES)
def test_every_alignment_has_a_factor_of_its_own(slope, curve):
    changed = Factors()._replace(**{f"{slope}_{curve}": 3.0})
    assert road_factor(changed, slope=slope, curve=curve) == pytest.approx(3.0 * road_factor())
    others = [(s, c) for s in SLOPES for c in CURVES if (s, c) != (slope, curve)]
    assert all(road_factor(changed, slope=s, curve=c) == road_factor() for s, c in others)


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_every_visibility_has_a_factor_of_its_own(visibility):
    changed = Factors()._replace(**{f"visibility_{visibility}": 2.0})
    assert road_factor(changed, visibility=visibility) == pytest.approx(2.0 * friction_loss(0.9))


@pytest.mark.parametrize("kind", TYPES)
def test_every_type_has_a_factor_of_its_own(kind):
    assert type_factor(kind, Factors()._replace(**{kind: 7.0})) == 7.0


def test_classes_that_are_unknown_are_refused_by_name():
    with pytest.raises(ValueError, match=r"^slope = 'hilly': expected one of flat, ordinary"):
        road_factor(slope="hilly")
    with pytest.raises(ValueError, match=r"^friction = 1.2 is out of range: expected a finite number >= 0 and <= 1$"):
        road_factor(friction=1.2)
    with pytest.raises(ValueError, match=r"^kind = 'lorry': expected one of car, truck"):
        road_users(0.0, 0.0, 1.0, 0.0, kind="lorry")


def test_only_persons_have_a_driver_factor():
    assert driver_factor(automated=True) == 0.0
    assert driver_factor() == 0.5
    assert driver_factor(Factors(driver_skill=1.5, driver_violations=0.8)) == pytest.approx(0.6)
    assert driver_factor(Factors(driver_state=3.0)) == 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(vx=45.0), r"^speed = 45 is out of range: expected < wave_speed = 44.4444 m/s$"),
        (dict(vx=[3.0, -32.0], vy=32.0), r"^speed = 45.2548 is out of range"),
        (dict(x=math.nan), r"^x = nan: expected a finite number$"),
        (dict(vy=math.inf), r"^vy = inf: expected a finite number$"),
        (dict(mass=0.0), r"^mass = 0.0 is out of range: expected a finite number > 0$"),
        (dict(driver=1.5), r"^driver = 1.5 is out of range: expected a finite number >= 0 and <= 1$"),
        (dict(road=-1.0), r"^road = -1.0 is out of range: expected a finite number > 0$"),
    ],
)
def test_road_users_are_checked_where_they_enter(change, message):
    with pytest.raises(ValueError, match=message):
        road_users(**(dict(x=0.0, y=0.0, vx=20.0, vy=0.0) | change))


def test_road_users_broadcast():
    users = road_users([0.0, 10.0, 20.0], 4.0, 25.0, 0.0, mass=[1500.0, 9000.0, 1200.0], driver=0.5)
    assert users["y"].tolist() == [4.0] * 3
    assert users["mass"].tolist() == [1500.0, 9000.0, 1200.0]
    assert (users["driver"] == 0.5).all()
    assert (users["road"] == RiskSettings().reference_road).all()
