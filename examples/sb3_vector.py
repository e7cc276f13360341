"""stable-baselines3 on many environments in the engine at once. The one word that makes it work: VectorEnvAdapter.

python examples/sb3_vector.py
"""

from stable_baselines3 import PPO

from rss_shield import make_vec
from rss_shield.agents.vec_env import VectorEnvAdapter

envs = make_vec("highway-fast-v0", 64)
try:
    PPO("MlpPolicy", envs)
except (ValueError, TypeError) as error:  # it knows its own vector environments only
    print(f"without the adapter: {str(error).split(',')[0]}")
model = PPO("MlpPolicy", VectorEnvAdapter(envs), n_steps=32, batch_size=256, n_epochs=4, gamma=0.9, seed=0)
model.learn(4096)  # far too little to learn from

episodes = list(model.ep_info_buffer)
print(f"with it: {len(episodes)} episodes, mean return {sum(one['r'] for one in episodes) / len(episodes):.1f}")
