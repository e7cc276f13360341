"""What a shield keeps of single frames: a record of the episode, and a look at the last one."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield.command import Command
from rss_shield.shield.lanes.judge import Log
from rss_shield.shield.lanes.pair import ROAD_USER


class Frame(NamedTuple):
    """One recorded frame: everything the shield saw, and the command that was executed."""

    keys: tuple[int, ...]  # `[N]` identity of each user within the episode
    poses: np.ndarray  # `[N + 1, 4]` x, y, heading, speed in the world, the ego last
    command: Command
    # in the lane frame of the ego, which nothing is measured in where roads cross
    ego: np.ndarray | None = None  # `ROAD_USER`, 0-d
    users: np.ndarray = np.zeros(0, ROAD_USER)  # `[N]` `ROAD_USER`
    curvature: float = 0.0  # of the lane under the ego [1/m]
    jumped: tuple[bool, ...] = ()  # `[N]` a user was moved in the lane frame, or with it
    ego_before: np.ndarray | None = None  # `ROAD_USER` on the frame before, in the lane frame of this one
    users_before: np.ndarray = np.zeros(0, ROAD_USER)  # `[N]` likewise


class Look(NamedTuple):
    """What a shield made of the last frame, for whoever films the episode."""

    wish: Command  # of the ego's own controller
    command: Command  # that was executed
    overridden: bool
    anticipated: bool
    limited: bool
    response: int  # sum of RESPONSE_*
    partner: int  # index among `ShieldedEgo.others` of who is nearest to danger, or in the way; -1 = nobody
    dangerous: bool


def log_of(frames: list[Frame]) -> Log:
    """Recorded frames as the arrays that `shield.lanes.judge.audit` reads."""
    count = 1 + max((max(frame.keys, default=-1) for frame in frames), default=-1)
    users, before = np.zeros((2, len(frames), count), ROAD_USER)
    present, jumped = np.zeros((2, len(frames), count), bool)
    for t, frame in enumerate(frames):
        keys = list(frame.keys)
        users[t, keys], before[t, keys] = frame.users, frame.users_before
        present[t, keys], jumped[t, keys] = True, frame.jumped
    return Log(
        ego=np.array([frame.ego for frame in frames], ROAD_USER),
        users=users,
        present=present,
        acceleration=np.array([frame.command.acceleration for frame in frames]),
        slip=np.array([frame.command.slip for frame in frames]),
        curvature=np.array([frame.curvature for frame in frames], float),
        jumped=jumped,
        ego_before=np.array([frame.ego_before for frame in frames], ROAD_USER),
        users_before=before,
    )
