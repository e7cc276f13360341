"""Lane changes that are not let through, or taken back: `envs.highway.ego` on the engine's arrays."""

from rss_shield.envs.fast.crossings import scene_of
from rss_shield.envs.fast.state import DIRECT, META
from rss_shield.shield._numba.compiled import inner, part
from rss_shield.shield.command import Command
from rss_shield.shield.junctions.controller import has_plan
from rss_shield.shield.lanes.lane_changes import OFF_CENTRE, is_blocked, lead_back, turns_back


@inner
def refuse_lane_change(before, cars, episode, lanes, sight, distances, plans, settings, step):
    """Ignore a lane change of this decision that leaves no plan, is blocked, or comes half-way through another.

    `before` is the lane the ego headed for.
    """
    episode.refused = False
    if plans is not None:
        _refuse_lane_change(before, cars, episode, sight, plans, settings)
    if distances is not None:
        _refuse_blocked(before, cars, episode, lanes, sight, settings, step)


@part
def _refuse_blocked(before, cars, episode, lanes, sight, settings, step):
    ego = cars[episode.ego]
    if not settings.overrides or not settings.table.rules.take_back or episode.blame != 0 or ego.kind != META:
        return
    if is_refused(before, ego, episode, lanes, sight, settings):
        ego.target_lane = before
        step.lane_change_refused = True


@inner
def is_refused(before, ego, episode, lanes, sight, settings):
    """Is the ego's change from lane `before` to its target blocked, or does it come half-way through another?"""
    k = ego.target_lane
    if not settings.table.rules.take_back or k == before or lanes[k].road != lanes[before].road:
        return False
    offsets = sight.lateral[ego.lane, episode.ego], sight.lateral[before, episode.ego]
    return turns_back(*offsets, k - before) or _is_blocked(k, episode, sight)


@inner
def _is_blocked(k, episode, sight):
    """Is the way to the centre of lane `k` blocked?"""
    return is_blocked(sight.lateral[k, episode.ego], episode.room_left, episode.room_right)


@inner
def take_back(wish, car, ego, episode, lanes, sight, body, settings, step):
    """`envs.highway.ego.ShieldedEgo._taken_back`: what the agent wants, and the lane that it heads for from now on."""
    slip = wish.slip
    if settings.table.rules.take_back and car.kind == DIRECT:
        rooms = episode.room_left, episode.room_right
        width = lanes[car.lane].width
        slip = lead_back(slip, ego, width, *rooms, body.half_wheelbase, body.curvature, settings.table.dt)
    if settings.table.rules.take_back and car.kind == META:
        lane = _reachable(car.lane, car.target_lane, episode, lanes, sight)
        step.lane_change_refused = step.lane_change_refused or lane != car.target_lane
        car.target_lane = lane
    step.lane_change_refused = step.lane_change_refused or slip != wish.slip
    return Command(wish.acceleration, slip)


@part
def _reachable(here, target, episode, lanes, sight):
    """Lane that the ego can get to: its target, one on the way, the one it is on, or the one it has come from."""
    if lanes[target].road != lanes[here].road:
        return target
    for k in range(target, here, 1 if here > target else -1):
        if not _is_blocked(k, episode, sight):
            return k
    if target != here or not _is_blocked(here, episode, sight):
        return here
    lateral = sight.lateral[here, episode.ego]
    if abs(lateral) <= OFF_CENTRE:
        return target
    step = 1 if lateral > 0.0 else -1
    if not 0 <= lanes[here].id + step < lanes[here].siblings or _is_blocked(here + step, episode, sight):
        return target
    return here + step


@part
def _refuse_lane_change(before, cars, episode, sight, plans, settings):
    ego = cars[episode.ego]
    if not settings.overrides or episode.blame != 0 or ego.kind != META:
        return
    lanes = plans.ways.roads.lanes
    if ego.target_lane == before or lanes[ego.target_lane].road != lanes[before].road:
        return
    n, path = episode.cars - 1, episode.path
    scene = scene_of(cars, episode, sight, plans, settings, False)
    if not has_plan(scene, plans.crossings[:n], settings.entry, not settings.waits_anywhere):
        ego.target_lane, episode.path = before, path
        episode.refused = True
