"""Episode logs of chosen environments. The others are not slowed down."""

from typing import NamedTuple

import numpy as np


class Log(NamedTuple):
    """All frames of one episode."""

    env: int  # which environment of the batch
    cars: np.ndarray  # `[T, N]` CAR at the start and after each frame, rows beyond `present` are empty
    present: np.ndarray  # `[T]` how many road users
    complete: bool  # False: the episode is still running


class Recording:
    """Keeps the frames of chosen environments.

    Args:
      engine: the engine to watch.
    """

    def __init__(self, engine) -> None:
        self._engine = engine
        self._running: dict[int, list[np.ndarray]] = {}
        self.finished: list[Log] = []

    def choose(self, environments) -> None:
        """Record these environments from now on, and no others; running logs begin with the present state."""
        chosen = [int(e) for e in environments]
        engine = self._engine
        frames, n = engine.film.cars.shape[1:]
        engine.film.slots[:] = -1
        engine.film.slots[chosen] = np.arange(len(chosen))
        engine.film = engine.film._replace(cars=np.zeros((len(chosen), frames, n), engine.film.cars.dtype))
        self._running = {e: [self._now(e)] for e in chosen}

    def running(self, e: int) -> Log:
        """The episode of environment `e` so far."""
        return self._log(e, complete=False)

    def begin(self, restarted) -> None:
        """Environments `restarted` `[E]` were reset from outside."""
        for e in self._running:
            if restarted[e]:
                self._running[e] = [self._now(e)]

    def advance(self, ended, began, same_step: bool) -> None:
        """One decision was made everywhere.

        Args:
          ended: `[E]` it ended the episode.
          began: `[E]` it was spent on beginning an episode; None = nowhere.
          same_step: a new episode follows at once.
        """
        for e in self._running:
            if began is not None and began[e]:
                self._running[e] = [self._now(e)]
                continue
            self._running[e].append(self._engine.film.cars[self._engine.film.slots[e]].copy())
            if ended[e]:
                self.finished.append(self._log(e, complete=True))
                if same_step:
                    self._running[e] = [self._now(e)]

    def _now(self, e: int) -> np.ndarray:
        return self._engine.batch.cars[e : e + 1].copy()

    def _log(self, e: int, complete: bool) -> Log:
        cars = np.concatenate(self._running[e])
        return Log(e, cars, (cars["length"] > 0).sum(axis=1), complete)
