"""Your own policy, reward, table of parameters and road beside the arms: six small files and four commands.

python examples/own_comparison.py
"""

import os
import tempfile
from pathlib import Path

from rss_shield.cli import main

FILES = {
    "my_policy.py": """
import numpy as np

def drive(observations):  # [B, 5, 5]: the ego and four others, each with presence, x / 200 m, y, ... -> actions [B]
    others = observations[:, 1:]
    near = (others[..., 0] > 0) & (others[..., 1] > 0) & (others[..., 1] < 0.25) & (abs(others[..., 2]) < 0.2)
    return np.where(near.any(axis=1), 4, 3)  # SLOWER, FASTER
""",
    "my_reward.py": """
def quick_and_gentle(decision):  # of E environments: reward [E], actions, ended, told(key) [E] -> [E]
    changed = decision.told("shield", "mean_acceleration_change")  # by the shield [m/s^2]
    return decision.reward + 0.02 * (decision.told("speed") - 20.0) - 0.1 * changed
""",
    "my-table.yaml": """
like: simulator
ego: {response_time: 0.4, a_min_brake: 4.5}
other: {response_time: 1.5}
source: measured in our lab
""",
    "my-road.yaml": "{lanes_count: 4, vehicles_count: 12, duration: 8}\n",
    "mine.yaml": """
arms: [unshielded, shielded, 'my_policy:drive']
seeds: [0, 1]
tests: {episodes: 10}
options: {preset: my-table.yaml, config: my-road.yaml, reward: 'my_reward:quick_and_gentle', total_timesteps: 512,
  n_envs: 8, removal_checks: 0, replay_episodes: 0, pages: false, workers: 1}
""",
    "my-sweep.yaml": """
policies: [faster, 'my_policy:drive']
tests: {episodes: 10}
options: {preset: my-table.yaml, config: my-road.yaml, reward: 'my_reward:quick_and_gentle'}
sweep: {grid: {ego.response_time: [0.4, 1.0]}}
""",
}
COMMANDS = ("train mine.yaml", "test my_policy:drive --preset my-table.yaml --config my-road.yaml --episodes 10")
COMMANDS += ("sweep my-sweep.yaml", "report runs/mine runs/my-sweep --out report")
before = Path.cwd()
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    for name, text in FILES.items():
        Path(name).write_text(text)
    for command in COMMANDS:
        print(f"$ rss-shield {command}")
        main(command.split())
    print(f"report/index.html: {Path('report/index.html').stat().st_size // 1024} kB")
    os.chdir(before)
