"""PPO that pays for interventions, at a price that moves until they are as many, or as large, as wanted."""

import functools

from gymnasium.vector import VectorEnv

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner
from rss_shield.agents.multiplier import Meter, MultiplierRecorder, Pid
from rss_shield.agents.vec_env import VectorEnvAdapter

# what `penalty_on` names: where it is in infos, the smallest scale of errors, and the gains
SIGNALS: dict[str, tuple[tuple[str, ...], float, dict[str, float]]] = {
    "response": (("shield", "override_fraction"), 0.005, dict(kp=0.1, ki=0.1, kd=0.1, largest=5.0)),
    "change": (("shield", "mean_acceleration_change"), 0.1, dict(kp=0.01, ki=0.005, kd=0.01, largest=2.0)),
}


def learner(target: float, penalty_on: str) -> Learner:
    """PPO with an adaptive intervention penalty.

    Args:
      target: wanted mean per decision: the share of frames that a proper response overrides, or the change
        of acceleration [m/s^2].
      penalty_on: "response" or "change".
    """
    keys, least, gains = SIGNALS[penalty_on]
    gains = {"scale": max(target, least), **gains}
    return ppo.learner()._replace(
        adapt=functools.partial(_adapt, keys),
        attributes=lambda: {"pid": Pid(target, **gains)},
        callbacks=lambda: [MultiplierRecorder("intervention")],
        notes={**ppo.learner().notes, "target": target, "penalty_on": penalty_on, **gains},
    )


def _adapt(keys: tuple[str, ...], env: VectorEnv) -> VectorEnvAdapter:
    return VectorEnvAdapter(env, Meter(*keys))
