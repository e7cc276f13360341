"""Would a duty change the ego's command in the coming decision, if everybody goes on as they do?

The ego is played ahead with its driver's own control laws and the always-on limits, in the lane frame that the shield
measures in; everybody else keeps the speed along the lane and across it that they have now. On every frame the shield's
own functions say whether a duty would change the command. Anticipation is left out of it: it would hide that an agent
asks for more than there is room for.
"""

from typing import Any, NamedTuple

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs.roads.steering import slip_toward
from rss_shield.shield._numba.compiled import apart, compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.frame import beyond
from rss_shield.shield.lanes.lane_changes import is_blocked
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import restrict

KP_ACCELERATION = ControlledVehicle.KP_A  # [1/s]
_NOBODY = -np.inf  # the nearest and the soonest are of no interest


class Aim(NamedTuple):
    """What the ego's driver heads for once an action is taken."""

    speed: float  # [m/s]
    offset: float  # of the ego from the middle of the lane, positive to the right [m]
    turn: float  # heading of that lane where the driver looks, relative to the lane frame under the ego [rad]


class Seen(NamedTuple):
    """The shield's view of this moment, before it has acted on it."""

    ego: Any  # `ROAD_USER` record
    users: np.ndarray  # `[N]` `ROAD_USER` of everybody else
    ego_before: Any  # the same on the frame before
    users_before: np.ndarray
    memory: np.ndarray  # `[N]` `MEMORY`, this moment not taken in yet


class Stage(NamedTuple):
    """Room to play ahead in."""

    ego: np.ndarray  # `[2]` `ROAD_USER`, now and on the frame before
    users: np.ndarray  # `[N]` `ROAD_USER`
    users_before: np.ndarray  # `[N]`
    memory: np.ndarray  # `[N]` `MEMORY`


def without_anticipation(settings: Any) -> Any:
    """`Settings` to look ahead with."""
    calm = settings.table.rules._replace(anticipation=0.0)
    return settings._replace(table=settings.table._replace(rules=calm))


def make_stage(n: int) -> Stage:
    """Room for `n` road users besides the ego."""
    users, before = np.zeros((2, n), ROAD_USER)
    return Stage(np.zeros(2, ROAD_USER), users, before, np.zeros(n, MEMORY))


@apart
def first_response(seen, stage, aim, body, frames, table, who=None):
    """Frame of the coming decision on which a duty first changes the command, or a lane change is taken back.

    Args:
      seen: `Seen`.
      stage: `Stage`, overwritten.
      aim: `Aim`.
      body: `Body` of the ego.
      frames: of a decision.
      table: as in `shield.lanes.controller.find_danger`; without anticipation.
      who: `[K]` indices of those who can matter, None = everybody.

    Returns:
      The frame, `frames` if there is none.
    """
    _set(stage, seen, who)
    ego, before, half_length = stage.ego[0], stage.ego[1], body.half_wheelbase
    start, users = ego.y, stage.users
    rules, dt = table.rules, table.dt
    for frame in range(frames):
        danger = find_danger(ego, users, before, stage.users_before, stage.memory, table, who, _NOBODY, _NOBODY)
        offset = aim.offset + ego.y - start
        if rules.take_back and is_blocked(offset, danger.room_left, danger.room_right):
            return frame
        slip = slip_toward(offset, aim.turn, ego.heading, ego.speed, 2.0 * half_length)
        wish = Command(KP_ACCELERATION * (aim.speed - ego.speed), slip)
        limited = restrict(wish, danger.free, ego, body, rules, dt)
        if danger.bounds != danger.free and restrict(wish, danger.bounds, ego, body, rules, dt) != limited:
            return frame
        stage.ego[1] = ego
        _drive(ego, limited, body, dt)
        for a in range(how_many(who, users)):
            i = which(who, a)
            stage.users_before[i] = users[i]
            _go_on(users[i], dt)
    return frames


@inner
def _set(stage, seen, who):
    stage.ego[0], stage.ego[1] = seen.ego, seen.ego_before
    for a in range(how_many(who, seen.users)):
        i = which(who, a)
        stage.users[i], stage.users_before[i] = seen.users[i], seen.users_before[i]
        stage.memory[i] = seen.memory[i]


@inner
def _drive(ego, command, body, dt):
    """One frame of the kinematic bicycle, in the lane frame; the lane goes on bending as it does under the ego."""
    v, turned = ego.speed, body.curvature * ego.speed * dt
    course = ego.heading + command.slip
    ego.along, ego.u = v * np.cos(course), v * np.sin(course) - 0.5 * turned * v
    ego.s += ego.along * dt
    ego.y += ego.u * dt
    ego.heading += v * np.sin(command.slip) / body.half_wheelbase * dt - turned
    ego.cos, ego.sin = np.cos(ego.heading), np.sin(beyond(ego.heading, body.slack))
    ego.speed = v + command.acceleration * dt


@inner
def _go_on(user, dt):
    """One frame more of the same."""
    user.s += user.speed * user.cos * dt
    user.y += user.u * dt


@compiled
def within(v, slowest, fastest, seconds, ego_params):
    """Margin of Def. 1 that cannot be used up in so many seconds by anybody who drives the ego's way [m].

    Args:
      v: speed of the ego [m/s].
      slowest, fastest: of everybody else, along the lane [m/s].
      seconds: of a decision.
      ego_params: `RSSParams` of the ego.
    """
    rho, a, b = ego_params.response_time, ego_params.a_max_accel, ego_params.a_min_brake
    v, v_up = max(v, 0.0), max(v, 0.0) + a * seconds
    v_down = max(v - ego_params.a_max_brake * seconds, 0.0)
    ahead = max(v_up - slowest, 0.0) * seconds + reach(v_up, rho, a, b, np.inf) - reach(v, rho, a, b, ego_params.v_cap)
    behind = max(fastest - v_down, 0.0) * seconds + (v**2 - v_down**2) / (2.0 * ego_params.a_max_brake)
    return max(ahead, behind) + 1.0
