"""What the agent sees."""

import numpy as np

from rss_shield.envs._numpy.floats import clip, dot, lmap, norm, not_zero
from rss_shield.envs.compiled import compiled, merged
from rss_shield.envs.fast.config import COS_H, HEADING, PRESENCE, TIME_TO_COLLISION, VX, VY, X, Y
from rss_shield.envs.fast.sight import locate
from rss_shield.envs.fast.state import OBSTACLE

_PERCEPTION = 200.0  # `AbstractEnv.PERCEPTION_DISTANCE` [m]
_BEHIND = -10.0  # twice the length of a car [m]
_LANE_WIDTH = 4.0  # `AbstractLane.DEFAULT_WIDTH` [m]


@merged
def observe(cars, episode, lanes, sight, config, features, ranges, connected, target_speeds, out):
    """The observation that the configuration asks for.

    Args:
      cars: `[N]` CAR.
      episode: EPISODE.
      lanes: `[L]` LANE.
      sight: this frame's.
      config: CONFIG.
      features, ranges, connected, target_speeds: of the `Scenario`.
      out: `[size]` float32, overwritten.
    """
    if config.observation == TIME_TO_COLLISION:
        _observe_times(cars, episode, lanes, sight, config, connected, target_speeds, out)
    else:
        _observe_kinematics(cars, episode, lanes, sight, config, features, ranges, out)


@merged
def _observe_kinematics(cars, episode, lanes, sight, config, features, ranges, out):
    """The ego and the cars nearest to it along its lane (`KinematicObservation`, `ExitObservation`)."""
    ego = cars[episode.ego]
    count = _find_nearest(cars, episode, lanes, sight, config)
    n_features = len(features)
    for row in range(config.rows):
        for k in range(n_features):
            value = 0.0
            if row <= count:
                i = episode.ego if row == 0 else sight.nearest[row - 1]
                value = _feature(features[k], cars[i])
                if row == 0 and config.exit_lane >= 0 and features[k] == X:
                    value = sight.s[config.exit_lane, episode.ego]
                if row > 0 and not config.absolute and X <= features[k] <= VY:
                    value -= _feature(features[k], ego)
                if config.normalize and not np.isnan(ranges[k, 0]):
                    low, high = ranges[k, 0], ranges[k, 1]
                    if np.isinf(high):
                        high = _LANE_WIDTH * episode.observed_lanes
                        low = -high
                    value = lmap(value, low, high, -1.0, 1.0)
                    if config.clips:
                        value = clip(value, -1.0, 1.0)
            out[row * n_features + k] = value


@merged
def _find_nearest(cars, episode, lanes, sight, config):
    """Fill `sight.nearest` with the observed road users, nearest along the lane first; returns how many."""
    ego = cars[episode.ego]
    s = sight.s[ego.lane]
    here = s[episode.ego]
    count = 0
    for j in range(episode.cars):
        obstacle = cars[j].kind == OBSTACLE
        if j == episode.ego or (obstacle and not config.obstacles):
            continue
        locate(ego.lane, j, cars, lanes, sight)
        ahead = s[j] - here
        if not ahead > _BEHIND and (obstacle or not config.see_behind):
            continue
        if not norm(cars[j].x - ego.x, cars[j].y - ego.y) < _PERCEPTION:
            continue
        if count == config.rows - 1:
            if abs(s[sight.nearest[count - 1]] - here) <= abs(ahead):
                continue
            count -= 1
        b = count - 1
        while b >= 0 and abs(s[sight.nearest[b]] - here) > abs(ahead):
            sight.nearest[b + 1] = sight.nearest[b]
            b -= 1
        sight.nearest[b + 1] = j
        count += 1
    return count


@merged
def _feature(feature, car):
    if feature == PRESENCE:
        return 1.0
    if feature == X:
        return car.x
    if feature == Y:
        return car.y
    if feature == VX:
        return car.speed * car.cos
    if feature == VY:
        return car.speed * car.sin
    if feature == HEADING:
        return car.heading
    if feature == COS_H:
        return car.cos
    return car.sin


@compiled
def _observe_times(cars, episode, lanes, sight, config, connected, target_speeds, out):
    """Predicted times to collision around the ego's speed and lane (`TimeToCollisionObservation`)."""
    ego = cars[episode.ego]
    n_lanes = lanes[ego.lane].siblings
    for v in range(config.speeds):
        for lane in range(n_lanes):
            for t in range(config.times):
                sight.grid[v, lane, t] = 0.0
    for v in range(config.speeds):
        for j in range(episode.vehicles):
            if j != episode.ego and target_speeds[v] != cars[j].speed:
                _mark_collisions(cars, episode, v, j, n_lanes, lanes, sight, config, connected, target_speeds)
    for a in range(3):
        v = int(clip(ego.speed_index - 1 + a, 0, config.speeds - 1))
        for b in range(3):
            lane = lanes[ego.lane].id - 1 + b
            for t in range(config.times):
                value = sight.grid[v, lane, t] if 0 <= lane < n_lanes else 1.0
                out[(a * 3 + b) * config.times + t] = value


@compiled
def _mark_collisions(cars, episode, v, j, n_lanes, lanes, sight, config, connected, target_speeds):
    """Mark in the grid when the ego would meet car `j` at target speed `v`."""
    ego, other = cars[episode.ego], cars[j]
    closing = not_zero(target_speeds[v] - other.speed * dot(other.cos, other.sin, ego.cos, ego.sin))
    apart = sight.s[ego.lane, j] - sight.s[ego.lane, episode.ego]
    if not connected[ego.lane, other.lane]:
        return
    same_width = lanes[other.lane].siblings == n_lanes
    first = lanes[other.lane].id if same_width else 0
    last = first + 1 if same_width else n_lanes
    for margin, cost in ((0.0, 1.0), (-5.0, 0.5), (5.0, 0.5)):
        time = (apart + margin) / closing
        if time < 0:
            continue
        for t in (np.floor(time / config.period), np.ceil(time / config.period)):
            if t < config.times:
                for lane in range(first, last):
                    sight.grid[v, lane, int(t)] = max(sight.grid[v, lane, int(t)], cost)
