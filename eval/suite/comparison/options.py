"""The options of the comparison, what each means, and its help."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from rss_shield.command_line import NO_OVERRIDES, ConfigFile, Overrides
from rss_shield.shield.params import PRESETS, Rules

COMMAND = "rss-shield train"  # what messages call it, unless a script was called
FIRST_TEST_SEED = 10**9  # test episode i: this + i; training seeds stay below 2**29
FIRST_REMOVAL_SEED = 2 * 10**9  # likewise of the tests on the way, far from both
DEFAULT_RULES = Rules()
PRESET_HELP = (
    f"RSS parameters by name: {', '.join(PRESETS)}; auto: intersection at intersections, parking on car parks, "
    "simulator elsewhere; or a file of your own."
)
HELP = """Train agents with and without the RSS shield, test each with and without it, report who crashes.

One table at the end: arms x shield {off, on} in testing; by default the arms are PPO with the shield {off, on} in
training. Everything is written to runs/NAME.

examples:
  python train.py
      the comparison with its defaults: 3 seeds, 200 000 decisions per arm and seed
  python train.py --total-timesteps 1000000 --seeds 0 1 2 3 4
      the same with more of everything
  python train.py --backend highway-env --total-timesteps 5376 --n-envs 2 --seeds 0 --eval-episodes 60
      on the original simulator, with much less of everything
  python train.py --env-id intersection-v0 --total-timesteps 50000 --intent known
      a junction, where the shield is told everybody's route
  python train.py --env-id roundabout-v0 --entry priority --waiting anywhere
      a ring, where others are expected to give way
  python train.py --env-id merge-v0 --preset slides
      another road, stricter assumptions
  python train.py --ego.response-time 0.5 --other.a-min-brake 4
      single RSS parameters
  python train.py --config.lanes-count 4 --config.reward-speed-range 20 35
      the environment's configuration, key by key
  python train.py --config my-road.json --config.observation.vehicles-count 8
      the same from a file; what the command line says wins
  python train.py --arms shielded --intervention-penalty 0.1
      one arm, which pays for what the shield must correct
  python train.py --arms lazy idm shielded adaptive-penalty --target-intervention 0.5
      drivers that learn nothing beside agents, one of which pays until the shield changes 0.5 m/s^2 on average
  python train.py --arms shielded my_driver:drive --reward my_reward:reward --preset my-table.yaml
      your own: a policy, a reward, a table of parameters
  python train.py --env-id intersection-v0 --network sets --config.observation.observe-intentions true
      an agent that is told where others are going, and to whom it is the same who is listed first
  python train.py --env-id merge-v0 --history 3
      one that sees its last three observations
  python train.py --list-arms
      all there are
  python train.py --resume --name my-run
      go on with a run that was stopped, with the options it was started with
"""


@dataclass(frozen=True)
class Config:
    """What `python train.py --help` shows; one option a field."""

    env_id: str = "highway-fast-v0"
    """Environment of highway-env."""
    config: ConfigFile = field(default_factory=dict)
    """Its configuration, a JSON, TOML or YAML file or JSON itself, as make() takes it; single keys as
    --config.lanes-count 4, nested ones as --config.observation.type Kinematics."""
    backend: str = "fast"
    """What simulates: fast (the compiled engine, with the same trajectories) or highway-env (the original)."""
    arms: tuple[str, ...] = ("unshielded", "shielded")
    """What to compare, e.g. unshielded (PPO, the shield only watches), shielded (PPO, it overrides), lazy, idm,
    penalty-0.5, adaptive-penalty; --list-arms shows all. A policy of your own is an arm as module:function."""
    list_arms: bool = False
    """Show the table of arms and stop."""
    total_timesteps: int = 200_000
    """Decisions to learn from, per arm and seed; rounded up to whole rollouts of about 8192 for PPO."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds; each trains every arm once."""
    preset: Annotated[str, tyro.conf.arg(help=PRESET_HELP)] = "auto"
    ego: Overrides = NO_OVERRIDES
    """RSS parameters of the ego that replace the preset's."""
    other: Overrides = NO_OVERRIDES
    """RSS parameters assumed of everybody else that replace the preset's."""
    entry: str = "cautious"
    """Whom the ego expects to give way where roads cross: cautious (nobody), priority (who must and still
    can) or assertive (everybody who still can)."""
    intent: str = "any"
    """Which routes it expects of others there: known (theirs), straight, or any that fits."""
    waiting: str = "line"
    """Where it may wait there: at the line, or anywhere that is in the way of nobody who is there."""
    rules: tyro.conf.FlagConversionOff[Rules] = DEFAULT_RULES
    """Duties and margins in force, for ablations: --rules.memory False; each that is changed costs the guarantee."""
    examine: str = "table"
    """Against whom plans through a junction are checked: table (whose ways meet the ego's), all, or one of the
    heuristics geofence, walk, first-conflicting, first."""
    traffic: str = "stock"
    """How everybody else drives: stock, or compliant (under a shield of their own; on highway-env only)."""
    filter: str = "rss"
    """What acts in the shield's place, to compare with: rss (the shield itself), or what rss-shield's docs name."""
    filter_at: float | None = None
    """At what that filter steps in, where it has a threshold; its unit is the filter's."""
    correction: str = "nearest"
    """What a duty makes of a command: see `ShieldWrapper`."""
    replace: str = "frame"
    """When it replaces the agent's action: see `ShieldWrapper`."""
    risk: bool = False
    """Measure the driving safety field, too."""
    reward: str = ""
    """A function of your own, module:function, that agents are paid by in training; tests show its return, too."""
    intervention_penalty: float = 0.0
    """Taken off the training reward when the shield overrides; >= 0. Testing uses the raw reward. Arms with a
    penalty of their own, as penalty-0.5, keep theirs."""
    penalty_on: str = "response"
    """What it is times: response (share of frames overridden) or change (of acceleration, mean [m/s^2])."""
    target_intervention: float = 0.5
    """Of the arm adaptive-penalty: the mean change of acceleration [m/s^2] toward which its penalty moves."""
    target_share: float = 0.01
    """Of the arm adaptive-share: likewise the share of frames that a proper response overrides."""
    cost_limit: float = 0.01
    """Of the arm ppo-lagrangian: wanted mean of info["cost"] per decision (1 where the ego breaks a duty or a
    contact is its fault)."""
    eval_episodes: int = 1000
    """Test episodes per trained model and test condition, on the same seeds for all."""
    first_seed: int = FIRST_TEST_SEED
    """Seed of the first test episode; the others follow. What is chosen by tests, such as hyperparameters, is to be
    tested on others afterwards."""
    replay_episodes: int = 5
    """How many of these are played again on the original simulator and compared; none if it is the backend."""
    pages: bool = True
    """Write pages on which the worst and the most typical episode of each arm play, into runs-dir/NAME/pages."""
    removal_checks: int = 10
    """How often an agent is tested with and without the shield on its way through training, at most; 0: never."""
    removal_episodes: int = 50
    """Test episodes of each of these tests, in the engine, on seeds of their own."""
    explore_for: int = 1
    """Of DQN and QR-DQN: a random action is done for 1 to so many decisions in a row."""
    history: int = 1
    """How many of the last observations an agent sees, side by side."""
    network: str = "mlp"
    """What it sees a list of road users with: mlp (a plain network), or sets or attention, to which everybody in the
    list is the same (observations in rows, such as Kinematics). Arms of semantic actions have their own."""
    hyperparameters: ConfigFile = field(default_factory=dict)
    """Of every arm's learner, instead of its own: a file as --config takes it, or single ones as
    --hyperparameters.learning-rate 3e-4. results.json shows all."""
    n_envs: int = 128
    """Environments side by side in each training."""
    workers: int = os.cpu_count() or 1
    """Processes that share the trainings and tests. Results do not depend on it."""
    tracker: str = "tensorboard"
    """What the numbers of training are written for: tensorboard, or also wandb (offline) or mlflow."""
    device: str = "cpu"
    """Where agents learn: cpu, cuda or auto. For networks this small the CPU is faster."""
    name: str = ""
    """Folder of the run inside runs-dir; by default made from the options that differ from their defaults."""
    runs_dir: Path = Path("runs")
    """Folder of all runs."""
    resume: bool = False
    """Go on with the run in the folder, with the options it was started with; nothing that is finished is
    repeated. Options that are given as well must be the same."""
    resume_or_start: bool = False
    """As --resume; where there is no run yet, it is started."""
    overwrite: bool = False
    """Throw the run in the folder away and start anew."""
