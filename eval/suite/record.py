"""`rss-shield record`: one episode of an environment into a trace."""

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.make import make
from rss_shield.shield.params import PRESETS
from rss_shield.shield.trace import save

SHIELDS = {"on": "override", "off": "monitor"}  # off: it watches only, so that the trace has a verdict


def run(arguments: list[str] | None = None) -> None:
    """Play and record one episode."""
    parser = argparse.ArgumentParser(prog="rss-shield record", description="Record one episode as a trace.")
    parser.add_argument("env", help="such as highway-fast-v0")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policy", default="faster", help="faster, random, or MODULE:FUNCTION of an observation")
    parser.add_argument("--shield", choices=SHIELDS, default="on")
    parser.add_argument("--params", help=f"preset: {', '.join(PRESETS)}")
    parser.add_argument("--out", type=Path, required=True, help="file, NAME.npz")
    options = parser.parse_args(arguments)
    try:
        env = make(options.env, SHIELDS[options.shield], options.params)
        trace = record_trace(env, policy_of(options.policy, env, options.seed), options.seed)
    except ValueError as error:
        sys.exit(f"rss-shield record: {error}")
    save(trace, options.out)
    said = ", ".join(contact.verdict for contact in trace.contacts)
    print(f"{options.out}: {len(trace.time)} samples, {len(trace.users.ids)} road users, blame: {said or 'no contact'}")


def policy_of(name: str, env: Any, seed: int) -> Callable[[Any], Any]:
    """A policy by name.

    Raises:
      ValueError: there is no such policy, or none for this environment.
    """
    if ":" in name:
        module, function = name.split(":", 1)
        try:
            return getattr(importlib.import_module(module), function)
        except (ImportError, AttributeError) as error:
            raise ValueError(f"policy = {name!r}: {error}") from None
    space = env.action_space
    if name == "random":
        space.seed(np.random.SeedSequence(seed).generate_state(1).tolist()[0])
        return lambda observation: space.sample()
    if name != "faster":
        raise ValueError(f"policy = {name!r}: expected faster, random or MODULE:FUNCTION")
    actions = getattr(env.unwrapped.action_type, "actions_indexes", None)
    if actions is None:
        raise ValueError("policy = 'faster': expected one agent with actions by name; use random")
    return lambda observation: actions["FASTER"]
