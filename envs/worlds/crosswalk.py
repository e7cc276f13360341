"""`crosswalk-v0`: a street with a marked crossing, and people who cross there, elsewhere, or jump onto the road.

A van that is parked before the crossing hides who comes from the right, on the crossing or between the two. Importing
this module registers the environment.
"""

import gymnasium as gym
import numpy as np

from rss_shield.envs.roads.visibility import Columns
from rss_shield.envs.worlds.streets import KERB, LANE, Person, StreetEnv, box_of_parked
from rss_shield.envs.worlds.walkers import (
    CROSSES,
    CROSSES_ELSEWHERE,
    JUMPS,
    Crossing,
    Errand,
    ParkedCar,
    Surroundings,
)
from rss_shield.shield.definitions.occlusion import REASONABLE

ENV_ID = "crosswalk-v0"
CROSSING = Crossing(58.0, 62.0)
PLACE, BESIDE = ("pedestrian", "crossing"), ("pedestrian", "roadside")
_ELSEWHERE = ((18.0, 46.0), (74.0, 100.0))  # stretches where people cross elsewhere [m]
_WAITS = (0.0, 0.4, 0.8, 1.4, 2.0, 3.0)  # how far behind the kerb people may stand unseen [m]
_REACTS = (3.0, 16.0)  # distance of the ego at which somebody unreasonable jumps [m]


class Van(ParkedCar):
    """Nobody looks over it."""

    LENGTH, WIDTH = 6.0, 2.2


_BEFORE = 2.5  # from the van to the crossing [m]
_VAN = CROSSING.start - _BEFORE - Van.LENGTH, CROSSING.start - _BEFORE  # where it is parked [m]
_APART = 0.5  # that people stand from it [m]


class CrosswalkEnv(StreetEnv):
    """See the module, and `StreetEnv` for the configuration."""

    def _surround(self):
        if not self.config["occluders"]:
            return Surroundings(crossings=(CROSSING,)), []
        van = Van(self.road, (sum(_VAN) / 2, LANE + 0.4 + Van.WIDTH / 2), 0.0)
        x = np.arange(CROSSING.start, CROSSING.end + 0.1, 0.5)
        columns = tuple(_column(x, side, PLACE, 0) for side in (1.0, -1.0))
        between = _column(np.arange(_VAN[1] + _APART, CROSSING.start - 0.1, 0.5), 1.0, BESIDE, -1)
        return Surroundings((box_of_parked(van),), (*columns, between), (CROSSING,)), [van]

    def _people(self) -> list[Person]:
        rng = self.np_random
        people = [self._reasonable() for _ in range(self.config["pedestrians"])]
        if rng.random() < self.config["unreasonable"]:
            x = rng.uniform(15.0, 100.0)
            errand = Errand(JUMPS, float(rng.uniform(4.0, 7.0)), 0.0, float(rng.uniform(*_REACTS)), 0.0)
            people.append(self._at(float(x), errand, BESIDE))
        return people

    def _reasonable(self) -> Person:
        rng = self.np_random
        after, near = float(rng.uniform(0.0, 3.0)), float(rng.uniform(6.0, 50.0))
        if rng.random() < 0.6:
            speed = float(rng.uniform(0.8, REASONABLE[PLACE].v_high))
            x = float(rng.uniform(CROSSING.start + 0.5, CROSSING.end - 0.5))
            return self._at(x, Errand(CROSSES, speed, after, near, 0.0), PLACE)
        speed, stretch = float(rng.uniform(0.8, 2.2)), _ELSEWHERE[int(rng.integers(2))]
        return self._at(float(rng.uniform(*stretch)), Errand(CROSSES_ELSEWHERE, speed, after, near, 0.0), BESIDE)

    def _at(self, x: float, errand: Errand, place: tuple[str, str]) -> Person:
        y = float(self.np_random.choice([-1.0, 1.0]) * KERB)
        if y > 0.0 and self.config["occluders"] and _VAN[0] - _APART < x < _VAN[1] + _APART:  # nobody stands in a van
            x = _VAN[0] - _APART if x < sum(_VAN) / 2 else _VAN[1] + _APART
        return Person(x, y, errand._replace(until=-y), place)


def _column(x: np.ndarray, side: float, place: tuple[str, str], crossing: int) -> Columns:
    """People who stand unseen on one side of the road, at `x` [m] along it."""
    points = np.stack(np.meshgrid(x, [side * (KERB - 0.6 + d) for d in _WAITS], indexing="ij"), axis=-1)
    return Columns(points, np.full(len(x), -side * np.pi / 2), place, crossing)


gym.register(id=ENV_ID, entry_point="rss_shield.envs.worlds.crosswalk:CrosswalkEnv")
