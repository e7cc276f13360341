"""Open space, where there are no lanes: who has to brake, and the proper response. Def. 22.

Where the paper leaves a choice: distances are between bodies, not points (U5); the condition "drives away" refers to
the car that brakes (U3); who drives away is who has to turn least (U2).
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, larger
from rss_shield.shield.definitions.occupancy import HI, LO
from rss_shield.shield.definitions.separation import all_of, drives_away, steps_apart, wrapped
from rss_shield.shield.definitions.trajectories import angle_away

# Def. 22: who brakes to keep the pair safe; the proper response that each item asks for
FIRST_BRAKES, SECOND_BRAKES, BOTH_BRAKE, DANGEROUS = range(4)
BRAKE, GO_ON, DRIVE_AWAY, STAY = range(4)


@compiled
def who_brakes(one, two, eps, theta):
    """Def. 22: is the distance of two road users safe, and who has to brake to keep it so?

    Args:
      one, two: `Occupancy` of each, in the same steps.
      eps: clearance >= 0 [m].
      theta: largest angle that counts as driving away [rad].

    Returns:
      FIRST_BRAKES or SECOND_BRAKES: safe by item 1, if this one brakes the other may go on.
      BOTH_BRAKE: safe by item 2 only.
      DANGEROUS: the sets may collide.
    """
    first, second = one.mover, two.mover
    rows = min(len(one.braking), len(two.braking))
    steps = max(one.bounds.steps, two.bounds.steps)
    if steps > rows:
        return DANGEROUS  # nobody has looked far enough ahead
    distance = np.hypot(second.x - first.x, second.y - first.y)
    if distance > one.bounds.reach + one.bounds.diagonal + two.bounds.reach + two.bounds.diagonal + eps:
        return BOTH_BRAKE
    if _meet_straight_ahead(one, two, min(one.bounds.steps, two.bounds.steps)):
        return DANGEROUS
    apart = steps_apart(one, one.braking, two, two.braking, steps, eps)
    first_suffices = _suffices(one, two, apart, eps, theta)
    second_suffices = _suffices(two, one, apart, eps, theta)
    if first_suffices != second_suffices:
        return FIRST_BRAKES if first_suffices else SECOND_BRAKES
    return BOTH_BRAKE if apart == all_of(steps) else DANGEROUS


@inner
def _meet_straight_ahead(one, two, steps):
    """Can two boxes that brake straight ahead touch after some steps? No direction parts them then.

    This is not needed, but soon told, and true of most pairs that are in danger.
    """
    least_1, most_1, least_2, most_2 = 0.0, 0.0, 0.0, 0.0
    for k in range(steps):
        least_1, most_1 = least_1 + one.braking[k, LO], most_1 + one.braking[k, HI]
        least_2, most_2 = least_2 + two.braking[k, LO], most_2 + two.braking[k, HI]
    first, second = one.mover, two.mover
    length_1, length_2 = first.half_length + 0.5 * (most_1 - least_1), second.half_length + 0.5 * (most_2 - least_2)
    middle_1, middle_2 = first.offset + 0.5 * (least_1 + most_1), second.offset + 0.5 * (least_2 + most_2)
    c_1, s_1, c_2, s_2 = one.bounds.cos, one.bounds.sin, two.bounds.cos, two.bounds.sin
    dx = second.x + middle_2 * c_2 - first.x - middle_1 * c_1
    dy = second.y + middle_2 * s_2 - first.y - middle_1 * s_1
    cos, sin = np.abs(c_1 * c_2 + s_1 * s_2), np.abs(c_1 * s_2 - s_1 * c_2)
    return (
        np.abs(dx * c_1 + dy * s_1) <= length_1 + length_2 * cos + second.half_width * sin
        and np.abs(dy * c_1 - dx * s_1) <= first.half_width + length_2 * sin + second.half_width * cos
        and np.abs(dx * c_2 + dy * s_2) <= length_2 + length_1 * cos + first.half_width * sin
        and np.abs(dy * c_2 - dx * s_2) <= second.half_width + length_1 * sin + first.half_width * cos
    )


@inner
def _suffices(braker, goer, apart, eps, theta):
    """Do the sets of one that brakes and of one that goes on not collide? `apart`: steps in which both brake apart."""
    wanted = all_of(braker.bounds.steps)
    return (
        apart & wanted == wanted
        and drives_away(braker, goer, theta)
        and steps_apart(braker, braker.braking, goer, goer.going_on, braker.bounds.steps, eps) == wanted
    )


@compiled
def who_stays(last, first_stands, second_stands, turn_1, turn_2):
    """Def. 22.1: once both have come to rest one may drive away, who has to turn less, and the other one stays.

    Args:
      last: `who_brakes` when it was safe last; DANGEROUS if it never was.
      first_stands, second_stands: is each at rest?
      turn_1, turn_2: `turn_to_drive_away` of each [rad].

    Returns:
      What takes the place of `last` until it is safe again: FIRST_BRAKES if the first one stays. Else `last`.
    """
    if first_stands and second_stands and last in (BOTH_BRAKE, DANGEROUS):
        return SECOND_BRAKES if turn_1 <= turn_2 else FIRST_BRAKES
    return last


@compiled
def proper_response(last, first_stands, second_stands):
    """Def. 22: what both have to do while their distance is not safe, (of the first, of the second).

    Args:
      last: `who_brakes` when it was safe last, or `who_stays`.
      first_stands, second_stands: is each at rest?

    Returns:
      BRAKE: keep C_b, that is brake once the response time is over. GO_ON: keep C_f. DRIVE_AWAY: move only within theta
      of the direction away from the other. STAY: keep standing.
    """
    if last == FIRST_BRAKES:
        return (STAY, DRIVE_AWAY) if first_stands else (BRAKE, GO_ON)
    if last == SECOND_BRAKES:
        return (DRIVE_AWAY, STAY) if second_stands else (GO_ON, BRAKE)
    return (STAY if first_stands else BRAKE), (STAY if second_stands else BRAKE)


@compiled
def headings_away(x, y, x_other, y_other, theta):
    """Headings in which one drives away from another: from the first angle, to the right, to the second [rad]."""
    away = np.arctan2(y - y_other, x - x_other)
    return wrapped(away - theta), wrapped(away + theta)


@compiled
def turn_to_drive_away(x, y, heading, x_other, y_other, theta):
    """By how much one has to turn before it may drive away from another [rad], 0 if it may at once."""
    return larger(angle_away(x_other, y_other, x, y, heading) - theta, 0.0)
