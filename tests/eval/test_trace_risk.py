"""Risk read off a trace: the worked cases, and the meter that looked on while the episode was played."""

import json
from dataclasses import replace

import numpy as np
import pytest
from places import DATA
from played import cut_in

from rss_shield import make
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.eval.trace_risk import risk_of_trace
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.trace import Trace, straight_lane, users_of

CASES = {case["name"].split()[0]: case for case in json.loads((DATA / "risk-examples.json").read_text())["cases"]}


def one_frame(case):
    """Ego and source of a case on the middle of three lanes along x."""
    who = [case["ego"], case["source"]]
    columns = {name: np.array([[user[name] for user in who]], float) for name in ("x", "y", "vx", "vy")}
    heading = np.arctan2(columns["vy"], columns["vx"])
    speed = np.hypot(columns["vx"], columns["vy"])
    users = users_of("01", ("car", "car"), 5.0, 2.0, columns["x"], columns["y"], heading, speed, lane=[[1, 1]])
    lanes = [straight_lane(name, (-200.0, y), (200.0, y)) for name, y in (("a", -4.0), ("b", 0.0), ("c", 4.0))]
    return Trace(0.1, np.zeros(1), users, tuple(lanes))


@pytest.mark.parametrize("mode", ["iso", "radial"])
@pytest.mark.parametrize("name", ["F1", "F3", "F4", "F7", "C0", "C1"])
def test_worked_cases_have_the_digits_given(name, mode):
    risk = risk_of_trace(one_frame(CASES[name]), 0, RiskSettings.validated(mode=mode))
    expected = CASES[name][mode]
    assert float(f"{risk.rdsi[0]:.6g}") == expected["RDSI"]
    assert float(f"{risk.lower[0]:.6g}") == expected["RDSI1_star"]
    assert risk.partner[0] == 1


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v0", "intersection-v0"])
def test_it_says_what_the_meter_said_while_the_episode_was_played(env_id):
    env = make(env_id, "monitor", risk=True, max_episode_steps=12)
    rng = np.random.default_rng(3)
    trace = record_trace(env, lambda observation: int(rng.integers(env.action_space.n)), seed=4)
    frames = env.risk_frames
    (ego,) = trace.ego_users
    risk = risk_of_trace(trace, ego)
    assert len(frames) >= 10
    for name in ("rdsi", "lower", "upper", "state", "largest", "total", "ttc", "thw", "drac"):
        expected = np.array([getattr(frame, name) for frame in frames], float)
        np.testing.assert_allclose(getattr(risk, name)[: len(frames)], expected, rtol=1e-9, atol=1e-9, err_msg=name)


def test_who_is_not_there_has_no_risk():
    risk = risk_of_trace(cut_in(True), 2)  # leaves the scene at 3 s
    assert np.isfinite(risk.rdsi[:30]).all() and np.isnan(risk.rdsi[30:]).all()
    assert (risk.state[30:] == -1).all() and (risk.partner[30:] == -1).all()


def test_a_truck_weighs_more_than_a_car_in_the_sum_of_energies_but_not_against_its_own_standard():
    trace = cut_in(False)
    car_ego, _, truck = trace.users.kinds
    heavier = trace.replaced(users=replace(trace.users, kinds=(car_ego, "truck", truck)))
    np.testing.assert_allclose(risk_of_trace(heavier, 0).rdsi, risk_of_trace(trace, 0).rdsi, rtol=1e-12)
    car = RiskSettings.validated(standard="car")
    ratio = risk_of_trace(heavier, 0, car).rdsi / risk_of_trace(trace, 0, car).rdsi
    np.testing.assert_allclose(ratio, 1.443 * 10_000 / 1500, rtol=1e-9)


def test_nobody_has_no_risk():
    with pytest.raises(ValueError, match="user = 3: expected the index of one of 3 users"):
        risk_of_trace(cut_in(True), 3)
