"""Def. 10 as printed, looked at once per decision, as public implementations for discrete actions do.

Danger is what the printed distances say (Lemmas 2 and 4, no margin for sampling), and only that of the decision's first
frame counts: who was in danger then gives the proper response on all of its frames, who was not gives none.
"""

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.lanes.memory import merge
from rss_shield.shield.lanes.pair import assess
from rss_shield.shield.params import Rules, Table

PRINTED = Rules(
    limits=False,
    no_credit=False,
    present_duties=False,
    brake_if_inherited=False,
    take_back=False,
    anticipation=0.0,
    heading_bound=1.0,
    discretisation_margin=False,
    overlap_margin=0.0,
)


@compiled
def is_dangerous(ego, users, table, who=None):
    """Are both printed distances too short toward anybody?

    Args:
      ego: `ROAD_USER` record.
      users: `[N]` `ROAD_USER` records of everybody else.
      table: `Table`, whose rules do not count here.
      who: `[K]` indices of those who are near, None = everybody.
    """
    printed = Table(table.ego, table.other, PRINTED, table.dt, table.others)
    for a in range(how_many(who, users)):
        pair = assess(ego, users[which(who, a)], printed)
        if not (pair.safe_lon or pair.safe_lat):
            return True
    return False


@compiled
def printed_duties(bounds, users, memory, table, who=None):
    """What Def. 10 leaves of some `Bounds`, on the axis that was safe last.

    Args:
      bounds: `Bounds`.
      users: `[N]` `ROAD_USER` records of everybody else.
      memory: `[N]` `MEMORY` of them, this sample included.
      table, who: as in `is_dangerous`.
    """
    for a in range(how_many(who, users)):
        bounds = merge(bounds, memory[which(who, a)], table.ego, PRINTED, table.dt)
    return bounds
