"""Small traces made by hand: what a replay page is tested with."""

import numpy as np

from rss_shield.shield.trace import (
    CHANGED_BY,
    PLANS,
    RESPONSES,
    SIDES,
    SIGNALS,
    Contact,
    Event,
    Light,
    Trace,
    ego_of,
    straight_lane,
    users_of,
)

DT = 0.1
AHEAD, BEHIND, LEFT, RIGHT = range(len(SIDES))


def cut_in(brakes: bool, seconds: float = 6.0) -> Trace:
    """A car 25 m ahead in the lane beside changes to the ego's, 10 m/s slower. An ego that does not brake hits it.

    Both lanes run to the right, the ego's along y = 0; cars are 5 m long, so bumpers touch at 5 m between centres.
    """
    t = np.arange(round(seconds / DT) + 1) * DT
    other = 25.0 + 15.0 * t
    side = 4.0 * np.clip(1.25 - 0.5 * t, 0.0, 1.0)  # from one lane to the other between 0.5 s and 2.5 s
    speed = np.maximum(25.0 - 5.0 * np.maximum(t - 0.5, 0.0), 15.0) if brakes else np.full(len(t), 25.0)
    ego = np.concatenate([[0.0], np.cumsum(speed[:-1] * DT)])
    gap = other - ego - 5.0
    touch = int(np.argmax(gap <= 1e-9)) if (gap <= 1e-9).any() else len(t)
    crashed = np.arange(len(t)) >= touch
    far = 300.0 + 20.0 * t, np.where(t < 3.0, 4.0, np.nan)  # leaves the scene at 3 s
    users = users_of(
        ("0", "1", "2"),
        ("car", "car", "truck"),
        (5.0, 5.0, 12.0),
        (2.0, 2.0, 2.5),
        np.column_stack([ego, other, np.where(np.isnan(far[1]), np.nan, far[0])]),
        np.column_stack([0.0 * t, side, far[1]]),
        np.zeros((len(t), 3)),
        np.column_stack([speed, np.full(len(t), 15.0), np.full(len(t), 20.0)]),
        acceleration=np.column_stack([np.append(np.diff(speed) / DT, np.nan), 0.0 * t, 0.0 * t]),
        steering=np.zeros((len(t), 3)),
        crashed=np.column_stack([crashed, crashed, np.zeros(len(t), bool)]),
        lane=np.column_stack([np.zeros(len(t)), (side > 2.0).astype(int), np.ones(len(t))]),
    )
    seen = ego_of(0, len(t))
    seen.wanted_acceleration[:] = 1.0
    seen.wanted_steering[:] = 0.0
    seen.gap[:, AHEAD] = gap
    seen.required[:, AHEAD] = 15.0 + (speed - 15.0) ** 2 / 8.0
    seen.neighbour[:, AHEAD] = 1
    seen.gap[:, LEFT], seen.required[:, LEFT] = np.nan, np.nan
    seen.gap[:, RIGHT], seen.required[:, RIGHT] = side - 2.0, 0.5
    seen.neighbour[:, RIGHT] = 1
    seen.partner[:] = 1
    seen.dangerous[:] = (gap < seen.required[:, AHEAD]) & (side < 2.5)
    seen.response[seen.dangerous] = RESPONSES.index("longitudinal")
    if brakes:
        seen.changed_by[t > 0.5] = CHANGED_BY.index("anticipation")
        seen.changed_by[seen.dangerous] = CHANGED_BY.index("response")
    begins = int(np.argmax(seen.dangerous))
    events = [Event(float(t[begins]), "danger begins", 0, 1)]
    contacts = []
    if touch < len(t):
        evidence = {
            "danger": "longitudinal",
            "seconds_since_threshold": float(t[touch] - t[begins]),
            "ego_duty": "braked less than the proper response asks [m/s^2]",
            "ego_excess": 4.0,
            "other_duty": "",
            "other_excess": 0.0,
        }
        events += [Event(float(t[touch]), "contact", 0, 1), Event(float(t[touch]), "contact", 1, 0)]
        events += [Event(float(t[touch]), "verdict", 0, 1, "ego")]
        contacts = [Contact(float(t[touch]), 0, 1, "ego", evidence)]
    lanes = (
        straight_lane("a", (-100.0, 0.0), (900.0, 0.0), right="b", left_line="continuous", right_line="striped"),
        straight_lane("b", (-100.0, 4.0), (900.0, 4.0), left="a", left_line="striped", right_line="continuous"),
    )
    meta = {"env_id": "cut-in", "seed": 1, "mode": "override" if brakes else "monitor", "scheme": "lanes"}
    return Trace(DT, t, users, lanes, egos=(seen,), events=tuple(events), contacts=tuple(contacts), meta=meta)


def crossing(seconds: float = 5.0) -> Trace:
    """An ego from below waits 12 m before the middle of a crossing for a car from the left, then goes on."""
    t = np.arange(round(seconds / DT) + 1) * DT
    y = np.where(t < 3.0, 12.0, 12.0 - 4.0 * (t - 3.0))
    zero = np.zeros(len(t))
    users = users_of(
        ("0", "1"),
        ("car", "bicycle"),
        (5.0, 1.8),
        (2.0, 0.6),
        np.column_stack([zero + 2.0, -20.0 + 10.0 * t]),
        np.column_stack([y, zero + 2.0]),
        np.column_stack([zero - np.pi / 2, zero]),
        np.column_stack([np.where(t < 3.0, 0.0, 4.0), zero + 10.0]),
        lane=np.column_stack([zero, zero + 1.0]),
    )
    seen = ego_of(0, len(t), areas=2)
    waits = t < 3.0
    seen.wanted_acceleration[:] = 2.0
    seen.changed_by[waits] = CHANGED_BY.index("response")
    seen.response[waits] = RESPONSES.index("longitudinal")
    seen.dangerous[waits] = True
    seen.partner[waits] = 1
    seen.plan[:] = np.where(waits, PLANS.index("stop"), PLANS.index("go"))
    seen.path[:], seen.path_s[:] = 0, 60.0 - y
    seen.plan_end[:] = np.where(waits, 49.0, np.nan)
    seen.area[waits, 0], seen.area_user[waits, 0] = (54.0, 62.0), 1
    path = np.column_stack([np.arange(0.0, 101.0, 1.0), np.full(101, 2.0), 60.0 - np.arange(0.0, 101.0, 1.0)])
    lanes = (
        straight_lane("up", (2.0, 60.0), (2.0, -40.0), right_line="continuous"),
        straight_lane("across", (-60.0, 2.0), (60.0, 2.0), right_line="continuous"),
    )
    signal = np.where(waits, SIGNALS.index("red"), SIGNALS.index("green"))
    lights = (Light("south", ("up",), 2.0, 9.0, -np.pi / 2, signal),)
    events = (Event(0.0, "response begins", 0, 1, "longitudinal"), Event(3.0, "response ends", 0, 1))
    meta = {"env_id": "crossing", "scheme": "plans", "mode": "override"}
    return Trace(DT, t, users, lanes, lights, (path,), (seen,), events, meta=meta)
