"""An ego that carries a plan out frame by frame, in place of its own speed law."""

from rss_shield.envs.roads.steering import steering_within
from rss_shield.envs.semantic.outlook import DRIFT, PLANNED_ACCELERATION
from rss_shield.shield._numba.compiled import inner


@inner
def follow(e, frame, trajectories, cars, episode, lanes, sight):
    """Commands of the ego for one frame, after its own; as `envs.highway.semantic` has them.

    Args:
      trajectories: `[E, F, 2]`, see `look_ahead`; None: it follows none, and numba leaves this out.
    """
    if trajectories is not None:
        ego = cars[episode.ego]
        k, drift = ego.target_lane, trajectories[e, frame, DRIFT]
        ego.acceleration = trajectories[e, frame, PLANNED_ACCELERATION]
        s, lateral = sight.s[k, episode.ego], sight.lateral[k, episode.ego]
        ego.steering = steering_within(lanes[k], s, lateral, ego.heading, ego.speed, ego.length, drift)
