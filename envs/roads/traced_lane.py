"""A lane of a trace, as highway-env's road networks have lanes."""

from dataclasses import asdict
from itertools import pairwise

import numpy as np
from highway_env.road.lane import AbstractLane

from rss_shield.shield.geometry import locate, make_road, wrap_angle
from rss_shield.shield.trace import Lane

_ARC = 1e-6  # how far a chord may be off the mean heading of its ends if an arc joins them [rad]


class TracedLane(AbstractLane):
    """A `Lane` of a trace: between two points of its centre line an arc of constant curvature, or straight.

    An arc joins two points if its chord has the mean of their headings; else they are joined by the chord.
    """

    def __init__(self, lane: Lane) -> None:
        self.lane = lane
        steps = np.hypot(*np.diff(lane.centre[:, :2], axis=0).T)
        kept = np.concatenate([[True], steps > 0.0])  # points that are there twice say nothing
        if kept.sum() < 2:
            raise ValueError(f"lane {lane.id!r}: all points of the centre line are the same: expected two that are not")
        self._pieces, self._widths = _pieces(lane.centre[kept]), lane.width[kept]
        lengths = [piece[4] for piece in self._pieces]
        self.starts = np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(self.starts[-1])
        self.tightest = max(abs(piece[3]) for piece in self._pieces)
        self.road = make_road([(*piece, start) for piece, start in zip(self._pieces, self.starts, strict=False)])
        self.priority, self.speed_limit, self.forbidden = lane.priority, lane.speed_limit, False

    def pieces(self, shift: float = 0.0) -> list[tuple[float, ...]]:
        """Start x, y, heading, curvature, length of each piece, or of what runs beside it."""
        moved: list[tuple[float, ...]] = []
        for x, y, heading, curvature, length in self._pieces:
            scale = max(1.0 - curvature * shift, 1e-3)
            x, y = x - shift * np.sin(heading), y + shift * np.cos(heading)
            moved.append((x, y, heading, curvature / scale, length * scale))
        return moved

    def position(self, longitudinal: float, lateral: float) -> np.ndarray:
        x, y, heading = self._at(longitudinal)
        return np.array([x - lateral * np.sin(heading), y + lateral * np.cos(heading)])

    def heading_at(self, longitudinal: float) -> float:
        return self._at(longitudinal)[2]

    def width_at(self, longitudinal: float) -> float:
        return float(np.interp(longitudinal, self.starts, self._widths))

    def local_coordinates(self, position: np.ndarray) -> tuple[float, float]:
        s, lateral, *_ = locate(self.road, float(position[0]), float(position[1]))
        return float(s), float(lateral)

    def _at(self, s: float) -> tuple[float, float, float]:
        k = int(np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self._pieces) - 1))
        x, y, heading, curvature, length = self._pieces[k]
        along = s - self.starts[k]
        on_arc = float(np.clip(along, 0.0, length))
        beyond, turn = along - on_arc, curvature * on_arc
        chord = on_arc * np.sinc(turn / 2 / np.pi)
        x, y = x + chord * np.cos(heading + turn / 2), y + chord * np.sin(heading + turn / 2)
        heading += turn
        return x + beyond * np.cos(heading), y + beyond * np.sin(heading), heading

    @classmethod
    def from_config(cls, config: dict) -> "TracedLane":
        fields = dict(config, centre=np.array(config["centre"], float), width=np.array(config["width"], float))
        return cls(Lane(**fields | {"successors": tuple(config["successors"])}))

    def to_config(self) -> dict:
        lane = asdict(self.lane) | {"centre": self.lane.centre.tolist(), "width": self.lane.width.tolist()}
        return {"class_path": f"{__name__}.TracedLane", "config": lane}


def _pieces(centre: np.ndarray) -> list[tuple[float, float, float, float, float]]:
    pieces = []
    for (x, y, heading), (x_next, y_next, heading_next) in pairwise(centre):
        chord, course = float(np.hypot(x_next - x, y_next - y)), float(np.arctan2(y_next - y, x_next - x))
        turn = float(wrap_angle(heading_next - heading))
        if turn != 0.0 and abs(wrap_angle(course - heading - turn / 2)) < _ARC:
            length = chord / float(np.sinc(turn / 2 / np.pi))
            pieces.append((float(x), float(y), float(heading), turn / length, length))
        else:
            pieces.append((float(x), float(y), course, 0.0, chord))
    return pieces
