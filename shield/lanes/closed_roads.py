"""On a closed road everybody is ahead and behind."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.lanes.memory import forget_safe
from rss_shield.shield.lanes.pair import assess


@compiled
def go_around(ego, user, ego_before, user_before, memory, table):
    """Count a road user where the margin is smaller, ahead or behind, unless danger lasts: who was ahead stays ahead.

    Where somebody changes places otherwise, the sample before is taken in again from there.

    Args:
      ego, user: `ROAD_USER` records; `s` of the user is changed in place.
      ego_before, user_before: the same on the frame before; `s` of the user is changed, too, if it changes places.
      memory: `MEMORY` record of the pair, up to the sample before; changed in place likewise.
      table: `Table` in force.

    Returns:
      Has the user changed places?
    """
    if not np.isfinite(user.around):
        return False
    known = memory.age > 0 or memory.skipped
    gap = user_before.s - ego_before.s if known else 0.0
    ahead = ego.s + (user.s - ego.s) % user.around
    behind = ahead - user.around
    follows = ahead if abs(ahead - ego.s - gap) <= abs(behind - ego.s - gap) else behind
    place = follows
    if memory.since == 0:
        place = ahead if _margin(ego, user, ahead, table) <= _margin(ego, user, behind, table) else behind
    user.s = place
    moved = known and place != follows
    if moved:
        user_before.s += place - follows
        forget_safe(memory)
    return moved


@compiled
def keep_place(ego, user, gap):
    """Who was ahead on a closed road is so still, in another lane frame, too; `s` of the user is changed in place.

    Args:
      ego, user: `ROAD_USER` records of one sample.
      gap: from the one to the other, as it was counted then [m].
    """
    if np.isfinite(user.around):
        user.s += user.around * np.rint((gap - (user.s - ego.s)) / user.around)


@inner
def _margin(ego, user, s, table):
    user.s = s
    return assess(ego, user, table).margin_lon
