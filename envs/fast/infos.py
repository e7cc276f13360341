"""What an environment says about a step, as arrays: the same keys and meanings as on highway-env.

Arrays of numbers are views of the engine's records; nothing is computed for an environment that
nobody asks about.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rss_shield.envs.fast.config import Scenario
from rss_shield.envs.fast.tasks import EXIT, INTERSECTION
from rss_shield.envs.options import Settings
from rss_shield.shield.risk import STATES
from rss_shield.shield.tally import shield_infos

_STATES = np.array(list(STATES), object)

# what a decision has and the beginning of an episode has not
OF_DECISIONS = ("raw_reward", "is_success", "proposed_action", "executed_action", "action_replaced")


class Agents(NamedTuple):
    """What is said of A egos."""

    steps: np.ndarray  # `[A, E]` STEP
    risks: np.ndarray | None  # `[A, E]` RISK, None = nobody asked

    def each(self) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        """Of one after the other."""
        return zip(self.steps, [None] * len(self.steps) if self.risks is None else self.risks, strict=True)


def step_infos(
    steps: np.ndarray,
    scenario: Scenario,
    settings: Settings | None,
    risks: np.ndarray | None = None,
    agents: Agents | None = None,
) -> dict:
    """Infos of a batch.

    Args:
      steps: `[E]` STEP.
      scenario: what was run.
      settings: of the shield, None = no shield.
      risks: `[E]` RISK, None = nobody asked.
      agents: what is said of each of several egos.

    Returns:
      Dictionary of arrays `[E]`: `speed`, `crashed`, `rewards` (one array per component), at intersections
      `agents_rewards` and `agents_terminated` (tuples, one value for each agent) and, with a shield, what
      `ShieldWrapper` documents. `blame_evidence` counts where `blame` is not "". Of several egos `agents` has that, a
      tuple with such a dictionary for each.
    """
    infos = {
        "speed": steps["speed"],
        "crashed": steps["crashed"],
        "rewards": {name: steps[f"reward_{k}"] for k, name in enumerate(scenario.reward_names)},
    }
    kind = scenario.config["scenario"][0]
    if kind == INTERSECTION:
        each = steps[None] if agents is None else agents.steps
        infos["agents_rewards"] = _tuples(each["raw_reward"])
        infos["agents_terminated"] = _tuples(each["crashed"] | each["success"])
    if agents is not None:
        if settings is not None:
            infos["raw_reward"] = infos["agents_rewards"] if scenario.apart else steps["raw_reward"]
            infos["agents"] = tuple(_infos_of(*one, settings) for one in agents.each())
        return infos
    if kind == EXIT or (kind == INTERSECTION and settings is not None):  # a bare intersection does not say it
        infos["is_success"] = steps["success"]
    if settings is not None:
        infos |= {"time": steps["time"], "raw_reward": steps["raw_reward"]} | _infos_of(steps, risks, settings)
    return infos


def _infos_of(steps: np.ndarray, risks: np.ndarray | None, settings: Settings) -> dict:
    """What a shield says of one ego."""
    infos = shield_infos(steps, settings.table.dt)
    return infos if risks is None else infos | _risk_infos(risks, settings.table.dt)


def _tuples(values: np.ndarray) -> np.ndarray:
    """`[A, E]` as tuples with one value for each agent, which is what highway-env says of them."""
    return np.fromiter(zip(*values.tolist(), strict=True), object, values.shape[1])


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


def where_decided(decided: np.ndarray, actions: Any) -> Any:
    """Actions `[E, ...]` where one was decided upon, else 0; of several agents a tuple of them."""
    if isinstance(actions, tuple):
        return tuple(where_decided(decided, one) for one in actions)
    return np.where(decided.reshape(-1, *[1] * (actions.ndim - 1)), actions, actions.dtype.type(0))


def marked(infos: dict, where: np.ndarray, decided: np.ndarray) -> dict:
    """Add the "_name" arrays that gymnasium expects; what only decisions have is left out where there was none."""
    told = {}
    for name, values in infos.items():
        valid = decided if name in OF_DECISIONS else where
        if valid is decided and not decided.any():
            continue
        if isinstance(values, tuple) and isinstance(values[0], dict):
            values = tuple(marked(one, where, decided) for one in values)
        told[name] = marked(values, where, decided) if isinstance(values, dict) else values
        told["_" + name] = valid
    return told


def without(info: dict, names: tuple[str, ...]) -> dict:
    def less(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(less, value))
        return without(value, names) if isinstance(value, dict) else value

    return {name: less(value) for name, value in info.items() if name not in names}
