"""What is counted while an ego is watched, in one decision and since reset, and how infos say it.

Both simulators keep these records and fill them in with these functions, so a key of an info means the same on both.
"""

from typing import Any

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.comfort import Comfort, comfort_of
from rss_shield.shield.definitions.response import AXES
from rss_shield.shield.junctions.plans import PLAN_NAMES
from rss_shield.shield.lanes.responses import response_name
from rss_shield.shield.open_space.pair import DANGER_NAMES
from rss_shield.shield.verdicts import DUTIES, VERDICTS

LONGEST_TTC = 100.0  # times to collision are reported up to this [s]
BY_PLANS = len(AXES)  # kinds of danger from here on are plans
IN_OPEN_SPACE = BY_PLANS + len(PLAN_NAMES)  # and from here on who has to brake where there are no lanes

# The contact of the ego, once it has had one.
_CONTACT = [
    ("blame", "i8"),  # 0 before a contact, then 1 + index into `shield.verdicts.VERDICTS`
    ("blame_partner", "i8"),
    ("blame_kind", "i8"),  # of danger: index into `KINDS`
    ("blame_frames", "i8"),  # from the danger threshold to the contact
    ("ego_duty", "i8"),
    ("other_duty", "i8"),
    ("ego_excess", "f8"),
    ("other_excess", "f8"),
]
# Counted in one decision, and what that amounts to since reset: fields of a record.
DECISION_FIELDS = [
    ("frames", "i8"),
    ("overridden", "i8"),  # frames on which a duty changed the command,
    ("anticipated", "i8"),  # on which no duty did but anticipation,
    ("limited", "i8"),  # on which only the always-on limits did
    ("dangerous_pairs", "i8"),
    ("broken_duties", "i8"),
    ("acceleration", "f8"),  # sums of what was executed [m/s^2]
    ("steering", "f8"),  # [rad]
    ("acceleration_change", "f8"),  # largest [m/s^2]
    ("steering_change", "f8"),  # [rad]
    ("acceleration_changed", "f8"),  # sums over the frames
    ("steering_changed", "f8"),
    ("lane_change_refused", "?"),
    ("margin_lon", "f8"),  # of the pair nearest to danger [m]
    ("margin_lat", "f8"),
    ("partner", "i8"),  # who that is, or who held the ego back; -1 = nobody
    ("response", "i8"),  # sum of the bits of `shield.lanes.responses`
    ("cost", "f8"),
    ("override_share", "f8"),
    ("anticipation_share", "f8"),
    ("limited_share", "f8"),
    ("mean_acceleration_change", "f8"),
    ("mean_steering_change", "f8"),
    ("comfort", "f8", (len(Comfort._fields),)),
    ("episode_cost", "f8"),
    ("episode_dangerous_pairs", "i8"),
    ("episode_broken_duties", "i8"),
    ("min_ttc", "f8"),  # at most LONGEST_TTC [s]
    *_CONTACT,
]
# Counted since reset.
EPISODE_FIELDS = [
    ("frames", "i8"),  # watched
    ("frames_overridden", "i8"),
    ("frames_anticipated", "i8"),
    ("frames_limited", "i8"),
    ("acceleration_changed", "f8"),  # sums of the sizes of changes [m/s^2]
    ("steering_changed", "f8"),  # [rad]
    ("dangerous_pairs", "i8"),
    ("broken_duties", "i8"),
    ("cost", "f8"),
    ("min_ttc", "f8"),  # [s]
    *_CONTACT,
]
JUDGED = (
    *("dangerous_pairs", "broken_duties", "episode_dangerous_pairs", "episode_broken_duties"),
    *(name for name, _ in _CONTACT),
)  # what a judge with a table of its own says
CONTACT = tuple(name for name, _ in _CONTACT)
COUNTED = tuple(name for name, _ in EPISODE_FIELDS if name not in CONTACT)


@compiled
def start_decision(step):
    """Nothing has happened in this decision yet. step: record with the fields `DECISION_FIELDS`."""
    step.frames = step.overridden = step.anticipated = step.limited = 0
    step.dangerous_pairs = step.broken_duties = 0
    step.acceleration = step.steering = 0.0
    step.acceleration_change = step.steering_change = step.acceleration_changed = step.steering_changed = 0.0
    step.lane_change_refused = False
    step.margin_lon = step.margin_lat = np.inf
    step.partner, step.response = -1, 0


@compiled
def start_episode(episode):
    """Nothing has happened since reset. episode: record with the fields `EPISODE_FIELDS`."""
    episode.frames = episode.frames_overridden = episode.frames_anticipated = episode.frames_limited = 0
    episode.acceleration_changed = episode.steering_changed = 0.0
    episode.dangerous_pairs = episode.broken_duties = 0
    episode.cost, episode.min_ttc = 0.0, np.inf
    episode.blame = episode.blame_kind = episode.blame_frames = episode.ego_duty = episode.other_duty = 0
    episode.blame_partner = -1
    episode.ego_excess = episode.other_excess = 0.0


@compiled
def copy_judgement(step, episode, judge_step, judge):
    """Take over what a judge says of the contact and of the last decision; the records are as in `count_frame`."""
    step.dangerous_pairs, step.broken_duties = judge_step.dangerous_pairs, judge_step.broken_duties
    episode.dangerous_pairs, episode.broken_duties = judge.dangerous_pairs, judge.broken_duties
    episode.blame, episode.blame_partner = judge.blame, judge.blame_partner
    episode.blame_kind, episode.blame_frames = judge.blame_kind, judge.blame_frames
    episode.ego_duty, episode.ego_excess = judge.ego_duty, judge.ego_excess
    episode.other_duty, episode.other_excess = judge.other_duty, judge.other_excess


@compiled
def enter_contact(episode, verdict, partner, by_plans):
    """Write down the `Verdict` of the contact with `partner`; by_plans: plans keep the ego safe, not distances."""
    episode.blame, episode.blame_partner = 1 + verdict.verdict, partner
    episode.blame_kind = verdict.kind + BY_PLANS if by_plans else verdict.kind
    episode.blame_frames = verdict.frames
    episode.ego_duty, episode.ego_excess = verdict.ego_duty, verdict.ego_excess
    episode.other_duty, episode.other_excess = verdict.other_duty, verdict.other_excess


@compiled
def count_frame(step, episode, overridden, anticipated, limited, pairs, broken, response, ttc):
    """Take in what happened on one frame.

    Args:
      step, episode: records with the fields `DECISION_FIELDS` and `EPISODE_FIELDS`.
      overridden, anticipated, limited: what changed the command; a duty goes before a limit.
      pairs, broken: dangerous pairs, and those whose duty the ego broke.
      response: bits of `shield.lanes.responses`.
      ttc: smallest time to collision [s].
    """
    limited = limited and not overridden
    step.frames += 1
    step.overridden += overridden
    step.anticipated += anticipated
    step.limited += limited
    step.dangerous_pairs += pairs
    step.broken_duties += broken
    step.response |= response
    episode.frames += 1
    episode.frames_overridden += overridden
    episode.frames_anticipated += anticipated
    episode.frames_limited += limited
    episode.dangerous_pairs += pairs
    episode.broken_duties += broken
    episode.min_ttc = min(episode.min_ttc, ttc)


@compiled
def note_executed(step, acceleration, steering):
    """Take in what the ego does on one frame [m/s^2], [rad]."""
    step.acceleration += acceleration
    step.steering += steering


@compiled
def count_change(step, episode, acceleration, steering):
    """Take in by how much the command was changed on one frame, >= 0 [m/s^2], [rad]."""
    step.acceleration_change = max(step.acceleration_change, acceleration)
    step.steering_change = max(step.steering_change, steering)
    step.acceleration_changed += acceleration
    step.steering_changed += steering
    episode.acceleration_changed += acceleration
    episode.steering_changed += steering


@compiled
def end_decision(step, episode, ride, cost):
    """Add the cost of this decision, and say in `step` what everything amounts to. ride: `RIDE` record."""
    episode.cost += cost
    step.cost, step.episode_cost = cost, episode.cost
    frames = max(episode.frames, 1)
    step.override_share = episode.frames_overridden / frames
    step.anticipation_share = episode.frames_anticipated / frames
    step.limited_share = episode.frames_limited / frames
    step.mean_acceleration_change = episode.acceleration_changed / frames
    step.mean_steering_change = episode.steering_changed / frames
    step.episode_dangerous_pairs = episode.dangerous_pairs
    step.episode_broken_duties = episode.broken_duties
    step.min_ttc = min(episode.min_ttc, LONGEST_TTC)
    step.blame, step.blame_partner = episode.blame, episode.blame_partner
    step.blame_kind, step.blame_frames = episode.blame_kind, episode.blame_frames
    step.ego_duty, step.ego_excess = episode.ego_duty, episode.ego_excess
    step.other_duty, step.other_excess = episode.other_duty, episode.other_excess
    for k, value in enumerate(comfort_of(ride)):
        step.comfort[k] = value


# ---------------------------------------------------------------- infos


def _texts(texts: Any) -> np.ndarray:
    """As objects: arrays of characters, each as long as the longest text, would be copied for every environment."""
    return np.array(list(texts), object)


_ON_ROADS = [*(AXES[axes] for axes in range(len(AXES))), *(PLAN_NAMES[kind] for kind in range(len(PLAN_NAMES)))]
KINDS = _texts([*_ON_ROADS, *DANGER_NAMES])
_BLAMES, _DUTIES = _texts(["", *VERDICTS]), _texts(DUTIES)
_RESPONSES = _texts(response_name(sum_of_bits) for sum_of_bits in range(16))


def shield_infos(steps: np.ndarray, dt: float) -> dict[str, Any]:
    """What infos say of the shield; `envs.highway.wrapper.ShieldWrapper` says what each key means.

    Args:
      steps: `[E]` records with the fields `DECISION_FIELDS`, after `end_decision`.
      dt: length of a frame [s].

    Returns:
      Dictionary of arrays `[E]`. `blame_evidence` counts where `blame` is not "".
    """
    frames = np.maximum(steps["frames"], 1)
    return {
        "shield": {
            "intervened": steps["overridden"] > 0,
            "override_fraction": steps["overridden"] / frames,
            "anticipation_fraction": steps["anticipated"] / frames,
            "limited_fraction": steps["limited"] / frames,
            "acceleration_change": steps["acceleration_change"],
            "steering_change": steps["steering_change"],
            "mean_acceleration_change": steps["acceleration_changed"] / frames,
            "mean_steering_change": steps["steering_changed"] / frames,
            "lane_change_refused": steps["lane_change_refused"],
            "dangerous": steps["dangerous_pairs"] > 0,
            "dangerous_pairs": steps["dangerous_pairs"],
            "broken_duties": steps["broken_duties"],
            "min_margin_lon": steps["margin_lon"],
            "min_margin_lat": steps["margin_lat"],
            "partner": steps["partner"],
            "response": _RESPONSES[steps["response"]],
        },
        "cost": steps["cost"],
        "blame": _BLAMES[steps["blame"]],
        "blame_evidence": evidence(steps, dt),
        **{name: steps[name] for name in _SINCE_RESET},
        **{name: steps["comfort"][:, k] for k, name in enumerate(Comfort._fields)},
    }


def evidence(records: np.ndarray, dt: float) -> dict[str, Any]:
    """What a contact was like: dictionary of arrays `[E]` of records `[E]` with the fields of a contact."""
    return {
        "verdict": _BLAMES[records["blame"]],
        "partner": records["blame_partner"],
        "danger": KINDS[records["blame_kind"]],
        "seconds_since_threshold": records["blame_frames"] * dt,
        "ego_duty": _DUTIES[records["ego_duty"]],
        "ego_excess": records["ego_excess"],
        "other_duty": _DUTIES[records["other_duty"]],
        "other_excess": records["other_excess"],
    }


_SINCE_RESET = (
    *("override_share", "anticipation_share", "limited_share", "mean_acceleration_change", "mean_steering_change"),
    *("episode_cost", "episode_dangerous_pairs", "episode_broken_duties", "min_ttc"),
)


def info_at(infos: dict[str, Any], e: int) -> dict[str, Any]:
    """Infos of one environment out of those of a batch, as plain Python values."""
    info = {key: _at(values, e) for key, values in infos.items()}
    if info.get("blame") == "":
        info["blame_evidence"] = {}
    return info


def _at(values: Any, e: int) -> Any:
    """Of environment `e`; a tuple has what is said of each agent, a continuous action is an array."""
    if isinstance(values, dict):
        return info_at(values, e)
    if isinstance(values, tuple):
        return tuple(_at(one, e) for one in values)
    return values.item(e) if values.ndim == 1 else values[e]
