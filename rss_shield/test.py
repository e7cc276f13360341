"""Test a trained model or a policy of one's own with the shield and without, and say who crashes: `rss-shield test`."""

from rss_shield.eval.interrupt import stop_on_interrupt

if __name__ == "__main__":  # before all that takes its time
    stop_on_interrupt("rss-shield test: stopping")

import functools
import json
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode, VectorEnv
from rich.console import Console

import rss_shield
from rss_shield.agents.history import LONGEST, with_history
from rss_shield.agents.load import algorithm_in, policy_of
from rss_shield.command_line import NO_OVERRIDES, ConfigFile, Overrides, fail, parsed, shown
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import WAITING
from rss_shield.eval.arms import CONTINUOUS, OFF_AND_ON
from rss_shield.eval.config_option import split_arguments, with_values
from rss_shield.eval.files import atomic, folder_for, write_json
from rss_shield.eval.metrics import summarise
from rss_shield.eval.own import digest_of, digests, driver_named, is_own
from rss_shield.eval.progress import move_to, progress_bar
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.run_folder import changes, versions
from rss_shield.eval.suite.comparison.options import FIRST_TEST_SEED
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, is_file, preset_in, usual_preset
from rss_shield.eval.suite.scored import columns_of, scored
from rss_shield.eval.suite.tested import check_free, title_of
from rss_shield.eval.table import print_table, write_table
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import PRESETS, Preset, RSSParams, with_parameters

PROGRAM = "rss-shield test"
ENV_ID = "highway-fast-v0"
SIDE_BY_SIDE = {"fast": 256, "highway-env": 1}
HELP = """Test a trained model, or a policy of one's own, with the shield and without; say who crashes.

Prints a table and writes every episode, with its verdict, to OUT/episodes.csv.

examples:
  rss-shield test runs/highway-fast-v0/shielded-seed0/model.zip
      a model of train.py: its card says on which road and with which parameters
  rss-shield test dqn_highway.zip --env-id highway-fast-v0
      any model of stable-baselines3 or sb3-contrib
  rss-shield test my_driver:drive --env-id merge-v0 --episodes 200
      a function in my_driver.py that maps observations [B, ...] to actions [B]
  rss-shield test my_driver:drive_one --one-by-one
      ... one observation to one action
  rss-shield test model.zip --config.duration 60 --config.lanes-count 4
      on a road that it was not trained on
  rss-shield test my_driver:drive --preset my-table.yaml --ego.response-time 0.5 --reward my_reward:reward
      with RSS parameters and a reward of one's own
"""
Policy = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Config:
    """What `rss-shield test --help` shows; one option a field."""

    policy: Annotated[str, tyro.conf.Positional]
    """A model's .zip file, or module:function."""
    env_id: str = ""
    """Environment; by default that of the model's card, else highway-fast-v0."""
    config: ConfigFile = field(default_factory=dict)
    """Its configuration, as for train: a file or JSON itself; single keys as --config.lanes-count 4."""
    tests: tuple[str, ...] = ("off", "on")
    """With what: off (the shield only watches and judges), on (it overrides), or both; also what the card names."""
    episodes: int = 1000
    """How many, on the same seeds for all tests."""
    first_seed: int = FIRST_TEST_SEED
    """Seed of the first; the others follow."""
    backend: str = "fast"
    """What simulates: fast (the compiled engine) or highway-env (the original)."""
    preset: str = "auto"
    """RSS parameters by name, or a file of your own; auto: the card's, else what suits the environment."""
    ego: Overrides = NO_OVERRIDES
    """RSS parameters of the ego that replace the preset's."""
    other: Overrides = NO_OVERRIDES
    """RSS parameters assumed of everybody else that replace the preset's."""
    reward: str = ""
    """A function of your own, module:function: its sums are in the column own return."""
    entry: str = ""
    """Whom the ego expects to give way where roads cross: cautious, priority or assertive."""
    intent: str = ""
    """Which routes it expects of others there: known, straight or any."""
    waiting: str = ""
    """Where it may wait there: line or anywhere."""
    history: int = 0
    """How many of the last observations it sees, side by side; by default as many as the card says, else one."""
    one_by_one: bool = False
    """The function maps one observation to one action."""
    out: Path = Path()
    """Folder for the results; by default runs/tested/NAME-ENVIRONMENT, of a model of train.py with the name of its
    run: runs/tested/RUN-ARM-seedK-model-ENVIRONMENT."""
    overwrite: bool = False
    """Replace results of other settings that are in the folder. Those of the same settings are replaced anyway."""


def main(arguments: list[str]) -> None:
    try:
        options, values = split_arguments(arguments)
        config = parsed(Config, PROGRAM, HELP, options)
        card = card_beside(config.policy)
        config = completed(config, values, card)
        policy, config = policy_for(config, card)
        tests = tests_of(config, card)
        preset, params = preset_of(config, card)
        policy = fitted(config, params, policy, next(iter(tests.values())))
        record = record_of(config, preset, params, tests)
        check_free(folder_for(config.out), record, config.overwrite)
    except (ValueError, OSError, ImportError) as error:
        fail(PROGRAM, f"{type(error).__name__}: {error}" if isinstance(error, ImportError) else str(error))
    played = []
    if card.get("options"):
        print(f"As on the card of the model: {json.dumps(card['options'])}", file=sys.stderr)
    for test, shield in tests.items():
        try:
            played.append(play(config, params, policy, card, test, shield))
        except ValueError as error:
            fail(PROGRAM, str(error))
    command = shlex.join([*PROGRAM.split(), *arguments])
    report(config.out, record, command, pd.concat(played, ignore_index=True))


def card_beside(policy: str) -> dict[str, Any]:
    """The card of a model of train.py; empty where there is none."""
    path = Path(policy).with_name("card.json")
    if not policy.endswith(".zip") or not path.exists():
        return {}
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} cannot be read: {error}") from None


def completed(config: Config, values: dict[tuple[str, ...], Any], card: Mapping[str, Any]) -> Config:
    """All options: what is not given, the card says, or the defaults.

    Raises:
      ValueError: names an option out of range.
    """
    same_road = config.env_id in ("", card.get("env_id"))
    env_id = config.env_id or card.get("env_id", ENV_ID)
    given = {**(card.get("config", {}) if same_road else {}), **config.config}
    if values or given:
        given = with_values(given, values, default_config(env_id))
        check_config(env_id, given)
    conduct = {
        name: getattr(config, name) or card.get(name, default)
        for name, default in (("entry", "cautious"), ("intent", "any"), ("waiting", "line"))
    }
    history = config.history or card.get("history", 1)
    config = replace(config, env_id=env_id, config=given, history=history, **conduct)
    if config.out == Path():
        config = replace(config, out=Path("runs") / "tested" / f"{name_of(config.policy)}-{env_id}")
    for option, good, expected in (
        ("episodes", config.episodes >= 1, "at least 1"),
        ("first_seed", 0 <= config.first_seed < 2**31, "0 to 2**31 - 1"),
        ("history", 1 <= config.history <= LONGEST, f"1 to {LONGEST}"),
        ("backend", config.backend in BACKENDS, f"one of {', '.join(BACKENDS)}"),
        ("preset", is_file(config.preset) or config.preset in ("auto", *PRESETS), f"one of auto, {KNOWN_PRESETS}"),
        ("entry", config.entry in ENTRIES, f"one of {', '.join(ENTRIES)}"),
        ("intent", config.intent in INTENTS, f"one of {', '.join(INTENTS)}"),
        ("waiting", config.waiting in WAITING, f"one of {', '.join(WAITING)}"),
    ):
        if not good:
            value = shown(getattr(config, option))
            raise ValueError(f"--{option.replace('_', '-')} {value} is out of range: expected {expected}")
    return config


def name_of(policy: str) -> str:
    """A policy in the name of a folder: a function, or a model after its folder and, where it has a card, its run."""
    if not policy.endswith(".zip"):
        return Path(policy).stem if ":" not in policy else policy.replace(":", "-")
    path = Path(policy)
    folders = path.resolve().parts[-3:-1] if path.with_name("card.json").exists() else [path.parent.name]
    return "-".join(filter(None, [*folders, path.stem]))


def tests_of(config: Config, card: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Name of each test -> options of the shield: those that a model was trained behind, and the test's own."""
    known = {**OFF_AND_ON, **card.get("tests", {})}
    unknown = [test for test in config.tests if test not in known]
    if unknown or not config.tests:
        raise ValueError(f"--tests {shown(config.tests)} is out of range: expected some of {', '.join(known)}")
    return {test: {**card.get("options", {}), **known[test]} for test in config.tests}


def preset_of(config: Config, card: Mapping[str, Any]) -> tuple[str, Preset]:
    """Name and table in force: as on the command line, as on the card, or what suits the environment.

    Raises:
      ValueError: names an option out of range.
    """
    name, preset = _preset_of(config, card)
    try:
        return name, with_parameters(preset, config.ego.given, config.other.given)
    except ValueError as error:
        raise ValueError(f"--{error}") from None


def _preset_of(config: Config, card: Mapping[str, Any]) -> tuple[str, Preset]:
    if config.preset != "auto":
        try:
            return config.preset, preset_in(config.preset)
        except ValueError as error:
            raise ValueError(f"--preset: {error}") from None
    if card.get("env_id") != config.env_id or "parameters" not in card:
        usual = usual_preset(config.env_id)
        return usual, PRESETS[usual]
    told = card["parameters"]
    sides = {side: RSSParams.validated(**{k: float(v) for k, v in told[side].items()}) for side in ("ego", "other")}
    return card.get("preset", "on its card"), Preset(**sides, source=told["source"], per_frame=told["per_frame"])


def record_of(config: Config, preset: str, params: Preset, tests: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """All that the result depends on."""
    options = {name: value for name, value in vars(config).items() if name not in ("out", "overwrite")}
    model = Path(config.policy)
    return {
        **options,
        "preset": preset,
        "ego": {**_replaced(preset, params, "ego"), **config.ego.given},
        "other": {**_replaced(preset, params, "other"), **config.other.given},
        "shield": {test: dict(shield) for test, shield in tests.items()},
        "sources": {
            **digests([config.policy, config.reward, config.preset]),
            **({config.policy: digest_of(model)} if model.is_file() else {}),
        },
        "parameters": {
            **{"ego": params.ego._asdict(), "other": params.other._asdict()},
            **{"per_frame": params.per_frame, "source": params.source},
        },
    }


def _replaced(preset: str, params: Preset, side: str) -> dict[str, float]:
    """Parameters that are not the preset's, as a card may have them; nothing where its file is not here."""
    try:
        usual = preset_in(preset)
    except ValueError:
        return {}
    return {name: value for name, value, _ in changes(getattr(params, side)._asdict(), getattr(usual, side)._asdict())}


class Tested:
    """A policy with what its environment has to have.

    Args:
      act: observations -> actions.
      spaces: of a model: observations and actions; None = anything.
      masked: it takes masks.
    """

    def __init__(self, act: Policy, spaces: tuple[gym.Space, gym.Space] | None = None, masked: bool = False) -> None:
        self.act, self.spaces, self.masked = act, spaces, masked


def policy_for(config: Config, card: Mapping[str, Any]) -> tuple[Tested, Config]:
    """The policy; and the options, with continuous actions where a model has them.

    Raises:
      ValueError: there is no such file, module or function.
    """
    if is_own(config.policy):
        return Tested(driver_named(config.policy, config.one_by_one)), config
    path = Path(config.policy)
    if not path.exists():
        raise ValueError(f"{path}: no such file; expected a model's .zip file or module:function")
    model: Any = algorithm_in(path).load(path, device="cpu")
    if isinstance(model.action_space, gym.spaces.Box) and "action" not in config.config:
        config = replace(config, config={**config.config, **CONTINUOUS})
    policy = policy_of(model)
    return Tested(policy, (model.observation_space, model.action_space), getattr(policy, "masked", False)), config


def environments(config: Config, params: Any, shield: Mapping[str, Any], n_envs: int) -> VectorEnv:
    conduct: dict[str, Any] = {"entry": config.entry, "intent": config.intent, "waiting": config.waiting}
    env = rss_shield.make_vec(
        config.env_id,
        n_envs,
        backend=config.backend,
        params=params,
        config=config.config or None,
        autoreset_mode=AutoresetMode.DISABLED,
        **{**conduct, **shield},
    )
    return with_history(env, config.history)


def fitted(config: Config, params: Any, policy: Tested, shield: Mapping[str, Any]) -> Tested:
    """The policy for the environment, as it is in one of the tests: a function's actions are compared with those there.

    Raises:
      ValueError: a model that is made for other observations or actions.
    """
    env = environments(config, params, shield, 1)
    env.close()
    if policy.spaces is None:
        return Tested(driver_named(config.policy, config.one_by_one, env.single_action_space))
    observations, actions = policy.spaces
    for kind, model, here in (
        ("observations", observations.shape, env.single_observation_space.shape),
        ("actions", _size(actions), _size(env.single_action_space)),
    ):
        if model != here:
            raise ValueError(
                f"{config.policy}: made for {kind} {model}, but {config.env_id} has {here}; --env-id and "
                "--config.observation... choose another environment"
            )
    return policy


def _size(space: gym.Space) -> Any:
    return int(space.n) if isinstance(space, gym.spaces.Discrete) else space.shape


def play(
    config: Config, params: Any, policy: Tested, card: Mapping[str, Any], test: str, shield: Mapping[str, Any]
) -> pd.DataFrame:
    """The episodes of one test."""
    discrete = not config.config.get("action") or config.config["action"].get("type") != "ContinuousAction"
    with progress_bar(config.episodes, f"shield {test}", "episode") as bar:
        episodes = evaluate(
            scored(functools.partial(environments, config, params, shield), config.reward),
            policy.act,
            range(config.first_seed, config.first_seed + config.episodes),
            n_envs=SIDE_BY_SIDE[config.backend],
            keep_actions=discrete,
            masked=policy.masked and shield["shield"] == "override",
            progress=lambda done: move_to(bar, done),
            more=columns_of,
        )
    return episodes.assign(train=card.get("arm", config.policy), test=test, train_seed=card.get("train_seed", 0))


def report(out: Path, record: dict[str, Any], command: str, episodes: pd.DataFrame) -> None:
    """Print the table; write it, the episodes and what they depend on."""
    summary, title = summarise(episodes), title_of(record)
    (out / "config.json").unlink(missing_ok=True)  # it comes last: what is half written is nobody's results
    with atomic(out / "episodes.csv") as temporary:
        episodes.to_csv(temporary, index=False)
    write_table(summary, out, title)
    write_json(out / "config.json", {"config": record, "command": command, **versions()})
    print_table(summary, title, Console(width=None if sys.stdout.isatty() else 160))
    print(f"\nEvery episode, with its verdict: {out / 'episodes.csv'}")


run = main  # what the console command calls

if __name__ == "__main__":
    main(sys.argv[1:])
