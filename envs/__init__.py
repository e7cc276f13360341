"""The shield on simulators."""

from envs.scenarios import make
from envs.wrapper import ShieldWrapper

__all__ = ["ShieldWrapper", "make"]
