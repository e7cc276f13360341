"""What noise explains counts as kept, and hides nothing else that was broken on the same sample."""

import numpy as np
import pytest

from rss_shield.shield.command import Command
from rss_shield.shield.definitions.response import LAT, LON
from rss_shield.shield.lanes.judge import NOW, audit_command, judge_motion_in
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for
from rss_shield.shield.verdicts import DUTIES, KEPT, TOO_CLOSE, TOO_FAR, TOO_WEAK, TOWARD

DT = 1 / 15
TABLE = table_for(PRESETS["simulator"], Rules(), DT)


def tolerances(**some: float) -> np.ndarray:
    found = np.zeros(len(DUTIES))
    for name, value in some.items():
        found[{"far": TOO_FAR, "weak": TOO_WEAK}[name]] = value
    return found


def one(kind, **values):
    record = np.zeros(1, kind)[0]
    for name, value in values.items():
        record[name] = value
    return record


@pytest.mark.parametrize(("tolerated", "duty"), [(0.0, TOO_FAR), (0.1, TOO_CLOSE)])
def test_a_way_that_is_a_little_too_long_hides_no_way_to_the_side(tolerated, duty):
    ego, other = (one(ROAD_USER, s=s, speed=20.0, cos=1.0, half_length=2.5, half_width=1.0) for s in (0.0, 30.0))
    halves = {"half_length_ego": 2.5, "half_length_other": 2.5}
    speeds = {"v_ego": 20.0, "v_other": 20.0, "speed_other": 20.0}
    memory = one(MEMORY, age=1, since=1, axes=LON | LAT, ego_is_rear=True, side=1.0, **halves, **speeds)
    judge_motion_in(memory, ego, other, TABLE, NOW, 0.0, DT, tolerances())
    assert memory["ego_broke"] == KEPT
    # a frame at 20 m/s and 3 m/s^2 after it are 1.34 m
    memory["travel_ego"], memory["travel_other"], memory["approach_ego"] = 1.4, 20.0 * DT, 3.0
    judge_motion_in(memory, ego, other, TABLE, NOW, 0.0, DT, tolerances(far=tolerated))
    assert memory["ego_broke"] == duty


@pytest.mark.parametrize(("tolerated", "expected"), [(0.0, TOO_WEAK), (0.5, TOWARD)])
def test_braking_a_little_too_weakly_hides_no_drift(tolerated, expected):
    ego = one(ROAD_USER, speed=20.0, cos=1.0)
    memory = one(MEMORY, age=40, since=30, axes=LON | LAT, ego_is_rear=True, side=1.0)
    command = Command(-TABLE.ego.a_min_brake + 0.4, 0.05)  # 1 m/s toward the other
    duty, excess = audit_command(memory, ego, command, 0.0, TABLE.ego, DT, tolerances(weak=tolerated))
    assert (duty, round(excess, 2)) == (expected, 0.4 if expected == TOO_WEAK else 1.0)
