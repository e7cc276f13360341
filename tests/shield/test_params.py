"""RSSParams: bad values are refused where they enter, and the presets are the published tables."""

import math

import pytest

from rss_shield.shield.params import PRESETS, ROADS, RSSParams, Rules

GOOD = dict(
    response_time=1.0,
    a_max_accel=3.5,
    a_min_brake=4.0,
    a_max_brake=8.0,
    a_min_brake_correct=3.0,
    a_lat_max_accel=0.2,
    a_lat_min_brake=0.8,
    mu=0.1,
    standstill_gap=1.0,
    v_cap=100.0,
)


def test_good_values_are_kept_as_floats():
    params = RSSParams.validated(**GOOD)
    assert params._asdict() == GOOD
    assert all(type(value) is float for value in RSSParams.validated(**(GOOD | {"response_time": 1})))


@pytest.mark.parametrize("name", ["response_time", "a_min_brake", "a_max_brake", "a_lat_min_brake", "v_cap"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_values_that_must_be_positive_name_field_value_and_range(name, value):
    with pytest.raises(ValueError, match=rf"^{name} = {value!r} .* > 0$"):
        RSSParams.validated(**(GOOD | {name: value}))


@pytest.mark.parametrize("name", ["a_max_accel", "a_lat_max_accel", "mu", "standstill_gap"])
@pytest.mark.parametrize("value", [-0.5, math.nan, math.inf])
def test_values_that_may_be_zero_name_field_value_and_range(name, value):
    assert getattr(RSSParams.validated(**(GOOD | {name: 0.0})), name) == 0.0
    with pytest.raises(ValueError, match=rf"^{name} = {value!r} .* >= 0$"):
        RSSParams.validated(**(GOOD | {name: value}))


def test_only_the_speed_cap_may_be_infinite():
    assert RSSParams.validated(**(GOOD | {"v_cap": math.inf})).v_cap == math.inf
    for name in RSSParams._fields:
        if name != "v_cap":
            with pytest.raises(ValueError, match=f"^{name} = inf "):
                RSSParams.validated(**(GOOD | {name: math.inf}))


def test_braking_as_a_negative_number_is_refused():
    with pytest.raises(ValueError, match=r"^a_min_brake = -4\.0 "):
        RSSParams.validated(**(GOOD | {"a_min_brake": -4.0}))


def test_an_unknown_field_is_refused_by_name():
    with pytest.raises(ValueError, match=r"'a_min_break'.*a_min_brake"):
        RSSParams.validated(**(GOOD | {"a_min_break": 4.0}))


@pytest.mark.parametrize("name", RSSParams._fields)
def test_a_missing_field_is_named(name):
    with pytest.raises(ValueError, match=f"{name} is missing"):
        RSSParams.validated(**{field: value for field, value in GOOD.items() if field != name})


@pytest.mark.parametrize("value", ["4 m/s^2", None, [4.0]])
def test_what_is_not_a_number_is_named_with_its_value(value):
    with pytest.raises(ValueError) as error:
        RSSParams.validated(**(GOOD | {"a_min_brake": value}))
    assert f"a_min_brake = {value!r} is not a number" in str(error.value)


def test_a_truth_value_is_no_number():
    with pytest.raises(ValueError, match="a_min_brake = True is out of range: expected a finite number"):
        RSSParams.validated(**(GOOD | {"a_min_brake": True}))


def test_nobody_brakes_weaker_than_the_hardest_braking_allows():
    with pytest.raises(ValueError, match=r"^a_min_brake = 9 .* at most a_max_brake = 8$"):
        RSSParams.validated(**(GOOD | {"a_min_brake": 9.0}))


def test_the_car_in_its_own_lane_is_not_asked_to_brake_harder_than_the_others():
    with pytest.raises(ValueError, match=r"^a_min_brake_correct = 5 .* at most a_min_brake = 4$"):
        RSSParams.validated(**(GOOD | {"a_min_brake_correct": 5.0}))


# rho of ego and others, then a_max_accel, a_min_brake, a_max_brake, a_min_brake_correct, lateral
# acceleration and braking, mu, standstill gap, speed cap: as printed in each preset's source
PUBLISHED = {
    "simulator": (2 / 15, 1.0, 3.0, 5.0, 6.0, 3.0, 1.0, 1.5, 0.1, 1.0, 40.0),
    "intersection": (2 / 15, 1.0, 6.0, 5.0, 6.0, 3.0, 1.0, 1.5, 0.1, 1.0, 40.0),
    "slides": (1.0, 2.0, 3.5, 4.0, 8.0, 4.0, 0.2, 0.8, 0.1, 1.0, math.inf),
    "ad-rss": (1.0, 2.0, 3.5, 4.0, 8.0, 3.0, 0.2, 0.8, 0.1, 0.0, 100.0),
    "carla": (0.5, 0.5, 5.0, 4.0, 8.0, 3.0, 0.2, 0.8, 0.1, 0.0, 100.0),
    "rodionova-conservative": (1.94, 1.94, 5.91, 4.13, 9.50, 1.86, 0.45, 0.86, 0.07, 0.0, math.inf),
    "rodionova-assertive": (0.53, 0.53, 4.10, 4.64, 8.03, 1.76, 0.43, 0.96, 0.07, 0.0, math.inf),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_presets_are_the_published_tables(name):
    rho_ego, rho_other, *rest = PUBLISHED[name]
    assert PRESETS[name].ego == (rho_ego, *rest)
    assert PRESETS[name].other == (rho_other, *rest)


@pytest.mark.parametrize("name", PRESETS)
def test_presets_pass_their_own_validation_and_name_their_source(name):
    preset = PRESETS[name]
    for params in (preset.ego, preset.other):
        assert RSSParams.validated(**params._asdict()) == params
    assert preset.source


def test_only_the_presets_of_the_simulator_react_as_fast_as_it_allows():
    quick = [name for name, preset in PRESETS.items() if preset.per_frame]
    assert quick == ["simulator", "intersection", "parking", *ROADS]


def test_every_rule_of_the_proof_is_in_force_by_default():
    rules = Rules()
    switches = [value for value in rules if isinstance(value, bool)]
    assert switches and all(switches)
    assert 0.0 < rules.heading_bound < 1.0
    assert rules.overlap_margin > 0.0
    assert rules.anticipation > 0.0
