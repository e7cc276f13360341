"""How a ride feels: accelerations and jerk of the ego, frame by frame, in constant memory.

Everything is a difference of the ego's speed and heading on successive frames, so it is what the car did and not what
was commanded: with dt the length of a frame,

    a = dv / dt        lateral a = v * yaw rate        jerk = da / dt        yaw acceleration = d(yaw rate) / dt

Sums give root mean squares; a histogram of sizes gives the 99 % quantile, to within the width of a bin (`WIDTHS`).
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, records
from rss_shield.shield.geometry import wrap_angle

A, JERK, LAT_A, LAT_JERK, YAW_A = range(5)  # the quantities measured
WIDTHS = np.array([0.05, 0.25, 0.05, 0.25, 0.05])  # of the bins [m/s^2], [m/s^3], [m/s^2], [m/s^3], [rad/s^2]
BINS = 512  # the last one holds whatever is larger

# What nuPlan counts as a comfortable ride.
LEAST_A, MOST_A, MOST_JERK, MOST_LAT_A, MOST_YAW_A = -4.05, 2.40, 4.13, 4.89, 1.93
HARD = -3.0  # braking harder than this is hard [m/s^2]
LONGEST_GAP = 100.0  # time gaps are reported up to this [s] ...
FOLLOWING = 5.0  # ... and averaged over the frames on which they are shorter than this

# What is remembered of a ride. A new record is all zeros.
RIDE = records(
    [
        ("samples", "i8"),  # taken in since reset
        ("speed", "f8"),  # on the last one [m/s]
        ("heading", "f8"),  # [rad]
        ("yaw_rate", "f8"),  # [rad/s]
        ("acceleration", "f8"),  # between the last two [m/s^2]
        ("lateral", "f8"),
        ("squares", "f8", (5,)),  # sums of the squares of what is measured
        ("counts", "i4", (5, BINS)),  # histograms of sizes
        ("bin", "i8", (5,)),  # in which the 99 % quantile lies
        ("above", "i8", (5,)),  # how many are in higher ones
        ("uncomfortable", "i8"),  # frames outside nuPlan's bounds
        ("hard", "i8"),  # frames of hard braking
        ("brakings", "i8"),  # how often that began
        ("distance", "f8"),  # [m]
        ("least_gap", "f8"),  # time gap to the car ahead [s]; 0 = nobody was ahead yet
        ("sum_of_gaps", "f8"),
        ("gaps", "i8"),  # frames behind a car ahead
    ]
)


class Comfort(NamedTuple):
    """Of a ride so far. 0 where nothing was measured yet."""

    rms_acceleration: float  # along the car [m/s^2]
    rms_jerk: float  # [m/s^3]
    rms_lateral_acceleration: float
    rms_lateral_jerk: float
    rms_yaw_acceleration: float  # [rad/s^2]
    p99_acceleration: float  # 99 % of the frames have no more, braking included
    p99_jerk: float
    p99_lateral_acceleration: float
    p99_lateral_jerk: float
    p99_yaw_acceleration: float
    comfortable_share: float  # frames inside nuPlan's bounds on all axes [1]
    hard_braking_share: float  # frames that brake harder than 3 m/s^2 [1]
    hard_brakings_per_km: float  # how often that begins [1/km]
    min_time_gap: float  # to the car ahead in the ego's way [s]; 100 if there was none
    mean_time_gap: float  # over the frames with less than 5 s; 100 if there were none


@inner
def start_ride(ride):
    """Forget how the ride felt."""
    ride.samples = ride.uncomfortable = ride.hard = ride.brakings = ride.gaps = 0
    ride.distance = ride.least_gap = ride.sum_of_gaps = 0.0
    for quantity in range(len(ride.squares)):
        ride.squares[quantity] = 0.0
        ride.bin[quantity] = ride.above[quantity] = 0
        for b in range(ride.counts.shape[1]):
            ride.counts[quantity, b] = 0


@compiled
def ride_on(ride, speed, heading, gap, dt):
    """Take in one sample of a ride, in place.

    Args:
      ride: RIDE.
      speed, heading: of the ego [m/s], [rad].
      gap: to the car ahead in its way, inf = nobody [m].
      dt: time since the last sample [s].
    """
    if ride.samples > 0:
        acceleration = (speed - ride.speed) / dt
        yaw_rate = wrap_angle(heading - ride.heading) / dt
        lateral = ride.speed * yaw_rate
        ride.distance += abs(ride.speed) * dt
        _count(ride, A, acceleration)
        _count(ride, LAT_A, lateral)
        is_hard = acceleration < HARD
        ride.hard += is_hard
        ride.brakings += is_hard and not (ride.samples > 1 and ride.acceleration < HARD)
        comfortable = LEAST_A <= acceleration <= MOST_A and abs(lateral) <= MOST_LAT_A
        if ride.samples > 1:
            jerk, yaw_acceleration = (acceleration - ride.acceleration) / dt, (yaw_rate - ride.yaw_rate) / dt
            _count(ride, JERK, jerk)
            _count(ride, LAT_JERK, (lateral - ride.lateral) / dt)
            _count(ride, YAW_A, yaw_acceleration)
            comfortable = comfortable and abs(jerk) <= MOST_JERK and abs(yaw_acceleration) <= MOST_YAW_A
        ride.uncomfortable += not comfortable
        ride.acceleration, ride.lateral, ride.yaw_rate = acceleration, lateral, yaw_rate
    ride.samples += 1
    ride.speed, ride.heading = speed, heading
    if speed > 0.0 and gap < LONGEST_GAP * speed:
        time_gap = max(gap / speed, 1e-3)
        ride.least_gap = time_gap if ride.least_gap == 0.0 else min(ride.least_gap, time_gap)
        if time_gap < FOLLOWING:
            ride.sum_of_gaps += time_gap
            ride.gaps += 1


@inner
def _count(ride, quantity, value):
    """Take in one value, and move on to the bin that now holds the 99 % quantile."""
    ride.squares[quantity] += value * value
    b = int(min(abs(value) / WIDTHS[quantity], BINS - 1.0))
    ride.counts[quantity, b] += 1
    q, above = ride.bin[quantity], ride.above[quantity] + (b > ride.bin[quantity])
    n = ride.samples - (quantity in (JERK, LAT_JERK, YAW_A))
    while 100 * above > n:
        q += 1
        above -= ride.counts[quantity, q]
    while q > 0 and 100 * (above + ride.counts[quantity, q]) <= n:
        above += ride.counts[quantity, q]
        q -= 1
    ride.bin[quantity], ride.above[quantity] = q, above


@compiled
def comfort_of(ride):
    """`Comfort` of a RIDE so far."""
    n = max(ride.samples - 1, 1)
    m = max(ride.samples - 2, 1)
    squares, bins = ride.squares, ride.bin
    measured, twice = ride.samples > 1, ride.samples > 2
    return Comfort(
        np.sqrt(squares[A] / n),
        np.sqrt(squares[JERK] / m),
        np.sqrt(squares[LAT_A] / n),
        np.sqrt(squares[LAT_JERK] / m),
        np.sqrt(squares[YAW_A] / m),
        (bins[A] + 1) * WIDTHS[A] if measured else 0.0,
        (bins[JERK] + 1) * WIDTHS[JERK] if twice else 0.0,
        (bins[LAT_A] + 1) * WIDTHS[LAT_A] if measured else 0.0,
        (bins[LAT_JERK] + 1) * WIDTHS[LAT_JERK] if twice else 0.0,
        (bins[YAW_A] + 1) * WIDTHS[YAW_A] if twice else 0.0,
        1.0 - ride.uncomfortable / n,
        ride.hard / n,
        1000.0 * ride.brakings / ride.distance if ride.distance > 0.0 else 0.0,
        ride.least_gap if ride.least_gap > 0.0 else LONGEST_GAP,
        ride.sum_of_gaps / ride.gaps if ride.gaps > 0 else LONGEST_GAP,
    )


@compiled
def gap_ahead(ego, users, boxes):
    """Gap to the nearest road user ahead in the way of the ego, by their boxes as they stand in the lane [m].

    Args:
      ego: `ROAD_USER` record, users: `[N]` of them.
      boxes: `[N + 1, 2+]` length and width of each, the ego last [m].
    """
    nearest, last = np.inf, len(users)
    for i in range(last):
        along, across = users[i].s - ego.s, users[i].y - ego.y
        nearest = min(nearest, gap_in_way(along, across, boxes[last, 0] + boxes[i, 0], boxes[last, 1] + boxes[i, 1]))
    return nearest


@compiled
def gap_in_way(along, across, lengths, widths):
    """Gap along the lane to somebody ahead whose box overlaps with the ego's across it, else inf [m].

    Args:
      along, across: from centre to centre [m].
      lengths, widths: of both boxes, added up [m].
    """
    if along < 0.0 or 2.0 * abs(across) >= widths:
        return np.inf
    return along - 0.5 * lengths
