"""Who goes first among compliant drivers where roads cross: they take turns.

Who came first goes first; of those who were there from the start, who has come further. A turn never changes, so all
agree on the order at every instant, and nobody who relied on its right loses it. Everybody keeps a plan that stays
clear of those before it, whatever they do, and of who drives ahead on its own way. It needs none that stays clear of
those after it, because theirs stay clear of it: that is safe by induction over the turns. No circle is left in
which everybody waits for the next, and the first waits for nobody. Whoever has no plan any more says so, and then
everybody stays clear of it.

Lanes have no say. A car on a lane with priority may be queuing behind one that has to give way, and to wait for it
would close a circle.

An agent that relies on nobody ("cautious") stays clear of everybody, so everybody may go before it, and whoever queues
behind it gets its turn only when the agent has gone: to wait for it would close a circle, too. Where the agent is held
back, those whose turn is after its own wait at such a distance that it finds its gap.
"""

from typing import Any

import numpy as np

from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.options import Settings
from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.junctions.conflict_areas import CELL, cell_of
from rss_shield.shield.junctions.controller import JunctionReport
from rss_shield.shield.junctions.followers import is_follower
from rss_shield.shield.junctions.memory import CAUTIOUS, PRIORITY
from rss_shield.shield.junctions.plans import Scene, Track
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE

GAP = 35.0  # whoever waits so far before the junction is in the way of no car that sets off at the junction [m]
PATIENCE = 15.0  # an agent that has waited for that long in all is given no more gaps: it may not want any [s]


class TurnTaker(JunctionEgo):
    """`JunctionEgo` with a turn; unless it is cautious, it relies on those whose turn is later."""

    turn = 0  # 0 = none yet: it stays clear of everybody
    to_junction = -np.inf  # from its centre to where it is in the way of others [m]
    waited = 0.0  # for a gap [s]
    trapped = False  # on the last frame no plan was clear of everybody
    is_held_back = False  # on the last frame its shield braked

    def _restrict(
        self, scene: Scene, acceleration: float, steering: float, holds: bool = False
    ) -> tuple[JunctionReport, float]:
        self.waited += self.settings.table.dt * self.needs_gap
        report, steering = super()._restrict(scene, acceleration, steering, holds)
        self.trapped, self.is_held_back = report.trapped, report.response == RESPONSE_BRAKE
        return report, steering

    def _look(self):
        track, threats, roads = super()._look()
        self.to_junction = float(np.argmax(roads.paths.crossed[track.path])) * CELL - track.s
        if self.settings.entry == CAUTIOUS:
            return track, threats, roads
        kept = 0
        for threat in threats:
            other = shield_of(self.others[threat["user"]])
            if threat["path"] >= 0 and other is not None:
                if self._may_rely_on(other) and not self._follows(roads.paths, track, threat):
                    self.crossings[threat["user"]]["relied"] = True
                    continue
                threat["priority"] = 0
            threats[kept] = threat
            kept += 1
        return track, threats[:kept], roads

    def _may_rely_on(self, other: "TurnTaker") -> bool:
        """Does another keep a plan that stays clear of this one?"""
        entry = other.settings.entry
        waits = entry == CAUTIOUS or (entry == PRIORITY and (other.turn == 0 or other.turn > self.turn))
        return self.turn > 0 and waits and not other.trapped

    def _follows(self, paths, track: Track, threat) -> bool:
        """Is a road user ahead on the same way, or does it take this one for its follower? It does not look behind."""
        lane = paths.lane[threat["path"], cell_of(threat["s"], paths.cells[threat["path"]])]
        if not np.isnan(paths.offset[track.path, lane]):
            return True
        path = threat["path"] % len(paths.boxes)  # of the ego's size, as which it is the front here
        its_track = Track(path, threat["s"], threat["v"], threat["half_length"], -1, 0.0)
        return self._is_behind(paths, track, its_track)

    def _is_behind(self, paths, track: Track, front: Track) -> bool:
        table = self.settings.table
        turned = table._replace(ego=table.other, other=table.ego)
        return bool(is_follower(Scene(paths, front, self.room, turned), track, True))

    def progress(self) -> float:
        """How far it has come on its path [m]."""
        self._meet()
        return float(self._look()[0].s)

    def queues_behind(self, agent: "TurnTaker") -> bool:
        """Is an agent that waits for everybody ahead on the same way, and still before the junction?"""
        if agent is self or agent.settings.entry != CAUTIOUS or agent.to_junction < 0.0:
            return False
        track, _, roads = self._look()
        return self._is_behind(roads.paths, track, agent._look()[0])

    @property
    def needs_gap(self) -> bool:
        """Does it wait before the junction, and relies on nobody to let it go?"""
        waits = self.settings.entry == CAUTIOUS and self.is_held_back
        return waits and 0.0 <= self.to_junction < GAP and self.waited < PATIENCE


class CompliantDriver(TurnTaker):
    """`TurnTaker` in a car that is no agent."""

    def __init__(self, vehicle, settings: Settings) -> None:
        super().__init__(vehicle, settings)
        self.holds = False

    def act(self, action=None) -> None:
        vehicle = self.vehicle
        if getattr(vehicle, "is_yielding", False):  # highway-env's own right of way knows no turns
            vehicle.target_speed = vehicle.lane.speed_limit
        super().act(action)

    def _look(self):
        track, threats, roads = super()._look()
        self.holds = self._leaves_gap(track)
        if not self.holds:
            return track, threats, roads
        cell = int(np.ceil((track.s + self.to_junction - GAP) / CELL))
        return track, self._closed_from(cell, track, threats, roads), roads

    def _leaves_gap(self, track: Track) -> bool:
        """Does it wait far back for an agent that needs a gap? Only if it can do so without hurry."""
        room = self.to_junction - GAP
        if not self.holds and room < 2.0 * stopping_distance(track.v, self.settings.table.ego.a_min_brake) + 1.0:
            return False
        return any(
            other is not None and other.turn < self.turn and other.needs_gap for other in map(shield_of, self.others)
        )


def take_turns(road: Any) -> None:
    """Give a turn to everybody who has none and can use it: after all others, and who has come further goes first."""
    shields = [shield for shield in map(shield_of, road.vehicles) if shield is not None]
    last = max((shield.turn for shield in shields), default=0)
    new = sorted((shield for shield in shields if shield.turn == 0), key=TurnTaker.progress, reverse=True)
    ready = [shield for shield in new if not any(map(shield.queues_behind, shields))]
    for turn, shield in enumerate(ready, last + 1):
        shield.turn = turn


def shield_of(vehicle: Any) -> TurnTaker | None:
    """The shield on a vehicle that takes its turn, until it has a contact."""
    shield = getattr(vars(vehicle).get("act"), "__self__", None)
    return shield if isinstance(shield, TurnTaker) and not shield.has_contact else None
