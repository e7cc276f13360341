"""What an environment says about a step, as arrays: the same keys and meanings as on highway-env.

Arrays of numbers are views of the engine's records; nothing is computed for an environment that
nobody asks about.
"""

import numpy as np

from rss_shield.envs.fast.config import Scenario
from rss_shield.envs.fast.tasks import EXIT, INTERSECTION
from rss_shield.envs.options import Settings
from rss_shield.shield.risk import STATES
from rss_shield.shield.tally import shield_infos

_STATES = np.array(list(STATES), object)


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
        infos |= shield_infos(steps, settings.table.dt) | {"time": steps["time"], "raw_reward": steps["raw_reward"]}
    if risks is not None and settings is not None:
        infos |= _risk_infos(risks, settings.table.dt)
    return infos


def _of_one_agent(values: np.ndarray) -> np.ndarray:
    """As tuples with one value each, which is what highway-env says of its agents."""
    return np.fromiter(zip(values.tolist(), strict=True), object, len(values))


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
