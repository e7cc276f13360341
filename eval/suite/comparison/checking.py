"""Options out of range are refused in one line that names option, value and range."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

from rss_shield.agents.blocks import available_devices
from rss_shield.agents.history import LONGEST
from rss_shield.agents.networks import NETWORKS
from rss_shield.agents.trackers import TRACKERS, check_tracker
from rss_shield.command_line import fail, shown
from rss_shield.envs.arguments import rules_of
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import PENALTIES, WAITING, Options
from rss_shield.eval.arms import arm_named
from rss_shield.eval.files import NAMES, valid_name
from rss_shield.eval.own import function_named, is_own
from rss_shield.eval.suite.comparison.making import wrapped
from rss_shield.eval.suite.comparison.options import FIRST_REMOVAL_SEED, FIRST_TEST_SEED, Config
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, is_file, preset_in
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import PRESETS

SEEDS = "different whole numbers, 0 to 2**32 - 1, at least one"


def check_seeds(arguments: list[str], program: str) -> None:
    """Whole numbers come after --seeds: the reader of the command line would not say which."""
    if "--seeds" not in arguments:
        return
    after = arguments[arguments.index("--seeds") + 1 :]
    seeds = list(itertools.takewhile(lambda word: not word.startswith("--"), after))
    if not seeds or not all(seed.lstrip("-").isdecimal() for seed in seeds if seed != "-h"):
        fail(program, f"--seeds {shown(seeds)} is out of range: expected {SEEDS}")


def check(config: Config, program: str) -> None:
    """Refuse what is out of range, naming option, value and range.

    RSS parameters: see `eval.suite.comparison.reading.resolve`.
    """
    try:
        rules_of(config.rules, "--rules")
        if config.tracker in TRACKERS:
            check_tracker(config.tracker)
        Options(**wrapped(config))
    except ValueError as error:
        fail(program, str(error))
    devices, resumes = available_devices(), config.resume or config.resume_or_start
    looked_up: list[tuple[str, Callable[[str], Any], str]] = [("--arms", arm_named, arm) for arm in config.arms]
    looked_up += [("--arms", function_named, arm) for arm in config.arms if is_own(arm)]
    looked_up += [("--reward", function_named, config.reward)] * bool(config.reward)
    looked_up += [("--preset", preset_in, config.preset)] * is_file(config.preset)
    for option, look_up, name in looked_up:
        try:
            look_up(name)
        except ValueError as error:
            fail(program, f"{option}: {error}")
    for option, good, expected in (
        ("backend", config.backend in BACKENDS, f"one of {', '.join(BACKENDS)}"),
        ("arms", is_set_of(config.arms, config.arms), "one or more different names"),
        ("preset", is_file(config.preset) or config.preset in ("auto", *PRESETS), f"one of auto, {KNOWN_PRESETS}"),
        ("total_timesteps", config.total_timesteps >= 1, "at least 1"),
        ("seeds", is_set_of(config.seeds, range(2**32)), SEEDS),
        ("entry", config.entry in ENTRIES, f"one of {', '.join(ENTRIES)}"),
        ("intent", config.intent in INTENTS, f"one of {', '.join(INTENTS)}"),
        ("waiting", config.waiting in WAITING, f"one of {', '.join(WAITING)}"),
        ("intervention_penalty", 0 <= config.intervention_penalty < math.inf, "a number >= 0"),
        ("penalty_on", config.penalty_on in PENALTIES, f"one of {', '.join(PENALTIES)}"),
        ("target_intervention", 0 <= config.target_intervention < math.inf, "a number >= 0"),
        ("target_share", 0 <= config.target_share <= 1, "0 to 1"),
        ("cost_limit", 0 <= config.cost_limit <= 1, "0 to 1"),
        ("removal_checks", config.removal_checks >= 0, "at least 0"),
        ("removal_episodes", config.removal_episodes >= 0, "at least 0"),
        ("eval_episodes", config.eval_episodes >= 1, "at least 1"),
        (
            "first_seed",
            FIRST_TEST_SEED <= config.first_seed <= FIRST_REMOVAL_SEED - config.eval_episodes,
            f"{FIRST_TEST_SEED} to {FIRST_REMOVAL_SEED} less the episodes, apart from the seeds of training",
        ),
        ("replay_episodes", config.replay_episodes >= 0, "at least 0"),
        ("explore_for", 1 <= config.explore_for <= 1000, "1 to 1000"),
        ("history", 1 <= config.history <= LONGEST, f"1 to {LONGEST}"),
        ("network", config.network in NETWORKS, f"one of {', '.join(NETWORKS)}"),
        ("n_envs", 1 <= config.n_envs <= 4096, "1 to 4096"),
        ("workers", 1 <= config.workers <= 256, "1 to 256"),
        ("tracker", config.tracker in TRACKERS, f"one of {', '.join(TRACKERS)}"),
        ("device", config.device in devices, f"one of {', '.join(devices)} on this machine"),
        ("name", config.name in ("", valid_name(config.name)), f"{NAMES}, such as {valid_name(config.name)}"),
        (
            "resume",
            not (resumes and config.overwrite),
            "--resume or --overwrite, not both",
        ),
    ):
        if not good:
            value = shown(getattr(config, option))
            fail(program, f"--{option.replace('_', '-')} {value} is out of range: expected {expected}")


def is_set_of(values: tuple, accepted: Sequence) -> bool:
    """At least one value, none twice, all of them accepted."""
    return 0 < len(values) == len(set(values)) and all(value in accepted for value in values)
