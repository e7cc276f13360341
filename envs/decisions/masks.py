"""Which meta-actions may be taken, given the frame on which each would first be answered."""

from rss_shield.shield._numba.compiled import compiled

LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER = range(5)  # as in `DiscreteMetaAction.ACTIONS_ALL`
_EAGERNESS = (2, 1, 3, 4, 0)  # of each; the calmest comes first where nothing else decides


@compiled
def allow(first, frames, labels, mask):
    """Fill in which actions pass the coming decision without an answer.

    If none does, the one that is answered last is left; of several, in this order: SLOWER, IDLE, LANE_LEFT,
    LANE_RIGHT, FASTER.

    Args:
      first: `[A]` frame on which each action is first answered, `frames` = never.
      frames: of a decision.
      labels: `[A]` meta-action of each.
      mask: `[A]`, overwritten.
    """
    best, any_passes = 0, False
    for a in range(len(labels)):
        mask[a] = first[a] >= frames
        any_passes |= mask[a]
        calmer = _EAGERNESS[labels[a]] < _EAGERNESS[labels[best]]
        if first[a] > first[best] or (first[a] == first[best] and calmer):
            best = a
    if not any_passes:
        mask[best] = True
