"""All worked numbers, in both modes, and that a change of any line of the formulas shows in them."""

import pytest
from examples import CASES, COMPILED, MODES, measured, mismatches, rounded
from mutants import interpreted

MUTATIONS = {
    "fields are stronger behind": ("bearing", "speed - along", "speed + along"),
    "closing counts the ego's speed only": ("bearing", "(source.vx - ego.vx) * x", "(-ego.vx) * x"),
    "the published energy is the radial one": ("bearing", "_iso_shape(along, speed, settings)", "doppler"),
    "it follows a line of equal field to behind the source": ("_iso_shape", "(k3 - speed)", "(k3 + speed)"),
    "fields decay by one power more": ("field_strength", "(r * _decay(r, settings))", "(r * r * _decay(r, settings))"),
    "energy is not the integral": ("energy", "(settings.distance_exponent - 1.0) * ", ""),
    "nobody minds who drives the source": ("coupling", " * (1.0 + source.driver)", ""),
    "the ego's road does not count": ("coupling", " * ego.road", ""),
    "speeds of losses in m/s": ("loss", " / KMH", ""),
    "losses without a floor": ("loss", "max(v, settings.slowest_loss)", "v"),
    "the type of the source does not count": ("virtual_mass", "type_factor * mass", "mass"),
    "energy weighs as much as its rate": ("dsi", "(1.0 - settings.energy_weight) * rate", "rate"),
    "the standard is closing at the ego's speed": ("risk_of", "gap_star / settings.ttc", "gap_star"),
    "the standard has the source's road": (
        "_reference",
        "settings.reference_road * settings",
        "source.road * settings",
    ),
    "the standard's distance is half": ("standard_distance", "settings.headway, ", "0.5 * settings.headway, "),
    "lane changes have the thresholds of following": ("risk_of", "if lane_change:", "if False:"),
    "the rear car may brake harder": ("_spacing", "stopping_distance(v_rear, b)", "stopping_distance(v_rear, 2 * b)"),
    "who is behind is in front": ("lane_change_distances", "> 0.0", "< 0.0"),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", CASES)
def test_every_quantity_of_every_case_has_the_digits_given(name, mode):
    case = CASES[name]
    expected = {quantity: case[mode][quantity] for quantity in measured(case, mode)}
    assert {quantity: rounded(value) for quantity, value in measured(case, mode).items()} == expected


def test_the_sources_say_what_the_compiled_functions_do():
    assert mismatches({name: interpreted(function) for name, function in COMPILED.items()}) == []


@pytest.mark.parametrize(("function", "old", "new"), MUTATIONS.values(), ids=MUTATIONS)
def test_any_other_formula_gives_other_numbers(function, old, new):
    made = {}
    changed = {name: interpreted(whole, {function: (old, new)}, made) for name, whole in COMPILED.items()}
    assert mismatches(changed)
