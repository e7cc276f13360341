"""A batch of the engine that remembers, episode by episode, what infos say of one decision only."""

from typing import Any

import numpy as np

from rss_shield.eval.suite.filmed import Studio
from rss_shield.eval.suite.judge.judgement import judge_trace


class Watched:
    """Around a `FastVectorEnv` without autoreset, as `eval.rollout.evaluate` uses it.

    Args:
      env: `FastVectorEnv` with a shield.
      judged: every contact is judged afterwards, too, from where everybody was.
    """

    def __init__(self, env: Any, judged: bool = False) -> None:
        self.env = env
        self.studio = Studio(env.scenario, env.settings) if judged else None
        if judged:
            env.recording.choose(range(env.num_envs))
        self.margin = np.full(env.num_envs, np.inf)
        self.actions: list[list[str]] = [[] for _ in range(env.num_envs)]

    def reset(self, *, seed: Any = None, options: dict | None = None) -> Any:
        """Forget where an episode begins."""
        mask = (options or {}).get("reset_mask")
        for e in range(self.env.num_envs) if mask is None else np.flatnonzero(mask):
            self.margin[e], self.actions[e] = np.inf, []
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: np.ndarray) -> Any:
        """Keep the action and the smallest margin: the larger of those along and across, of the pair nearest to danger,
        as long as there is no contact."""
        for e, action in enumerate(actions.tolist()):
            self.actions[e].append(",".join(map(repr, action)) if isinstance(action, list) else str(action))
        result = self.env.step(actions)
        told = result[-1]["shield"]
        self.margin = np.fmin(self.margin, np.maximum(told["min_margin_lon"], told["min_margin_lat"]))
        return result

    def close(self) -> None:
        """Close the batch."""
        self.env.close()

    def columns(self, e: int) -> dict[str, Any]:
        """Of environment `e`, whose episode has just ended: `worst_margin` [m], inf where plans are kept; `actions`;
        `judged`: the verdict of the judge, "" = no contact."""
        columns = {"worst_margin": float(self.margin[e]), "actions": " ".join(self.actions[e])}
        if self.studio is None:
            return columns
        finished = self.env.recording.finished
        log = finished.pop(next(i for i in reversed(range(len(finished))) if finished[i].env == e))
        return columns | {"judged": self._verdict(e, log)}

    def _verdict(self, e: int, log: Any) -> str:
        if self.studio is None or not self.env.info(e)["blame"]:
            return ""
        trace = self.studio.develop(log)
        (ego,) = trace.ego_users
        return judge_trace(trace, users=[ego]).verdict_of(ego)
