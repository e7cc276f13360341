"""Trained models as policies: our own and anybody's, recognised from the file.

A policy maps observations `[B, ...]` to actions `[B]` or `[B, A]`, greedily. It may have an attribute `masked`: then it
takes the masks `[B, A]` of permitted actions as a second argument.
"""

import copy
import importlib
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor

from rss_shield.agents.networks import Rows

Policy = Callable[..., np.ndarray]
ALGORITHM = "algorithm_path"  # attribute of our models: where their class is
# module of the policy's class, an entry that tells apart who shares it (None: any) -> the class of the algorithm
KNOWN = (
    ("stable_baselines3.common.policies", "clip_range", "stable_baselines3.PPO"),
    ("stable_baselines3.common.policies", "cg_max_steps", "sb3_contrib.TRPO"),
    ("stable_baselines3.common.policies", "rms_prop_eps", "stable_baselines3.A2C"),
    ("stable_baselines3.common.policies", "normalize_advantage", "stable_baselines3.A2C"),
    ("stable_baselines3.dqn.policies", None, "stable_baselines3.DQN"),
    ("stable_baselines3.sac.policies", None, "stable_baselines3.SAC"),
    ("stable_baselines3.td3.policies", None, "stable_baselines3.TD3"),
    ("sb3_contrib.common.maskable.policies", None, "sb3_contrib.MaskablePPO"),
    ("sb3_contrib.qrdqn.policies", None, "sb3_contrib.QRDQN"),
    ("sb3_contrib.tqc.policies", None, "sb3_contrib.TQC"),
    ("sb3_contrib.crossq.policies", None, "sb3_contrib.CrossQ"),
)


def load_policy(path: Path) -> Policy:
    """Load a trained model as a greedy policy; see `policy_of`.

    Raises:
      ValueError: the file is no model of stable-baselines3, or of an algorithm that is not known.
    """
    return policy_of(algorithm_in(path).load(path, device="cpu"))


def algorithm_in(path: Path) -> type[BaseAlgorithm]:
    """The class of the algorithm that a file was saved by.

    Raises:
      ValueError: see `load_policy`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: not a model of stable-baselines3 ({error})") from None
    module = str((data.get("policy_class") or {}).get("__module__", ""))
    found = data.get(ALGORITHM)
    if found is None:
        found = next((to for of, key, to in KNOWN if of == module and (key is None or key in data)), None)
    if found is None:
        names = ", ".join(sorted({to.split(".")[-1] for *_, to in KNOWN}))
        raise ValueError(f"{path}: saved by an algorithm with policies of {module!r}; expected one of {names}")
    package, _, name = str(found).rpartition(".")
    return getattr(importlib.import_module(package), name)


def policy_of(model: BaseAlgorithm) -> Policy:
    """The greedy policy of a model as it is now.

    Runs on the CPU, one thread. Where the policy is a network of ours or a plain one for discrete actions, in double
    precision: rounding depends on B, and so must be far too small to turn one action into another.
    """
    torch.set_num_threads(1)
    policy: Any = model.policy
    masked = type(policy).__module__.startswith("sb3_contrib.common.maskable")
    plain = isinstance(policy, ActorCriticPolicy) or masked
    if plain and hasattr(model.action_space, "n") and isinstance(policy.features_extractor, FlattenExtractor | Rows):
        return _Logits(policy, masked)
    return _Predicting(model)


class _Logits:
    """Greedy choice from the logits of an actor."""

    def __init__(self, policy: Any, masked: bool) -> None:
        # a copy: the model may go on learning
        actor = torch.nn.Sequential(policy.features_extractor, policy.mlp_extractor.policy_net, policy.action_net)
        self.logits, self.masked = copy.deepcopy(actor).double().cpu(), masked

    def __call__(self, observations: np.ndarray, masks: np.ndarray | None = None) -> np.ndarray:
        with torch.no_grad():
            logits = self.logits(torch.as_tensor(observations, dtype=torch.float64)).numpy()
        if masks is not None:
            logits = np.where(masks | ~masks.any(axis=1, keepdims=True), logits, -np.inf)
        return logits.argmax(axis=1)


class _Predicting:
    """What the model itself predicts."""

    masked = False

    def __init__(self, model: BaseAlgorithm) -> None:
        self.model = model

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        return self.model.predict(observations, deterministic=True)[0]
