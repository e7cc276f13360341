"""Who is nearest to an ego in each direction along lanes, and how much room it needs there."""

import numpy as np

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.shield.lanes.pair import assess
from rss_shield.shield.trace import SIDES


def around(shield: ShieldedEgo) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The nearest in each of SIDES on the last frame, where distances along lanes keep an ego safe.

    Returns:
      `[4]` gap and required gap, bumper to bumper [m], NaN where nobody is; `[4]` index among the shield's `others`,
      -1 = nobody.
    """
    ego, users = shield.last
    gap, required, nearest = np.full(4, np.nan), np.full(4, np.nan), np.full(4, -1)
    if not len(users):
        return gap, required, nearest
    ds, dy = users["s"] - ego["s"], users["y"] - ego["y"]
    lon = np.abs(ds) - ego["half_length"] - users["half_length"]
    lat = np.abs(dy) - ego["half_width"] - users["half_width"]
    in_lane, alongside = lat < 0.0, (lon < 0.0) & (lat >= 0.0)
    sides = (
        (in_lane & (ds >= 0.0), lon),
        (in_lane & (ds < 0.0), lon),
        (alongside & (dy < 0.0), lat),
        (alongside & (dy >= 0.0), lat),
    )
    for k, (among, distance) in enumerate(sides):
        if not among.any():
            continue
        i = int(np.argmin(np.where(among, distance, np.inf)))
        pair = assess(ego, users[i], shield.settings.table)
        along = SIDES[k] in ("ahead", "behind")
        gap[k] = pair.gap_lon if along else pair.gap_lat
        required[k] = gap[k] - (pair.margin_lon if along else pair.margin_lat)
        nearest[k] = i
    return gap, required, nearest
