"""Who was to blame? Read a log of two cars in one lane, frame by frame, and ask the judge.

    python examples/judge_a_log.py

The log has positions [m] and speeds [m/s] of frames of 0.5 s. Both cars are 5 m long.
"""

import numpy as np

from rss_shield.shield import PRESETS, Rules, table_for
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.judge import judge_contact, judge_frame
from rss_shield.shield.lanes.memory import MEMORY, remember
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.verdicts import DUTIES, VERDICTS

DT = 0.5
LOG = {  # the ego drives on while the other brakes to rest
    "ego": ([0, 12.5, 25, 37.5, 50, 62.5, 75, 87.5, 100, 112.5, 125, 137.5, 150], [25] * 13),
    "other": ([125, 135, 143, 149, 153, 155, *[155] * 7], [20, 16, 12, 8, 4, *[0] * 8]),
}
table = table_for(PRESETS["slides"], Rules(overlap_margin=0.0), DT)


def car(name: str, frame: int) -> np.ndarray:
    """A road user in the middle of the lane; `along` is its speed over the frame before."""
    record, (s, speed) = np.zeros(1, ROAD_USER), LOG[name]
    record["s"], record["speed"], record["cos"], record["around"] = s[frame], speed[frame], 1.0, np.inf
    record["along"] = (s[frame] - s[frame - 1]) / DT if frame else speed[frame]
    record["half_length"], record["half_width"], record["in_own_lane"] = 2.5, 1.0, True
    return record


memory = np.zeros(1, MEMORY)
for frame in range(13):
    ego, users = car("ego", frame)[0], car("other", frame)
    pair = assess(ego, users[0], table)
    print(f"{frame * DT:.1f} s: gap {pair.gap_lon:5.1f} m, {-pair.margin_lon:6.1f} m short of what is safe")
    if pair.gap_lon <= 0.0:
        found = judge_contact(ego, users[0], memory[0], table)
        print(f"blame: {VERDICTS[found.verdict]}")
        print(f"the ego: {DUTIES[found.ego_duty] or 'kept its duty'}")
        print(f"the other: {DUTIES[found.other_duty] or 'kept its duty'}")
        break
    remember(memory[0], pair, ego, users[0], DT)
    command = Command((LOG["ego"][1][frame + 1] - ego["speed"]) / DT, 0.0)
    judge_frame(ego, users, memory, command, 0.0, table)
