"""Risk of a whole scene: the sum of all sources, and the one that matters most."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.risk.classes import KNOWN_SAFE, classify
from rss_shield.shield.risk.markings import marking_risk
from rss_shield.shield.risk.standard import risk_of


class SceneRisk(NamedTuple):
    """Risk of one scene. Thresholds are made for one source, so classes come from the critical one.

    The critical source is that of the worst class and, among those, of the largest RDSI relative to its upper
    threshold.
    """

    rdsi: float  # of the critical source; 0 if nobody is in range
    lower: float  # RDSI1* of the critical source; 1 if nobody is in range
    upper: float  # RDSI2* likewise
    state: int  # class of the critical source: index into `STATES`
    critical: int  # its index, -1 if nobody is in range
    largest: float  # largest RDSI of one source
    total: float  # sum of RDSI over all sources and markings
    state_of_total: int  # class of that sum between the thresholds of the critical source
    markings: float  # part of the sum that is due to lane markings
    energy: float  # SPE, sum over road users
    rate: float  # dSPE/dt likewise
    dsi: float  # DSI likewise


@compiled
def scene_risk(ego, sources, lines, lane_change, settings, who=None, rdsi=None):
    """`SceneRisk` ((5)-(7) of the paper, with a standard for each source).

    Args:
      ego: `SOURCE` record.
      sources: `[N]` `SOURCE` records of everybody else.
      lines: `[L]` `MARKING` records.
      lane_change: does the ego change lanes? Thresholds are those of a lane change then.
      settings: `RiskSettings`; whoever is beyond `farthest` is left out.
      who: `[K]` indices of the sources to look at, if not all.
      rdsi: `[N]`, filled in: RDSI of each source looked at, nan for others.
    """
    if rdsi is not None:
        rdsi[:] = np.nan
    energy = rate = dsi = total = 0.0
    critical, state, largest = -1, KNOWN_SAFE, -np.inf
    worst, lower, upper = 0.0, 1.0, 1.0
    for a in range(how_many(who, sources)):
        i = which(who, a)
        if _is_far(ego, sources[i], settings):
            continue
        risk = risk_of(ego, sources[i], lane_change, settings)
        energy += risk.energy
        rate += risk.rate
        dsi += risk.dsi
        total += risk.rdsi
        largest = max(largest, risk.rdsi)
        here = classify(risk.rdsi, risk.lower, risk.upper)
        if critical < 0 or here > state or (here == state and risk.rdsi * upper > worst * risk.upper):
            critical, state, worst, lower, upper = i, here, risk.rdsi, risk.lower, risk.upper
        if rdsi is not None:
            rdsi[i] = risk.rdsi
    markings = 0.0
    for k in range(len(lines)):
        markings += marking_risk(lines[k], settings).rdsi
    total += markings
    return SceneRisk(
        worst,
        lower,
        upper,
        state,
        critical,
        largest if critical >= 0 else 0.0,
        total,
        classify(total, lower, upper),
        markings,
        energy,
        rate,
        dsi,
    )


@inner
def _is_far(ego, source, settings):
    dx, dy = ego.x - source.x, ego.y - source.y
    return dx * dx + dy * dy > settings.farthest * settings.farthest


@compiled
def neighbours(ahead, beside, lane_width, toward, out):
    """The nearest road users ahead and behind in the ego's lane and the adjacent ones: six at most.

    For a lane change these are the leader in its own lane, and leader and follower in the lane that it goes to.

    Args:
      ahead, beside: `[N]` of each from the ego along its lane and across it, centre to centre [m].
      lane_width: [m] across which a lane begins and ends.
      toward: 0, or the side of the lane that the ego changes to: the sign of `beside` there.
      out: `[6]` indices, filled in.

    Returns:
      How many there are.
    """
    count = 0
    for lane in range(-1, 2):
        for front in (True, False):
            if toward != 0 and not (lane == toward or (lane == 0 and front)):
                continue
            nearest, found = np.inf, -1
            for i in range(len(ahead)):
                across = beside[i] / lane_width - lane
                there = -0.5 < across <= 0.5 and (ahead[i] >= 0.0) == front
                if there and abs(ahead[i]) < nearest:
                    nearest, found = abs(ahead[i]), i
            if found >= 0:
                out[count] = found
                count += 1
    return count
