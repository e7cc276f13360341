"""What is earned with hindsight: plans as they are said, and never less than what each of them earns."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from bench import hindsight
from bench.hindsight import FASTER, FIRST_SEED, IDLE, SLOWER, Config, follow, main, plans, rows_of
from rss_shield import make_vec


class Road:
    """Three seeds; each action of a plan is written down, and pays its number. The second ends with a contact."""

    num_envs = 3

    def __init__(self):
        self.done = []

    def reset(self, seed):
        assert seed == [FIRST_SEED, FIRST_SEED + 1, FIRST_SEED + 2]

    def step(self, actions):
        self.done.append(int(actions[0]))
        step = len(self.done)
        ended, hit = np.array([step >= 5, step >= 2, step >= 4]), np.array(["", "other" if step >= 2 else "", ""])
        return None, actions.astype(float), ended, np.zeros(3, bool), {"blame": hit}


def test_a_plan_is_followed_as_it_is_said_and_what_comes_after_an_episode_is_not_counted():
    road = Road()
    returns, hits = follow(road, (10, 1, 2), (1, SLOWER, 2))
    assert road.done == [2, 10, 10, 2, 2]
    assert returns.tolist() == [26.0, 12.0, 24.0]
    assert hits.tolist() == [False, True, False]


def test_the_first_plan_is_always_faster_and_none_is_there_twice():
    every = list(plans())
    assert every[0] == (0, FASTER, 0) and len(set(every)) == len(every)
    assert {action for _, action, _ in every} == {SLOWER, IDLE, FASTER}


@pytest.mark.slow
def test_the_best_for_each_earns_at_least_what_the_best_for_all_does(monkeypatch):
    few = [(0, FASTER, 0), (2, SLOWER, 3), (1, IDLE, 2)]
    monkeypatch.setattr(hindsight, "plans", lambda: iter(few))
    rows = rows_of("intersection-v0", "monitor", 12)
    always, alike, each = (float(cells[4].split()[0]) for cells in rows)
    assert always <= alike <= each
    env = make_vec("intersection-v0", 12, shield="monitor", autoreset_mode=AutoresetMode.DISABLED)
    assert always == pytest.approx(follow(env, (0, 1, 2), few[0])[0].mean(), abs=0.005)
    env.close()


@pytest.mark.parametrize(("config", "said"), [(Config(("merge-v0",)), "merge-v0"), (Config(seeds=1), "--seeds 1")])
def test_what_is_not_known_is_refused(config, said):
    with pytest.raises(ValueError, match=said):
        main(config)
