"""One controlled vehicle under the shield, from one decision step to the next: what all wrappers have in common."""

from typing import Any

from highway_env.vehicle.controller import ControlledVehicle

from envs.compliant import TurnTaker
from envs.free_steering import FreeEgo
from envs.highway import LANES, Frame, Settings, ShieldedEgo, StepTally, log_of, response_name
from envs.junction_ego import JunctionEgo
from shield.blame import Audit, audit
from shield.comfort import comfort_of

PENALTIES = ("response", "change")  # what an intervention penalty is charged for
LONGEST_TTC = 100.0  # times to collision are reported up to this [s]


def attach(
    vehicle: Any, settings: Settings, record: bool = False, destination: str = "", takes_turns: bool = False
) -> ShieldedEgo:
    """Put a shield on a vehicle.

    Args:
      vehicle: highway-env's.
      settings, record: see `ShieldedEgo`.
      destination: where a car goes that is steered freely and has no route; needed where roads cross.
      takes_turns: it is among compliant drivers.
    """
    if settings.scheme == LANES:
        return ShieldedEgo(vehicle, settings, record)
    if not isinstance(vehicle, ControlledVehicle):
        return FreeEgo(vehicle, settings, record, destination)
    return (TurnTaker if takes_turns and settings.overrides else JunctionEgo)(vehicle, settings, record)


def begin_step(ego: ShieldedEgo) -> bool:
    """Start counting anew; returns whether the ego has had its contact before this step."""
    ego.tally = StepTally()
    if ego.meter is not None:
        ego.meter.begin_step()
    return ego.contact is not None


def end_step(ego: ShieldedEgo, had_contact: bool, action: Any) -> dict[str, Any]:
    """Judge what happened since `begin_step`; returns the info of this step."""
    ego.check_contact()
    at_fault = not had_contact and ego.contact is not None and ego.contact["verdict"] in ("ego", "both")
    cost = 1.0 if ego.tally.broken_duties or at_fault else 0.0
    ego.cost += cost
    info = info_of(ego, cost)
    info["shield"]["proposed_action"] = action
    return info


def info_of(ego: ShieldedEgo, cost: float = 0.0) -> dict[str, Any]:
    """What a wrapper says about one ego after a step; see `ShieldWrapper` for the keys."""
    tally = ego.tally
    frames, all_frames = max(tally.frames, 1), max(ego.frames, 1)
    return {
        "shield": {
            "intervened": tally.overridden > 0,
            "override_fraction": tally.overridden / frames,
            "anticipation_fraction": tally.anticipated / frames,
            "limited_fraction": tally.limited / frames,
            "acceleration_change": tally.acceleration_change,
            "steering_change": tally.steering_change,
            "mean_acceleration_change": tally.acceleration_changed / frames,
            "mean_steering_change": tally.steering_changed / frames,
            "lane_change_refused": tally.lane_change_refused,
            "dangerous": tally.dangerous_pairs > 0,
            "dangerous_pairs": tally.dangerous_pairs,
            "broken_duties": tally.broken_duties,
            "min_margin_lon": tally.margin_lon,
            "min_margin_lat": tally.margin_lat,
            "partner": tally.partner,
            "response": response_name(tally.response),
        },
        "cost": cost,
        "blame": ego.contact["verdict"] if ego.contact else "",
        "blame_evidence": dict(ego.contact) if ego.contact else {},
        "override_share": ego.frames_overridden / all_frames,
        "anticipation_share": ego.frames_anticipated / all_frames,
        "limited_share": ego.frames_limited / all_frames,
        "mean_acceleration_change": ego.acceleration_changed / all_frames,
        "mean_steering_change": ego.steering_changed / all_frames,
        "episode_cost": ego.cost,
        "episode_dangerous_pairs": ego.dangerous_pairs,
        "episode_broken_duties": ego.broken_duties,
        "min_ttc": min(ego.min_ttc, LONGEST_TTC),
        **comfort_of(ego.ride)._asdict(),
        **(ego.meter.info() if ego.meter is not None else {}),
    }


def charge(info: dict[str, Any], penalty: float, penalty_on: str) -> Any:
    """What an ego pays for the interventions of a step: the penalty times the share of frames or the mean change."""
    shield = info["shield"]
    return penalty * (shield["override_fraction"] if penalty_on == "response" else shield["mean_acceleration_change"])


def audit_of(frames: list[Frame], settings: Settings) -> Audit:
    """For every dangerous pair-frame of one ego: did it keep its duty?

    Raises:
      ValueError: roads cross; recorded frames hold distances along a lane, and the duties there are others.
    """
    if settings.scheme != LANES:
        raise ValueError(
            "audit: expected an environment without junctions; where roads cross, infos count the pair-frames: "
            "episode_dangerous_pairs, episode_broken_duties"
        )
    return audit(log_of(frames), settings.ego, settings.other, settings.rules, settings.dt)
