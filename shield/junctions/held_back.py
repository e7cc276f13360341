"""Who is in the way of what the ego wants at a junction: for reports, no duty depends on it."""

from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import ANYWHERE, NEVER, SLACK, go_plan, plan_conflict, stop_conflict

_FORESIGHT = 20.0  # [s]


@apart
def held_by(scene, nominal, users, at_line):
    """Index of the road user that leaves no plan after an acceleration, the soonest met if there are several.

    Where only several together leave none, it is the first to be met. To be asked after `junction_frame`, about a frame
    on which it changed the command.

    Args:
      scene: `Scene`.
      nominal: acceleration that the ego's own controller asks for [m/s^2].
      users: how many road users there are.
      at_line: as for `junction_frame`.

    Returns:
      The index, -1 = nobody: a light or the road itself is in the way.
    """
    a, slack = limit(nominal, scene.track.v, scene.table.ego, scene.table.dt), SLACK + scene.drift
    who, soonest = -1, NEVER
    for i in range(users):
        if stop_conflict(scene, a, i, at_line, slack) != NEVER:
            go, go_at = go_plan(scene, a, i, at_line, slack)
            if go < 0 and go_at < soonest and _is_met(scene, a, i, slack):
                who, soonest = i, go_at
    if who >= 0 or _is_closed(scene):
        return who
    for i in range(users):
        met = _first_met(scene, a, i, slack)
        if met < soonest:
            who, soonest = i, met
    return who


@inner
def _is_closed(scene):
    """Is something in the ego's way that is no road user, such as a line at a red light?"""
    closed = False
    for k in range(len(scene.threats)):
        closed |= scene.threats[k].user < 0
    return closed


@apart
def _first_met(scene, a, i, slack):
    """First frame on which a road user is met, whether the ego brakes or goes on; `NEVER` if it is not."""
    go_on = plan_conflict(scene, int(_FORESIGHT / scene.table.dt), i, slack)
    return min(stop_conflict(scene, a, i, ANYWHERE, slack), go_on)


@apart
def _is_met(scene, a, i, slack):
    return _first_met(scene, a, i, slack) != NEVER
