"""The engine as a `gymnasium.vector.VectorEnv`."""

from time import perf_counter
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from highway_env.envs.common.action import DiscreteMetaAction

from rss_shield.envs.arguments import reset_options, seed_of, whole
from rss_shield.envs.decisions.executed import executed_actions
from rss_shield.envs.decisions.replacement import order_of, replace
from rss_shield.envs.fast.config import Scenario, Unsupported
from rss_shield.envs.fast.engine import DISABLED, NEXT_STEP, SAME_STEP, Engine, Outputs
from rss_shield.envs.fast.infos import OF_DECISIONS, Agents, marked, step_infos, where_decided, without
from rss_shield.envs.fast.pictures import MODES as RENDER_MODES
from rss_shield.envs.fast.pictures import Painter
from rss_shield.envs.fast.recording import Recording
from rss_shield.envs.options import Settings
from rss_shield.envs.sensing import Sensing
from rss_shield.shield.ground import Ground
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.tally import info_at

_MODES = {
    AutoresetMode.SAME_STEP: SAME_STEP,
    AutoresetMode.NEXT_STEP: NEXT_STEP,
    AutoresetMode.DISABLED: DISABLED,
}


class FastVectorEnv(VectorEnv):
    """E environments in the compiled engine, with the trajectories of highway-env.

    Seeds mean what they mean there: environment e of `reset(seed=s)` has the episodes of a stock
    environment reset with s + e and then without a seed.

    Autoreset, as gymnasium defines it:

      SAME_STEP (default): the step that ends an episode returns the first observation of the next
        one; its last observation is `infos["final_obs"][e]` and its infos are
        `infos["final_info"]`, both valid where `infos["_final_info"]` is True.
      NEXT_STEP: the step after the last one ignores its action, begins the next episode and
        returns reward 0.
      DISABLED: episodes are begun by `reset(options={"reset_mask": mask})`.

    Infos are dictionaries of arrays `[E]`; `info(e)` builds the dictionary of one environment. A
    key "_name" marks where "name" is valid: `raw_reward` and `is_success` are not where an episode has just
    begun, and `action` is 0 there. Where an episode ended, "episode" holds its return "r", length "l" and duration on
    the clock "t" [s]: in `final_info` if episodes begin in the same step, else in the infos themselves.

    Of A agents on one road (`intersection-multi-agent-v0`) spaces are tuples, as in highway-env: actions are a tuple
    of A arrays, observations another, and `infos["agents"]` is a tuple with what the shield says of each. The reward is
    one for all, or where highway-env hands out each agent's (`-v1`, `-v2`) an array `[E, A]`, with `episode["r"]`
    likewise; the penalty is subtracted from each agent's, or its mean from the reward of all. An episode ends for
    everybody at once: when somebody has crashed or everybody has arrived. `infos["agents_terminated"]` says for whom.

    Args:
      scenario: what to run.
      num_envs: E.
      settings: of the shield, None = no shield.
      intervention_penalty: subtracted from the reward, times the step's override fraction, or
      penalty_by_change: its mean change of acceleration.
      autoreset_mode: see above.
      threads: threads that share the work. Results do not depend on it.
      replaces: a meta-action whose mask is False is replaced at the start of the decision; see `ShieldWrapper`.
      risk: settings of the driving safety field that is measured around each ego, too; None = not measured.
      render_mode: "rgb_array", or None: nobody looks.
      follows: the egos carry out the engine's `trajectories`; see `envs.fast.semantic`.
      sensing: what goes wrong with what egos see, None = nothing; where distances along lanes keep them safe.
      ground: conditions of the road and classes of vehicles, None = dry, and cars.
    """

    metadata: dict[str, Any] = {"render_modes": [*RENDER_MODES], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        scenario: Scenario,
        num_envs: int,
        settings: Settings | None = None,
        intervention_penalty: float = 0.0,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        threads: int = 1,
        penalty_by_change: bool = False,
        replaces: bool = False,
        risk: RiskSettings | None = None,
        render_mode: str | None = None,
        follows: bool = False,
        sensing: Sensing | None = None,
        ground: Ground | None = None,
    ) -> None:
        self.scenario = scenario
        self.settings = settings
        self.render_mode = render_mode
        self._painter: Painter | None = None
        self.num_envs = num_envs
        self.single_observation_space = scenario.observation_space
        self.single_action_space = scenario.action_space
        self.observation_space = batch_space(scenario.observation_space, num_envs)
        self.action_space = batch_space(scenario.action_space, num_envs)
        self.metadata = self.metadata | {"autoreset_mode": autoreset_mode}
        mode = _MODES[autoreset_mode]
        rules = settings, intervention_penalty, mode, threads, penalty_by_change, risk, follows, sensing, ground
        self.engine = Engine(scenario, num_envs, *rules)
        self._order = order_of(scenario.labels) if replaces and settings is not None and settings.overrides else None
        self.recording = Recording(self.engine)
        self._everywhere = np.ones(num_envs, bool)
        self._decided = np.zeros(num_envs, bool)  # not where the last call began an episode
        self._seeded = False
        self._begun = np.zeros(num_envs, bool)
        self._all_begun = False
        self._infos: dict = {}
        self._began = np.full(num_envs, perf_counter())

    def reset(self, *, seed=None, options=None):
        """Begin episodes everywhere, or where `options["reset_mask"]` `[E]` says so."""
        options = reset_options(options)
        mask = options.pop("reset_mask", None)
        if "config" in options:
            given = f"config = {options['config']!r} at a reset"
            raise Unsupported(given, "it as an argument of make_vec, or backend = 'highway-env'")
        if options:
            raise ValueError(f"reset options {sorted(options)} are not supported; expected 'reset_mask'")
        restarted = self._everywhere if mask is None else np.asarray(mask)
        if restarted.shape != (self.num_envs,) or restarted.dtype != bool:
            raise ValueError(f"reset option reset_mask = {mask!r}: expected {self.num_envs} truth values")
        self.engine.seed(self._seeds(seed))
        outputs = self.engine.reset(None if mask is None else restarted)
        self.recording.begin(restarted)
        self._begun |= restarted
        self._all_begun = bool(self._begun.all())
        self._began[restarted] = perf_counter()
        self._decided = np.zeros(self.num_envs, bool)
        self._infos = self._told(outputs, self._decided)
        return self._shaped(outputs.observations), marked(self._infos, restarted, self._decided)

    def step(self, actions):
        """One decision everywhere.

        Args:
          actions: `[E]` integers or `[E, A]` floats of the action space; of several agents a tuple of them.

        Returns:
          Observations `[E, ...]`, rewards `[E]`, terminated `[E]`, truncated `[E]`, infos.

        Raises:
          ResetNeeded: somewhere no episode has been begun yet.
        """
        self.check_begun("step")
        proposed = np.asarray(actions) if self.scenario.agents is None else self._of_each(actions)
        discrete, commands = self._commands(proposed)
        actions = proposed
        if self._order is not None:
            actions = discrete = replace(discrete, self.engine.action_masks(), self._order)
        began = self.engine.batch.episodes["ended"].copy()
        outputs = self.engine.step(discrete, commands)
        ended = outputs.terminated | outputs.truncated
        same_step, next_step = self.engine.autoreset == SAME_STEP, self.engine.autoreset == NEXT_STEP
        self.recording.advance(ended, began if next_step else None, same_step)

        self._decided = ~ended if same_step else ~began if next_step else self._everywhere
        self._infos = self._told(outputs, self._decided, actions, proposed)
        infos = marked(self._infos, self._everywhere, self._decided)
        if ended.any():
            if same_step:
                infos |= self._finals(outputs, ended, actions, proposed)
            else:
                episode = {name: where_decided(ended, values) for name, values in self._episode(outputs).items()}
                infos |= marked({"episode": episode}, ended, ended)
        self._began[ended if same_step else began] = perf_counter()
        told = outputs.told
        rewards = told.rewards.T if told is not None and self.scenario.apart else outputs.rewards
        return self._shaped(outputs.observations), rewards, outputs.terminated, outputs.truncated, infos

    def action_masks(self) -> np.ndarray:
        """Which meta-actions would pass the coming decision without a proper response, `[E, A]` bool.

        As `ShieldWrapper.action_masks` in every environment; no state changes. All are True where the ego has had its
        contact, or where the episode is over and the next call begins another one.

        Raises:
          ValueError: there is no shield, or the actions are no meta-actions.
          ResetNeeded: as `step`.
        """
        if self.settings is None:
            raise ValueError("action_masks with shield = None: expected shield = 'override' or 'monitor'")
        if not len(self.scenario.labels) or self.scenario.agents is not None:
            kind = type(self.scenario.stock.action_type).__name__
            raise ValueError(f"action_masks: expected DiscreteMetaAction, not {kind}")
        self.check_begun("action_masks")
        return self.engine.action_masks()

    def info(self, e: int) -> dict:
        """The last infos of one environment as a plain dictionary."""
        info = info_at(self._infos, e)
        return info if self._decided[e] else without(info, OF_DECISIONS)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures of all environments, as `picture` makes them; None if `render_mode` is."""
        if self.render_mode is None:
            return None
        return tuple(self.picture(e) for e in range(self.num_envs))

    def picture(self, e: int) -> np.ndarray:
        """Environment `e` as highway-env draws it, `[H, W, 3]` uint8. The engine's state is only read.

        Raises:
          ValueError: there is no such environment.
        """
        if not 0 <= e < self.num_envs:
            raise ValueError(f"e = {e!r}: expected a whole number from 0 to {self.num_envs - 1}")
        if self._painter is None:
            self._painter = Painter(self.scenario)
        return self._painter.paint(self.engine.batch.cars[e], self.engine.batch.episodes[e])

    def close_extras(self, **kwargs) -> None:
        self.engine.close()
        if self._painter is not None:
            self._painter.close()

    def check_begun(self, what: str) -> None:
        """Is there an episode everywhere?"""
        if not self._all_begun:
            raise ResetNeeded(f"{what} before reset(): expected reset() first, in every environment")

    def _finals(self, outputs: Outputs, ended, actions, proposed) -> dict:
        finals = self._told(outputs, ended, actions, proposed, final=True)
        finals["episode"] = self._episode(outputs, final=True)
        return {
            "final_obs": self._shaped(outputs.final_observations),
            "_final_obs": ended,
            "final_info": marked(finals, ended, ended),
            "_final_info": ended,
        }

    def _told(self, outputs: Outputs, decided, actions=None, proposed=None, final=False) -> dict:
        """Infos, with the actions where one was decided upon; final: of the last decision of episodes that ended."""
        steps, risks = (outputs.final_steps, outputs.final_risks) if final else (outputs.steps, outputs.risks)
        agents = _agents_of(outputs, final)
        infos = step_infos(steps, self.scenario, self.settings, risks, agents)
        if actions is None:
            actions = proposed = create_empty_array(self.single_action_space, self.num_envs)
        infos["action"] = where_decided(decided, actions)
        if self.settings is not None and agents is None:
            infos["shield"] |= self._chosen(steps, decided, actions, proposed)
        elif self.settings is not None and agents is not None:
            for a, info in enumerate(infos["agents"]):
                info["shield"] |= self._chosen(agents.steps[a], decided, actions[a], proposed[a])
        return infos

    def _chosen(self, steps, decided, actions, proposed) -> dict:
        """What one agent proposed, and what came of it."""
        return {
            "proposed_action": where_decided(decided, proposed),
            "executed_action": where_decided(decided, self._executed(steps, actions)),
            "action_replaced": decided & (_rows(actions) != _rows(proposed)).any(axis=1),
        }

    def _executed(self, steps, actions) -> np.ndarray:
        kind, commands = self.scenario.kind, np.full((len(steps), 2), np.nan)
        if not isinstance(kind, DiscreteMetaAction):  # of which nobody asks for commands
            np.divide(steps["acceleration"], steps["frames"], out=commands[:, 0], where=steps["frames"] > 0)
            np.divide(steps["steering"], steps["frames"], out=commands[:, 1], where=steps["frames"] > 0)
        return executed_actions(kind, actions, steps["lane_change_refused"], commands)

    def _episode(self, outputs: Outputs, final=False) -> dict:
        lasted = np.round(perf_counter() - self._began, 6)
        steps, agents = outputs.final_steps if final else outputs.steps, _agents_of(outputs, final)
        returns = agents.steps["episode_return"].T if agents and self.scenario.apart else steps["episode_return"]
        return {"r": returns, "l": steps["episode_length"], "t": lasted}

    def _seeds(self, seed) -> list[int | None]:
        if seed is None:
            if self._seeded:
                return [None] * self.num_envs
            seed = int(np.random.SeedSequence().generate_state(1)[0])
        self._seeded = True
        if np.ndim(seed) == 0:
            first = whole("seed", seed, 0)
            return [first + e for e in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds given; expected {self.num_envs}")
        return [seed_of(one) for one in seed]

    def _of_each(self, actions) -> tuple[np.ndarray, ...]:
        """The actions of several agents, one after the other."""
        count = self.scenario.agents
        if not isinstance(actions, tuple | list | np.ndarray) or len(actions) != count:
            raise ValueError(f"actions = {actions}: expected a tuple with those of each of {count} agents")
        return tuple(np.asarray(one) for one in actions)

    def _commands(self, actions):
        """Discrete actions and commands as `Engine.step` takes them."""
        if self.scenario.agents is None:
            return self._commands_of(actions, self.action_space)
        own: Any = self.action_space
        each = [self._commands_of(asked, space) for asked, space in zip(actions, own.spaces, strict=True)]
        discrete, commands = zip(*each, strict=True)
        return np.stack(discrete), None if commands[0] is None else np.stack(commands)

    def _commands_of(self, actions: np.ndarray, space: spaces.Space):
        """Likewise, of one agent with the batched `space`."""
        if actions.ndim == 0 or len(actions) != self.num_envs:
            given = f"actions = {actions}" if actions.ndim == 0 else f"{len(actions)} actions given"
            raise ValueError(f"{given}; expected {self.num_envs}")
        choices = self.scenario.choices
        count = len(self.scenario.labels) if choices is None else len(choices)
        if count:
            if not np.issubdtype(actions.dtype, np.integer) or actions.min() < 0 or actions.max() >= count:
                raise ValueError(f"actions = {actions}: expected integers from 0 to {count - 1}")
            return actions.astype(np.int64), None if choices is None else choices[actions]
        numbers = np.issubdtype(actions.dtype, np.number) and np.isfinite(actions).all()
        if actions.shape != space.shape or not numbers:
            raise ValueError(f"actions = {actions}: expected finite numbers, shape {space.shape}")
        return _compared(actions), self.scenario.commands(actions)

    def _shaped(self, observations: np.ndarray) -> Any:
        """Observations `[E, size]` as the space has them."""
        space, glances = self.observation_space, self.scenario.glances
        if not isinstance(space, spaces.Tuple):
            return observations.reshape(space.shape).astype(space.dtype, copy=False)
        columns = [observations[:, one.start : one.start + one.size] for one in glances]
        return tuple(
            seen.reshape(part.shape).astype(part.dtype) for seen, part in zip(columns, space.spaces, strict=True)
        )


def _compared(actions: np.ndarray) -> np.ndarray:
    """Numbers `[E, A]` as highway-env compares them with its lane changes, 0 and 2, when it rewards; -1 = neither."""
    if actions.shape[1] > 1:
        return np.full(len(actions), -1)
    return np.where(np.isin(actions[:, 0], (0, 2)), actions[:, 0], -1).astype(np.int64)


def _rows(actions: np.ndarray) -> np.ndarray:
    return actions.reshape(len(actions), -1)


def _agents_of(outputs: Outputs, final: bool) -> Agents | None:
    """What is said of each of several egos."""
    told = outputs.told
    if told is None:
        return None
    return Agents(told.final_steps, told.final_risks) if final else Agents(told.steps, told.risks)
