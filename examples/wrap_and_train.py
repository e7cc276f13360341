"""Put the shield around an environment, train with stable-baselines3, read the verdicts.

python examples/wrap_and_train.py
"""

from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor

from rss_shield import make

env = make("highway-fast-v0", intervention_penalty=0.2)  # the agent pays for what the shield must correct
env = Monitor(env, info_keywords=("blame", "override_share"))
model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0).learn(64)  # far too little to learn from

for episode in model.ep_info_buffer:
    verdict = episode["blame"] or "nobody was touched"
    print(f"{verdict}; the shield overrode {episode['override_share']:.0%} of the frames")
