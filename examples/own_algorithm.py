"""An algorithm of your own in one file, on many environments in the compiled engine: REINFORCE in PyTorch.

    python examples/own_algorithm.py

`make_vec` returns a `gymnasium.vector.VectorEnv`, so whatever reads one will do. `info["cost"]` is what algorithms for
constrained problems ask for.
"""

import numpy as np
import torch
from torch import nn

from rss_shield import make_vec

ENVS, DECISIONS, UPDATES, DISCOUNT = 16, 16, 3, 0.9
torch.manual_seed(0)
envs = make_vec("highway-fast-v0", ENVS)
inputs = int(np.prod(envs.single_observation_space.shape))
policy = nn.Sequential(nn.Flatten(), nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, int(envs.single_action_space.n)))
optimizer = torch.optim.Adam(policy.parameters(), lr=3e-3)

observations, infos = envs.reset(seed=0)
for update in range(UPDATES):
    log_probs, rewards, going, cost = [], [], [], 0.0
    for _ in range(DECISIONS):
        chosen = torch.distributions.Categorical(logits=policy(torch.as_tensor(observations, dtype=torch.float32)))
        actions = chosen.sample()
        observations, reward, terminated, truncated, infos = envs.step(actions.numpy())
        log_probs.append(chosen.log_prob(actions))
        rewards.append(reward)
        going.append(~(terminated | truncated))
        cost += float(np.sum(infos["cost"]))
    returns = np.zeros((DECISIONS, ENVS))
    later = np.zeros(ENVS)
    for t in reversed(range(DECISIONS)):
        later = returns[t] = rewards[t] + DISCOUNT * going[t] * later
    advantages = torch.as_tensor(returns - returns.mean(axis=1, keepdims=True), dtype=torch.float32)
    loss = -(torch.stack(log_probs) * advantages).mean()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    print(f"update {update}: reward per decision {np.mean(rewards):.2f}, broken duties and faults {cost:.0f}")
envs.close()
