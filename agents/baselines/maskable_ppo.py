"""MaskablePPO of sb3-contrib: chooses among the actions that `action_masks()` of the environment permits.

Huang & Ontañón, "A closer look at invalid action masking in policy gradient algorithms", 2022. A mask looks ahead over
one decision; the shield of every frame stays behind it.
"""

from sb3_contrib import MaskablePPO

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner


def learner() -> Learner:
    """MaskablePPO with the hyperparameters of PPO."""
    return ppo.learner()._replace(algorithm=MaskablePPO)
