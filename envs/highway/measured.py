"""The measures of an episode on highway-env: they change nothing, and cost nothing where nobody asks for them."""

from typing import Any

import numpy as np

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import LANES
from rss_shield.shield.risk.meter import EpisodeMeter
from rss_shield.shield.verdicts import KEPT

CAUSES = ("ego", "other", "nobody")


class EgoMeter:
    """Looks at an ego once per frame, after its shield.

    `violation` counts the time with a dangerous pair, by who has broken a duty of it until then: the ego, the other, or
    nobody yet. Danger is counted where distances along lanes keep the ego safe; both may have broken theirs.
    """

    def __init__(self, ego: ShieldedEgo) -> None:
        self.meter = EpisodeMeter(ego.settings.table.dt, ego.settings.scheme != LANES)
        self.violation = dict.fromkeys(CAUSES, 0.0)
        self.spent, self.frames = 0.0, 0  # by the shield [s]
        self.touched = False

    def look(self, ego: ShieldedEgo, spent: float) -> None:
        """Take in one frame; `spent`: time that the shield took for it [s]."""
        self.spent, self.frames = self.spent + spent, self.frames + 1
        there = ego.witness
        boxes = np.array([(v.LENGTH, v.WIDTH) for v in [*there.others, there.vehicle]])
        self.meter.look(there.poses, boxes)
        judge = ego.judge
        if judge.settings.scheme == LANES:
            dangerous = judge.memory["since"] > 0
            ego_broke, other_broke = (judge.memory[name] != KEPT for name in ("ego_broke", "other_broke"))
            for cause, who in (("ego", ego_broke), ("other", other_broke), ("nobody", ~(ego_broke | other_broke))):
                if (dangerous & who).any():
                    self.violation[cause] += judge.settings.table.dt

    def info(self, ego: ShieldedEgo) -> dict[str, Any]:
        """What infos say since reset; see `ShieldWrapper`."""
        contact, there = ego.judge.contact, ego.witness
        if contact is not None and not self.touched and len(there.poses) > 1:
            self.touched = True
            partners = [i for i in range(len(there.others)) if there._index_on_road(i) == contact["partner"]]
            if partners:
                self.meter.touch(there.poses, partners[0])
        return {
            **self.meter.measures._asdict(),
            **{f"violation_{cause}": seconds for cause, seconds in self.violation.items()},
            "shield_time": self.spent / max(self.frames, 1),
        }
