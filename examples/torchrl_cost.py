"""TorchRL: the environment in a GymWrapper, `info["cost"]` as a key of its tensors for constrained learners.

python examples/torchrl_cost.py            (pip install 'rss-shield[torchrl]')
"""

import numpy as np
import torch
from torchrl.data import Unbounded
from torchrl.envs import GymWrapper
from torchrl.envs.libs.gym import default_info_dict_reader

from rss_shield import make


class Cost(default_info_dict_reader):
    """Reads what gymnasium gives as a number; TorchRL expects arrays."""

    def __call__(self, info, tensordict):
        return super().__call__({"cost": np.array([info["cost"]], np.float32)}, tensordict)


env = GymWrapper(make("highway-fast-v0", "monitor"))  # only watched, so that there is something to pay for
env.set_info_dict_reader(Cost(["cost"], {"cost": Unbounded((1,))}))
torch.manual_seed(0)
paid = 0.0
for seed in range(5):
    env.set_seed(seed)
    episode = env.rollout(40)
    paid += float(episode["next", "cost"].sum())
print(f"keys {sorted(map(str, episode['next'].keys()))}, cost of 5 random episodes: {paid:.0f}")
