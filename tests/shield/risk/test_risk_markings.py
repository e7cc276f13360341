"""Lane markings."""

import numpy as np
import pytest
from examples import CASES, EXAMPLES, MODES, rounded
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.shield.risk import RiskSettings, marking, marking_risk

RISK = RiskSettings()


@pytest.mark.parametrize("mode", MODES)
def test_the_marking_of_the_lane_change_has_the_digits_given(mode):
    expected = EXAMPLES["lane_marking_L1"]
    line = marking(expected["line"], expected["dist_m"], expected["approach_ms"], expected["D_m"])[0]
    risk = marking_risk(line, RISK)
    assert rounded(line["eta"]) == expected["eta"]
    assert rounded(risk.rdsi) == expected["RDSI_L"]
    if mode == "iso":
        standard = CASES["L1"][mode]["DSI_star"]
        assert risk.energy * standard == pytest.approx(expected["SPE_L"], rel=1e-5)
        assert risk.rate * standard == pytest.approx(expected["dSPE_L_dt"], rel=1e-5)


@settings(max_examples=100, deadline=None)
@given(st.floats(0.01, 1.7), st.floats(0.5, 3.0), st.floats(3.6, 6.0))
@pytest.mark.parametrize("kind", ["striped", "solid", "edge"])
def test_force_is_what_energy_loses_with_distance(kind, distance, exponent, width):
    risk, h = RISK._replace(marking_exponent=exponent), 1e-5

    def at(r):
        return marking_risk(marking(kind, r, 0.3, width)[0], risk)

    slope = (at(distance - h).energy - at(distance + h).energy) / (2 * h)
    assert at(distance).force == pytest.approx(slope, rel=1e-4, abs=1e-9)
    assert at(distance).rate == pytest.approx(0.3 * at(distance).force)


@pytest.mark.parametrize(("kind", "eta"), [("none", 0.0), ("striped", 0.02), ("solid", 0.1), ("edge", 0.3)])
@pytest.mark.parametrize("width", [3.5, 4.0])
def test_on_the_line_and_along_it_the_risk_is_its_weight(kind, eta, width):
    assert marking_risk(marking(kind, 0.0, 0.0, width)[0], RISK).rdsi == pytest.approx(eta)


def test_heading_for_a_line_at_1_m_s_makes_ten_times_its_weight():
    assert marking_risk(marking("solid", 0.0, 1.0, 4.0)[0], RISK).rdsi == pytest.approx(0.1 * 10)  # 1 + 9 * 2 * 2/4


@pytest.mark.parametrize("distance", [2.0, 2.5, 40.0])
def test_half_a_lane_away_there_is_none(distance):
    assert marking_risk(marking("edge", distance, 3.0, 4.0)[0], RISK) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("approach", [-0.5, -3.0])
def test_leaving_a_line_is_no_negative_risk(approach):
    risk = marking_risk(marking("solid", 1.0, approach, 4.0)[0], RISK)
    assert risk.rate < 0.0
    assert risk.rdsi == 0.0


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (("dotted", 1.0, 0.0, 4.0), r"^marking = 'dotted': expected one of none, striped, solid, edge$"),
        (("solid", -1.0, 0.0, 4.0), r"^distance = -1.0 is out of range: expected a finite number >= 0$"),
        (("solid", 1.0, np.nan, 4.0), r"^approach = nan: expected a finite number$"),
        (("solid", 1.0, 0.0, 0.0), r"^lane_width = 0.0 is out of range: expected a finite number > 0$"),
    ],
)
def test_markings_are_checked_where_they_enter(row, message):
    with pytest.raises(ValueError, match=message):
        marking(*row)
