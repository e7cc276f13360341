"""What users bring along: policies, rewards, tables and configurations of their own."""

import json
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from gymnasium.vector import AutoresetMode, VectorEnv

import rss_shield.test
from rss_shield import train
from rss_shield.agents import ppo
from rss_shield.agents.blocks import train_in_blocks
from rss_shield.agents.own_reward import rewards_by
from rss_shield.agents.vec_env import VectorEnvAdapter
from rss_shield.eval.arms import arm_called, arm_named
from rss_shield.eval.own import OwnFailed, blaming, digests, driver_named, function_named, is_own
from rss_shield.eval.plots import style_of
from rss_shield.eval.report import cell_path
from rss_shield.eval.runs.experiment import experiment_of
from rss_shield.eval.runs.tasks import tasks_of
from rss_shield.eval.suite.comparison.reading import resolve, started
from rss_shield.eval.suite.own_table import preset_in
from rss_shield.eval.suite.scored import Scored, columns_of
from rss_shield.eval.suite.scripted import play
from rss_shield.eval.suite.sweep import check_tasks
from rss_shield.shield.params import PRESETS

ENV = "highway-fast-v0"
MODULE = """
import numpy as np

number = 3

def drive(observations):
    return np.full(len(observations), 3)

def one(observation):
    return 3

def length(decision):
    return np.ones(len(decision.reward))

def scalar(decision):
    return 1.0

def nothing(decision):
    return decision.reward * np.nan

def texts(decision):
    return ["good"] * len(decision.reward)

def pairs(observations):
    return np.zeros((len(observations), 2), int)

def ragged(observations):
    return [[1], *([1, 2] for _ in observations[1:])]
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "brought.py").write_text(MODULE)
    (tmp_path / "fails.py").write_text("1 / 0\n")
    (tmp_path / "wants.py").write_text("import not_installed\n")
    monkeypatch.delitem(sys.modules, "brought", raising=False)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("not_there:drive", "no module 'not_there' in"),
        ("brought", "'brought': expected module:function"),
        ("brought:none", "module 'brought' has no 'none'"),
        ("brought:number", "int cannot be called"),
        ("fails:drive", "fails cannot be imported: ZeroDivisionError: division by zero"),
        ("wants:drive", "wants imports 'not_installed', which is not there"),
    ],
)
def test_what_cannot_be_looked_up_is_said_in_one_line(name, message, capsys):
    with pytest.raises(ValueError, match=name) as error:
        function_named(name)
    assert message in str(error.value)
    for option in (["--arms", "lazy", name], ["--reward", name])[":" not in name :]:
        with pytest.raises(SystemExit):
            started(option)
        assert message in capsys.readouterr().err


def test_a_policy_answers_with_one_action_for_each_observation():
    seen = np.zeros((4, 5, 5))
    assert driver_named("brought:drive")(seen).tolist() == driver_named("brought:one", True)(seen).tolist() == [3] * 4
    with pytest.raises(OwnFailed, match="brought:one: returned int 3 for 4 observations; expected one action for"):
        driver_named("brought:one")(seen)
    with pytest.raises(OwnFailed, match=r"brought:ragged: returned list \[\[1\], \[1, 2\], .* for 4 observations"):
        driver_named("brought:ragged")(seen)


@pytest.mark.parametrize(
    ("name", "space", "message"),
    [
        ("pairs", gym.spaces.Discrete(5), r"shape \(4, 2\) and type int64, .* one whole number from 0 to 4 for each"),
        ("drive", gym.spaces.Discrete(3), r"shape \(4,\) .*\[3, 3, 3\] .* one whole number from 0 to 2 for each"),
        ("drive", gym.spaces.Box(-1.0, 1.0, (2,)), r"shape \(4,\) .* expected finite numbers of shape \(2,\) for each"),
    ],
)
def test_actions_are_those_of_the_environment(name, space, message):
    with pytest.raises(OwnFailed, match=f"brought:{name}: returned an array of {message}"):
        driver_named(f"brought:{name}", actions=space)(np.zeros((4, 5, 5)))


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_a_sweep_names_the_policy_whose_actions_do_not_fit(backend):
    with pytest.raises(OwnFailed, match=r"brought:pairs: returned an array of shape \(\d, 2\)"):
        play(ENV, "brought:pairs", {"backend": backend, "config.duration": 3}, range(2))


def test_what_an_own_function_raises_names_it_and_its_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "raising.py").write_text("def drive(seen):\n    return sped\n\n\ndef paid(d):\n    d.told('sped')\n")
    with pytest.raises(OwnFailed, match=r"raising:drive: NameError: .*raising.py, line 2: return sped"):
        driver_named("raising:drive")(np.zeros((2, 5)))
    function = blaming(function_named("raising:paid"), "raising:paid")
    infos = {"raw_reward": np.ones(2), "speed": np.ones(2)}
    with pytest.raises(OwnFailed, match=r"raising:paid: KeyError: told\('sped'\): .*; the nearest is 'speed' \("):
        rewards_by(function, np.ones(2), np.zeros(2), infos, np.zeros(2, bool))
    monkeypatch.setattr(train, "main", driver_named("raising:drive"))
    with pytest.raises(SystemExit) as stop:
        train.run([])
    assert stop.value.code == 2 and len(capsys.readouterr().err.splitlines()) == 1


def test_a_policy_of_ones_own_is_an_arm():
    arm = arm_named("brought:drive")
    assert arm.own and arm.scripted and arm_called(arm.name) == arm and style_of(arm.name)["marker"] == "*"
    assert cell_path(Path("run"), "brought:drive", 0, "on").name == "brought-drive-seed0-test-on.csv"
    assert arm_called("off").name == "unshielded" and arm_called("nobody") is None
    config, folder = started(["--arms", "shielded", "brought:drive"])
    assert config.arms == ("shielded", "brought:drive") and ":" not in folder.name
    with pytest.raises(ValueError, match=r"nearest is shielded, .* is module:function"):
        arm_named("shieldet")


def test_a_table_of_ones_own_replaces_what_it_names(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("like: slides\nego: {response_time: 0.5}\nother: {a_max_brake: 9}\nsource: our lab\n")
    mine, slides = preset_in(str(file)), PRESETS["slides"]
    assert mine.ego == slides.ego._replace(response_time=0.5)
    assert mine.other == slides.other._replace(a_max_brake=9.0) and mine.source == "our lab"
    config, _ = started(["--preset", str(file), "--other.mu", "0.3"])
    assert resolve(config).other == mine.other._replace(mu=0.3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ergo: {response_time: 1}", "the table has an unknown key 'ergo'; the nearest is 'ego'"),
        ("ego: {responce_time: 1}", "ego has an unknown key 'responce_time'; the nearest is 'response_time'"),
        ("ego: {response_time: -1}", "ego: response_time = -1"),
        ("like: slide", "like = 'slide': expected one of"),
        ("ego: 3", "ego = 3: expected parameters"),
    ],
)
def test_a_bad_table_is_refused_where_it_is_named(text, message, tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(SystemExit):
        started(["--preset", "mine.yaml"])
    assert f"--preset: mine.yaml: {message}" in capsys.readouterr().err
    for name in ("mine.yaml", "none.yaml", "slide"):
        with pytest.raises(ValueError, match=name):
            preset_in(name)


def test_the_key_of_a_task_is_that_of_the_source(tmp_path):
    experiment = experiment_of({"name": "x", "policies": ["brought:drive"], "options": {"preset": "mine.yaml"}})
    keys = set()
    for change in ("", "# changed\n"):
        for table in ("like: slides", "like: wet"):
            (tmp_path / "brought.py").write_text(MODULE + change)
            (tmp_path / "mine.yaml").write_text(table)
            check_tasks(tasks_of(experiment))
            keys.add(tasks_of(experiment)[0].key)
    assert len(keys) == 4
    (stock,) = tasks_of(experiment_of({"name": "x", "policies": ["faster"]}))
    assert "sources" not in stock.config and digests(["faster", "x.yaml", 3, None]) == {}


def test_a_policy_that_is_not_known_is_refused_before_anything_runs():
    for policy, message in (("fastr", "the nearest is 'faster'"), ("brought:none", "has no 'none'")):
        with pytest.raises(ValueError, match=message):
            check_tasks(tasks_of(experiment_of({"name": "x", "policies": [policy]})))


def test_a_file_is_no_function(tmp_path):
    (tmp_path / "a:b").write_text("")
    assert is_own("brought:drive") and not is_own("a:b") and not is_own("shielded")


# ---------------------------------------------------------------- rewards


class Counting(VectorEnv):
    """Two environments whose episodes last 2 and 3 decisions; decision k earns k, less a penalty of 1/4."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(self, n=2):
        self.num_envs, self.lasts = n, np.array([2, 3])
        self.single_observation_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.single_action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.k = np.zeros(2, int)
        return np.zeros((2, 1), np.float32), {}

    def step(self, actions):
        self.k += 1
        ended, speed = self.k == self.lasts, 10.0 * self.k
        rewards, told = self.k - 0.25, {"raw_reward": self.k.astype(float), "speed": speed}
        final = told | {"blame": np.array(["", ""]), "episode": {"r": np.full(2, -99.0), "l": self.k.copy()}}
        infos = {"raw_reward": np.where(ended, np.nan, self.k), "speed": np.where(ended, np.nan, speed)}
        if ended.any():
            infos |= {"final_info": final, "final_obs": np.zeros((2, 1), np.float32)}
        self.k = np.where(ended, 0, self.k)
        return np.zeros((2, 1), np.float32), rewards, ended, np.zeros(2, bool), infos


def test_a_reward_of_ones_own_takes_the_place_of_the_environments_and_a_penalty_stays():
    env = VectorEnvAdapter(Counting())
    env.reward = lambda decision: decision.reward + decision.told("speed") * (decision.actions == 1)
    env.reset()
    paid, returns = [], []
    for _ in range(3):
        _, rewards, ended, infos = env.step(np.array([1, 0]))
        paid.append(rewards.tolist())
        returns += [infos[e]["episode"]["r"] for e in np.flatnonzero(ended)]
    # decision k earns k + 10 k where the action is 1, else k; the agent is paid 1/4 less
    assert paid == [[10.75, 0.75], [21.75, 1.75], [10.75, 2.75]]
    assert returns == [33.0, 6.0]


def test_a_reward_may_work_in_place():
    def in_place(decision):
        earned = decision.reward
        earned *= 0.0
        earned += 5.0
        decision.told("speed")[:] = 0.0
        decision.ended[:] = True
        decision.actions[:] = 9
        return earned

    infos, ended, actions = {"raw_reward": np.ones(2), "speed": np.ones(2)}, np.zeros(2, bool), np.zeros(2, int)
    paid = rewards_by(in_place, np.array([1.0, 0.75]), actions, infos, ended)
    assert paid.tolist() == [5.0, 4.75]
    assert infos["raw_reward"].tolist() == infos["speed"].tolist() == [1.0, 1.0]
    assert not ended.any() and not actions.any()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("scalar", r"shape \(\) for 2 environments; expected \(2,\)"),
        ("nothing", "nan; expected"),
        ("texts", r"returned list \['good', 'good'\]; expected numbers, shape \(2,\)"),
    ],
)
def test_a_reward_is_one_finite_number_for_each_environment(name, message):
    infos = {"raw_reward": np.ones(2)}
    with pytest.raises(ValueError, match=f"reward brought:{name}: {message}"):
        rewards_by(function_named(f"brought:{name}"), np.ones(2), np.zeros(2), infos, np.zeros(2, bool))


@pytest.mark.slow
def test_an_agent_learns_from_it(tmp_path):
    train_in_blocks(
        ppo.learner(),
        lambda n: Counting(n),
        tmp_path / "model",
        seed=0,
        total_timesteps=32,
        n_envs=2,
        reward=lambda decision: np.ones(2),
    )
    curve = pd.read_csv(tmp_path / "model" / "learning_curve.csv")
    finished = curve[curve["cut"] == 0]
    assert set(finished["length"]) == {2, 3}
    # 1 a decision, and no penalty is in it; so it is where an episode is cut off
    assert np.allclose(curve["return"], curve["length"])


def test_tests_count_it_beside_the_return():
    env = Scored(Counting(), lambda decision: decision.told("speed"))
    env.reset()
    env.step(np.zeros(2))
    _, rewards, ended, _, _ = env.step(np.zeros(2))
    assert rewards.tolist() == [1.75, 1.75] and ended.tolist() == [True, False]
    assert columns_of(env, 0) == {"own_return": 10.0 + 20.0 - 0.5} and columns_of(env.env, 0) == {}
    env.reset(options={"reset_mask": np.array([True, False])})
    assert env.sums.tolist() == [0.0, 29.5]


@pytest.mark.slow
def test_an_agent_with_masks_a_history_and_a_network_of_its_own_learns_from_it_and_is_tested_again(tmp_path):
    words = "--arms maskable --seeds 0 --total-timesteps 512 --eval-episodes 4 --n-envs 4 --workers 1 --name run"
    words += " --removal-checks 1 --removal-episodes 2 --replay-episodes 1 --no-pages --config.duration 6"
    words += " --reward brought:length --history 2 --network sets"
    train.main([*words.split(), "--runs-dir", str(tmp_path)])
    model = tmp_path / "run" / "maskable-seed0" / "model.zip"
    card = json.loads((model.parent / "card.json").read_text())
    assert card["history"] == 2 and "the last 2 observations" in (model.parent / "card.md").read_text()
    before = pd.read_csv(tmp_path / "run" / "episodes.csv")
    assert (before["own_return"] == before["length"]).all()
    rss_shield.test.main([str(model), "--episodes", "4", "--out", "again", "--reward", "brought:length"])
    again = pd.read_csv("again/episodes.csv")
    same = ["seed", "return", "length", "blame", "own_return", "actions", "test"]
    pd.testing.assert_frame_equal(again[same], before[same])
    with pytest.raises(SystemExit):
        rss_shield.test.main([str(model), "--history", "3", "--out", "again"])


def test_the_test_command_takes_tables_parameters_and_rewards(tmp_path):
    (tmp_path / "mine.yaml").write_text("{like: slides, ego: {response_time: 0.5}}")
    (tmp_path / "road.yaml").write_text("{lanes_count: 2, duration: 5, vehicles_count: 5}")
    words = (
        "brought:drive --preset mine.yaml --ego.mu 0.3 --reward brought:length --config road.yaml --episodes 3 --out o"
    )
    rss_shield.test.main(words.split())
    episodes = pd.read_csv("o/episodes.csv")
    assert (episodes["own_return"] == episodes["length"]).all() and (episodes["own_return"] != episodes["return"]).any()
    record = json.loads(Path("o/config.json").read_text())["config"]
    assert record["parameters"]["ego"]["response_time"] == 0.5 and record["parameters"]["ego"]["mu"] == 0.3
    assert set(record["sources"]) == {"brought:drive", "brought:length", "mine.yaml"}
    table = Path("o/table.md").read_text()
    assert "own return" in table and "preset mine.yaml (ego.mu 0.3), reward brought:length, 3 episodes" in table
