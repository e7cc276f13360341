"""One frame of the simulation: everybody decides, then everybody moves.

`flow` is None where no traffic comes and goes. numba compiles the kernel for either kind of road, and for each
without what only the other needs.
"""

from rss_shield.envs.fast.collisions import collide
from rss_shield.envs.fast.drivers import decide, list_changing
from rss_shield.envs.fast.motion import move
from rss_shield.envs.fast.regulation import regulate
from rss_shield.envs.fast.sight import line_up, place, project, sort_along_x, update_lanes
from rss_shield.shield._numba.compiled import inner


@inner
def survey(cars, episode, net, sight, flow):
    """Find out where everybody is. Nobody has moved since their lanes were found."""
    if flow is None:
        project(cars, episode.cars, net, sight)
    else:
        place(cars, episode.cars, net.lanes, sight)


@inner
def look_around(cars, episode, order, net, sight, flow):
    """Get ready to `think`, after a survey; returns how many cars change lanes."""
    if flow is None:
        line_up(episode.cars, net, order, sight)
    return list_changing(cars, episode.cars, sight)


@inner
def think(cars, episode, first, last, changing, net, sight, config):
    """Commands of the vehicles `first` to `last` - 1; returns how many cars change lanes then."""
    return decide(cars, first, last, episode.cars, episode.ego, changing, net, net.lanes, sight, config)


@inner
def act(cars, episode, order, net, sight, config, flow):
    """Carry the commands out, survey the result and find collisions."""
    if flow is not None:
        regulate(cars, episode, net, sight, config, flow[0])
    move(cars, episode.vehicles, sight, config.dt, config.max_speed, config.min_speed)
    if flow is None:
        project(cars, episode.cars, net, sight)
        update_lanes(cars, episode.vehicles, net, sight)
    else:
        place(cars, episode.cars, net.lanes, sight)
    sort_along_x(cars, episode.cars, order)
    collide(cars, episode, order, sight, config.dt)
