"""The crossings: each a few lines of data, with what is expected of it and how that is worked out by hand.

`intersection-v0`, in the frame of its centre, x to the east and y to the south [m]. Everybody enters on a lane of
100 m that ends 11 m before the centre: from the south on x = 2, y = 111 - s; from the west on y = 2, x = s - 111; from
the north on x = -2, y = s - 111; from the east on y = -2, x = 111 - s. A left turn is a quarter of a circle of 13 m.
Cars are 5 m x 2 m, so two whose ways cross at right angles touch when both are within 2.5 + 1 = 3.5 m of the crossing,
centre to centre; a contact is seen one frame (1/15 s) ahead.

The ego is cautious: it relies on nobody to give way (docs/junctions.md). So whoever drives on where others may come has
left itself no way to stay clear of them, and without the shield is to blame, also towards somebody who had to give way.
With it the ego waits where it is in nobody's way.
"""

from rss_shield.eval.suite.scenarios.crossing import Crossing, Rider

INTERSECTION, ROUNDABOUT = "intersection-v0", "roundabout-v0"
SOUTH, WEST, NORTH, EAST = (("o0", "ir0", 0), ("o1", "ir1", 0), ("o2", "ir2", 0), ("o3", "ir3", 0))
ACROSS, LEFT_TURN, TURNING, STANDING, RING = (
    *("straight crossing paths", "left turn across path", "turning"),
    *("lead vehicle stopped", "turning into a ring"),
)

CROSSINGS = (
    Crossing(
        "crossing traffic from the left",
        "The ego's y = 50 - 10 t, the other's x = -52 + 10 t. Within 3.5 m of (2, 2) the ego is from 4.45 to 5.15 s "
        "on, "
        "the other from 5.05 s on.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o2"), Rider("other", WEST, 59.0, 10.0, "o3")),
        *("ego", ""),
        touched=5.05,
        kind=ACROSS,
    ),
    Crossing(
        "crossing traffic from the right",
        "The ego's y = 50 - 10 t, the other's x = 48 - 10 t. Within 3.5 m of (2, -2) the other is from 4.25 s on, the "
        "ego from 4.85 s on.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o2"), Rider("other", EAST, 63.0, 10.0, "o1")),
        *("ego", ""),
        touched=4.85,
        kind=ACROSS,
    ),
    Crossing(
        "a driver runs the stop line",
        "The ego has priority, the other comes from the minor road and does not stop. The ego's x = -50 + 10 t, the "
        "other's y = 52 - 10 t: within 3.5 m of (2, 2) from 4.85 s and 4.65 s on. A cautious ego counts on no "
        "priority.",
        INTERSECTION,
        (Rider("ego", WEST, 61.0, 10.0, "o3"), Rider("other", SOUTH, 59.0, 10.0, "o2")),
        *("ego", ""),
        touched=4.85,
        kind=ACROSS,
    ),
    Crossing(
        "the ego turns left across oncoming traffic",
        "Its circle crosses x = -2 at the angle of acos(9 / 13) = 46.2 degrees, y = 11 - 13 sin 46.2 = 1.6, after 13 x "
        "0.806 = 10.5 m: (39 + 10.5) / 10 = 4.95 s. The other's y = -50 + 10 t is 1.6 at 5.16 s; it is 2.5 m long to "
        "the "
        "front and the ego, turned by 46 degrees, 2.5 x 0.69 + 1 x 0.72 = 2.4 m deep: at most 4.9 m, or 0.49 s, "
        "before.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o1"), Rider("other", NORTH, 61.0, 10.0, "o0")),
        *("ego", ""),
        touched=4.85,
        kind=LEFT_TURN,
    ),
    Crossing(
        "oncoming traffic turns left across the ego",
        "The same with changed parts: the other crosses x = 2 at y = -1.6 after 4.95 s, the ego is there at 5.16 s.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o2"), Rider("other", NORTH, 61.0, 10.0, "o3")),
        *("ego", ""),
        touched=4.85,
        kind=LEFT_TURN,
    ),
    Crossing(
        "a blocked junction",
        "Somebody stands across the ego's way, at (2, 2). The ego's y = 70 - 10 t is 5.5 after 6.45 s. With the "
        "shield it "
        "waits before the junction.",
        INTERSECTION,
        (Rider("ego", SOUTH, 41.0, 10.0, "o2"), Rider("other", ("ir1", "il3", 0), 13.0, 0.0, "o3")),
        *("ego", ""),
        touched=6.45,
        kind=STANDING,
    ),
    Crossing(
        "the leader turns right",
        "It slows down from 10 to 4 m/s with 4 m/s^2 from 1 s on, 10 m ahead: 10 - 2 tau^2 = 5.5 m are left after "
        "1.5 s, "
        "and gone 5.5 / 6 = 0.92 s later, still before the junction (70 + 10 + 10.5 + 3.7 = 94 m).",
        INTERSECTION,
        (
            Rider("ego", SOUTH, 55.0, 10.0, "o2"),
            Rider("other", SOUTH, 70.0, 10.0, "o3", ((1.0, 0.0), (2.5, -4.0))),
        ),
        *("ego", ""),
        touched=3.42,
        kind=TURNING,
    ),
    Crossing(
        "the ego turns right before crossing traffic",
        "A right turn is a quarter of a circle of 9 m, 14.1 m: the ego is on the other's lane, at x = 11, after (39 + "
        "14.1) / 10 = 5.3 s. The other's x = -45 + 10 t is 8.1 then, 2.9 m behind, centre to centre: they touch "
        "before, "
        "but not before its front, 2.5 m ahead, is at x = 4, where the ego turns into its way: 4.65 s.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o3"), Rider("other", WEST, 66.0, 10.0, "o3")),
        *("ego", ""),
        touched=4.95,
        kind=TURNING,
    ),
    Crossing(
        "entering a ring",
        "8 m/s: the ego is in the ring after (2.5 + 17) / 8 = 2.44 s. The other, on the outer lane, has 8.6 + 20.1 m "
        "to "
        "go there: 2.87 s, so it is 0.43 s or 4.3 m behind then, centre to centre, less than a car is long.",
        ROUNDABOUT,
        (Rider("ego", ("ser", "ses", 0), 125.0, 8.0, "nxs"), Rider("other", ("we", "sx", 1), 9.0, 10.0, "exr")),
        *("ego", ""),
        touched=2.44,
        kind=RING,
    ),
    Crossing(
        "nobody is in the way",
        "The other is beyond the junction, on the ego's way out, 21 m ahead of the end of a junction of 22 m and as "
        "fast.",
        INTERSECTION,
        (Rider("ego", SOUTH, 61.0, 10.0, "o2"), Rider("other", ("il2", "o2", 0), 60.0, 10.0, "o2")),
        *("", ""),
        touched=None,
        kind="none",
    ),
)
