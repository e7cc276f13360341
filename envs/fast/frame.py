"""One frame of the simulation: everybody decides, then everybody moves."""

from envs.fast.collisions import collide
from envs.fast.compiled import compiled
from envs.fast.config import INTERSECTION
from envs.fast.drivers import decide
from envs.fast.motion import move
from envs.fast.regulation import regulate
from envs.fast.sight import line_up, place, project, sort_along_x, update_lanes


@compiled
def survey(cars, episode, lanes, sight, config):
    """Find out where everybody is. Nobody has moved since their lanes were found."""
    if config.scenario == INTERSECTION:
        place(cars, episode.cars, lanes, sight)
    else:
        project(cars, episode.cars, lanes, sight)


@compiled
def think(cars, episode, order, net, sight, config):
    """Commands of all vehicles, after a survey."""
    if config.scenario != INTERSECTION:
        line_up(episode.cars, net.lanes, order, sight)
    decide(cars, episode, net, net.lanes, sight, config)


@compiled
def act(cars, episode, order, net, sight, config):
    """Carry the commands out, survey the result and find collisions."""
    lanes = net.lanes
    if config.regulation_period > 0:
        regulate(cars, episode, net, sight, config)
    move(cars, episode.vehicles, config.dt, config.max_speed, config.min_speed)
    if config.scenario == INTERSECTION:
        place(cars, episode.cars, lanes, sight)
    else:
        project(cars, episode.cars, lanes, sight)
        update_lanes(cars, episode.vehicles, lanes, sight)
    sort_along_x(cars, episode.cars, order)
    collide(cars, episode, order, sight, config.dt)
