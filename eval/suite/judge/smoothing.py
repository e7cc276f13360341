"""Accelerations of a log that has none, and how far to trust them.

Positions are smoothed by a Savitzky-Golay filter (Savitzky, Golay, Analytical Chemistry 1964): in a window around every
sample a polynomial is fitted by least squares, and its derivatives there are speed and acceleration. The filter is
linear, so noise of standard deviation sigma in positions becomes sigma times the norm of the filter's coefficients in
whatever it estimates. Sigma is what is left of the positions after the fit.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from rss_shield.shield.trace import Trace, stretches
from rss_shield.shield.verdicts import DUTIES

WINDOW = 1.1  # length of the fit: long enough for NGSIM's noise, short enough to see a braking begin [s]
ORDER = 3
SURE = 3.0  # standard deviations beyond which a broken duty is no noise: a log has many samples


class Noise(NamedTuple):
    """Standard deviations of what a log says, or what was estimated from it; 0 = exact."""

    position: float = 0.0  # [m]
    speed: float = 0.0  # [m/s]
    acceleration: float = 0.0  # [m/s^2]


EXACT = Noise()


def sigma_of(duty: int, noise: Noise) -> float:
    """Standard deviation of what a duty is measured in."""
    text = DUTIES[duty]
    if text.endswith("[m/s^2]"):
        return noise.acceleration
    return noise.speed if text.endswith("[m/s]") else noise.position if text.endswith("[m]") else 0.0


def window_of(dt: float, samples: int) -> int:
    """Samples of a fit: odd, more than the order, and no more than there are."""
    return min(full_window(dt), samples if samples % 2 else samples - 1)


def full_window(dt: float) -> int:
    """Samples of a fit where there are enough."""
    return max(round(WINDOW / dt) | 1, ORDER + 2 | 1)


def derivative(values: np.ndarray, dt: float, order: int) -> np.ndarray:
    """Derivative of a series `[T]` without gaps by a fit around every sample; order 0 = the smoothed series."""
    window = window_of(dt, len(values))
    if window <= ORDER:  # too short for a fit
        for _ in range(order):
            values = np.gradient(values, dt) if len(values) > 1 else np.zeros_like(values)
        return values
    return savgol_filter(values, window, ORDER, deriv=order, delta=dt)


def filled_in(trace: Trace) -> tuple[Trace, Noise]:
    """The trace with accelerations where it has none, and how exact they are.

    Positions of whom that is done for are smoothed as well: from one sample to the next noise moves everybody across
    the lane faster than any car drives.
    """
    u = trace.users
    unknown = np.isnan(u.acceleration) & u.present
    unknown[-1] = False  # nobody knows what follows
    if not unknown.any():
        return trace, EXACT
    acceleration, x, y = u.acceleration.copy(), u.x.copy(), u.y.copy()
    along: list[np.ndarray] = []
    across: list[np.ndarray] = []
    for i in np.flatnonzero(unknown.any(axis=0)):
        for start, end in stretches(u.present[:, i]):
            raw = u.x[start:end, i], u.y[start:end, i]
            cos, sin = np.cos(u.heading[start:end, i]), np.sin(u.heading[start:end, i])
            forward = derivative(raw[0], trace.dt, 2) * cos + derivative(raw[1], trace.dt, 2) * sin
            v = u.speed[start:end, i]  # the fit goes on braking a little after a car has come to rest
            forward[:-1] = np.maximum(forward[:-1], (np.minimum(v[1:], 0.0) - v[:-1]) / trace.dt)
            mine = unknown[start:end, i]
            acceleration[start:end, i][mine] = forward[mine]
            smooth = derivative(raw[0], trace.dt, 0), derivative(raw[1], trace.dt, 0)
            x[start:end, i], y[start:end, i] = smooth
            if end - start > full_window(trace.dt):  # what a shorter fit leaves over is another share of the noise
                dx, dy = raw[0] - smooth[0], raw[1] - smooth[1]
                along.append(dx * cos + dy * sin)
                across.append(dy * cos - dx * sin)
    noise = max(noise_of(along, trace.dt), noise_of(across, trace.dt))
    return trace.replaced(users=replace(u, acceleration=acceleration, x=x, y=y)), noise


def noise_of(left: list[np.ndarray], dt: float) -> Noise:
    """Standard deviations by what a fit has left over of positions."""
    if not left:
        return EXACT
    window = full_window(dt)
    share = 1.0 - savgol_coeffs(window, ORDER)[window // 2]  # of the noise's variance that a fit leaves
    sigma = float(np.sqrt(np.mean(np.concatenate(left) ** 2) / share))
    speed, acceleration = (
        float(np.linalg.norm(savgol_coeffs(window, ORDER, deriv=order, delta=dt))) * sigma for order in (1, 2)
    )
    return Noise(sigma, speed, acceleration)
