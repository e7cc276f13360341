"""What is remembered at a junction: of each road user, of what the ego read of it, and of the plan in force."""

from rss_shield.shield._numba.compiled import records

CAUTIOUS, PRIORITY, ASSERTIVE = range(3)  # whom the ego expects to give way: nobody, who must, who can
ENTRIES = ("cautious", "priority", "assertive")

# What the ego remembers of one road user. SI units.
CROSSING = records(
    [
        ("age", "i8"),  # samples since first sight
        ("since", "i8"),  # frames since the last sample with a plan; 0 = there is one now
        ("items", "i8"),  # plans at that sample: STOP, GO or both; 0 = never any
        ("follows", "?"),  # was the ego's follower at the last sample, on one of its ways at least
        ("behind", "?"),  # and has been so at a safe distance
        ("stood", "i8"),  # frames for which it has been standing, 0 = it moves
        ("counted_on", "i8"),  # frames for which the ego has had no plan but one that counts on that (rule J9)
        ("relied", "?"),  # is counted on to give way on this frame
        ("relied_before", "?"),  # was so on the frame before
        ("way", "i8"),  # path of the ego then
        ("path", "i8"),  # path that its announced route followed then, -1 = none announced
        ("wreck", "?"),  # at the last sample
        ("astray", "?"),  # was on no path then
        ("x", "f8"),  # at the last sample
        ("y", "f8"),
        ("heading", "f8"),
        ("speed", "f8"),
        ("lanes", "i8"),  # lanes on which it may be now or next, as a set of bits
        ("ways", "i8"),  # paths that it may be on, likewise
        ("reachable", "i8"),  # likewise, if it changes lanes
        ("ego_broke", "i8"),  # first duty each broke since the last sample with a plan, index into `verdicts.DUTIES`
        ("ego_excess", "f8"),
        ("other_broke", "i8"),
        ("other_excess", "f8"),
        (
            "faint",
            "i8",
        ),  # likewise, also by less than is tolerated: counts where nothing else explains a contact
        ("faint_excess", "f8"),
        ("was_lawless", "?"),  # the other broke one up to this sample, though the ego may have a plan toward it again
    ]
)

# What the ego reads of one road user on one sample. SI units.
SAMPLE = records(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("heading", "f8"),
        ("half_length", "f8"),
        ("speed", "f8"),
        ("lanes", "i8"),  # lanes on which it may be, as a set of bits
        ("next_lanes", "i8"),  # these and the ones that follow
        ("reachable", "i8"),  # those, and lanes beside them
        ("path", "i8"),  # path that its announced route follows, -1 = none announced
        ("wreck", "?"),
        ("ways", "i8"),  # paths that it may be on, as a set of bits
        ("strays", "?"),  # has gone on where none of the ways leads that it might be on before
        ("astray", "?"),  # on no lane at all
        ("alert", "?"),  # is known to wait: nobody counts on it to stand
    ]
)

# The plan in force.
PLAN = records(
    [
        ("go", "i8"),  # frames of throttle left, -1 = no plan
        ("held_at", "f8"),  # acceleration to which the ego was held back on the last frame, inf = it was not [m/s^2]
        ("wronged", "?"),  # somebody broke a duty, and there has been no plan since that stays clear of everybody
    ]
)
