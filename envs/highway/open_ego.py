"""One car where nothing is marked, under the shield of `shield.open_space`."""

from typing import Any

import numpy as np
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.highway.ego import ShieldedEgo, carried_over
from rss_shield.envs.highway.frames import Frame, Look
from rss_shield.envs.options import Settings
from rss_shield.shield.comfort import ride_on
from rss_shield.shield.command import Command
from rss_shield.shield.open_space.controller import WORK, Intended, open_space_frame
from rss_shield.shield.open_space.frames import CAR, FIXED, LOT, PEDESTRIAN, STANDS, USER, Space
from rss_shield.shield.open_space.judge import judge_motion, judge_touch
from rss_shield.shield.open_space.pair import PAIR
from rss_shield.shield.tally import count_change, note_executed
from rss_shield.shield.verdicts import Verdict


class OpenSpaceEgo(ShieldedEgo):
    """`ShieldedEgo` with trajectories (Defs. 19-22) instead of distances along a lane.

    Who goes first where two stand is settled by the order of the cars on the road, on which all shields agree.
    """

    space: Space = LOT

    def __init__(self, vehicle: Any, settings: Settings, record: bool = False) -> None:
        super().__init__(vehicle, settings, record)
        self.pairs = np.zeros(0, PAIR)
        self.users = np.zeros(1, USER)  # everybody on the last frame, the ego last
        self.slip = 0.0  # of the last frame [rad]
        self.work = np.zeros(WORK)

    def _frame(self) -> None:
        vehicle, settings = self.vehicle, self.settings
        nominal = self.nominal  # a continuous action persists
        acceleration, steering = float(nominal["acceleration"]), float(nominal["steering"])
        self._meet()
        now = self._seen()
        wish = Intended(acceleration, float(np.arctan(0.5 * np.tan(steering))), self.slip)
        common = settings.table, self.space
        report = open_space_frame(now, self.users, self.pairs, wish, *common, settings.overrides, self.work)
        self.users, self.slip = now, report.slip
        granted, steered = float(report.acceleration), steering
        if report.slip != wish.slip:
            steered = float(np.arctan(2.0 * np.tan(report.slip)))
        if settings.overrides:
            vehicle.action = {"steering": steered, "acceleration": granted}
        if report.partner >= 0 and self.tally["partner"] < 0:
            self.tally["partner"] = self._index_on_road(report.partner)
        note_executed(self.tally, granted, steered)
        count_change(self.tally, self.since, abs(granted - acceleration), abs(steered - steering))
        self._count(report, report, report.pairs, report.broken)
        ride_on(self.ride, self.poses[-1, 3], self.poses[-1, 2], np.inf, settings.table.dt)
        asked, command = Command(acceleration, wish.slip), Command(granted, report.slip)
        changed = report.overridden, report.anticipated, report.limited
        self.look = Look(asked, command, *changed, report.response, report.partner, report.pairs > 0)
        if self.record is not None:
            self.record.append(Frame(tuple(self.keys), self.poses, command))

    def _seen(self) -> np.ndarray:
        """`[N + 1]` everybody as `USER`, the ego last."""
        everybody = [*self.others, self.vehicle]
        users = np.zeros(len(everybody), USER)
        users["x"], users["y"], users["heading"], users["speed"] = self.poses.T
        users["speed"][np.abs(users["speed"]) < STANDS] = 0.0
        users["half_length"] = [v.LENGTH / 2 for v in everybody]
        users["half_width"] = [v.WIDTH / 2 for v in everybody]
        users["kind"] = [_kind_of(v) for v in everybody]
        vehicles = self.vehicle.road.vehicles
        before = {id(v) for v in vehicles[: vehicles.index(self.vehicle)]}
        users["first"] = [id(v) in before for v in everybody]
        return users

    def _follow(self, others: list) -> None:
        self.pairs = carried_over(self.pairs, self.others, others)
        self.users = np.append(carried_over(self.users[:-1], self.others, others), self.users[-1:])  # the ego is last
        super()._follow(others)

    def _verdicts(self, touching: list[int]) -> list[Verdict]:
        now, table, verdicts = self._seen(), self.settings.table, []
        for i in touching:
            pair, common = self.pairs[i], (table, self.space, self.work)
            if pair["age"] > 0:
                judge_motion(self.users[-1], self.users[i], now[-1], now[i], pair, *common)
            verdicts.append(judge_touch(now[-1], now[i], pair))
        return verdicts


def _kind_of(user: Any) -> int:
    """Who drives, who walks, and what stays where it is: walls, and cars that nobody drives."""
    if not hasattr(user, "action"):
        return FIXED
    if getattr(user, "WALKS", False):
        return PEDESTRIAN
    if "act" in vars(user):
        return CAR
    driven = getattr(user, "DRIVEN", type(user) is not Vehicle or user.speed != 0.0)
    return CAR if driven else FIXED
