"""The engine as a `gymnasium.vector.VectorEnv`."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from envs.fast.config import Scenario
from envs.fast.engine import DISABLED, NEXT_STEP, SAME_STEP, Engine, Outputs
from envs.fast.infos import info_of, step_infos
from envs.fast.recording import Recording
from envs.highway import Settings

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
    key "_name" marks where "name" is valid. `final_info["episode"]` holds return "r" and
    length "l".

    Args:
      scenario: what to run.
      num_envs: E.
      settings: of the shield, None = no shield.
      intervention_penalty: subtracted from the reward, times the step's override fraction, or
      penalty_by_change: its mean change of acceleration.
      autoreset_mode: see above.
      threads: threads that share the work. Results do not depend on it.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        scenario: Scenario,
        num_envs: int,
        settings: Settings | None = None,
        intervention_penalty: float = 0.0,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        threads: int = 1,
        penalty_by_change: bool = False,
    ) -> None:
        self.scenario = scenario
        self.settings = settings
        self.num_envs = num_envs
        self.single_observation_space = scenario.observation_space
        self.single_action_space = scenario.action_space
        self.observation_space = batch_space(scenario.observation_space, num_envs)
        self.action_space = batch_space(scenario.action_space, num_envs)
        self.metadata = self.metadata | {"autoreset_mode": autoreset_mode}
        mode = _MODES[autoreset_mode]
        self.engine = Engine(scenario, num_envs, settings, intervention_penalty, mode, threads, penalty_by_change)
        self.recording = Recording(self.engine)
        self._everywhere = np.ones(num_envs, bool)
        self._seeded = False
        self._infos: dict = {}

    def reset(self, *, seed=None, options=None):
        """Begin episodes everywhere, or where `options["reset_mask"]` `[E]` says so."""
        options = dict(options or {})
        mask = options.pop("reset_mask", None)
        if options:
            raise ValueError(f"reset options {sorted(options)} are not supported; expected 'reset_mask'")
        self.engine.seed(self._seeds(seed))
        outputs = self.engine.reset(mask)
        restarted = self._everywhere if mask is None else np.asarray(mask, bool)
        self.recording.begin(restarted)
        self._infos = step_infos(outputs.steps, self.scenario, self.settings)
        return self._shaped(outputs.observations), _marked(self._infos, restarted)

    def step(self, actions):
        """One decision everywhere.

        Args:
          actions: `[E]` integers or `[E, A]` floats of the action space.

        Returns:
          Observations `[E, ...]`, rewards `[E]`, terminated `[E]`, truncated `[E]`, infos.
        """
        discrete, commands = self._commands(np.asarray(actions))
        began = self.engine.batch.episodes["ended"].copy()
        outputs = self.engine.step(discrete, commands)
        ended = outputs.terminated | outputs.truncated
        same_step = self.engine.autoreset == SAME_STEP
        self.recording.advance(ended, began if self.engine.autoreset == NEXT_STEP else None, same_step)

        self._infos = step_infos(outputs.steps, self.scenario, self.settings)
        if self.settings is not None:
            self._infos["shield"]["proposed_action"] = np.asarray(actions)
        infos = _marked(self._infos, self._everywhere)
        if same_step and ended.any():
            infos |= self._finals(outputs, ended, actions)
        return self._shaped(outputs.observations), outputs.rewards, outputs.terminated, outputs.truncated, infos

    def info(self, e: int) -> dict:
        """The last infos of one environment as a plain dictionary."""
        return info_of(self._infos, e)

    def close_extras(self, **kwargs) -> None:
        self.engine.close()

    def _finals(self, outputs: Outputs, ended, actions) -> dict:
        finals = step_infos(outputs.final_steps, self.scenario, self.settings)
        if self.settings is not None:
            finals["shield"]["proposed_action"] = np.asarray(actions)
        steps = outputs.final_steps
        finals["episode"] = {"r": steps["episode_return"], "l": steps["episode_length"]}
        return {
            "final_obs": self._shaped(outputs.final_observations),
            "_final_obs": ended,
            "final_info": _marked(finals, ended),
            "_final_info": ended,
        }

    def _seeds(self, seed) -> list[int | None]:
        if seed is None:
            if self._seeded:
                return [None] * self.num_envs
            seed = int(np.random.SeedSequence().generate_state(1)[0])
        self._seeded = True
        if np.ndim(seed) == 0:
            return [int(seed) + e for e in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds given; expected {self.num_envs}")
        return list(seed)

    def _commands(self, actions: np.ndarray):
        if len(actions) != self.num_envs:
            raise ValueError(f"{len(actions)} actions given; expected {self.num_envs}")
        count = len(self.scenario.labels)
        if count:
            if not np.issubdtype(actions.dtype, np.integer) or actions.min() < 0 or actions.max() >= count:
                raise ValueError(f"actions = {actions}: expected integers from 0 to {count - 1}")
            return actions.astype(np.int64), None
        if actions.shape != self.action_space.shape or not np.isfinite(actions).all():
            raise ValueError(f"actions = {actions}: expected finite numbers, shape {self.action_space.shape}")
        return None, self.scenario.commands(actions)

    def _shaped(self, observations: np.ndarray) -> np.ndarray:
        return observations.reshape(self.observation_space.shape)


def _marked(infos: dict, where: np.ndarray) -> dict:
    """Add the "_name" arrays that gymnasium expects."""
    marked = {}
    for name, values in infos.items():
        marked[name] = _marked(values, where) if isinstance(values, dict) else values
        marked["_" + name] = where
    return marked
