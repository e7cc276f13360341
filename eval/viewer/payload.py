"""A trace as the numbers that a replay page draws: rounded, as differences, so that they pack well."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rss_shield.eval.trace_risk import risk_of_trace
from rss_shield.shield.geometry import wrap_angle
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.trace import (
    CHANGED_BY,
    PLANS,
    RESPONSES,
    SIDES,
    SIGNALS,
    Contact,
    Ego,
    Event,
    Lane,
    Trace,
    ego_of,
)

CENTI, MILLI = 100, 1000  # steps of what is kept: 1 cm, 1 mrad
AHEAD, BEHIND, LEFT, RIGHT = range(len(SIDES))
LONGEST = 60.0  # margins beyond are of no interest [m]
# what the page calls what a trace has a number for
NAMES = {
    "CHANGED_NAMES": ("", "limits", "anticipation", "proper response"),
    "RESPONSE_NAMES": ("", "brake", "steer", "brake and steer", "go on"),
    "PLAN_NAMES": PLANS,
    "SIGNAL_NAMES": SIGNALS,
}
assert len(NAMES["CHANGED_NAMES"]) == len(CHANGED_BY) and len(NAMES["RESPONSE_NAMES"]) == len(RESPONSES)
_AROUND = 250.0  # road farther from everybody than this is not drawn [m]
_TURN = 0.05  # of an arc between two points that are drawn [rad]


def payload(trace: Trace, label: str, settings: RiskSettings = RiskSettings()) -> dict[str, Any]:
    """What a page needs of one episode, as plain values for JSON."""
    users = trace.users
    names = _names(trace)
    return {
        "label": label,
        "outcome": outcome(trace, names),
        "dt": float(trace.dt),
        "start": float(trace.time[0]),
        "frames": len(trace.time),
        "users": [_user(trace, i, names[i]) for i in range(len(users.ids))],
        "lanes": _lanes(trace),
        "paths": [_path(points) for points in trace.paths],
        "lights": [
            {"x": _round(light.x), "y": _round(light.y), "heading": _round(light.heading), "signal": runs(light.signal)}
            for light in trace.lights
        ],
        "egos": [_ego(trace, ego, settings) for ego in trace.egos or (_blank(trace),)],
        "events": [
            {"frame": _frame(trace, event.time), "kind": event.kind, "text": _event_text(trace, event, names)}
            for event in _told_once(trace.events)
        ],
        "contacts": [
            {
                "frame": _frame(trace, contact.time),
                "user": contact.user,
                "partner": contact.partner,
                "title": _title(contact, names),
                "evidence": _grounds(contact, names),
            }
            for contact in trace.contacts
        ],
    }


# ---------------------------------------------------------------- numbers


def packed(values: Iterable[float], scale: float) -> list[int | None]:
    """Differences of whole multiples of 1 / `scale`; None is what is not known."""
    found: list[int | None] = []
    last = 0
    for value in values:
        if not np.isfinite(value):
            found.append(None)
            continue
        here = round(float(value) * scale)
        found.append(here - last)
        last = here
    return found


def runs(values: Iterable[Any]) -> list[int]:
    """Whole numbers as value, how often, value, how often, ..."""
    found: list[int] = []
    for value in values:
        if found and found[-2] == int(value):
            found[-1] += 1
        else:
            found += [int(value), 1]
    return found


def _round(value: float, digits: int = 3) -> float:
    return round(float(value), digits)


def _frame(trace: Trace, time: float) -> int:
    return int(np.argmin(np.abs(trace.time - time)))


# ---------------------------------------------------------------- road


def _lanes(trace: Trace) -> list[dict[str, Any]]:
    """Lanes as lines of straight pieces, where anybody comes near them."""
    users, present = trace.users, trace.users.present
    x, y = users.x[present], users.y[present]
    low = np.array([x.min(), y.min()]) - _AROUND
    high = np.array([x.max(), y.max()]) + _AROUND
    number = {lane.id: i for i, lane in enumerate(trace.lanes)}
    found = []
    for lane in trace.lanes:
        points = _cut(_line(lane), low, high)
        found.append(
            {
                "x": packed(points[:, 0], CENTI),
                "y": packed(points[:, 1], CENTI),
                "width": packed(points[:, 2], CENTI),
                "left": lane.left_line,
                "right": lane.right_line,
                "on": [number[name] for name in lane.successors],
            }
        )
    return found


def _line(lane: Lane) -> np.ndarray:
    """`[P, 3]` x, y, width along a lane, arcs as short straight pieces [m]."""
    rows = []
    for k in range(len(lane.centre) - 1):
        (x, y, heading), (x_next, y_next, heading_next) = lane.centre[k], lane.centre[k + 1]
        turn, chord = float(wrap_angle(heading_next - heading)), np.hypot(x_next - x, y_next - y)
        share = np.linspace(0.0, 1.0, max(int(np.ceil(abs(turn) / _TURN)), 1) + 1)[:-1]
        if abs(turn) < 1e-6:
            along, across = share * chord, 0.0 * share
            cos, sin = (x_next - x) / max(chord, 1e-9), (y_next - y) / max(chord, 1e-9)
        else:
            radius = 0.5 * chord / np.sin(0.5 * turn)
            along, across = radius * np.sin(share * turn), radius * (1.0 - np.cos(share * turn))
            cos, sin = np.cos(heading), np.sin(heading)
        width = lane.width[k] + share * (lane.width[k + 1] - lane.width[k])
        rows.append(np.column_stack([x + along * cos - across * sin, y + along * sin + across * cos, width]))
    return np.vstack([*rows, [[*lane.centre[-1, :2], lane.width[-1]]]])


def _cut(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """What of a line lies in a rectangle, and at least two points of it; long pieces are cut where it ends."""
    first, last = 0, len(points) - 1
    inside = np.flatnonzero(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1))
    if len(inside):
        first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 1, last)
    cut = points[first : last + 1].copy()
    cut[0], cut[-1] = _clip(cut[0], cut[1], low, high), _clip(cut[-1], cut[-2], low, high)
    return cut


def _clip(point: np.ndarray, toward: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """A point, moved toward another one until it is in the rectangle; as it is if the way does not lead there."""
    step, share = toward - point, 0.0
    for k in range(2):
        short = low[k] - point[k] if point[k] < low[k] else high[k] - point[k] if point[k] > high[k] else 0.0
        if short and step[k]:
            share = max(share, short / step[k])
    return point + share * step if 0.0 < share < 1.0 else point


def _path(points: np.ndarray) -> dict[str, Any]:
    """A way through a junction; arc length counts from its first point."""
    return {"x": packed(points[:, 1], CENTI), "y": packed(points[:, 2], CENTI)}


# ---------------------------------------------------------------- road users


def _names(trace: Trace) -> list[str]:
    """What the page calls everybody."""
    egos = trace.ego_users
    several = len(egos) > 1
    return [
        (f"ego {name}" if several else "ego") if i in egos else name for i, name in enumerate(trace.users.ids)
    ]  # fmt: skip


def _name(names: Sequence[str], user: int) -> str:
    return names[user] if user >= 0 else "somebody"


def _user(trace: Trace, i: int, name: str) -> dict[str, Any]:
    users = trace.users
    there = np.flatnonzero(users.present[:, i])
    first, last = (int(there[0]), int(there[-1]) + 1) if len(there) else (0, 0)
    crashed = np.flatnonzero(users.crashed[:, i])
    span = slice(first, last)
    return {
        "name": name,
        "kind": users.kinds[i],
        "length": _round(users.length[i]),
        "width": _round(users.width[i]),
        "from": first,
        "crashed": int(crashed[0]) if len(crashed) else None,
        "x": packed(users.x[span, i], CENTI),
        "y": packed(users.y[span, i], CENTI),
        "heading": packed(users.heading[span, i], MILLI),
        "speed": packed(users.speed[span, i], CENTI),
    }


def _blank(trace: Trace) -> Ego:
    """Who is looked at where nobody had a shield: the one that touched somebody first, or that is there longest."""
    contacts = sorted(trace.contacts, key=lambda contact: contact.time)
    user = contacts[0].user if contacts else int(np.argmax(trace.users.present.sum(axis=0)))
    return ego_of(user, len(trace.time))


def _ego(trace: Trace, ego: Ego, settings: RiskSettings) -> dict[str, Any]:
    users, i = trace.users, ego.user
    offset = [float(points[0, 0]) for points in trace.paths]
    start = np.array([offset[k] if k >= 0 else 0.0 for k in ego.path])
    return {
        "user": i,
        "shield": bool(trace.egos),
        "gap": [packed(column, CENTI) for column in ego.gap.T],
        "required": [packed(column, CENTI) for column in ego.required.T],
        "neighbour": [runs(column) for column in ego.neighbour.T],
        "changed_by": runs(ego.changed_by),
        "response": runs(ego.response),
        "partner": runs(ego.partner),
        "dangerous": runs(ego.dangerous),
        "plan": runs(ego.plan),
        "path": runs(ego.path),
        "path_s": packed(ego.path_s - start, CENTI),
        "plan_end": packed(ego.plan_end - start, CENTI),
        "areas": _areas(ego, start),
        "lane": runs(users.lane[:, i]),
        "series": _series(trace, ego, settings),
    }


def _areas(ego: Ego, start: np.ndarray) -> list[list[float] | None]:
    """Per frame from, to, user of each stretch; None = as on the frame before."""
    found: list[list[float] | None] = []
    last: list[float] | None = None
    for stretches, owners, s in zip(ego.area, ego.area_user, start, strict=True):
        here = [
            value
            for (low, high), user in zip(stretches, owners, strict=True)
            if np.isfinite(low)
            for value in (_round(low - s, 1), _round(high - s, 1), int(user))
        ]
        found.append(None if here == last else here)
        last = here
    return found


def _series(trace: Trace, ego: Ego, settings: RiskSettings) -> dict[str, tuple[int, list[int | None]]]:
    """Name -> scale, numbers of each time series."""
    users, i = trace.users, ego.user
    acceleration = users.acceleration[:, i]
    if np.isnan(acceleration).all():  # nobody wrote down the commands
        acceleration = np.append(np.diff(users.speed[:, i]), np.nan) / trace.dt
    margin = np.minimum(ego.gap - ego.required, LONGEST)
    beside = np.fmin(margin[:, LEFT], margin[:, RIGHT])
    series = {
        "speed": users.speed[:, i],
        "acceleration": acceleration,
        "wanted": ego.wanted_acceleration,
        "steering": np.degrees(users.steering[:, i]),
        "wanted_steering": np.degrees(ego.wanted_steering),
        "jerk": np.diff(acceleration, prepend=np.nan) / trace.dt,
        "margin_ahead": margin[:, AHEAD],
        "margin_beside": beside,
        **_risk_series(trace, i, settings),
    }
    return {name: (CENTI, packed(values, CENTI)) for name, values in series.items() if np.isfinite(values).any()}


def _risk_series(trace: Trace, user: int, settings: RiskSettings) -> dict[str, np.ndarray]:
    """Nothing where somebody is as fast as the wave of the field, which then has no value."""
    speeds = np.abs(trace.users.speed[trace.users.present])
    if not speeds.max() < settings.wave_speed:
        return {}
    risk = risk_of_trace(trace, user, settings)
    with np.errstate(divide="ignore"):
        inverse_ttc = np.where(np.isnan(risk.ttc), np.nan, 1.0 / risk.ttc)
    return {"rdsi": risk.rdsi, "lower": risk.lower, "upper": risk.upper, "inverse_ttc": inverse_ttc}


# ---------------------------------------------------------------- words


def outcome(trace: Trace, names: Sequence[str] | None = None) -> str:
    """How an episode ended, in a few words."""
    names = names or _names(trace)
    span = float(trace.time[-1] - trace.time[0])
    if not trace.contacts:
        return f"no contact in {span:.1f} s"
    first = min(trace.contacts, key=lambda contact: contact.time)
    return f"contact after {first.time - trace.time[0]:.1f} s: {_blamed(first, names)}"


def _blamed(contact: Contact, names: Sequence[str]) -> str:
    who, other = names[contact.user], _name(names, contact.partner)
    return {
        "ego": f"{who} is to blame",
        "other": f"{other} is to blame",
        "both": "both are to blame",
        "inherited": "the situation was inherited",
        "none": "nobody is to blame by the rules",
    }.get(contact.verdict, contact.verdict)


def _title(contact: Contact, names: Sequence[str]) -> str:
    return f"Contact of {names[contact.user]} and {_name(names, contact.partner)}: {_blamed(contact, names)}"


def _told_once(events: Iterable[Event]) -> list[Event]:
    """Events without the contacts that are there already, seen from the other road user."""
    found: list[Event] = []
    for event in events:
        mirrored = (event.time, event.kind, event.partner, event.user)
        if event.kind != "contact" or mirrored not in [(e.time, e.kind, e.user, e.partner) for e in found]:
            found.append(event)
    return found


def _event_text(trace: Trace, event: Event, names: Sequence[str]) -> str:
    who, other = names[event.user], f" with {names[event.partner]}" if event.partner >= 0 else ""
    if event.kind == "verdict":
        return next(
            (_blamed(one, names) for one in trace.contacts if one.user == event.user and one.time == event.time),
            event.text,
        )
    if event.kind.startswith("response"):
        owed = f", {_OWED.get(event.text, event.text)}" if event.text else ""
        return f"{who}: {event.kind.replace('response', 'proper response')}{owed}"
    return f"{who}: {event.kind}{other}"


_OWED = dict(zip(RESPONSES, NAMES["RESPONSE_NAMES"], strict=True))
_UNIT = re.compile(r"\s*\[(.+)\]$")


def _grounds(contact: Contact, names: Sequence[str]) -> list[str]:
    """Evidence of a verdict in sentences; what this page does not know is told as it is."""
    evidence = dict(contact.evidence)
    found = []
    danger, seconds = evidence.pop("danger", ""), evidence.pop("seconds_since_threshold", None)
    if danger:
        since = "" if seconds is None else f", for {float(seconds):.1f} s"
        found.append(f"danger: {str(danger).replace('_', ' ')}{since}")
    for key, who in (("ego", names[contact.user]), ("other", _name(names, contact.partner))):
        duty, excess = str(evidence.pop(f"{key}_duty", "")), evidence.pop(f"{key}_excess", None)
        unit = _UNIT.search(duty)
        measured = f", by {float(excess):.2f} {unit[1].replace('^2', '²')}" if unit and excess is not None else ""
        found.append(f"{who} {_UNIT.sub('', duty)}{measured}" if duty else f"{who} kept its duty")
    return [*found, *(f"{name.replace('_', ' ')}: {value}" for name, value in evidence.items())]
