"""Add a baseline of your own and measure it by the same judge: a rule of two seconds beside the shield.

python examples/baseline.py
"""

import gymnasium as gym
import pandas as pd

from rss_shield import ShieldWrapper, make
from rss_shield.eval.rollout import run_episode
from rss_shield.eval.stats import wilson

FASTER, SLOWER, HEADWAY, EPISODES = 3, 4, 2.0, 5


class TwoSeconds(gym.ActionWrapper):
    """Slow down where the car ahead in the own lane is less than two seconds away."""

    def action(self, action):
        env = self.env.unwrapped
        leader, _ = env.road.neighbour_vehicles(env.vehicle)
        if leader is None:
            return action
        gap = env.vehicle.lane_distance_to(leader) - leader.LENGTH
        return SLOWER if gap < HEADWAY * env.vehicle.speed else action


ARMS = {
    "no filter": lambda: make("highway-fast-v0", "monitor"),  # a monitor judges and changes nothing
    "two seconds": lambda: TwoSeconds(ShieldWrapper(make("highway-fast-v0", None), mode="monitor")),
    "the shield": lambda: make("highway-fast-v0", "override"),
}
for name, make_env in ARMS.items():
    records = pd.DataFrame([run_episode(make_env, lambda observation: FASTER, seed) for seed in range(EPISODES)])
    faults = int(records["blame"].isin(["ego", "both"]).sum())
    high = wilson(faults, EPISODES).high
    print(f"{name}: at fault in {faults} of {EPISODES} (95 % below {high:.0%}), return {records['return'].mean():.1f}")
