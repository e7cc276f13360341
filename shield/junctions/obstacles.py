"""Which cells of the ego's path something that stands is in the way of."""

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.junctions.conflict_areas import boxes_overlap, cell_of
from rss_shield.shield.junctions.plans import NEVER


@compiled
def block(paths, track, box, threat):
    """Fill in which cells of the ego's path ahead, and of the lane that it is leaving, an obstacle is in the way of."""
    threat.from_cell, threat.to_cell = _blocked(paths, track.path, track.s, box)
    threat.from_cell_beside, threat.to_cell_beside = NEVER, -1
    if track.beside >= 0:
        threat.from_cell_beside, threat.to_cell_beside = _blocked(paths, track.beside, track.s + track.shift, box)


@compiled
def _blocked(paths, path, s, box):
    """First and last cell of a path from `s` on that overlap an obstacle; `NEVER` and -1 if none does."""
    first, last = NEVER, -1
    for i in range(cell_of(s, paths.cells[path]), paths.cells[path]):
        if boxes_overlap(paths.boxes[path, i], box, 0.0):
            first, last = min(first, i), i
    return first, last
