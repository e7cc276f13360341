"""A moment of a trace from above, on matplotlib's axes."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.patches import Polygon

from rss_shield.shield.trace import Trace


def draw_from_above(axes: Any, trace: Trace, t: int, colour_of: Callable[[int], str]) -> None:
    """Lanes, and everybody who is there on a sample.

    Args:
      axes: they get equal scales and no ticks; their limits are the caller's.
      t: the sample.
      colour_of: index of a user -> colour.
    """
    u = trace.users
    for lane in trace.lanes:
        x, y, heading = lane.centre.T
        for side in (-0.5, 0.5):
            off = side * lane.width
            axes.plot(x - off * np.sin(heading), y + off * np.cos(heading), color="#cccccc", lw=0.6)
    for k in np.flatnonzero(u.present[t]):
        box = box_at(u.x[t, k], u.y[t, k], u.heading[t, k], u.length[k], u.width[k])
        axes.add_patch(Polygon(box, color=colour_of(int(k)), lw=0))
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])


def box_at(x: float, y: float, heading: float, length: float, width: float, ahead: float = 0.0) -> np.ndarray:
    """`[4, 2]` corners of a rectangle whose middle is `ahead` of a point [m]."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.5 * length, 0.5 * width] + [ahead, 0.0]
    c, s = np.cos(heading), np.sin(heading)
    return corners @ np.array([[c, s], [-s, c]]) + [x, y]
