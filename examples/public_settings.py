"""Published training settings, unchanged but for the line that makes the environment: the shield around it.

python examples/public_settings.py 20000 makes so many decisions with each; without a number, a few. Facts of
HighwayEnv's scripts sb3_highway_dqn.py, sb3_highway_ppo.py and sb3_highway_ppo_transformer.py (its road; a plain
network here) and of rl-agents' IntersectionEnv/agents/DQNAgent/baseline.json (without its rate of 0.1, which is
another optimizer's).
"""

import sys

import torch
from stable_baselines3 import DQN, PPO

from rss_shield import make_vec
from rss_shield.agents.vec_env import VectorEnvAdapter

torch.set_num_threads(1)
DECISIONS = int(sys.argv[1]) if sys.argv[1:] and sys.argv[1].isdigit() else 384
SEEN = {"type": "Kinematics", "vehicles_count": 10, "absolute": False}
SEEN["features"] = ["presence", "x", "y", "vx", "vy", "cos_h", "sin_h"]
THREE_LANES = {"lanes_count": 3, "vehicles_count": 15, "policy_frequency": 2, "duration": 40, "observation": SEEN}
EXPLORATION = {"exploration_fraction": 0.5, "exploration_final_eps": 0.05}
LATE = {"learning_starts": 200, "train_freq": 1, "gradient_steps": 1, "target_update_interval": 50}
REPLAY = {"buffer_size": 15_000, "batch_size": 32, **LATE}
PPO_FAST = {"n_steps": 64 * 12 // 6, "batch_size": 64, "n_epochs": 10, "learning_rate": 5e-4, "gamma": 0.8}
WIDE, NARROW = {"policy_kwargs": {"net_arch": [256, 256]}}, {"policy_kwargs": {"net_arch": [128, 128]}}
SETTINGS = {  # name -> environment, its configuration, how many, algorithm, its settings
    "HighwayEnv DQN": ("highway-fast-v0", {}, 1, DQN, {**WIDE, "learning_rate": 5e-4, "gamma": 0.8, **REPLAY}),
    "HighwayEnv PPO": ("highway-fast-v0", {}, 6, PPO, {**WIDE, **PPO_FAST}),
    "HighwayEnv attention road, PPO": (
        *("highway-v0", THREE_LANES, 4, PPO),
        {"n_steps": 512 // 4, "batch_size": 64, "learning_rate": 2e-3},
    ),
    "rl-agents DQN": ("intersection-v0", {}, 1, DQN, {**NARROW, "gamma": 0.95, **REPLAY, **EXPLORATION}),
}
for name, (env_id, config, count, algorithm, settings) in SETTINGS.items():
    env = VectorEnvAdapter(make_vec(env_id, count, config=config))  # theirs: gymnasium.make, or make_vec_env
    model = algorithm("MlpPolicy", env, seed=0, **settings).learn(DECISIONS)
    ended = [episode["r"] for episode in model.ep_info_buffer]
    mean = f"mean return {sum(ended) / len(ended):.1f}" if ended else "none ended"
    print(f"{name}: {model.num_timesteps} decisions, {len(ended)} episodes, {mean}")
