"""Of the contacts that others are to blame for, how many could the ego have avoided?

    python bench/avoidable.py                       hostile drivers x policies x motorways, with and without H23
    python bench/avoidable.py --seeds 5 --drivers overtaker companion

For every contact with the verdict `other` or `inherited` under the shield, the episode is taken up again three seconds
before, from a copy of everything, everybody else as hostile as ever: once with the ego braking at a_max_brake in its
lane, once with the ego staying in its lane at its speed. A contact counts as avoidable if one of the two touches
nobody until a second after. That is hindsight: three seconds before there need not have been any danger.
"""

import copy
import itertools
import sys
import warnings
from collections import Counter, deque
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro

from rss_shield import Rules, make
from rss_shield.envs.highway.hostile import HOSTILE
from rss_shield.eval.files import atomic
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.stats import wilson

ENVIRONMENTS = ("highway-fast-v0", "merge-v0", "two-way-v0", "u-turn-v0")
BEFORE, AFTER = 3.0, 1.0  # [s]
LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER = range(5)
POLICIES = {"faster": (FASTER,), "idle": (IDLE,), "random": tuple(range(5)), "lanes": (LANE_LEFT, LANE_RIGHT)}
LAWS = {"with H23": Rules(), "by the letter": Rules(present_duties=False)}


def play(env_id: str, driver: str, policy: str, seed: int, rules: Rules) -> dict[str, Any]:
    """One episode; if others are to blame for a contact, whether braking or staying in lane would have avoided it."""
    config: dict[str, Any] = {"other_vehicles_type": HOSTILE[driver], "policy_frequency": 1}
    if env_id.startswith("highway"):
        config |= {"vehicles_count": 8, "vehicles_density": 1.5, "lanes_count": 3}
    env = make(env_id, config=config, rules=rules)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    past = deque([copy.deepcopy(env)], maxlen=int(BEFORE) + 1)
    ended, info = False, {"blame": ""}
    while not ended and not info["blame"]:
        *_, terminated, truncated, info = env.step(int(rng.choice(POLICIES[policy])))
        ended = terminated or truncated
        past.append(copy.deepcopy(env))
    row = dict(
        env_id=env_id, driver=driver, policy=policy, seed=seed, blame=info["blame"], braking=False, staying=False
    )
    if info["blame"] in ("other", "inherited"):
        # the last copy is of the moment after the contact; how long after, the decision hides
        row["braking"] = _is_avoided(copy.deepcopy(past[0]), len(past) - 1, -env.settings.table.ego.a_max_brake)
        row["staying"] = _is_avoided(copy.deepcopy(past[0]), len(past) - 1, 0.0)
    return row


def _is_avoided(env: Any, seconds: int, acceleration: float) -> bool:
    """Does an ego that keeps its lane and this acceleration from now on touch nobody?"""
    base = env.unwrapped
    ego, dt = base.vehicle, 1 / base.config["simulation_frequency"]
    lane = ego.lane_index

    def act(action: Any = None) -> None:
        ego.target_lane_index = lane
        ego.follow_road()
        steering = float(ego.steering_control(ego.target_lane_index))
        ego.action = {"steering": steering, "acceleration": max(acceleration, -max(ego.speed, 0.0) / dt)}

    ego.act = act
    for _ in range(int((seconds + AFTER) / dt)):
        base.road.act()
        base.road.step(dt)
        if ego.crashed:
            return False
    return True


def main(
    environments: tuple[str, ...] = ENVIRONMENTS,
    drivers: tuple[str, ...] = tuple(HOSTILE),
    policies: tuple[str, ...] = tuple(POLICIES),
    seeds: int = 3,
    out: Path = Path("runs/avoidable.csv"),
) -> None:
    """Play and print a table."""
    warnings.filterwarnings("ignore")
    rows = []
    cases = list(itertools.product(LAWS, environments, drivers, policies, range(seeds)))
    with progress_bar(len(cases), "episodes", "episode") as bar:
        for law, env_id, driver, policy, seed in cases:
            rows.append({"law": law, **play(env_id, driver, policy, seed, LAWS[law])})
            bar.update(1)
    table = pd.DataFrame(rows)
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic(out) as file:
        table.to_csv(file, index=False)
    for law, played in table.groupby("law"):
        print(f"{law}: {len(played)} episodes, {dict(Counter(played['blame']))}")
        hit = played[played["blame"].isin(["other", "inherited"])]
        for driver, some in hit.groupby("driver"):
            avoidable = int((some["braking"] | some["staying"]).sum())
            interval = wilson(avoidable, len(some))
            print(
                f"  {driver:14s} contacts {len(some):4d}, avoidable {avoidable:3d}"
                f" [{100 * interval.low:.0f}, {100 * interval.high:.0f}] %: by braking {int(some['braking'].sum())},"
                f" by staying in lane {int(some['staying'].sum())}"
            )


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
