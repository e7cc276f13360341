"""A bare junction: the paths of highway-env's intersection, cars that move along them frame by frame."""

from functools import cache

import gymnasium as gym
import highway_env  # noqa: F401
import numpy as np

from rss_shield.envs.roads.ways import Junction, junction_of
from rss_shield.shield.junctions.conflict_areas import cell_of, in_conflict
from rss_shield.shield.junctions.controller import junction_frame
from rss_shield.shield.junctions.examined import TABLE as TABLE_ONLY
from rss_shield.shield.junctions.judge import judge_crossing
from rss_shield.shield.junctions.memory import CAUTIOUS, CROSSING, PLAN, SAMPLE
from rss_shield.shield.junctions.plans import Scene, Track
from rss_shield.shield.junctions.reach import THREAT
from rss_shield.shield.params import PRESETS, Rules, Table
from rss_shield.shield.verdicts import VERDICTS

DT = 1 / 15
TABLE = PRESETS["intersection"]
EGO = TABLE.ego._replace(response_time=2 / 15)
RULED = Table(EGO, TABLE.other, Rules(), DT)


@cache
def junction(env_id: str = "intersection-v0") -> Junction:
    env = gym.make(env_id).unwrapped
    env.reset(seed=0)
    return junction_of(env.road.network)


def arms(path: int) -> tuple[str, str]:
    """Where a path of the intersection comes from and goes to."""
    walk = junction().walks[path]
    return walk[0][0], walk[-1][1]


def crossing_pairs() -> list[tuple[int, int]]:
    """Ordered pairs of paths from different arms to different arms that come in conflict."""
    paths = junction().roads.paths
    count = len(paths.cells)
    return [
        (a, b)
        for a in range(count)
        for b in range(count)
        if arms(a)[0] != arms(b)[0] and arms(a)[1] != arms(b)[1] and np.isfinite(paths.conflicts[a, b, :, 0]).any()
    ]


class Duel:
    """The ego under the shield on one path, another car that does what it likes within its bounds on a second one."""

    rate = 0.0  # of anticipation [1/s]

    def __init__(self, ego_path, other_path, s_ego, v_ego, s_other, v_other, entry=CAUTIOUS, assumed=TABLE.other):
        self.roads = junction().roads
        self.path, self.s, self.v = ego_path, float(s_ego), float(v_ego)
        self.threats = np.zeros(1, THREAT)
        self.threats["path"], self.threats["s"], self.threats["v"] = other_path, s_other, v_other
        self.threats["cap"], self.threats["half_length"] = self.roads.limit, 2.5
        self.threats["priority"] = self.roads.paths.priority[ego_path, other_path]
        self.memory, self.plan = np.zeros(1, CROSSING), np.zeros(1, PLAN)
        self.plan["go"], self.plan["held_at"] = -1, np.inf
        self.entry, self.assumed = entry, assumed
        self.report = None

    def scene(self) -> Scene:
        track = Track(self.path, self.s, self.v, 2.5, -1, 0.0)
        return Scene(self.roads.paths, track, self.threats, RULED._replace(other=self.assumed))

    def frame(self, nominal: float, a_other: float, overrides: bool = True) -> None:
        """One frame; the other car's acceleration is cut to what it can do."""
        self.decide(nominal, overrides)
        self.move(self.report.acceleration if overrides else nominal, a_other)

    def decide(self, nominal: float, overrides: bool = True) -> None:
        """What the shield lets through, in `report`."""
        sample = np.zeros(1, SAMPLE)
        sample["speed"] = self.threats["v"]
        self.report = junction_frame(
            self.scene(),
            sample,
            self.memory,
            self.plan[0],
            nominal,
            self.entry,
            True,
            TABLE_ONLY,
            overrides,
            self.rate,
        )

    def move(self, a_ego: float, a_other: float) -> None:
        """Both go on for one frame."""
        other = self.threats[0]
        a = min(max(a_other, -TABLE.other.a_max_brake), TABLE.other.a_max_accel)
        a = min(max(a, -other["v"] / DT), max((self.roads.limit - other["v"]) / DT, 0.0))
        other["s"] += other["v"] * DT
        other["v"] = max(other["v"] + a * DT, 0.0)
        self.s += self.v * DT
        self.v = max(self.v + a_ego * DT, 0.0)

    def touch(self) -> bool:
        """Is each in the way of the other now?"""
        paths, s = self.roads.paths, float(self.threats["s"][0])
        return bool(
            in_conflict(paths, self.path, cell_of(self.s, paths.cells[self.path]), int(self.threats["path"][0]), s, s)
        )


def verdict_of(duel, speed, outside=False):
    sample = np.zeros(1, SAMPLE)[0]
    sample["speed"] = speed
    return VERDICTS[judge_crossing(sample, duel.memory[0], outside, TABLE.other, DT).verdict]
