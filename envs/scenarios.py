"""Named environments and how to make them with a shield."""

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments

from envs.wrapper import ShieldWrapper
from shield.params import PRESETS, Preset, RSSParams, Rules


def make(
    env_id: str,
    shield: str | None = "override",
    params: Preset | tuple[RSSParams, RSSParams] = PRESETS["simulator"],
    rules: Rules = Rules(),
    intervention_penalty: float = 0.0,
    record: bool = False,
    **kwargs,
) -> gym.Env:
    """`gymnasium.make` with a shield around it.

    Args:
      env_id: "highway-fast-v0", "highway-v0", "two-way-v0", "merge-v0", "exit-v0", ...
      shield: "override", "monitor", or None for the bare environment.
      params, rules, intervention_penalty, record: see `ShieldWrapper`.
      kwargs: passed to `gymnasium.make`, e.g. `config={"vehicles_count": 30}`, `render_mode="rgb_array"`.

    Raises:
      ValueError: unknown environment or shield, or whatever `ShieldWrapper` objects to.
    """
    if shield is not None and shield not in ("override", "monitor"):
        raise ValueError(f"shield = {shield!r}: expected 'override', 'monitor' or None")
    try:
        env = gym.make(env_id, **kwargs)
    except gym.error.Error as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    if shield is None:
        return env
    return ShieldWrapper(
        env, mode=shield, params=params, intervention_penalty=intervention_penalty, rules=rules, record=record
    )
