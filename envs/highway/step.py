"""One controlled vehicle under the shield, from one decision step to the next: what all wrappers have in common."""

from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.dynamics import BicycleVehicle

from rss_shield.envs.decisions.executed import executed_actions
from rss_shield.envs.highway.compliant import TurnTaker
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.frames import log_of
from rss_shield.envs.highway.free_ego import FreeEgo
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.highway.open_ego import OpenSpaceEgo
from rss_shield.envs.highway.people_ego import PeopleEgo
from rss_shield.envs.highway.senses import Senses
from rss_shield.envs.highway.sliding_ego import SlidingEgo
from rss_shield.envs.options import LANES, OPEN_SPACE, Options, Settings
from rss_shield.envs.worlds.walkers import Watched
from rss_shield.shield.ground import Ground
from rss_shield.shield.lanes.judge import Audit, audit
from rss_shield.shield.tally import JUDGED, end_decision, info_at, shield_infos, start_decision
from rss_shield.shield.verdicts import AT_FAULT


def attach(
    vehicle: Any,
    settings: Settings,
    record: bool = False,
    destination: str = "",
    takes_turns: bool = False,
    judge: Settings | None = None,
    senses: Senses | None = None,
    grounds: tuple[Ground | None, Ground | None] = (None, None),
) -> ShieldedEgo:
    """Put a shield on a vehicle.

    Args:
      vehicle: highway-env's.
      settings, record: see `ShieldedEgo`.
      destination: where a car goes that is steered freely and has no route; needed where roads cross.
      takes_turns: it is among compliant drivers.
      judge: what it is judged by, where that is not what it is restricted by.
      senses: what it sees, where that is not what is there; the judge sees that.
      grounds: what it drives on, by its own table and by the judge's, where not all of that is alike.
    """
    if senses is not None and judge is None:
        judge, grounds = settings, (grounds[0], grounds[0])
    if judge is not None:  # first, because the shield that acts is the one that was attached last
        watching = attach(vehicle, judge._replace(overrides=False), record, destination, grounds=(grounds[1], None))
        ego = attach(vehicle, settings, record, destination, takes_turns, grounds=(grounds[0], None))
        ego.judge, ego.senses = watching, senses
        return ego
    if settings.scheme == LANES:
        ego = (SlidingEgo if isinstance(vehicle, BicycleVehicle) else ShieldedEgo)(vehicle, settings, record)
        ego.ground = grounds[0]
        return ego
    if settings.scheme == OPEN_SPACE:
        return OpenSpaceEgo(vehicle, settings, record)
    if not isinstance(vehicle, ControlledVehicle):
        return FreeEgo(vehicle, settings, record, destination)
    if isinstance(vehicle.road, Watched):
        return PeopleEgo(vehicle, settings, record)
    return (TurnTaker if takes_turns and settings.overrides else JunctionEgo)(vehicle, settings, record)


def shield_on(vehicle: Any) -> ShieldedEgo | None:
    """The shield that a vehicle carries itself; a shallow copy of a vehicle carries that of the original."""
    shield = getattr(vars(vehicle).get("act"), "__self__", None)
    return shield if isinstance(shield, ShieldedEgo) and shield.vehicle is vehicle else None


def begin_step(ego: ShieldedEgo) -> bool:
    """Start counting anew; returns whether the ego has had its contact before this step."""
    start_decision(ego.tally)
    if ego.meter is not None:
        ego.meter.begin_step()
    if ego.judge is not ego:
        start_decision(ego.judge.tally)
    return ego.has_contact


def end_step(ego: ShieldedEgo, had_contact: bool, action: Any, kind: Any, handed: Any = None) -> dict[str, Any]:
    """Judge what happened since `begin_step`; returns the info of this step.

    Args:
      ego: the shield on the ego.
      had_contact: before this step.
      action: that the agent proposed.
      kind: highway-env's type of the action.
      handed: the action that was handed to highway-env, None = the agent's.
    """
    ego.check_contact()
    judge = ego.judge
    at_fault = not had_contact and judge.blame in AT_FAULT
    info = info_of(ego, 1.0 if judge.tally["broken_duties"] or at_fault else 0.0)
    handed = action if handed is None else handed
    info["shield"]["proposed_action"] = action
    info["shield"]["executed_action"] = _executed(ego.tally, kind, handed)
    info["shield"]["action_replaced"] = bool(np.any(np.asarray(action) != np.asarray(handed)))
    return info


def _executed(tally: np.void, kind: Any, handed: Any) -> Any:
    """See `executed_actions`."""
    frames = tally["frames"] or np.nan
    commands = np.array([[tally["acceleration"] / frames, tally["steering"] / frames]])
    refused = np.array([tally["lane_change_refused"]])
    return executed_actions(kind, np.asarray(handed)[None], refused, commands)[0]


def info_of(ego: ShieldedEgo, cost: float = 0.0) -> dict[str, Any]:
    """What a wrapper says about one ego after a step; see `ShieldWrapper` for the keys."""
    end_decision(ego.tally, ego.since, ego.ride, cost)
    step, judge = np.array([ego.tally]), ego.judge
    if judge is not ego:
        end_decision(judge.tally, judge.since, judge.ride, cost)
        for name in JUDGED:
            step[name] = judge.tally[name]
    info = info_at(shield_infos(step, ego.settings.table.dt), 0)
    info |= {"measures": ego.measured.info(ego)} if ego.measured is not None else {}
    return info | (ego.meter.info() if ego.meter is not None else {})


class Told(gym.Wrapper):
    """Below a wrapper that reads infos itself: puts into them what a shield around that wrapper says."""

    def __init__(self, env: gym.Env, shield: Any) -> None:
        super().__init__(env)
        self.shield = shield

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.shield.tell(info, reward)
        return observation, reward, terminated, truncated, info


def tell_inside(shield: Any) -> None:
    """Let a wrapper inside a shield's that reads infos, as stable-baselines3's `Monitor` does, read the shield's."""
    env, reader = shield.env, None
    while isinstance(env, gym.Wrapper):
        if getattr(env, "info_keywords", ()):
            reader = env
        env = env.env
    if reader is not None:
        reader.env = Told(reader.env, shield)


def charge(info: dict[str, Any], options: Options) -> Any:
    """What an ego pays for the interventions of a step: the penalty times the share of frames or the mean change."""
    unit = "override_fraction" if options.penalty_on == "response" else "mean_acceleration_change"
    return float(options.intervention_penalty) * info["shield"][unit]


def audit_of(ego: ShieldedEgo) -> Audit:
    """For every recorded dangerous pair-frame of one ego: did it keep its duty?

    Raises:
      ValueError: roads cross, or cars are parked; recorded frames hold distances along a lane, and the duties there
        are others. Or parameters change with the road or the kind of vehicle: frames do not say which counted when.
    """
    settings, frames = ego.judge.settings, ego.judge.record or []
    if settings.scheme != LANES:
        raise ValueError(
            "audit: expected an environment without junctions; where roads cross or cars are parked, infos count the "
            "pair-frames: episode_dangerous_pairs, episode_broken_duties"
        )
    if ego.judge.ground is not None:
        raise ValueError(
            "audit: expected an environment without conditions and classes; where they are given, infos count the "
            "pair-frames: episode_dangerous_pairs, episode_broken_duties"
        )
    return audit(log_of(frames), settings.table)
