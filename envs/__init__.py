"""The shield on simulators."""

from envs.scenarios import make
from envs.vector import make_vec
from envs.wrapper import ShieldWrapper

__all__ = ["ShieldWrapper", "make", "make_vec"]
