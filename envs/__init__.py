"""The shield on simulators."""

from envs.multi_agent import MultiAgentShield
from envs.scenarios import make
from envs.vector import make_vec
from envs.wrapper import ShieldWrapper

__all__ = ["MultiAgentShield", "ShieldWrapper", "make", "make_vec"]
