"""Engine and stock simulator side by side, from the same seeds, with the same actions."""

from typing import NamedTuple

import numpy as np
from gymnasium import spaces

import rss_shield
from rss_shield.envs.fast.config import compile_scenario
from rss_shield.envs.fast.draws import generator_state
from rss_shield.envs.fast.engine import DISABLED, Engine
from rss_shield.envs.fast.infos import Agents, step_infos
from rss_shield.envs.fast.state import OBSTACLE, TRAFFIC
from rss_shield.envs.fast.vector import _compared
from rss_shield.envs.stock import drivers_unchanged
from rss_shield.shield.tally import info_at

_NEAREST = ("shield.partner", "shield.min_margin_lon", "shield.min_margin_lat")
POLICIES = ("random", "faster", "slower")


class Comparison(NamedTuple):
    """Largest differences found over some episodes."""

    episodes: int
    equal: int  # episodes without any difference
    close: int  # episodes without a discrete difference, and none beyond 1e-8 or one unit of float32
    decisions: int
    state: float  # positions [m], headings [rad], speeds [m/s], timers [s]
    reward: float
    observation_ulps: int
    discrete: list[str]  # flags, lanes, indices, generators or infos that differ


def actions_of(policy: str, space, rng):
    """Next action of a policy, of several agents a tuple."""
    if isinstance(space, spaces.Tuple):
        return tuple(actions_of(policy, one, rng) for one in space)
    if isinstance(space, spaces.Box):
        throttle = {"random": rng.uniform(-1, 1), "faster": 1.0, "slower": -1.0}[policy]
        action = rng.uniform(-1, 1, space.shape) * (0.1 if policy != "random" else 1.0)
        action[0] = throttle
        return action.astype(np.float32)
    names = {"faster": {5: 3, 3: 2, 9: 7}, "slower": {5: 4, 3: 0, 9: 1}}  # of `DiscreteAction`, straight on
    return int(rng.integers(space.n)) if policy == "random" else names[policy][int(space.n)]


def compare(
    env_id, seeds, policy="random", config=None, shield=None, max_steps=60, until=None, **options
) -> Comparison:
    """Run one episode per seed on both and compare everything after every decision.

    Args:
      options: of the shield.
      until: called with the number of decisions so far; stops when it returns True.
    """
    with drivers_unchanged():
        return _compare(env_id, list(seeds), policy, config, shield, max_steps, until, options)


def _compare(env_id, seeds, policy, config, shield, max_steps, until, options) -> Comparison:
    stock = rss_shield.make(env_id, shield=shield, config=config, **options)
    settings = stock.settings if shield else None
    engine = Engine(compile_scenario(env_id, config), 1, settings, autoreset=DISABLED)
    largest = {"state": 0.0, "reward": 0.0, "ulps": 0}
    discrete: list[str] = []
    decisions = episodes = equal = close = 0
    for seed in seeds:
        rng = np.random.default_rng([seed, 99])
        worst = dict.fromkeys(largest, 0)
        before = len(discrete)
        seen, _ = stock.reset(seed=seed)
        engine.seed([seed])
        out = engine.reset()
        where = f"{env_id} {policy} seed {seed}"
        _compare_state(stock.unwrapped, engine, f"{where} reset", worst, discrete)
        _compare_observation(seen, out, worst)
        for step in range(max_steps):
            action = actions_of(policy, stock.action_space, rng)
            seen, reward, terminated, truncated, info = stock.step(action)
            out = engine.step(*engine_inputs(engine, action))
            decisions += 1
            here = f"{where} step {step}"
            _compare_state(stock.unwrapped, engine, here, worst, discrete)
            _compare_observation(seen, out, worst)
            rewarded = out.told.rewards[:, 0] if isinstance(reward, tuple) else out.rewards[0]
            worst["reward"] = max(worst["reward"], np.max(np.abs(np.subtract(reward, rewarded))))
            if isinstance(terminated, tuple):  # agent by agent
                terminated = bool(stock.unwrapped._is_terminated())
            if (terminated, truncated) != (out.terminated[0], out.truncated[0]):
                discrete.append(f"{here}: ends {terminated, truncated}, {out.terminated[0], out.truncated[0]}")
            if shield:
                agents = Agents(out.told.steps, None) if out.told is not None else None
                _compare_info(info, step_infos(out.steps, engine.scenario, settings, None, agents), here, discrete)
            if terminated or truncated or len(discrete) > before:
                break
        episodes += 1
        same = len(discrete) == before
        equal += same and not any(worst.values())
        close += same and max(worst["state"], worst["reward"]) <= 1e-8 and worst["ulps"] <= 1
        largest = {name: max(largest[name], worst[name]) for name in largest}
        if until and until(decisions):
            break
    stock.close()
    return Comparison(episodes, equal, close, decisions, *largest.values(), discrete)


def engine_inputs(engine, action):
    """What one action of the stock environment is for an engine of one environment."""
    scenario = engine.scenario
    if scenario.agents is not None:
        each = [_inputs_of(scenario, one) for one in action]
        return np.stack([one for one, _ in each]), None if each[0][1] is None else np.stack([two for _, two in each])
    return _inputs_of(scenario, action)


def _inputs_of(scenario, action):
    """Of one agent."""
    if len(scenario.labels):
        return np.array([action]), None
    if scenario.choices is not None:
        return np.array([action]), scenario.choices[[action]]
    return _compared(np.asarray(action)[None]), scenario.commands(np.asarray(action)[None])


def _compare_state(env, engine, where, worst, discrete) -> None:
    road = env.road
    users = [*road.vehicles, *road.objects]
    episode = engine.batch.episodes[0]
    if len(users) != episode["cars"]:
        discrete.append(f"{where}: {len(users)} road users, {episode['cars']}")
        return
    indices = {index: i for i, index in enumerate(road.network.lanes_dict())}
    for i, user in enumerate(users):
        car = engine.batch.cars[0, i]
        numbers = {
            "x": user.position[0],
            "y": user.position[1],
            "heading": user.heading,
            "speed": user.speed,
        }
        flags = {"lane": indices[user.lane_index], "crashed": user.crashed}
        if car["kind"] != OBSTACLE:
            flags["hit"] = user.impact is not None
        if hasattr(user, "target_lane_index"):
            flags["target_lane"] = indices[user.target_lane_index]
            numbers["target_speed"] = user.target_speed
            flags["yields"] = getattr(user, "is_yielding", False)
            if user.route is not None:
                flags["route_step"] = _steps(engine, car) - len(user.route)
        if hasattr(user, "speed_index"):
            flags["speed_index"] = user.speed_index
        if car["kind"] == TRAFFIC:
            numbers["timer"], numbers["delta"] = user.timer, user.DELTA
        for name, value in numbers.items():
            worst["state"] = max(worst["state"], abs(value - car[name]))
            if not abs(value - car[name]) < 1e-6:
                discrete.append(f"{where}: car {i} {name} {value} {car[name]}")
        for name, value in flags.items():
            if value != car[name]:
                discrete.append(f"{where}: car {i} {name} {value} {car[name]}")
    if getattr(road, "steps", 0) != episode["road_frames"]:
        discrete.append(f"{where}: {road.steps} frames of the road, {episode['road_frames']}")
    if road.np_random.bit_generator.state != generator_state(episode):
        discrete.append(f"{where}: random generator")


def _steps(engine, car):
    """Length of the route that a car planned."""
    return (engine.scenario.network.route_roads[car["route"]] >= 0).sum()


def _compare_observation(seen, out, worst) -> None:
    if isinstance(seen, tuple):
        seen = np.concatenate([part.ravel() for part in seen])
    ours = out.observations[0].reshape(seen.shape)
    seen = seen.astype(np.float32)
    spacing = np.spacing(np.maximum(np.abs(seen), np.float32(1e-7)))
    worst["ulps"] = max(worst["ulps"], int(np.ceil(np.max(np.abs(seen - ours) / spacing))))


def _compare_info(info, infos, where, discrete) -> None:
    ours = info_at(infos, 0)
    if "agents" in ours:
        for a, (theirs, own) in enumerate(zip(info["agents"], ours.pop("agents"), strict=True)):
            _compare_one(theirs, own, f"{where} agent {a}", discrete)
    _compare_one(info, ours, where, discrete)


def _compare_one(info, ours, where, discrete) -> None:
    theirs = {key: info[key] for key in ours}
    tie = False
    if "shield" in ours:
        theirs["shield"] = {key: info["shield"][key] for key in ours["shield"]}
        margins = [max(i["shield"]["min_margin_lon"], i["shield"]["min_margin_lat"]) for i in (ours, theirs)]
        tie = margins[0] == margins[1] or abs(margins[0] - margins[1]) < 1e-8
    for name, (a, b) in _flat(theirs, ours):
        if tie and name in _NEAREST:
            continue  # two users equally near to danger: the last bit decides who is reported
        close = isinstance(a, float) and abs(a - b) <= 1e-8 * max(1.0, abs(a))
        if not (a == b or close):
            discrete.append(f"{where}: info {name} {a!r} {b!r}")


def _flat(a, b, prefix=""):
    for key in a:
        if isinstance(a[key], dict):
            yield from _flat(a[key], b[key], f"{prefix}{key}.")
        else:
            yield prefix + key, (a[key], b[key])
