"""An algorithm of your own in one file, on many environments in the compiled engine: PPO in PyTorch, and its speed.

python examples/own_algorithm.py 500000 makes so many decisions; without a number, too few to learn from. `make_vec`
returns a `gymnasium.vector.VectorEnv`: whatever reads one will do. `info["cost"]` is for constrained problems.
"""

import sys
import time

import numpy as np
import torch
from torch import nn

from rss_shield import make_vec

DECISIONS = int(sys.argv[1]) if sys.argv[1:] and sys.argv[1].isdigit() else 8192
ENVS, STEPS, EPOCHS, BATCHES, DISCOUNT, TRACE, CLIP = 256, 16, 4, 4, 0.9, 0.95, 0.2
torch.set_num_threads(1)
torch.manual_seed(0)
envs = make_vec("highway-fast-v0", ENVS)
inputs, actions = int(np.prod(envs.single_observation_space.shape)), int(envs.single_action_space.n)
layers = (nn.Linear(inputs, 128), nn.ReLU(), nn.Linear(128, 128), nn.ReLU(), nn.Linear(128, actions + 1))
net = nn.Sequential(*layers)  # logits, and the value
optimizer = torch.optim.Adam(net.parameters(), lr=1e-3, eps=1e-5, fused=True)
seen = torch.zeros(STEPS + 1, ENVS, inputs)
chosen, old = torch.zeros(STEPS, ENVS, dtype=torch.int64), torch.zeros(STEPS, ENVS)
rewards, going, values = torch.zeros(STEPS, ENVS), torch.zeros(STEPS, ENVS), torch.zeros(STEPS + 1, ENVS)

seen[0] = torch.as_tensor(envs.reset(seed=0)[0]).flatten(1)
updates, began = DECISIONS // (STEPS * ENVS), time.perf_counter()
for update in range(updates):
    cost = 0.0
    with torch.no_grad():
        for t in range(STEPS):
            values[t], logs = (out := net(seen[t]))[:, -1], out[:, :-1].log_softmax(1)
            chosen[t] = torch.multinomial(logs.exp(), 1)[:, 0]
            old[t] = logs.gather(1, chosen[t][:, None])[:, 0]
            observations, reward, terminated, truncated, infos = envs.step(chosen[t].numpy())
            seen[t + 1], rewards[t] = torch.as_tensor(observations).flatten(1), torch.as_tensor(reward)
            going[t], cost = torch.as_tensor(~(terminated | truncated)), cost + float(infos["cost"].sum())
        values[-1] = net(seen[-1])[:, -1]
        gains, later = torch.zeros(STEPS, ENVS), 0.0
        for t in reversed(range(STEPS)):
            error = rewards[t] + DISCOUNT * going[t] * values[t + 1] - values[t]
            later = gains[t] = error + DISCOUNT * TRACE * going[t] * later
    data = (seen[:-1].flatten(0, 1), chosen.flatten(), old.flatten(), gains.flatten(), (gains + values[:-1]).flatten())
    for _ in range(EPOCHS):
        for part in torch.randperm(STEPS * ENVS).chunk(BATCHES):
            x, a, before, gain, target = (column[part] for column in data)
            out = net(x)
            ratio = (out[:, :-1].log_softmax(1).gather(1, a[:, None])[:, 0] - before).exp()
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            loss = -torch.min(gain * ratio, gain * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            optimizer.zero_grad()
            (loss + 0.5 * nn.functional.mse_loss(out[:, -1], target)).backward()
            optimizer.step()
    print(f"update {update}: reward per decision {rewards.mean():.2f}, broken duties and faults {cost:.0f}")
print(f"{updates * STEPS * ENVS / (time.perf_counter() - began):.0f} decisions/s")
envs.close()
