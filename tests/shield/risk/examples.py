"""The worked numbers of `risk-examples.json`, and what any reading of the field makes of the same scenes."""

import json

import numpy as np
from places import DATA

from rss_shield.shield.risk.classes import STATES, classify
from rss_shield.shield.risk.factors import DRY, WET, road_factor
from rss_shield.shield.risk.field import bearing, field, mass_of, road_users
from rss_shield.shield.risk.settings import RiskSettings
from rss_shield.shield.risk.standard import lane_change_distances, risk_of, standard_distance

EXAMPLES = json.loads((DATA / "risk-examples.json").read_text())
CASES = {case["name"].split()[0]: case for case in EXAMPLES["cases"]}
MODES = ("iso", "radial")
COMPILED = {
    function.__name__: function
    for function in (bearing, field, mass_of, risk_of, standard_distance, lane_change_distances)
}


def user(x=0.0, y=0.0, vx=0.0, vy=0.0, **more):
    """One `SOURCE` record; a car."""
    return road_users(x, y, vx, vy, **more).view(np.recarray)[0]


def scene(case):
    """Ego and source of a case."""
    road = road_factor(friction=WET if case["name"].startswith("W") else DRY)
    return tuple(
        user(who["x"], who["y"], who["vx"], who["vy"], mass=who["m_kg"], kind=who["kind"], road=road, driver=who["DR"])
        for who in (case["ego"], case["source"])
    )


def measured(case, mode, functions=COMPILED):
    """What the functions of the package say about a case, under the names of the examples."""
    ego, source = scene(case)
    settings, lane_change = RiskSettings.validated(mode=mode), case["name"].startswith("L")
    sight, here = functions["bearing"](ego, source, settings), functions["field"](ego, source, settings)
    risk = functions["risk_of"](ego, source, lane_change, settings)
    spacing = functions["lane_change_distances"](ego, source, settings) if lane_change else (None, None)
    return {
        "r_m": sight.distance,
        "cos_theta": sight.along / sight.speed if sight.speed else 0.0,
        "r_dot": -sight.closing,
        "M_src": functions["mass_of"](source, settings),
        "M_ego": functions["mass_of"](ego, settings),
        "R_src": source.road,
        "R_ego": ego.road,
        "E_mag": here.strength,
        "F_mag": here.force,
        "F_vec": [here.force_x, here.force_y],
        "SPE": here.energy,
        "dSPE_dt": here.rate,
        "DSI": here.dsi,
        "r_star_m": functions["standard_distance"](ego, settings),
        "DSI_star": risk.standard,
        "RDSI": risk.rdsi,
        "RDSI1_star": risk.lower,
        "RDSI2_star": risk.upper,
        "D1_m": spacing[0],
        "D2_m": spacing[1],
        "state": STATES[classify.py_func(risk.rdsi, risk.lower, risk.upper)],
    }


def rounded(value):
    """To the six digits of the examples."""
    if isinstance(value, list):
        return [rounded(number) for number in value]
    return value if value is None or isinstance(value, str) else float(f"{value:.6g}")


def mismatches(functions=COMPILED):
    """Everything that differs from the examples: (case, mode, quantity)."""
    return [
        (name, mode, quantity)
        for name, case in CASES.items()
        for mode in MODES
        for quantity, value in measured(case, mode, functions).items()
        if rounded(value) != case[mode][quantity]
    ]
