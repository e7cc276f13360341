"""The scenarios: each a few lines of data, with what is expected of it and how that is worked out by hand.

For all of them (`stage.EGO`, `stage.OTHER`): rho = 0.5 s for the ego and 1 s for others, a = 2, b_min = 4, b_max = 8,
b_correct = 3 m/s^2, across the lane a = 0.5, b = 1 m/s^2, mu = 0.2 m, lambda = 1 m. Cars are 5 m x 2 m unless said
otherwise, lanes 4 m wide, frames 0.1 s. "gap" is bumper to bumper. So

  an ego at v behind a leader at u needs     D(v, u)  = 0.5 v + 0.25 + (v + 1)^2 / 8 - u^2 / 16 + 1
  another at v behind an ego at u needs      D'(v, u) = v + 1 + (v + 2)^2 / 8 - u^2 / 16 + 1
  D(20, 20) = 10.25 + 55.125 - 25 + 1 = 41.375 m,     D(20, 0) = 66.375 m,     D'(20, 20) = 57.5 m

Across the lane the boxes count as wide as a car that may be turned by arcsin 0.1: 2.5 0.1 + 1 0.995 = 1.245 m to
either side, so cars in the middle of neighbouring lanes are 4 - 2.49 = 1.51 m apart. Who moves toward the other at w
needs w rho + a rho^2 / 2 + (w + a rho)^2 / 2 (b = 1): E(w) for the ego, E'(w) for others, and the pair mu and 0.1 m (a
contact is predicted one frame ahead) and up to 0.05 m more (frames), so 0.35 m in all:

  E(0) = 0.0625 + 0.03125 = 0.09,   E(0.3) = 0.15 + 0.0625 + 0.15125 = 0.36,   E(2) = 1 + 0.0625 + 2.53 = 3.59 m
  E'(0) = 0.25 + 0.125 = 0.375,     E'(0.3) = 0.3 + 0.25 + 0.32 = 0.87,        E'(1) = 1 + 0.25 + 1.125 = 2.375 m
  neighbours that keep their lanes: 0.09 + 0.375 + 0.35 = 0.82 < 1.51: safe

A time "t" is that of the formulas; danger is seen on the next frame, or up to 0.3 s earlier, because sampling (C5) and
boxes that may turn cost a little. tau counts from when somebody begins to do something.
"""

from rss_shield.eval.suite.scenarios.stage import Car, Scenario

FOREVER = 1e9
LEFT, MIDDLE, RIGHT = 0.0, 4.0, 8.0
TWO_WAY = ((0.0, True), (4.0, False))  # the left lane runs the other way
PASSING = ((0.0, True), (0.0, False), (4.0, False))  # and who overtakes may drive there, as in two-way-v0
FOLLOWING, BEHIND, CUT_IN, BESIDE, CHANGE, HEAD_ON = (
    *("lead vehicle", "following vehicle", "cut-in"),
    *("vehicle beside", "changing lanes", "opposite direction"),
)


def ego(v=20.0, phases=(), sideways=(), y=MIDDLE) -> Car:
    return Car("ego", y, 0.0, v, phases, sideways)


def ahead(gap, v, phases=(), sideways=(), y=MIDDLE, name="leader", length=5.0, backs_up=False) -> Car:
    return Car(name, y, gap + 2.5 + length / 2, v, phases, sideways, length, backs_up=backs_up)


def behind(gap, v, phases=(), sideways=(), y=MIDDLE, name="follower") -> Car:
    return Car(name, y, -gap - 5.0, v, phases, sideways)


def oncoming(gap, v, phases=(), sideways=(), y=MIDDLE) -> Car:
    return Car("oncoming", y, gap + 5.0, v, phases, sideways, turned=True)


def from_second_one(a) -> tuple:
    """Keeps its speed for a second, then accelerates."""
    return ((1.0, 0.0), (FOREVER, a))


SCENARIOS = (
    # ------------------------------------------------------------ somebody ahead
    Scenario(
        "following at a distance",
        "50 m > D(20, 20) = 41.375 m at any time: no danger.",
        (ego(), ahead(50.0, 20.0)),
        *("", ""),
        partner="leader",
        kind=FOLLOWING,
    ),
    Scenario(
        "following too closely from the start",
        "30 m < 41.375 m in one lane: neither axis was ever safe, so danger is inherited from t = 0, and answered "
        "on both. Both keep their speeds: no contact without the shield. With it the ego brakes.",
        (ego(), ahead(30.0, 20.0)),
        *("", ""),
        partner="leader",
        danger=0.0,
        axis="inherited",
        response="both",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader brakes as hard as allowed",
        "8 m/s^2 from 1 s. gap = 50 - 4 tau^2, D(20, 20 - 8 tau) = 41.375 + 20 tau - 4 tau^2: equal at tau = 8.625 "
        "/ 20 = 0.431, t = 1.43 s. It stops after 25 m, so at 20 m/s the ego is there after (50 + 25) / 20 = 3.75 "
        "s, t = 4.75 s, and has not braked. With the shield it needs 20 0.1 + 20^2 / 8 = 52 m from t = 1.5 s, 10 m "
        "more than it has driven since 1 s: 62 < 75 m.",
        (ego(), ahead(50.0, 20.0, from_second_one(-8.0))),
        *("ego", ""),
        partner="leader",
        danger=1.431,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader slows down gently",
        "2 m/s^2 from 1 s. gap = 50 - tau^2, D = 41.375 + 5 tau - tau^2 / 4: 0.75 tau^2 + 5 tau = 8.625 at tau = "
        "1.42, t = 2.42 s. An ego that goes on touches when tau^2 = 50, t = 8.07 s.",
        (ego(), ahead(50.0, 20.0, from_second_one(-2.0))),
        *("ego", ""),
        partner="leader",
        danger=2.422,
        axis="longitudinal",
        response="longitudinal",
        seconds=14.0,
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader brakes harder than allowed",
        "25 m/s^2 from 1 s, gap 43 m. 41.375 + 62.5 tau - 39.06 tau^2 = 43 - 12.5 tau^2 at tau = 0.026, t = 1.03 "
        "s. It stops after 20^2 / 50 = 8 m: 51 m for the ego, which needs 0.1 20 + 20^2 / 8 = 52 m and more: "
        "contact, but it has kept its response. Without the shield both have broken theirs. "
        "With evasion it brakes with 8 m/s^2 and stops after 20^2 / 16 = 25 m more.",
        (ego(), ahead(43.0, 20.0, from_second_one(-25.0))),
        *("both", "other"),
        evaded="",
        partner="leader",
        danger=1.026,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader crashes: it stops on the spot",
        "200 m/s^2 from 1 s, gap 45 m: it stops within a frame or two, 2 m on, so there are 47 m and the ego needs "
        "52 m. At 1.1 s D(20, 0) = 66.375 > 43 m; at 1 s 41.375 < 45 m. "
        "With evasion it brakes with 8 m/s^2: 25 m.",
        (ego(), ahead(45.0, 20.0, from_second_one(-200.0))),
        *("both", "other"),
        evaded="",
        partner="leader",
        danger=1.0,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "a stalled car",
        "It stands 100 m ahead. D(20, 0) = 66.375 m is left after (100 - 66.375) / 20 = 1.68 s; an ego that goes "
        "on touches it at 5 s.",
        (ego(), ahead(100.0, 0.0, name="stalled")),
        *("ego", ""),
        partner="stalled",
        danger=1.681,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "a slower leader",
        "10 m/s, gap 70 m. D(20, 10) = 66.375 - 6.25 = 60.125 m is left after 9.875 / 10 = 0.99 s; touched at 7 s.",
        (ego(), ahead(70.0, 10.0)),
        *("ego", ""),
        partner="leader",
        danger=0.9875,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "the ego speeds up behind its leader",
        "2 m/s^2, v = 20 + 2 t, gap = 60 - t^2, D = 10 + t + 0.25 + (21 + 2 t)^2 / 8 - 25 + 1 = 41.375 + 11.5 t + "
        "0.5 t^2: 1.5 t^2 + 11.5 t = 18.625 at t = 1.37 s. Touched when t^2 = 60, 7.75 s.",
        (ego(phases=((FOREVER, 2.0),)), ahead(60.0, 20.0)),
        *("ego", ""),
        partner="leader",
        danger=1.3735,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "creeping up",
        "2 m/s toward a standing car, 10 m. D(2, 0) = 1.25 + 9 / 8 + 1 = 3.375 m is left after 6.625 / 2 = 3.31 s; "
        "touched at 5 s.",
        (ego(2.0), ahead(10.0, 0.0)),
        *("ego", ""),
        partner="leader",
        danger=3.3125,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "a faster leader",
        "D(20, 25) = 66.375 - 39.06 = 27.3 < 30 m, and the gap grows: no danger.",
        (ego(), ahead(30.0, 25.0)),
        *("", ""),
        partner="leader",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader brakes and drives on",
        "4 m/s^2 from 1 s to 2 s, then 2 m/s^2 up to 20 m/s. gap = 50 - 2 tau^2, D = 41.375 + 10 tau - tau^2: "
        "tau^2 + 10 tau = 8.625 at tau = 0.797, t = 1.80 s. At 4 s it drives 20 m/s again, 48 - 4 = 44 m > 41.375 "
        "m ahead: the danger is over.",
        (ego(), ahead(50.0, 20.0, ((1.0, 0.0), (2.0, -4.0), (4.0, 2.0)))),
        *("", ""),
        partner="leader",
        danger=1.797,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "at motorway speed the leader brakes",
        "35 m/s both, D = 17.75 + 162 - 76.56 + 1 = 104.19 m, gap 110 m; 8 m/s^2 from 1 s: 104.19 + 35 tau - 4 "
        "tau^2 = 110 - 4 tau^2 at tau = 0.166, t = 1.17 s. It stops after 76.6 m: touched 186.6 / 35 = 5.33 s "
        "later.",
        (ego(35.0), ahead(110.0, 35.0, from_second_one(-8.0))),
        *("ego", ""),
        partner="leader",
        danger=1.166,
        axis="longitudinal",
        response="longitudinal",
        seconds=12.0,
        kind=FOLLOWING,
    ),
    Scenario(
        "a truck of 16 m brakes",
        "Gaps count from bumper to bumper, so all is as with a leader of 5 m that brakes as hard as allowed: t = "
        "1.43 s.",
        (ego(), ahead(50.0, 20.0, from_second_one(-8.0), length=16.0)),
        *("ego", ""),
        partner="leader",
        danger=1.431,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "deceleration ahead (UN R157)",
        "16 m/s, two seconds behind: 32 m > D(16, 16) = 8.25 + 36.125 - 16 + 1 = 29.375 m. 6 m/s^2 from 1 s: "
        "29.375 + 12 tau - 2.25 tau^2 = 32 - 3 tau^2 at tau = 0.216, t = 1.22 s. It stops after 21.3 m: touched "
        "53.3 / 16 = 3.33 s later.",
        (ego(16.0), ahead(32.0, 16.0, from_second_one(-6.0))),
        *("ego", ""),
        partner="leader",
        danger=1.216,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "cut-out before a stalled car (UN R157)",
        "The leader, 43 m ahead at 20 m/s, leaves the lane from 1 s on. A car stands 130 m ahead; nothing is "
        "hidden here, so danger begins with D(20, 0) = 66.375 m, after 63.625 / 20 = 3.18 s. Touched at 6.5 s.",
        (ego(), ahead(43.0, 20.0, sideways=((1.0, 3.0, -2.0),)), ahead(130.0, 0.0, name="stalled")),
        *("ego", ""),
        partner="stalled",
        danger=3.181,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "starting too early",
        "Both stand 3 m apart, the ego sets off with 2 m/s^2 at 1 s: gap = 3 - tau^2, D(2 tau, 0) = 1.375 + 1.5 "
        "tau + 0.5 tau^2: 1.5 tau^2 + 1.5 tau = 1.625 at tau = 0.655, t = 1.65 s. Touched when tau^2 = 3, t = 2.73 "
        "s.",
        (ego(0.0, from_second_one(2.0)), ahead(3.0, 0.0)),
        *("ego", ""),
        partner="leader",
        danger=1.655,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader backs up into a standing ego",
        "10 m; it reverses from 1 s on, up to 2 m/s. The ego may need 0.25 + 0.125 m if it starts (Def. 2), the "
        "other at u toward it u + 1 + (u + 2)^2 / 8 m, and 1 m: 6.375 m at 2 m/s. gap = 9 - 2 (tau - 1) = 6.375 at "
        "tau = 2.31, t = 3.31 s. The ego stands all the time, and the other takes more than its share.",
        (ego(0.0), ahead(10.0, 0.0, ((1.0, 0.0), (2.0, -2.0)), backs_up=True)),
        *("other", "other"),
        partner="leader",
        danger=3.3125,
        axis="longitudinal",
        response="longitudinal",
        kind="backing up",
    ),
    Scenario(
        "an object on the road",
        "It is 1 m long and lies 100 m ahead. As with a stalled car D(20, 0) = 66.375 m is left after 1.68 s.",
        (ego(), ahead(100.0, 0.0, name="object", length=1.0)),
        *("ego", ""),
        partner="object",
        danger=1.681,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "the leader pulls over and stops",
        "3 m/s^2 and 1 m/s to the right from 1 s on. gap = 50 - 1.5 tau^2, D = 66.375 - (20 - 3 tau)^2 / 16 = 41.375 + "
        "7.5 tau - 0.5625 tau^2: 0.9375 tau^2 + 7.5 tau = 8.625 at tau = 1.02, t = 2.02 s, 1 m to the side by then. An "
        "ego that goes on is there when 1.5 tau^2 = 50, tau = 5.8, and the other out of its lane since tau = 4.",
        (ego(), ahead(50.0, 20.0, from_second_one(-3.0), ((1.0, 5.0, 1.0),))),
        *("", ""),
        partner="leader",
        danger=2.019,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    Scenario(
        "secondary hit: the leader runs into a stalled car",
        "The leader is 60 m ahead at 20 m/s, the stalled car 35 m before it: they touch at 1.75 s, and a wreck may "
        "stop on "
        "the spot: D(20, 0) = 66.375 > 60 m at once. Here it slides, losing its speed by e every second, 20 m in all. "
        "With the shield the ego needs 52 m from 1.8 s on, and has 60 m and more. Without it touches, after 80 m at "
        "5.8 "
        "s: it has not braked, and the leader stopped shorter than with 8 m/s^2.",
        (ego(), ahead(60.0, 20.0), ahead(100.0, 0.0, name="stalled")),
        *("both", ""),
        partner="leader",
        danger=1.75,
        axis="longitudinal",
        response="longitudinal",
        kind=FOLLOWING,
    ),
    # ------------------------------------------------------------ somebody behind
    Scenario(
        "rear-ended while standing",
        "A car comes with 15 m/s from 100 m behind. D'(15, 0) = 16 + 289 / 8 + 1 = 53.125 m is left after 46.875 / "
        "15 = 3.125 s. It owes the braking; touched at 6.67 s.",
        (ego(0.0), behind(100.0, 15.0)),
        *("other", "other"),
        partner="follower",
        danger=3.125,
        axis="longitudinal",
        kind=BEHIND,
    ),
    Scenario(
        "tailgated",
        "5 m behind from the start, same speed: inherited danger. The ego owes no braking, and must not move "
        "toward it.",
        (ego(), behind(5.0, 20.0)),
        *("", ""),
        partner="follower",
        danger=0.0,
        axis="inherited",
        response="lateral",
        kind=BEHIND,
    ),
    Scenario(
        "the ego brakes and its follower does not",
        "60 m > D'(20, 20) = 57.5 m. The ego brakes with 8 m/s^2 from 1 s: 57.5 + 20 tau - 4 tau^2 = 60 - 4 tau^2 "
        "at tau = 0.125, t = 1.13 s. It may brake so; the follower, which goes on, is there after 85 / 20 = 4.25 s. "
        "With evasion it does not go on braking once it is in danger: speeding up with 2 m/s^2 it has what it lost, "
        "1.6 m/s and 0.6 m of 60 m by then, back within a second.",
        (ego(phases=from_second_one(-8.0)), behind(60.0, 20.0)),
        *("other", "other"),
        evaded="",
        partner="follower",
        danger=1.125,
        axis="longitudinal",
        kind=BEHIND,
    ),
    Scenario(
        "the ego brakes harder than allowed",
        "12 m/s^2 from 1 s, 60 m before a follower that does its worst within the rules: 2 m/s^2 for 1 s, then -4 "
        "m/s^2. It needs 21 + 22^2 / 8 = 81.5 m. The ego stops after 16.7 m: 76.7 m are too few. With the shield "
        "it brakes with 8 m/s^2 and stops after 25 m: 85 m. Danger: 57.5 + 43 tau - 8.5 tau^2 = 60 - 7 tau^2 at "
        "tau = 0.058, t = 1.06 s.",
        (ego(phases=from_second_one(-12.0)), behind(60.0, 20.0, ((1.0, 0.0), (2.0, 2.0), (FOREVER, -4.0)))),
        *("ego", ""),
        partner="follower",
        danger=1.058,
        axis="longitudinal",
        kind=BEHIND,
    ),
    Scenario(
        "a faster car comes up behind",
        "30 m/s, 150 m behind. D'(30, 20) = 31 + 128 - 25 + 1 = 135 m is left after 15 / 10 = 1.5 s; touched at 15 s. "
        "With evasion it speeds up with 2 m/s^2: it is as fast 5 s later, for which 25 m of 135 m go.",
        (ego(), behind(150.0, 30.0)),
        *("other", "other"),
        evaded="",
        partner="follower",
        danger=1.5,
        axis="longitudinal",
        seconds=16.0,
        kind=BEHIND,
    ),
    # ------------------------------------------------------------ cut-ins
    Scenario(
        "cut-in with room",
        "60 m ahead at the same speed, more than D(20, 20) = 41.375 m before, during and after: no danger.",
        (ego(), ahead(60.0, 20.0, sideways=((1.0, 3.0, 2.0),), y=LEFT, name="cutter")),
        *("", ""),
        partner="cutter",
        kind=CUT_IN,
    ),
    Scenario(
        "reckless cut-in at the same speed",
        "10 m ahead, 2 m/s across from 1 s on: E'(2) = 2 + 0.25 + 3.125 = 5.4 > 1.51 m, and along the lane it was "
        "never safe: danger at once, with the lateral axis safe last. The ego answers on both: it must not come "
        "closer, and brakes for who is in its way (H23). No contact either way.",
        (ego(), ahead(10.0, 20.0, sideways=((1.0, 3.0, 2.0),), y=LEFT, name="cutter")),
        *("", ""),
        partner="cutter",
        danger=1.0,
        axis="lateral",
        response="both",
        kind=CUT_IN,
    ),
    Scenario(
        "cut-in, then hard braking",
        "As before, and 8 m/s^2 from 4 s on. Without the shield the ego owes braking from 1.5 s on (H23) and does "
        "none, the other came closer than its share: both. With it the ego brakes from 1.1 s on; at 2.6 s it "
        "drives 14 m/s, D(14, 20) = 11.4 m, 14.5 m behind: safe, and so it stays. By the letter of Def. 10 it owes "
        "nothing along the lane and goes on: a contact, in which by our table (H23) it has a share.",
        (ego(), ahead(10.0, 20.0, ((4.0, 0.0), (FOREVER, -8.0)), ((1.0, 3.0, 2.0),), LEFT, "cutter")),
        *("both", ""),
        partner="cutter",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    Scenario(
        "a slower car cuts in",
        "15 m/s, 20 m ahead at the start, 2 m/s across from 1 s on: 15 m then, 3 s later nothing is left. Braking "
        "with 4 m/s^2 takes 5 m/s off within 5^2 / 8 = 3.1 m: no contact with the shield.",
        (ego(), ahead(20.0, 15.0, sideways=((1.0, 3.0, 2.0),), y=LEFT, name="cutter")),
        *("both", ""),
        partner="cutter",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    Scenario(
        "cut-in (UN R157)",
        "Ego 16, other 12 m/s and 20 m ahead; 1 m/s across from 1 s on: E'(1) = 2.375 > 1.51 m, D(16, 12) = 8.25 + "
        "36.125 - 9 + 1 = 36.4 > 16 m. 4 s later nothing would be left; 4^2 / 8 = 2 m are enough to brake.",
        (ego(16.0), ahead(20.0, 12.0, sideways=((1.0, 5.0, 1.0),), y=LEFT, name="cutter")),
        *("both", ""),
        partner="cutter",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    Scenario(
        "cut-in so close that nothing helps",
        "3 m ahead, 2 m/s across from 1 s on, 8 m/s^2 from 1.5 s on. The ego brakes from 1.1 s on and drives 18.4 "
        "m/s at 1.5 s, 3.3 m behind; 1.6 m/s slower, but it loses 4 m/s each second: 3.3 + 1.6 tau - 2 tau^2 = 0 "
        "at tau = 1.75, in its lane by then. It kept its response. Without the shield the contact is at 2.4 s, 0.9 "
        "s after braking was owed. "
        "With evasion it brakes with 8 m/s^2 from 1.1 s on, is 3.2 m/s slower at 1.5 s and stays slower, so the gap "
        "grows.",
        (ego(), ahead(3.0, 20.0, ((1.5, 0.0), (FOREVER, -8.0)), ((1.0, 3.0, 2.0),), LEFT, "cutter")),
        *("both", "other"),
        evaded="",
        partner="cutter",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    Scenario(
        "merging beside the ego",
        "From the right, 2 m ahead (centre to centre), 1 m/s across from 1 s on: 2 m to go, so contact at 3 s. "
        "Braking with 4 m/s^2 from 1.1 s on the ego is 5 m behind when 2 tau^2 = 3, tau = 1.22, t = 2.3 s: free.",
        (ego(), Car("merging", RIGHT, 2.0, 20.0, sideways=((1.0, 5.0, -1.0),))),
        *("both", ""),
        partner="merging",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    Scenario(
        "a slow car pulls out",
        "5 m/s on the right, 60 m ahead at the start, 1 m/s across from 1 s on: 45 m then, 3 s later nothing is "
        "left and it is in the lane. 15^2 / 8 = 28 m are enough to brake down to 5 m/s.",
        (ego(), Car("slow", RIGHT, 65.0, 5.0, sideways=((1.0, 5.0, -1.0),))),
        *("both", ""),
        partner="slow",
        danger=1.0,
        axis="lateral",
        response="both",
        literal="both",
        kind=CUT_IN,
    ),
    # ------------------------------------------------------------ somebody beside
    Scenario(
        "side by side",
        "0.82 < 1.51 m needed between cars that keep their lanes: no danger, though beside each other.",
        (ego(), Car("neighbour", LEFT, -1.0, 20.0)),
        *("", ""),
        partner="neighbour",
        kind=BESIDE,
    ),
    Scenario(
        "the neighbour drifts over",
        "0.3 m/s from 1 s on, 1 m behind: it needs E'(0.3) + E(0) + 0.35 = 0.87 + 0.09 + 0.35 = 1.31 m, and 1.51 - "
        "0.3 tau is left: tau = 0.67, t = 1.67 s. It touches at 2 m / 0.3 = 6.7 s later. The ego keeps its lane: "
        "that is all it owes. "
        "With evasion it drops behind: 6 m at 4 m/s^2 take sqrt(12 / 4) = 1.7 s, long before the 6.7 s.",
        (ego(), Car("neighbour", LEFT, -1.0, 20.0, sideways=((1.0, 12.0, 0.3),))),
        *("other", "other"),
        evaded="",
        partner="neighbour",
        danger=1.67,
        axis="lateral",
        response="lateral",
        kind=BESIDE,
    ),
    Scenario(
        "the ego drifts over",
        "0.3 m/s from 1 s on: E(0.3) + E'(0) + 0.35 = 0.36 + 0.375 + 0.35 = 1.09 m, 1.51 - 0.3 tau: tau = 1.4, t = "
        "2.4 s. Touched at 7.7 s; with the shield it stops moving sideways.",
        (ego(sideways=((1.0, 12.0, -0.3),)), Car("neighbour", LEFT, -1.0, 20.0)),
        *("ego", ""),
        partner="neighbour",
        danger=2.4,
        axis="lateral",
        response="lateral",
        kind=BESIDE,
    ),
    Scenario(
        "both drift toward each other",
        "0.3 m/s each from 1 s on: 0.36 + 0.87 + 0.35 = 1.58 > 1.51 m at once. Without the shield both, with it "
        "the other alone. "
        "With evasion it drops behind, within 1.7 s as above; 2 m across take 6.7 s.",
        (ego(sideways=((1.0, 12.0, -0.3),)), Car("neighbour", LEFT, -1.0, 20.0, sideways=((1.0, 12.0, 0.3),))),
        *("both", "other"),
        evaded="",
        partner="neighbour",
        danger=1.0,
        axis="lateral",
        response="lateral",
        kind=BESIDE,
    ),
    Scenario(
        "squeezed from both sides",
        "Neighbours on either side drift over as the one above: t = 1.67 s with each. No duty toward one "
        "contradicts the other: the ego keeps its lane. "
        "With evasion it drops behind both within 1.7 s.",
        (
            ego(),
            Car("left", LEFT, -1.0, 20.0, sideways=((1.0, 12.0, 0.3),)),
            Car("right", RIGHT, -1.0, 20.0, sideways=((1.0, 12.0, -0.3),)),
        ),
        *("other", "other"),
        evaded="",
        partner="left",
        danger=1.67,
        axis="lateral",
        response="lateral",
        kind=BESIDE,
    ),
    # ------------------------------------------------------------ the ego changes lanes
    Scenario(
        "the ego changes lanes into a neighbour",
        "2 m/s across from 1 s on, E(2) = 3.59 > 1.51 m: danger at once. Without the shield it touches 1 s later.",
        (ego(sideways=((1.0, 3.0, -2.0),)), Car("neighbour", LEFT, -1.0, 20.0)),
        *("ego", ""),
        partner="neighbour",
        danger=1.0,
        axis="lateral",
        response="lateral",
        kind=CHANGE,
    ),
    Scenario(
        "the ego cuts in before a faster car",
        "25 m/s in the left lane, 15 m behind at the start. D'(25, 20) = 26 + 91.1 - 25 + 1 = 93 m, never safe "
        "along the lane; 2 m/s across from 1 s on: danger at once, the lateral axis safe last. What is left, 10 m, "
        "is gone 2 s later. The ego came closer than its share; the other keeps its lane, which is all it owed.",
        (ego(sideways=((1.0, 3.0, -2.0),)), behind(15.0, 25.0, y=LEFT)),
        *("ego", ""),
        partner="follower",
        danger=1.0,
        axis="lateral",
        response="lateral",
        kind=CHANGE,
    ),
    Scenario(
        "the ego changes lanes with room",
        "80 m before a car of the same speed: D'(20, 20) = 57.5 m. No danger, and nothing to take back.",
        (ego(sideways=((1.0, 3.0, -2.0),)), behind(80.0, 20.0, y=LEFT)),
        *("", ""),
        partner="follower",
        kind=CHANGE,
    ),
    Scenario(
        "the ego changes lanes behind a slow car",
        "10 m/s in the left lane, 40 m ahead at the start: 30 m at 1 s, D(20, 10) = 60.1 m. 2 m/s across from 1 s "
        "on: danger at once. Without the shield touched when 40 - 10 t = 0, at 4 s. With it the ego stays in its "
        "lane.",
        (ego(sideways=((1.0, 3.0, -2.0),)), ahead(40.0, 10.0, y=LEFT, name="slow")),
        *("ego", ""),
        partner="slow",
        danger=1.0,
        axis="lateral",
        response="lateral",
        kind=CHANGE,
    ),
    Scenario(
        "the ego returns too early after overtaking",
        "25 m/s, 5 m before a car of 20 m/s in the right lane: D'(20, 25) = 21 + 60.5 - 39.1 + 1 = 43.4 m. 2 m/s "
        "across from 1 s on, 10 m ahead by then: danger at once, but the gap grows: no contact either way.",
        (ego(25.0, sideways=((1.0, 3.0, 2.0),)), behind(5.0, 20.0, y=RIGHT)),
        *("", ""),
        partner="follower",
        danger=1.0,
        axis="lateral",
        response="lateral",
        kind=CHANGE,
    ),
    # ------------------------------------------------------------ somebody comes the other way
    Scenario(
        "meeting on a two-way road",
        "Each in its own lane: 0.82 < 1.51 m. No danger.",
        (ego(15.0), oncoming(150.0, 15.0, y=LEFT)),
        *("", ""),
        partner="oncoming",
        lanes=TWO_WAY,
        kind=HEAD_ON,
    ),
    Scenario(
        "a wrong-way driver that does not brake",
        "15 m/s each, 150 m apart. The ego is in its lane: 7.5 + 0.25 + 16^2 / 6 = 50.4 m; the other: 15 + 1 + "
        "17^2 / 8 = 52.1 m; with 1 m 103.5 m, left after 46.5 / 30 = 1.55 s. The ego stops, and is hit.",
        (ego(15.0), oncoming(150.0, 15.0)),
        *("both", "other"),
        partner="oncoming",
        danger=1.549,
        axis="longitudinal",
        response="longitudinal",
        lanes=TWO_WAY,
        kind=HEAD_ON,
    ),
    Scenario(
        "a wrong-way driver that brakes in time",
        "As before, but 4 m/s^2 from 2.4 s on. Sampling costs 2 15 0.05 = 1.5 m and boxes 0.2 m: danger at 1.49 s, "
        "so 1.4 s is the last safe sample, and 1 s later is in time. It stands after 36 + 28.1 = 64.1 m. An ego "
        "that goes on is alone at fault; with the shield it stands after 1.6 15 + 28.1 = 52 m and a frame: 117 < "
        "150 m.",
        (ego(15.0), oncoming(150.0, 15.0, ((2.4, 0.0), (FOREVER, -4.0)))),
        *("ego", ""),
        partner="oncoming",
        danger=1.549,
        axis="longitudinal",
        response="longitudinal",
        lanes=TWO_WAY,
        kind=HEAD_ON,
    ),
    Scenario(
        "the ego overtakes into oncoming traffic",
        "It drives in the lane of the other, which counts on b_correct: ego 7.75 + 16^2 / 8 = 39.75 m, other 16 + "
        "17^2 / 6 = 64.2 m; with 1 m 104.9 m, left after 45.1 / 30 = 1.5 s. The other brakes with 3 m/s^2 from 2.4 "
        "s on, as it must from 1 s after the last safe sample on. The ego is to blame if it goes on; with the "
        "shield it stands after 1.6 15 + 28.1 = 52 m, the other after 36 + 37.5 = 73.5 m: 126 < 150 m.",
        (ego(15.0, y=LEFT), oncoming(150.0, 15.0, ((2.4, 0.0), (FOREVER, -3.0)), y=LEFT)),
        *("ego", ""),
        partner="oncoming",
        danger=1.503,
        axis="longitudinal",
        response="longitudinal",
        lanes=PASSING,
        kind=HEAD_ON,
    ),
)
