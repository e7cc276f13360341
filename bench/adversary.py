"""PPO against the shield: an agent that is paid for contacts that are the ego's fault, and for nothing else.

    python bench/adversary.py                         trains what is not there yet, in the compiled engine
    python bench/adversary.py --write                 writes docs/results/adversary.md and its picture of what is there
    python bench/adversary.py --only whole            against one of the shields

It drives the ego, with throttle and wheels, against the whole shield and against shields without one or two of its
conditions. Every contact is judged afterwards by the whole table (`rss-shield judge`), not by the rules that are left,
and the first one at fault is kept as a trace. A small reward for small margins shows the way. One training is one file
in runs/adversary, written as it goes on; one that is whole is not repeated.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch
import tyro
from stable_baselines3 import PPO

from rss_shield import make_vec
from rss_shield.agents.vec_env import VectorEnvAdapter
from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.pages import markdown, spaced
from rss_shield.eval.stats import clopper_pearson
from rss_shield.eval.suite.filmed import Studio
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.params import Rules
from rss_shield.shield.trace import save
from rss_shield.shield.verdicts import AT_FAULT

PAGE, PICTURE = Path("docs/results/adversary.md"), Path("docs/results/adversary.png")
ENV_ID = "highway-fast-v0"
CONFIG = {"action": {"type": "ContinuousAction"}, "vehicles_count": 12, "vehicles_density": 1.5, "duration": 20}
# what is dropped; anticipation is off there, which would else hide some of it
SHIELDS: dict[str, dict[str, Any]] = {
    "whole": {},
    "no duty along the lane (Def. 4, H23)": {"longitudinal": False, "present_duties": False},
    "no answer to who has cut in (H23)": {"present_duties": False},
    "no duty across the lane (Def. 8, H23)": {"lateral": False, "present_duties": False},
    "no limits of acceleration and lateral speed (C1)": {"limits": False},
    "no limits, no bound of the heading": {"limits": False, "heading_bound": 1.0},
    "no braking for lost distance (Def. 4)": {"longitudinal": False},
    "no stop across the lane (Def. 8)": {"lateral": False},
}
ENVS = 128
STEPS = 64  # of each environment between two updates
_NEAR = 0.02  # paid per decision at no margin ...
_FADES = 5.0  # ... and less by e for each of these [m]


@dataclasses.dataclass(frozen=True)
class Config:
    """Train adversaries."""

    decisions: int = 2_000_000  # against the whole shield
    weakened: int = 200_000  # against each of the others
    seed: int = 0
    out: Path = Path("runs/adversary")
    only: str = ""  # shields whose names begin so
    write: bool = False  # the page


class Paid(VectorEnvAdapter):
    """The engine for PPO, with rewards for faults only.

    Args:
      env: `FastVectorEnv`.
      keep: where the first contact at fault is kept.
    """

    def __init__(self, env: Any, keep: Path) -> None:
        super().__init__(env)
        self.studio, self.keep = Studio(env.scenario, env.settings), keep
        self.rules = Rules()
        self.episodes = self.contacts = self.faults = 0
        env.recording.choose(range(env.num_envs))

    def step_wait(self):
        observations, _, ended, infos = super().step_wait()
        margin = np.maximum(self.told("shield", "min_margin_lon"), self.told("shield", "min_margin_lat"))
        rewards = _NEAR * np.exp(-np.clip(np.nan_to_num(margin, posinf=1e3), 0.0, 1e3) / _FADES)
        verdicts = self.told("blame")
        logs = {log.env: log for log in self.env.recording.finished}
        self.env.recording.finished.clear()
        for e in np.flatnonzero(ended):
            self.episodes += 1
            if verdicts[e]:
                self.contacts += 1
                rewards[e] += self._is_fault(logs[int(e)])
        return observations, rewards.astype(np.float32), ended, infos

    def _is_fault(self, log: Any) -> bool:
        trace = self.studio.develop(log)
        (ego,) = trace.ego_users
        fault = judge_trace(trace, rules=self.rules, users=[ego]).verdict_of(ego) in AT_FAULT
        if fault and not self.faults:
            meta = trace.meta | {"judge_rules": self.rules._asdict()}
            save(trace.replaced(meta=meta), self.keep)
        self.faults += fault
        return fault


def train(name: str, config: Config, path: Path) -> None:
    """One adversary; keeps its curve: decisions, episodes, contacts and faults until then, after each rollout."""
    changes = SHIELDS[name]
    rules = Rules(**changes)._replace(anticipation=0.0) if changes else Rules()
    paid = Paid(make_vec(ENV_ID, ENVS, config=CONFIG, rules=rules), path.with_suffix(".npz"))
    model = PPO(
        *("MlpPolicy", paid),
        n_steps=STEPS,
        batch_size=1024,
        n_epochs=5,
        gamma=0.95,
        learning_rate=1e-3,
        ent_coef=0.003,
        policy_kwargs={"net_arch": [64, 64]},
        seed=config.seed,
        device="cpu",
    )
    curve = [[0, 0, 0, 0]]
    total = config.weakened if changes else config.decisions
    while model.num_timesteps < total:
        model.learn(ENVS * STEPS, reset_num_timesteps=False)
        curve.append([model.num_timesteps, paid.episodes, paid.contacts, paid.faults])
        write_json(path, {"name": name, "changes": changes, "seed": config.seed, "total": total, "curve": curve})
        print(name, curve[-1], flush=True)
    paid.close()


def page_of(results: list[dict[str, Any]]) -> str:
    """The page of results."""
    rows: list[list[Any]] = [["shield", "decisions", "episodes", "contacts", "ego at fault [95 %]", "first after"]]
    for one in results:
        decisions, episodes, contacts, faults = one["curve"][-1]
        share = clopper_pearson(faults, episodes)
        first = next((spaced(row[0]) for row in one["curve"] if row[3]), "-")
        rate = f"{spaced(faults)}: {share.value:.2%} [{share.low:.2%}, {share.high:.2%}]" if faults else (
            f"**0** (95 % below {share.high:.1e})"
        )  # fmt: skip
        rows.append([one["name"], spaced(decisions), spaced(episodes), spaced(contacts), rate, first])
    return "\n\n".join(
        [
            "# An adversary that learns",
            "Written by `python bench/adversary.py --write`. PPO drives the ego with throttle and wheels "
            f"(`{ENV_ID}`, 12 cars at 1.5 times the density, episodes of 20 s) and is paid 1 for a contact that is the "
            "ego's fault and up to 0.02 per decision for small margins; nothing else. Contacts are judged afterwards "
            "by "
            "the whole table, whatever shield was there. Against shields that lack a condition anticipation is off, "
            "too. *First after*: decisions after which the rollout with the first fault ended. Rates are over all "
            "episodes of the training, exact intervals.",
            markdown(rows),
            "![Faults found while training](adversary.png)",
            "A shield without a condition against which nothing was found is no proof that the condition is not "
            "needed: "
            "several answer the same danger (without Def. 4 the ego still brakes for whoever is in its way now, H23), "
            "and some are missed only in scenes that this traffic does not have. What each one is for: "
            "[what each rule buys](ablation.md).",
        ]
    )


def draw(results: list[dict[str, Any]], path: Path) -> None:
    """Training curves: share of a rollout's episodes that end with the ego at fault."""
    figure, axes = plt.subplots(figsize=(8, 4.5), layout="constrained")
    for one in results:
        curve = np.array(one["curve"], float)
        episodes, faults = np.diff(curve[:, 1]), np.diff(curve[:, 3])
        width = max(1, len(faults) // 25)
        kernel = np.ones(width)
        share = np.convolve(faults, kernel, "same") / np.maximum(np.convolve(episodes, kernel, "same"), 1.0)
        whole = not one["changes"]
        axes.plot(curve[1:, 0], 100 * share, label=one["name"], lw=2.5 if whole else 1.2, color="k" if whole else None)
    axes.set(xlabel="decisions", ylabel="episodes with the ego at fault [%]", xscale="log")
    axes.legend(fontsize=7)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _is_whole(path: Path) -> bool:
    """Is a training there, and finished?"""
    if not path.exists():
        return False
    found = json.loads(path.read_text(encoding="utf-8"))
    return found["curve"][-1][0] >= found["total"]


def main(config: Config) -> None:
    """Train what is missing, or write what is there."""
    torch.set_num_threads(1)
    config.out.mkdir(parents=True, exist_ok=True)
    results = []
    for k, name in enumerate(SHIELDS):
        path = config.out / f"{k}_seed{config.seed}_{config.decisions if not k else config.weakened}.json"
        if not config.write and name.startswith(config.only) and not _is_whole(path):
            train(name, config, path)
        if path.exists():
            results.append(json.loads(path.read_text(encoding="utf-8")))
    if config.write:
        draw(results, PICTURE)
        write_text(PAGE, page_of(results) + "\n")
    else:
        print(page_of(results))


if __name__ == "__main__":
    main(tyro.cli(Config))
