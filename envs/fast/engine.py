"""The engine: batches of environments, one compiled kernel, Python threads.

The kernel advances a range of environments and releases the interpreter lock, so threads work on one batch
side by side. Environments do not see each other: results do not depend on who advances which.
"""

import sys
from collections.abc import Callable
from copy import deepcopy
from threading import Timer
from typing import Any, NamedTuple

import numpy as np
from numba import typeof

from rss_shield.envs.compiled import kernel, unfolded
from rss_shield.envs.conditions import group_of, held
from rss_shield.envs.decisions.foresight import without_anticipation
from rss_shield.envs.fast.config import Scenario
from rss_shield.envs.fast.crossings import Plans, Ways, carry_over, compile_ways, plans_of
from rss_shield.envs.fast.draws import load_generator
from rss_shield.envs.fast.envs.intersection import let_traffic_flow, open_intersection
from rss_shield.envs.fast.following import follow
from rss_shield.envs.fast.foresight import foresee, make_desk
from rss_shield.envs.fast.frame import act, look_around, survey, think
from rss_shield.envs.fast.guard import (
    cost_of,
    distances_of,
    guard,
    make_watch,
    report,
    ride_of,
    start_judging,
    start_watch,
)
from rss_shield.envs.fast.linear_drivers import start_habits
from rss_shield.envs.fast.neighbours import Distances, LaneFrames, Past, compile_lane_frames, make_past
from rss_shield.envs.fast.rating import is_truncated
from rss_shield.envs.fast.risk import RISK, Field, Meter, begin_looks, compile_field, meter_of, report_risk, start_risk
from rss_shield.envs.fast.seats import (
    NO_ACTION,
    Seats,
    Told,
    begin_seats,
    charge,
    earn,
    guard_seat,
    is_over,
    judge_seats,
    keep_last,
    make_seats,
    make_told,
    move_seats,
    report_seats,
    restart_seats,
    stop_after,
    take_actions,
)
from rss_shield.envs.fast.senses import GHOSTS, Aware, Sensed, aware_of, begin_episode, look, make_sensed
from rss_shield.envs.fast.sight import Sight, make_sight, project, sort_along_x
from rss_shield.envs.fast.state import CAR, EPISODE, LINEAR_CAR, STEP, TRAFFIC
from rss_shield.envs.fast.tasks import make_scene
from rss_shield.envs.fast.threads import Crew
from rss_shield.envs.fast.views.apart import call_of
from rss_shield.envs.fast.views.record import NONE, View
from rss_shield.envs.fast.views.usual import observe
from rss_shield.envs.options import PLANS, Settings
from rss_shield.envs.roads.lanes import tightest
from rss_shield.envs.roads.network import Network
from rss_shield.envs.semantic.outlook import PLAN_FIELDS
from rss_shield.envs.sensing import Sensing
from rss_shield.shield._numba.compiled import compiling_quickly, inner, rare
from rss_shield.shield.comfort import RIDE
from rss_shield.shield.ground import Ground
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.table import below, table_for
from rss_shield.shield.tally import start_decision

DISABLED, SAME_STEP, NEXT_STEP = range(3)  # when an ended episode is followed by a new one
# what an environment does on a call; the last two where its kernel is called twice, with a look between
DECIDE, RESTART, STAY, GO_ON, DONE = range(5)
_PATIENCE = 6.0  # seconds of silence before the first call explains itself


class World(NamedTuple):
    """What does not change."""

    config: np.ndarray  # `[1]` CONFIG
    flow: np.ndarray | None  # `[1]` FLOW where traffic comes and goes
    network: Network
    # one of the two where a shield runs; numba compiles the kernel for either, and for none
    frames: LaneFrames | None
    ways: Ways | None
    # the rest is as in `Scenario`
    target_speeds: np.ndarray
    labels: np.ndarray
    sees: View  # `Scenario.view`
    lane_odds: np.ndarray
    linear: np.ndarray | None  # `[6]` as in `linear_drivers`, where the traffic is of that kind
    field: Field | None  # of the measure of risk, where somebody asked for it
    ground: Ground | None  # where not all of it, or not everybody on it, is alike


class Batch(NamedTuple):
    """State of E environments with room for N road users."""

    cars: np.ndarray  # `[E, N]` CAR
    episodes: np.ndarray  # `[E]` EPISODE
    order: np.ndarray  # `[E, N]` indices sorted by x
    # what the shield remembers, if there is one
    past: Past | None  # with `World.frames`
    crossings: np.ndarray | None  # `[E, N]` CROSSING, with `World.ways`
    rides: np.ndarray | None  # `[E]` RIDE
    risks: np.ndarray | None  # `[E]` RISK, with `World.field`
    sensed: Sensed | None  # where an ego does not see what is there
    seats: Seats | None  # where there are several egos; they have the rest of what a shield remembers, too


class Inputs(NamedTuple):
    """What the agents want. Only one of the first two kinds of command counts; those of several egos are `Seats`'."""

    actions: np.ndarray  # `[E]` discrete actions
    commands: np.ndarray  # `[E, 2]` acceleration [m/s^2] and steering [rad]
    todo: np.ndarray  # `[E]` DECIDE, RESTART or STAY, overwritten
    trajectories: np.ndarray | None  # `[E, F, 2]` what the egos carry out frame by frame, see `following`


class Outputs(NamedTuple):
    """What came of it."""

    observations: np.ndarray  # `[E, size]` float32, of the new episode where one began
    rewards: np.ndarray  # `[E]`
    terminated: np.ndarray  # `[E]`
    truncated: np.ndarray  # `[E]`
    steps: np.ndarray  # `[E]` STEP, of the new episode where one began
    final_observations: np.ndarray  # `[E, size]` written where an episode ended and another began
    final_steps: np.ndarray  # `[E]` STEP, likewise
    risks: np.ndarray | None  # `[E]` RISK, of the new episode where one began; with `World.field`
    final_risks: np.ndarray | None  # `[E]` likewise, written where an episode ended and another began
    told: Told | None  # of each of several egos


class Film(NamedTuple):
    """The frames of the last decision, of chosen environments."""

    slots: np.ndarray  # `[E]` row of each environment, -1 = not filmed
    cars: np.ndarray  # `[slots, frames, N]` CAR after each frame


class Place(NamedTuple):
    """One environment of a batch, and where it is worked out."""

    cars: np.ndarray  # `[N]` CAR
    episode: np.ndarray  # EPISODE
    order: np.ndarray  # `[N]`
    sight: Sight
    # of the first ego, None where there is no such thing
    distances: Distances | None
    plans: Plans | None
    ride: np.ndarray | None  # RIDE
    meter: Meter | None
    aware: Aware | None


@rare
def _populate(cars, episode, order, world, sight, flow):
    config, net, linear = world.config[0], world.network, world.linear
    start_habits(cars, linear)
    if flow is None:
        make_scene(cars, episode, order, net, net.lanes, config, world.target_speeds, world.lane_odds, linear)
    else:
        open_intersection(cars, episode, order, net, sight, config, flow, world.target_speeds, linear)
    _draw_groups(cars, episode, world.ground)


@inner
def _draw_groups(cars, episode, ground):
    """Vehicle classes; the ego is a car."""
    if ground is not None:
        for i in range(episode.vehicles):
            cars[i].group = group_of(episode.state_low, i, ground.shares)
        cars[episode.ego].group = 0


@inner
def _hold(cars, episode, ground):
    """Everybody does what tyres and brakes admit."""
    if ground is not None:
        for i in range(episode.vehicles):
            car = cars[i]
            group = car.group if car.kind == TRAFFIC else -1
            car.acceleration = held(car.acceleration, ground, car.x, group)


@inner
def _go_on(e, cars, episode, order, world, plans, watch, flow, seats):
    """Cars come and go between two decisions."""
    if flow is not None:
        was_ego = episode.ego
        let_traffic_flow(cars, episode, order, world.network, world.config[0], flow[0], world.linear)
        if plans is not None:
            carry_over(episode, cars, plans.crossings, was_ego, watch.blank_crossing)
        move_seats(e, cars, episode, world, watch, seats)


@rare
def _restart(e, place, world, watch, step, out, seats, told):
    """Begin a new episode and observe it."""
    cars, episode, order, sight, distances, plans, ride, meter, aware = place
    _populate(cars, episode, order, world, sight, world.flow)
    episode.time, episode.steps, episode.return_, episode.ended = 0.0, 0, 0.0, False
    survey(cars, episode, world.network, sight, world.flow)
    sort_along_x(cars, episode.cars, order)
    start_watch(cars, episode, distances, plans, ride, watch, aware)
    start_risk(meter)
    start_decision(step)
    restart_seats(e, cars, episode, world, watch, seats, told)
    step.raw_reward = earn(e, cars, episode, NO_ACTION, world, sight, step, seats, told)
    report(cars, episode, ride, 0.0, step)
    report_seats(e, cars, world, seats, told)
    _see_apart(cars, episode, world, sight, out, aware)


@inner
def _see(cars, episode, world, sight, out, aware):
    """What the agent observes: what is there, or what is sensed."""
    if aware is None:
        _observe(cars, episode, world, sight, out)
    else:
        _see_sensed(cars, episode, world, sight, out, aware)


@inner
def _see_sensed(cars, episode, world, sight, out, aware):
    if not aware.sensor.to_agent:
        _observe(cars, episode, world, sight, out)
        return
    n = episode.cars
    look(cars, episode, aware)
    project(aware.cars, n + GHOSTS, world.network, sight)
    episode.cars = n + GHOSTS
    _observe(aware.cars, episode, world, sight, out)
    episode.cars = n
    project(cars, n, world.network, sight)


@inner
def _observe(cars, episode, world, sight, out):
    observe(cars, episode, world.network, sight, world.sees, world.target_speeds, world.config[0].period, out)


@rare
def _see_apart(cars, episode, world, sight, out, aware):
    """`_see` where it is rare; the kernel would else contain it thrice."""
    _see(cars, episode, world, sight, out, aware)


@unfolded
def _advance(e, place, world, watch, settings, inputs, film, step, seats, told):
    """One decision of one environment, frame by frame."""
    cars, episode, order, sight, distances, plans, ride, meter, aware = place
    config, net, flow = world.config[0], world.network, world.flow
    lanes = net.lanes
    survey(cars, episode, net, sight, flow)
    start_decision(step)
    start_judging(aware)
    begin_looks(meter)
    begin_seats(e, cars, episode, world, seats, told)
    had_contact = episode.blame != 0
    for frame in range(config.frames):
        if frame == 0:
            take_actions(e, cars, episode, world, sight, distances, plans, settings, inputs, step, seats, told)
        changing = look_around(cars, episode, order, net, sight, flow)
        # plans depend on the lanes that others head for, and those after the ego see the lane that it is given back:
        # the shield looks when those up to the ego have decided
        in_turn = ride is not None and (plans is not None or settings.table.rules.take_back)
        turn, first, last = 0, 0, stop_after(0, e, episode, in_turn, seats)
        while first < episode.vehicles:  # a loop, lest the kernel contain it twice
            changing = think(cars, episode, first, last, changing, net, sight, config)
            if first == 0:
                follow(e, frame, inputs.trajectories, cars, episode, lanes, sight)
                changing = guard(
                    cars, episode, changing, net, sight, distances, plans, ride, meter, watch, settings, step, aware
                )
            changing = guard_seat(turn, e, cars, changing, world, sight, watch, settings, seats, told)
            turn += 1
            first, last = last, stop_after(turn, e, episode, in_turn, seats)
        _hold(cars, episode, world.ground)
        act(cars, episode, order, net, sight, config, flow)
        if film.slots[e] >= 0:
            for i in range(len(cars)):
                film.cars[film.slots[e], frame, i] = cars[i]
    episode.time += config.period
    episode.steps += 1
    judge_seats(e, cars, world, sight, watch, settings, seats, told)
    return cost_of(cars, episode, lanes, sight, distances, plans, ride, watch, settings, had_contact, step, aware)


@kernel
def run(first, last, sight, world, batch, inputs, outputs, film, watch, settings, penalty, by_change, autoreset):
    """One decision of the environments `first` to `last` - 1, resets included.

    Where observations are made apart from it, it waits for that after the decision: the next call goes on from there.
    """
    config, lanes, waits = world.config[0], world.network.lanes, world.sees.record[0].kind == NONE
    seats, told = batch.seats, outputs.told
    for e in range(first, last):
        if inputs.todo[e] == DONE:
            continue
        cars, episode, order, step = batch.cars[e], batch.episodes[e], batch.order[e], outputs.steps[e]
        distances, plans = distances_of(e, world.frames, batch.past), plans_of(e, world.ways, batch.crossings)
        ride, meter = ride_of(e, batch.rides), meter_of(e, world.field, batch.risks)
        observation = outputs.observations[e]
        if inputs.todo[e] == RESTART or (inputs.todo[e] == DECIDE and autoreset == NEXT_STEP and episode.ended):
            begin_episode(e, batch.sensed)
        aware = aware_of(e, batch.sensed, world.frames)
        if inputs.todo[e] == STAY:
            _start_outputs(e, outputs)
            report(cars, episode, ride, 0.0, step)
            report_risk(e, meter, outputs.risks)
            report_seats(e, cars, world, seats, told)
            inputs.todo[e] = DONE
            continue
        place = Place(cars, episode, order, sight, distances, plans, ride, meter, aware)
        if inputs.todo[e] == RESTART or (inputs.todo[e] == DECIDE and autoreset == NEXT_STEP and episode.ended):
            _start_outputs(e, outputs)
            _restart(e, place, world, watch, step, observation, seats, told)
            report_risk(e, meter, outputs.risks)
            inputs.todo[e] = DONE
            continue
        if inputs.todo[e] == DECIDE:
            _start_outputs(e, outputs)
            cost = _advance(e, place, world, watch, settings, inputs, film, step, seats, told)
            _see(cars, episode, world, sight, observation, aware)
            reward = earn(e, cars, episode, inputs.actions[e], world, sight, step, seats, told)
            step.raw_reward = reward
            reward -= charge(e, step, penalty, by_change, seats, told)
            episode.return_ += reward
            outputs.rewards[e] = reward
            outputs.terminated[e] = is_over(e, cars, episode, lanes, sight, config, seats)
            outputs.truncated[e] = is_truncated(episode, config)
            episode.ended = outputs.terminated[e] or outputs.truncated[e]
            report(cars, episode, ride, cost, step)
            report_risk(e, meter, outputs.risks)
            report_seats(e, cars, world, seats, told)
            inputs.todo[e] = GO_ON
            if waits:
                continue
        inputs.todo[e] = DONE
        _go_on(e, cars, episode, order, world, plans, watch, world.flow, seats)
        if episode.ended and autoreset == SAME_STEP:
            for k in range(len(observation)):
                outputs.final_observations[e, k] = observation[k]
            outputs.final_steps[e] = step
            report_risk(e, meter, outputs.final_risks)
            keep_last(e, world, seats, told)
            begin_episode(e, batch.sensed)
            aware = aware_of(e, batch.sensed, world.frames)
            place = Place(cars, episode, order, sight, distances, plans, ride, meter, aware)
            _restart(e, place, world, watch, step, observation, seats, told)
            report_risk(e, meter, outputs.risks)
            inputs.todo[e] = RESTART


@inner
def _start_outputs(e, outputs):
    outputs.rewards[e] = 0.0
    outputs.terminated[e] = outputs.truncated[e] = False


class Engine:
    """E environments in lockstep, as arrays.

    Args:
      scenario: what to run.
      num_envs: E.
      settings: `envs.options.Settings` of the shield, None = no shield.
      penalty: subtracted from the reward, times the share of frames that the shield overrode.
      autoreset: DISABLED, SAME_STEP or NEXT_STEP.
      threads: how many threads share the work.
      by_change: the penalty is times the mean change of acceleration instead [m/s^2].
      risk: settings of the measure of risk around each ego, None = nobody asked; it needs a shield.
      follows: the egos carry out `trajectories`, which are written before each step.
      sensing: what goes wrong with what an ego sees, None = nothing; it needs a shield that keeps distances.
      ground: conditions of the road and classes of vehicles, None = dry, and cars; it needs a shield, too.
    """

    def __init__(
        self,
        scenario: Scenario,
        num_envs: int,
        settings: Settings | None = None,
        penalty: float = 0.0,
        autoreset: int = SAME_STEP,
        threads: int = 1,
        by_change: bool = False,
        risk: RiskSettings | None = None,
        follows: bool = False,
        sensing: Sensing | None = None,
        ground: Ground | None = None,
    ) -> None:
        n = scenario.capacity
        self.scenario = scenario
        self.num_envs = num_envs
        self.autoreset = autoreset
        self.penalty, self.by_change = float(penalty), bool(by_change)
        self.settings = settings or Settings(table_for(PRESETS["simulator"], Rules(), 1.0), False)
        network, net = scenario.stock.road.network, scenario.network
        seen = n if sensing is None else n + GHOSTS
        frames = ways = past = crossings = rides = risks = seats = None
        if settings is not None:
            rides = np.zeros(num_envs, RIDE)
            risks = None if risk is None else np.zeros(num_envs, RISK)
        if settings is not None and settings.scheme == PLANS:
            ways = compile_ways(network, net, float(scenario.config["dt"][0]))
            self.settings = settings._replace(table=below(settings.table, ways.roads.limit))
            crossings = np.zeros((num_envs, n), CROSSING)
        elif settings is not None:
            frames = compile_lane_frames(network, settings, ground)
            past = make_past(num_envs, seen)
        if scenario.agents is not None:
            crossings = rides = risks = None
            seats = make_seats(scenario.agents, num_envs, n, settings is not None, risk is not None)
        self.world = World(
            scenario.config,
            scenario.flow,
            net,
            frames,
            ways,
            scenario.target_speeds,
            scenario.labels,
            scenario.view,
            scenario.lane_odds,
            scenario.linear,
            None if risk is None else compile_field(network, risk, self.settings),
            ground,
        )
        self.batch = Batch(
            np.zeros((num_envs, n), CAR if scenario.linear is None else LINEAR_CAR),
            np.zeros(num_envs, EPISODE),
            np.zeros((num_envs, n), np.int64),
            past,
            crossings,
            rides,
            risks,
            None if sensing is None else make_sensed(sensing, self.settings, num_envs, n),
            seats,
        )
        frames_of_decision = np.zeros((0, int(scenario.config["frames"][0]), n), self.batch.cars.dtype)
        self.film = Film(np.full(num_envs, -1, np.int64), frames_of_decision)
        planned = num_envs, int(scenario.config["frames"][0]), PLAN_FIELDS
        self.trajectories = np.zeros(planned) if follows else None
        self.sensing = sensing
        self._seen: np.ndarray | None = None  # last observations
        last = scenario.glances[-1] if scenario.glances else None
        self._size = last.start + last.size if last else int(np.prod(scenario.observation_space.shape or 1))
        self._looks: list[Callable[..., None] | None] = [None] * len(scenario.glances)  # kernels, compiled likewise
        self._crew = Crew(threads)
        self._kernel: Callable[..., None] | None = None  # `run`, compiled for this engine
        self._foresees: Callable[..., None] | None = None  # `foresee`, likewise
        grids = [view.record[0] for view in (scenario.view, *(glance.view for glance in scenario.glances))]
        grid = [max(int(one[name]) for one in grids) for name in ("speeds", "lanes", "times")]
        self._sights = [make_sight(len(net.lanes), seen, grid, scenario.linear) for _ in range(threads)]
        self._watch = make_watch(self.settings.table.rules.heading_bound, tightest(network))
        self._calm = without_anticipation(self.settings)
        self._desks = [make_desk(seen, len(scenario.labels)) for _ in range(threads)]

    def seed(self, seeds) -> None:
        """Give environments the generators that highway-env would have.

        Args:
          seeds: `[E]` integers; None leaves a generator as it is.
        """
        for e, seed in enumerate(seeds):
            if seed is not None:
                load_generator(self.batch.episodes[e], np.random.PCG64(np.random.SeedSequence(seed)))
                if self.sensing is not None and self.batch.sensed is not None:
                    self.batch.sensed.keys[e], self.batch.sensed.begun[e] = self.sensing.keys(seed), 0

    def reset(self, mask=None) -> Outputs:
        """Begin new episodes, in all environments or where `mask` `[E]` says so; the others stand still."""
        e = self.num_envs
        todo = np.full(e, RESTART, np.int8) if mask is None else np.where(mask, RESTART, STAY).astype(np.int8)
        seen, stays = self._seen, todo == STAY
        outputs = self._run(Inputs(np.zeros(e, np.int64), np.zeros((e, 2)), todo, self.trajectories))
        outputs.observations[stays] = 0.0 if seen is None else seen[stays]
        return outputs

    def step(self, actions=None, commands=None) -> Outputs:
        """One decision everywhere.

        Args:
          actions: `[E]` int64 meta-actions, or
          commands: `[E, 2]` acceleration [m/s^2] and steering [rad]; then actions only count in the reward.
            Of several egos `[A, E]` and `[A, E, 2]`.
        """
        e, seats = self.num_envs, self.batch.seats
        if seats is not None:
            seats.actions[:] = 0 if actions is None else actions
            seats.commands[:] = 0.0 if commands is None else commands
            actions = commands = None
        actions = np.full(e, -1) if actions is None else actions
        commands = np.zeros((e, 2)) if commands is None else commands
        # compiled for these types and no others
        actions, commands = np.ascontiguousarray(actions, np.int64), np.ascontiguousarray(commands, np.float64)
        return self._run(Inputs(actions, commands, np.full(e, DECIDE, np.int8), self.trajectories))

    def action_masks(self) -> np.ndarray:
        """`[E, A]` bool: which meta-actions would pass the coming decision; see `FastVectorEnv.action_masks`."""
        masks = np.empty((self.num_envs, len(self.scenario.labels)), bool)
        common = (self.world, self.batch, self._watch, self._calm, masks)
        if self._foresees is None:
            self._foresees = _specialise(foresee, self._sights[0], self._desks[0], *common)
        look = self._foresees
        self._crew.work(
            self.num_envs,
            lambda thread, first, last: look(first, last, self._sights[thread], self._desks[thread], *common),
        )
        return masks

    def _run(self, inputs: Inputs) -> Outputs:
        e = self.num_envs
        outputs = Outputs(
            np.empty((e, self._size), np.float32),
            np.empty(e),
            np.empty(e, bool),
            np.empty(e, bool),
            np.zeros(e, STEP),
            np.zeros((e, self._size), np.float32),
            np.zeros(e, STEP),
            None if self.batch.risks is None else np.zeros(e, RISK),
            None if self.batch.risks is None else np.zeros(e, RISK),
            None if self.batch.seats is None else make_told(self.batch.seats),
        )
        rules = (self.settings, self.penalty, self.by_change, self.autoreset)
        common = (self.world, self.batch, inputs, outputs, self.film, self._watch, *rules)
        if self._kernel is None:
            self._kernel = _specialise(run, self._sights[0], *common)
        advance = self._kernel

        def work() -> None:
            self._crew.work(e, lambda thread, first, last: advance(first, last, self._sights[thread], *common))

        acts = inputs.todo != STAY
        work()
        if self.scenario.glances:
            self._look(acts, outputs.observations)
            work()
            self._look(inputs.todo == RESTART, outputs.observations)
        several = () if self.batch.seats is None else (self.batch.seats.episodes,)
        if any(episodes["overflow"].any() for episodes in (self.batch.episodes, *several)):
            for episodes in (self.batch.episodes, *several):
                episodes["overflow"] = False
            raise OverflowError(
                f"more than {self.scenario.capacity} road users in one environment; "
                "expected fewer, or a larger `capacity` in `compile_scenario`"
            )
        self._seen = outputs.observations
        return outputs

    def _look(self, which: np.ndarray, out: np.ndarray) -> None:
        """Make the observations that are made apart, of the environments `which` `[E]`, into `out` `[E, size]`."""
        if not which.any():
            return
        seats, egos = self.batch.seats, self.batch.episodes["ego"]
        first = egos.copy()
        for g, glance in enumerate(self.scenario.glances):
            egos[:] = first if seats is None else seats.episodes["ego"][glance.agent]
            entry, arguments = call_of(glance, self.world, self.batch, self._sights[0], which, out)
            look = self._looks[g] = self._looks[g] or _specialise(entry, *arguments)

            def part(thread, first, last, glance=glance, look=look) -> None:
                _, given = call_of(glance, self.world, self.batch, self._sights[thread], which, out)
                look(first, last, *given)

            self._crew.work(self.num_envs, part)
        egos[:] = first

    def close(self) -> None:
        """Give the threads back."""
        self._crew.close()

    def __deepcopy__(self, memo: dict) -> "Engine":
        """All but what is compiled, which both share."""
        twin = memo[id(self)] = object.__new__(type(self))
        for name, value in vars(self).items():
            setattr(twin, name, deepcopy(value, memo))
        return twin

    def __reduce__(self):
        raise TypeError(
            "an engine cannot be pickled, because it is bound to code that this process has compiled; expected "
            "copy.deepcopy in the same process, or make_vec with the same arguments and seed in another"
        )


def _specialise(entry: Any, *arguments) -> Callable[..., None]:
    """A kernel, compiled for these arguments or loaded from numba's cache; says so if that takes long.

    It skips what numba does on every call to find out the types of its arguments, a hundred arrays.
    """
    notice = Timer(
        _PATIENCE, lambda: print("compiling the fast engine; numba keeps the result for later runs", file=sys.stderr)
    )
    notice.start()
    try:
        with compiling_quickly():
            entry(0, 0, *arguments)
    finally:
        notice.cancel()
    return entry.overloads[tuple(typeof(argument) for argument in (0, 0, *arguments))].entry_point
