"""What can be owed, who can be to blame, and which verdict weighs most: the words of Def. 27, said once.

Both kinds of roads use them: where distances along lanes keep cars safe, and where plans do.
"""

from typing import NamedTuple

from rss_shield.shield._numba.compiled import compiled, inner

# duties along lanes
KEPT, TOO_FAR, TOO_SHORT, TOO_CLOSE, TOO_WEAK, TOO_HARD, TOWARD = range(7)
# at junctions; who is TRAPPED has no plan left toward anybody because a third broke its duty
LEFT_NO_PLAN, WAVERED, ACCELERATED, BRAKED, LEFT_PATHS, CRASHED, GAVE_NO_WAY, REVERSED, CUT_IN, TRAPPED = range(7, 17)
# of and toward pedestrians, and whoever was hidden
LEAPED, WALKED_IN, HURRIED, LEFT_CROSSING, UNREASONABLE, NO_CAUTION = range(17, 23)
# in open space, where some of the above are owed, too
STEERED = 23
# of whoever is not a car as cars are, where roads cross and in open space
JUMPED = 24
DUTIES = (
    "",
    "got farther along the lane than its share [m]",
    "stopped shorter than braking at a_max_brake would [m]",
    "came closer across the lane than its share [m]",
    "braked less than the proper response asks [m/s^2]",
    "braked harder than a_max_brake [m/s^2]",
    "moved toward the other across the lane [m/s]",
    "left itself no way to stay clear [m/s^2]",
    "neither braked nor went on [m/s^2]",
    "accelerated harder than a_max_accel [m/s^2]",
    "braked harder than a_max_brake at a junction [m/s^2]",
    "left every path it could take",
    "crashed before",
    "did not give way",
    "reversed [m/s]",
    "cut in in front of the other",
    "none: somebody else had trapped the ego",
    "got farther than a pedestrian may reach [m]",
    "walked into a car that was there before",
    "went faster than a pedestrian may [m/s]",
    "left the crossing",
    "came out of hiding faster than is reasonable [m/s]",
    "drove too fast for who was hidden",
    "turned while it had to brake [rad]",
    "moved or turned farther than its speed explains [m]",
)
NOBODY, EGO, OTHER, BOTH, INHERITED = range(5)
VERDICTS = ("none", "ego", "other", "both", "inherited")
AT_FAULT = ("ego", "both")  # verdicts that charge the ego
BLAMES = ("ego", "both", "other", "inherited", "none")  # in the order in which tables show them


class Verdict(NamedTuple):
    """Who is to blame for a contact, with the evidence."""

    verdict: int  # index into VERDICTS
    kind: int  # of danger: axes that were safe at the threshold (`response.AXES`), or plans (`plans.PLAN_NAMES`)
    frames: int  # from the threshold to the contact
    ego_duty: int  # first duty broken, index into DUTIES
    ego_excess: float
    other_duty: int
    other_excess: float


@inner
def judged(verdict, kind, memory):
    """A verdict with the evidence that is remembered of one road user, a `MEMORY` or `CROSSING` record."""
    return Verdict(
        verdict, kind, memory.since, memory.ego_broke, memory.ego_excess, memory.other_broke, memory.other_excess
    )


@inner
def who_broke(memory, never_safe):
    """Def. 27: the verdict by who broke a duty since the danger threshold.

    Args:
      memory: `MEMORY` or `CROSSING` record.
      never_safe: there was no threshold: the two were in danger from first sight on, which is nobody's duty to explain.
    """
    if never_safe:
        return EGO if memory.ego_broke != KEPT else INHERITED
    if memory.ego_broke != KEPT:
        return BOTH if memory.other_broke != KEPT else EGO
    return OTHER if memory.other_broke != KEPT else NOBODY


@compiled
def weight_of(verdict):
    """Of several contacts at once the one that weighs most counts: a bug, then what charges the ego."""
    if verdict == NOBODY:
        return 4
    if verdict == EGO:
        return 3
    if verdict == BOTH:
        return 2
    return 1 if verdict == OTHER else 0


@inner
def charges_ego(verdict):
    """Is the ego to blame, alone or with the other?"""
    return verdict in (EGO, BOTH)
