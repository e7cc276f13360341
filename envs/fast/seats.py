"""Several egos on one road, each with a shield that looks when it is its car's turn.

What a road has once is in the EPISODE of its environment; what is an ego's own is in an EPISODE of its seat, which
knows the cars from there. Where there is one ego, the two are one record: `seats` is None then, and numba compiles the
kernel without any of this.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.fast.crossings import carry_over, plans_of
from rss_shield.envs.fast.drivers import take_meta_action
from rss_shield.envs.fast.guard import cost_of, guard, report, ride_of, start_watch
from rss_shield.envs.fast.lane_changes import refuse_lane_change
from rss_shield.envs.fast.risk import RISK, begin_looks, meter_of, report_risk, start_risk
from rss_shield.envs.fast.state import EPISODE, STEP, TRAFFIC
from rss_shield.envs.fast.tasks import is_terminated, is_terminated_together, rate
from rss_shield.shield._numba.compiled import inner, part, rare
from rss_shield.shield.comfort import RIDE
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.tally import start_decision

NO_ACTION = np.int64(-1)


class Seats(NamedTuple):
    """A egos in each of E environments with room for N road users, in the order in which they stand on the road."""

    episodes: np.ndarray  # `[A, E]` EPISODE
    actions: np.ndarray  # `[A, E]` discrete actions
    commands: np.ndarray  # `[A, E, 2]` acceleration [m/s^2] and steering [rad]
    touched: np.ndarray  # `[A, E]` had its contact before this decision
    # what their shields remember, if there are any
    crossings: np.ndarray | None  # `[A, E, N]` CROSSING
    rides: np.ndarray | None  # `[A, E]` RIDE
    risks: np.ndarray | None  # `[A, E]` RISK, if somebody asked


class Told(NamedTuple):
    """What came of it for each ego."""

    rewards: np.ndarray  # `[A, E]`
    costs: np.ndarray  # `[A, E]`
    steps: np.ndarray  # `[A, E]` STEP, of the new episode where one began
    final_steps: np.ndarray  # `[A, E]` STEP, written where an episode ended and another began
    risks: np.ndarray | None  # `[A, E]` RISK likewise
    final_risks: np.ndarray | None


def make_seats(agents: int, num_envs: int, n: int, shielded: bool, measures_risk: bool) -> Seats:
    """Seats of `agents` egos; their shields go by plans."""
    shape = agents, num_envs
    return Seats(
        np.zeros(shape, EPISODE),
        np.zeros(shape, np.int64),
        np.zeros((*shape, 2)),
        np.zeros(shape, bool),
        np.zeros((*shape, n), CROSSING) if shielded else None,
        np.zeros(shape, RIDE) if shielded else None,
        np.zeros(shape, RISK) if measures_risk else None,
    )


def make_told(seats: Seats) -> Told:
    """Room for what comes of one call."""
    shape = seats.episodes.shape
    steps = np.zeros(shape, STEP), np.zeros(shape, STEP)
    if seats.risks is None:
        return Told(np.zeros(shape), np.zeros(shape), *steps, None, None)
    return Told(np.zeros(shape), np.zeros(shape), *steps, np.zeros(shape, RISK), np.zeros(shape, RISK))


# Where `seats` is None, the next ones do what there is to do for one ego, or nothing.


@inner
def take_actions(e, cars, episode, world, sight, distances, plans, settings, inputs, step, seats, told):
    """Begin to carry out what the agents ask for."""
    if seats is None:
        asked = inputs.actions[e], inputs.commands[e, 0], inputs.commands[e, 1]
        _take_action(cars, episode, *asked, world, sight, distances, plans, settings, step)
    else:
        for a in range(len(seats.episodes)):
            asked = seats.actions[a, e], seats.commands[a, e, 0], seats.commands[a, e, 1]
            own = plans_of(e, world.ways, _row(a, seats.crossings))
            _take_action(cars, seats.episodes[a, e], *asked, world, sight, None, own, settings, told.steps[a, e])


@inner
def _take_action(cars, episode, action, acceleration, steering, world, sight, distances, plans, settings, step):
    ego, net = cars[episode.ego], world.network
    if world.config[0].meta_actions:
        before = ego.target_lane
        take_meta_action(cars, episode.ego, world.labels[action], net, net.lanes, sight, world.target_speeds)
        refuse_lane_change(before, cars, episode, net.lanes, sight, distances, plans, settings, step)
    else:
        ego.acceleration, ego.steering = acceleration, steering
        episode.nominal_acceleration, episode.nominal_steering = ego.acceleration, ego.steering


@inner
def stop_after(turn, e, episode, in_turn, seats):
    """How many vehicles have decided before the shield looks for the time `turn`; those after it wait for that."""
    if seats is None:
        return episode.ego + 1 if in_turn and turn == 0 else episode.vehicles
    return seats.episodes[turn, e].ego + 1 if turn < len(seats.episodes) else episode.vehicles


@inner
def guard_seat(turn, e, cars, changing, world, sight, watch, settings, seats, told):
    """`guard` for the ego whose turn it is; returns `changing`."""
    if seats is None:
        return changing
    if turn < len(seats.episodes):
        return _guard_seat(turn, e, cars, changing, world, sight, watch, settings, seats, told)
    return changing


@part
def _guard_seat(a, e, cars, changing, world, sight, watch, settings, seats, told):
    plans, ride = plans_of(e, world.ways, _row(a, seats.crossings)), ride_of(e, _row(a, seats.rides))
    meter, episode, step = meter_of(e, world.field, _row(a, seats.risks)), seats.episodes[a, e], told.steps[a, e]
    return guard(cars, episode, changing, world.network, sight, None, plans, ride, meter, watch, settings, step, None)


@inner
def earn(e, cars, episode, action, world, sight, step, seats, told):
    """Reward of the last decision, before any penalty; its components go to `step`."""
    if seats is None:
        return rate(cars, episode, action, world.network.lanes, sight, world.config[0], step)
    return _earn_together(e, cars, world, sight, step, seats, told)


@part
def _earn_together(e, cars, world, sight, step, seats, told):
    """The mean over the agents, added up in their order, is the reward of all."""
    total, count = 0.0, len(seats.episodes)
    first = second = third = fourth = 0.0
    for a in range(count):
        own = told.steps[a, e]
        own.raw_reward = rate(cars, seats.episodes[a, e], NO_ACTION, world.network.lanes, sight, world.config[0], own)
        total += own.raw_reward
        first, second = first + own.reward_0, second + own.reward_1
        third, fourth = third + own.reward_2, fourth + own.reward_3
    step.reward_0, step.reward_1, step.reward_2, step.reward_3 = (
        first / count,
        second / count,
        third / count,
        fourth / count,
    )
    return total / count


@inner
def charge(e, step, penalty, by_change, seats, told):
    """What is subtracted from the reward for interventions."""
    if seats is None:
        return _charged(step, penalty, by_change)
    return _charge_each(e, penalty, by_change, seats, told)


@inner
def _charged(step, penalty, by_change):
    charged = step.acceleration_changed if by_change else float(step.overridden)
    return penalty * (charged / max(step.frames, 1))


@part
def _charge_each(e, penalty, by_change, seats, told):
    total = 0.0
    for a in range(len(seats.episodes)):
        own, episode = told.steps[a, e], seats.episodes[a, e]
        charged = _charged(own, penalty, by_change)
        told.rewards[a, e] = own.raw_reward - charged
        episode.return_ += told.rewards[a, e]
        total += charged
    return total / len(seats.episodes)


@inner
def is_over(e, cars, episode, lanes, sight, config, seats):
    """Is the state terminal?"""
    if seats is None:
        return is_terminated(cars, episode, lanes, sight, config)
    return is_terminated_together(cars, episode, seats.episodes[:, e], lanes, sight, config)


@inner
def begin_seats(e, cars, episode, world, seats, told):
    """A decision begins."""
    if seats is not None:
        find_egos(e, cars, episode, seats)
        for a in range(len(seats.episodes)):
            start_decision(told.steps[a, e])
            begin_looks(meter_of(e, world.field, _row(a, seats.risks)))
            seats.touched[a, e] = seats.episodes[a, e].blame != 0


@inner
def judge_seats(e, cars, world, sight, watch, settings, seats, told):
    """Costs of a decision."""
    if seats is not None:
        _judge_seats(e, cars, world, sight, watch, settings, seats, told)


@part
def _judge_seats(e, cars, world, sight, watch, settings, seats, told):
    lanes = world.network.lanes
    for a in range(len(seats.episodes)):
        plans, ride = plans_of(e, world.ways, _row(a, seats.crossings)), ride_of(e, _row(a, seats.rides))
        own, touched, step = seats.episodes[a, e], seats.touched[a, e], told.steps[a, e]
        told.costs[a, e] = cost_of(cars, own, lanes, sight, None, plans, ride, watch, settings, touched, step, None)


@inner
def report_seats(e, cars, world, seats, told):
    """Fill in what every step says of each agent."""
    if seats is not None:
        for a in range(len(seats.episodes)):
            report(cars, seats.episodes[a, e], ride_of(e, _row(a, seats.rides)), told.costs[a, e], told.steps[a, e])
            report_risk(e, meter_of(e, world.field, _row(a, seats.risks)), _row(a, told.risks))


@inner
def keep_last(e, world, seats, told):
    """An episode has ended, and another one is about to begin."""
    if seats is not None:
        for a in range(len(seats.episodes)):
            told.final_steps[a, e] = told.steps[a, e]
            report_risk(e, meter_of(e, world.field, _row(a, seats.risks)), _row(a, told.final_risks))


@rare
def restart_seats(e, cars, episode, world, watch, seats, told):
    """A new episode begins."""
    if seats is not None:
        find_egos(e, cars, episode, seats)
        for a in range(len(seats.episodes)):
            own, plans = seats.episodes[a, e], plans_of(e, world.ways, _row(a, seats.crossings))
            own.return_, told.costs[a, e] = 0.0, 0.0
            start_watch(cars, own, None, plans, ride_of(e, _row(a, seats.rides)), watch, None)
            start_risk(meter_of(e, world.field, _row(a, seats.risks)))
            start_decision(told.steps[a, e])


@inner
def move_seats(e, cars, episode, world, watch, seats):
    """Cars came and went."""
    if seats is not None:
        find_egos(e, cars, episode, seats)
        for a in range(len(seats.episodes)):
            own = seats.episodes[a, e]
            _carry(own, cars, plans_of(e, world.ways, _row(a, seats.crossings)), watch)


@inner
def _carry(episode, cars, plans, watch):
    if plans is not None:
        carry_over(episode, cars, plans.crossings, cars[episode.ego].was, watch.blank_crossing)


@part
def find_egos(e, cars, episode, seats):
    """Let every seat know where its car stands, and who is there."""
    a = 0
    for i in range(episode.vehicles):
        if cars[i].kind != TRAFFIC and a < len(seats.episodes):
            own = seats.episodes[a, e]
            own.ego, own.cars, own.vehicles = i, episode.cars, episode.vehicles
            own.time, own.observed_lanes = episode.time, episode.observed_lanes
            a += 1


@inner
def _row(a, rows):
    """Row `a`; None if there are none."""
    if rows is None:
        return None
    return rows[a]
