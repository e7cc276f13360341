"""gymnasium's vector wrappers around the engine, and its own `make_vec` style of training loop.

python examples/vector_wrappers.py
"""

import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import FlattenObservation, NormalizeObservation, NormalizeReward, RecordEpisodeStatistics

from rss_shield import make_vec

# wrappers that look at single observations want each episode to begin in a step of its own
envs = make_vec("highway-fast-v0", 32, autoreset_mode=AutoresetMode.NEXT_STEP)
for wrap in (RecordEpisodeStatistics, FlattenObservation, NormalizeObservation, NormalizeReward):
    envs = wrap(envs)

rng, cost, returns = np.random.default_rng(0), 0.0, []
observations, _ = envs.reset(seed=0)
for _ in range(64):
    observations, rewards, terminated, truncated, infos = envs.step(rng.integers(5, size=32))
    cost += float(infos["cost"].sum())
    returns += infos["episode"]["r"][infos["_episode"]].tolist() if "episode" in infos else []
print(
    f"observations {observations.shape}, {len(returns)} episodes, mean return {np.mean(returns):.1f}, cost {cost:.0f}"
)
