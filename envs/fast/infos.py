"""What an environment says about a step, as arrays: the same keys and meanings as on highway-env.

Arrays of numbers are views of the engine's records; nothing is computed for an environment that
nobody asks about.
"""

import numpy as np

from rss_shield.envs.fast.config import EXIT, INTERSECTION, Scenario
from rss_shield.envs.options import Settings
from rss_shield.shield.tally import shield_infos


def step_infos(steps: np.ndarray, scenario: Scenario, settings: Settings | None) -> dict:
    """Infos of a batch.

    Args:
      steps: `[E]` STEP.
      scenario: what was run.
      settings: of the shield, None = no shield.

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
    return infos


def _of_one_agent(values: np.ndarray) -> np.ndarray:
    """As tuples with one value each, which is what highway-env says of its agents."""
    return np.fromiter(zip(values.tolist(), strict=True), object, len(values))
