"""What an environment says about a step, as arrays: the same keys and meanings as on highway-env.

Arrays of numbers are views of the engine's records; nothing is computed for an environment that
nobody asks about.
"""

import numpy as np

from rss_shield.envs.fast.config import EXIT, INTERSECTION, Scenario
from rss_shield.envs.options import Settings
from rss_shield.shield.comfort import Comfort
from rss_shield.shield.definitions.response import AXES
from rss_shield.shield.junctions.plans import PLAN_NAMES
from rss_shield.shield.lanes.controller import response_name
from rss_shield.shield.lanes.judge import DUTIES, VERDICTS
from rss_shield.shield.risk import STATES


def _names(texts) -> np.ndarray:
    """As objects: arrays of characters, each as long as the longest name, would be copied for every environment."""
    return np.array(list(texts), object)


_BLAMES = _names(["", *VERDICTS])
_DUTIES = _names(DUTIES)
_STATES = _names(STATES)
_RESPONSES = _names(response_name(sum_of_bits) for sum_of_bits in range(16))
_AXES = _names([*(AXES[axes] for axes in range(len(AXES))), *(PLAN_NAMES[kind] for kind in range(len(PLAN_NAMES)))])


def step_infos(
    steps: np.ndarray, scenario: Scenario, settings: Settings | None, risks: np.ndarray | None = None
) -> dict:
    """Infos of a batch.

    Args:
      steps: `[E]` STEP.
      scenario: what was run.
      settings: of the shield, None = no shield.
      risks: `[E]` RISK, None = nobody asked.

    Returns:
      Dictionary of arrays `[E]`: `speed`, `crashed`, `rewards` (one array per component), at intersections
      `agents_rewards` and `agents_terminated` (tuples, one value for each agent) and, with a shield, what
      `ShieldWrapper` documents. `blame_evidence` counts where `blame` is not "".
    """
    infos = {
        "speed": steps["speed"],
        "crashed": steps["crashed"],
        "rewards": {name: steps[f"reward_{k}"] for k, name in enumerate(scenario.reward_names)},
    }
    kind = scenario.config["scenario"][0]
    if kind == INTERSECTION:
        infos["agents_rewards"] = _of_one_agent(steps["raw_reward"])
        infos["agents_terminated"] = _of_one_agent(steps["crashed"] | steps["success"])
    if kind == EXIT or (kind == INTERSECTION and settings is not None):  # a bare intersection does not say it
        infos["is_success"] = steps["success"]
    if settings is not None:
        infos |= _shield_infos(steps, settings)
    if risks is not None and settings is not None:
        infos |= _risk_infos(risks, settings.dt)
    return infos


def _of_one_agent(values: np.ndarray) -> np.ndarray:
    """As tuples with one value each, which is what highway-env says of its agents."""
    return np.fromiter(zip(values.tolist(), strict=True), object, len(values))


def _shield_infos(steps: np.ndarray, settings: Settings) -> dict:
    frames = np.maximum(steps["frames"], 1)
    blame = _BLAMES[steps["blame"]]
    return {
        "shield": {
            "intervened": steps["overridden"] > 0,
            "override_fraction": steps["overridden"] / frames,
            "anticipation_fraction": steps["anticipated"] / frames,
            "limited_fraction": steps["limited"] / frames,
            "acceleration_change": steps["acceleration_change"],
            "steering_change": steps["steering_change"],
            "mean_acceleration_change": steps["acceleration_changed"] / frames,
            "mean_steering_change": steps["steering_changed"] / frames,
            "lane_change_refused": steps["lane_change_refused"],
            "dangerous": steps["dangerous_pairs"] > 0,
            "dangerous_pairs": steps["dangerous_pairs"],
            "broken_duties": steps["broken_duties"],
            "min_margin_lon": steps["margin_lon"],
            "min_margin_lat": steps["margin_lat"],
            "partner": steps["partner"],
            "response": _RESPONSES[steps["response"]],
        },
        "time": steps["time"],
        "cost": steps["cost"],
        "blame": blame,
        "blame_evidence": {
            "verdict": blame,
            "partner": steps["blame_partner"],
            "danger": _AXES[steps["blame_axes"]],
            "seconds_since_threshold": steps["blame_frames"] * settings.dt,
            "ego_duty": _DUTIES[steps["ego_duty"]],
            "ego_excess": steps["ego_excess"],
            "other_duty": _DUTIES[steps["other_duty"]],
            "other_excess": steps["other_excess"],
        },
        "override_share": steps["override_share"],
        "anticipation_share": steps["anticipation_share"],
        "limited_share": steps["limited_share"],
        "mean_acceleration_change": steps["mean_acceleration_change"],
        "mean_steering_change": steps["mean_steering_change"],
        "episode_cost": steps["episode_cost"],
        "episode_dangerous_pairs": steps["episode_dangerous_pairs"],
        "episode_broken_duties": steps["episode_broken_duties"],
        "min_ttc": steps["min_ttc"],
        **{name: steps["comfort"][:, k] for k, name in enumerate(Comfort._fields)},
        "raw_reward": steps["raw_reward"],
    }


def _risk_infos(risks: np.ndarray, dt: float) -> dict:
    return {
        "risk": {
            "rdsi": risks["rdsi"],
            "lower": risks["lower"],
            "upper": risks["upper"],
            "state": _STATES[risks["state"]],
            "partner": risks["partner"],
            "largest": risks["largest"],
            "total": risks["total"],
            "state_of_total": _STATES[risks["state_of_total"]],
            "ttc": risks["ttc"],
            "thw": risks["thw"],
            "drac": risks["drac"],
        },
        "max_rdsi": risks["max_rdsi"],
        "max_total_rdsi": risks["max_total_rdsi"],
        **{f"time_{name}": risks[name] * dt for name in STATES},
        "band_risk": risks["band_risk"],
        "min_thw": risks["min_thw"],
        "max_drac": risks["max_drac"],
    }


def info_of(infos: dict, e: int) -> dict:
    """Infos of one environment out of those of a batch, as plain Python values."""
    info = {key: info_of(values, e) if isinstance(values, dict) else values.item(e) for key, values in infos.items()}
    if info.get("blame") == "":
        info["blame_evidence"] = {}
    return info
