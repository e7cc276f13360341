"""A cost beside the reward, as OmniSafe and Safety-Gymnasium have it: six values a step, and a multiplier that learns.

`info["cost"]` is 1 in a decision in which the ego breaks its proper response or a contact is its fault.

python examples/cost_key.py
"""

import gymnasium as gym
import numpy as np

from rss_shield import make


class WithCost(gym.Wrapper):
    """Steps return observation, reward, cost, terminated, truncated, info."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, info["cost"], terminated, truncated, info


env = WithCost(make("highway-fast-v0", "monitor"))  # the agent is to learn what the shield would enforce
rng, multiplier, limit, rate = np.random.default_rng(0), 0.0, 0.01, 0.5
for episode in range(5):
    env.reset(seed=episode)
    done, costs = False, []
    while not done:
        _, reward, cost, terminated, truncated, info = env.step(int(rng.integers(5)))
        paid = reward - multiplier * cost  # what a learner would get
        costs.append(cost)
        done = terminated or truncated
    multiplier = max(0.0, multiplier + rate * (np.mean(costs) - limit))
print(f"mean cost of the last episode {np.mean(costs):.2f}, multiplier {multiplier:.2f}")
