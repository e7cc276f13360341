"""Stays inside the band, and their risk."""

import numpy as np
import pytest
from examples import EXAMPLES, MODES, rounded, user

from rss_shield.shield.risk import RiskSettings, band_risk, risk_of


def braking_run(mode):
    """The example's run: 20 m/s, 45 m behind a car at 15 m/s, brakes at 2.5 m/s^2 from t = 2 s until as slow."""
    times, risk = np.arange(0.0, 8.05, 0.1), []
    for t in times:
        braking = min(max(t - 2.0, 0.0), 2.0)
        x = 20.0 * t - 1.25 * braking**2 - 2.5 * braking * max(t - 4.0, 0.0)
        ego, lead = user(x, 0.0, 20.0 - 2.5 * braking), user(45.0 + 15.0 * t, 0.0, 15.0)
        risk.append(risk_of(ego, lead, False, RiskSettings.validated(mode=mode)))
    return times, *(np.array(column) for column in zip(*(one[:3] for one in risk), strict=True))


@pytest.mark.parametrize("mode", MODES)
def test_the_run_of_the_example_has_the_digits_given(mode):
    expected = EXAMPLES[f"band_{mode}"]
    times, rdsi, lower, upper = braking_run(mode)
    assert [rounded(value) for value in rdsi[::10]] == expected["RDSI_every_1s"]
    assert rounded(rdsi.max()) == expected["RDSI_max"]
    assert [rounded(lower.min()), rounded(lower.max())] == expected["RDSI1_range"]
    for kind in ("integral", "excess"):
        band = band_risk(times, rdsi, lower, upper, mode=kind)
        assert band.spans == pytest.approx(np.array(expected["spans"]), rel=5e-6, abs=1e-12)
        assert rounded(band.total) == expected[f"risk_{kind}"]
        assert (band.risks.sum(), band.mode) == (band.total, kind)


def test_a_triangle_by_hand():
    # up from 0 to 1 and down again in 2 s, lower 0.5: inside from 0.5 to 1.5 s, mean 0.75, excess half of 0.5
    for mode, risk in (("integral", 0.75), ("excess", 0.25)):
        band = band_risk([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], 0.5, 2.0, mode=mode)
        assert band.spans.tolist() == [[0.5, 1.5]]
        assert band.total == pytest.approx(risk)


def test_what_is_beyond_the_upper_threshold_is_left_out():
    # 0 to 4 and back in 8 s, band [1, 2]: one stay up and one down, 1 s each, mean 1.5
    band = band_risk([0.0, 4.0, 8.0], [0.0, 4.0, 0.0], 1.0, 2.0)
    assert band.spans.tolist() == [[1.0, 2.0], [6.0, 7.0]]
    assert band.risks.tolist() == pytest.approx([1.5, 1.5])


def test_a_step_through_the_whole_band_is_a_stay_inside_it():
    band = band_risk([0.0, 1.0], [0.0, 4.0], 1.0, 2.0)
    assert band.spans.tolist() == [[0.25, 0.5]]
    assert band.total == pytest.approx(0.25 * 1.5)


def test_thresholds_may_move():
    band = band_risk([0.0, 2.0], [1.0, 1.0], [0.0, 2.0], [3.0, 3.0], mode="excess")
    assert band.spans.tolist() == [[0.0, 1.0]]
    assert band.total == pytest.approx(0.5)  # a triangle


def test_short_stays_do_not_count():
    times, rdsi = [0.0, 1.0, 1.1, 1.2, 2.0, 3.0], [0.0, 0.0, 1.0, 0.0, 1.0, 1.0]
    assert len(band_risk(times, rdsi, 0.5, 2.0).spans) == 1
    both = band_risk(times, rdsi, 0.5, 2.0, least_stay=0.05)
    assert both.spans.ravel().tolist() == pytest.approx([1.05, 1.15, 1.6, 3.0])


@pytest.mark.parametrize("rdsi", [[], [1.0], [0.0, 0.0, 0.0], [5.0, 5.0], [0.0, 9.0 - 9.0]])
def test_nothing_inside_is_no_risk(rdsi):
    band = band_risk(np.arange(len(rdsi)), rdsi, 0.5, 2.0)
    assert band.spans.shape == (0, 2)
    assert band.total == 0.0


@pytest.mark.parametrize("mode", ["integral", "excess"])
def test_samples_in_between_change_nothing(mode):
    rng = np.random.default_rng(5)
    for _ in range(50):
        times = np.cumsum(rng.uniform(0.3, 1.0, 12))
        rdsi, lower, upper = rng.uniform(0, 2, 12), rng.uniform(0.3, 0.7, 12), rng.uniform(0.9, 1.3, 12)
        finer = np.sort(np.r_[times, rng.uniform(times[0], times[-1], 30)])
        series = [np.interp(finer, times, column) for column in (rdsi, lower, upper)]
        one = band_risk(times, rdsi, lower, upper, mode=mode, least_stay=0.0)
        two = band_risk(finer, *series, mode=mode, least_stay=0.0)
        assert two.total == pytest.approx(one.total, rel=1e-9, abs=1e-12)
        assert two.spans.shape == one.spans.shape
        assert two.spans == pytest.approx(one.spans, abs=1e-9)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match=r"^mode = 'area': expected one of integral, excess$"):
        band_risk([0.0], [1.0], 0.5, 1.0, mode="area")
    with pytest.raises(ValueError, match=r"^times: expected ascending values$"):
        band_risk([0.0, 0.0], [1.0, 1.0], 0.5, 1.0)
