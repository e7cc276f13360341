"""What a policy sees of a list of road users, by name: a network in front of the learner's own layers.

An observation is a list of rows, `[V, F]`, the ego's first, or a history of them, `[H, V, F]` (`agents.history`). Rows
of zeros stand for nobody. A plain network has weights of its own for every place in the list; these have the same for
everybody, so that it is the same to them who is listed third and who is listed fourth. Of a history the rows in one
place of all its lists count as one road user; where lists are sorted by distance, somebody else may have been there.
"""

from collections.abc import Mapping
from typing import Any

import torch
from gymnasium.spaces import Box
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

WIDTH = 128  # numbers that are handed on
PERSON = 64  # ... of one road user


class Rows(BaseFeaturesExtractor):
    """What the networks here have in common: rows `[B, V, H * F]`, and who is there."""

    def __init__(self, observation_space: Box) -> None:
        super().__init__(observation_space, WIDTH)
        shape = observation_space.shape
        self.inputs = shape[-1] * (shape[0] if len(shape) == 3 else 1)

    def rows(self, observations: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Rows, and `[B, V]`: is somebody there now?"""
        if observations.ndim == 3:
            return observations, (observations != 0).any(-1)
        there = (observations[:, -1] != 0).any(-1)
        return observations.transpose(1, 2).flatten(2), there


class Sets(Rows):
    """Each road user beside the ego, then their largest and summed features (Deep Sets; Zaheer et al., 2017)."""

    def __init__(self, observation_space: Box) -> None:
        super().__init__(observation_space)
        self.ego = nn.Sequential(nn.Linear(self.inputs, PERSON), nn.ReLU())
        self.other = nn.Sequential(nn.Linear(2 * self.inputs, WIDTH), nn.ReLU(), nn.Linear(WIDTH, PERSON), nn.ReLU())
        self.together = nn.Sequential(nn.Linear(3 * PERSON, WIDTH), nn.ReLU())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features `[B, WIDTH]`."""
        rows, there = self.rows(observations)
        ego, others = rows[:, :1], rows[:, 1:]
        beside = torch.cat([others, ego.expand_as(others)], -1)
        each = self.other(beside) * there[:, 1:, None]
        return self.together(torch.cat([self.ego(ego[:, 0]), each.amax(1), each.sum(1)], -1))


class Attention(Rows):
    """The ego asks everybody, in two heads (ego-attention; Leurent & Mercat, 2019)."""

    HEADS = 2

    def __init__(self, observation_space: Box) -> None:
        super().__init__(observation_space)
        self.person = nn.Sequential(nn.Linear(self.inputs, PERSON), nn.ReLU(), nn.Linear(PERSON, PERSON), nn.ReLU())
        self.asks = nn.MultiheadAttention(PERSON, self.HEADS, batch_first=True)
        self.together = nn.Sequential(nn.Linear(2 * PERSON, WIDTH), nn.ReLU())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features `[B, WIDTH]`."""
        rows, there = self.rows(observations)
        people = self.person(rows)
        # of an empty list all are asked: attention to nothing is no number
        absent = ~there & there.any(1, keepdim=True)
        heard, _ = self.asks(people[:, :1], people, people, key_padding_mask=absent, need_weights=False)
        return self.together(torch.cat([people[:, 0], heard[:, 0]], -1))


MLP = "mlp"
NETWORKS: Mapping[str, type[Rows] | None] = {MLP: None, "sets": Sets, "attention": Attention}


def check_network(network: str, shape: tuple[int, ...]) -> None:
    """Refuse observations that a network cannot see.

    Raises:
      ValueError: they are no lists of at least two rows.
    """
    if NETWORKS[network] is not None and (len(shape) not in (2, 3) or shape[-2] < 2):
        raise ValueError(f"network = {network!r}: observations are {shape}; expected rows [V, F], such as Kinematics")


def policy_arguments(network: str) -> dict[str, Any]:
    """Arguments of a policy of stable-baselines3 for a network of `NETWORKS`; none for "mlp"."""
    kind = NETWORKS[network]
    return {} if kind is None else {"features_extractor_class": kind}
