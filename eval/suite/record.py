"""`rss-shield record`: one episode of an environment into a trace."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.make import make
from rss_shield.eval.files import file_for, refuse
from rss_shield.eval.own import driver_named, is_own
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, preset_in
from rss_shield.shield.trace import save

SHIELDS = {"on": "override", "off": "monitor"}  # off: it watches only, so that the trace has a verdict


def run(arguments: list[str] | None = None) -> None:
    """Play and record one episode."""
    parser = argparse.ArgumentParser(prog="rss-shield record", description="Record one episode as a trace.")
    parser.add_argument("env", help="such as highway-fast-v0")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policy", default="faster", help="faster, random, or MODULE:FUNCTION, as for rss-shield test")
    parser.add_argument("--one-by-one", action="store_true", help="the function maps one observation to one action")
    parser.add_argument("--shield", choices=SHIELDS, default="on")
    parser.add_argument("--preset", "--params", help=f"RSS parameters: {KNOWN_PRESETS}")
    parser.add_argument("--out", type=Path, help="file (default: ENV-seedSEED.npz)")
    options = parser.parse_args(arguments)
    try:
        if options.seed < 0:
            raise ValueError(f"--seed {options.seed}: expected a whole number >= 0")
        preset = None if options.preset is None else preset_in(options.preset)
        env = make(options.env, SHIELDS[options.shield], preset)
        policy = policy_of(options.policy, env, options.seed, options.one_by_one)
        out = file_for(options.out or f"{options.env.replace('/', '-')}-seed{options.seed}.npz")
        trace = record_trace(env, policy, options.seed)
        save(trace, out)
    except (ValueError, OSError) as error:
        refuse("rss-shield record", error)
    said = ", ".join(contact.verdict for contact in trace.contacts)
    print(f"{out}: {len(trace.time)} samples, {len(trace.users.ids)} road users, blame: {said or 'no contact'}")


def policy_of(name: str, env: Any, seed: int, one_by_one: bool = False) -> Callable[[Any], Any]:
    """A policy by name; functions take observations `[1, ...]`, as they do of all that are tested at once.

    Raises:
      ValueError: there is no such policy, or none for this environment.
    """
    if is_own(name):
        own = driver_named(name, one_by_one, env.action_space)
        return lambda observation: own(np.asarray(observation)[None])[0]
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
