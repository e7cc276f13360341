"""gymnasium's vector wrappers around the engine.

Wrappers that look at single observations want each episode to begin in a step of its own. Episodes are counted already:
`infos["episode"]` is there, and `RecordEpisodeStatistics` needs another key beside it.

python examples/vector_wrappers.py
"""

import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import FlattenObservation, NormalizeObservation, NormalizeReward, RecordEpisodeStatistics

from rss_shield import make_vec

envs = RecordEpisodeStatistics(
    make_vec("highway-fast-v0", 32, autoreset_mode=AutoresetMode.NEXT_STEP), stats_key="counted"
)
envs = NormalizeReward(NormalizeObservation(FlattenObservation(envs)))

rng, cost, returns = np.random.default_rng(0), 0.0, []
envs.reset(seed=0)
for _ in range(64):
    observations, rewards, terminated, truncated, infos = envs.step(rng.integers(5, size=32))
    cost += float(infos["cost"].sum())
    if (ended := terminated | truncated).any():
        returns += infos["episode"]["r"][ended].tolist()
        assert np.allclose(infos["counted"]["r"][ended], infos["episode"]["r"][ended])
print(
    f"observations {observations.shape}, {len(returns)} episodes, mean return {np.mean(returns):.1f}, cost {cost:.0f}"
)
