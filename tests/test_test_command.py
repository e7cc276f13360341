"""`rss-shield test`: models of ours and of others, functions, and what goes wrong."""

import json
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from stable_baselines3 import A2C, PPO, SAC

import rss_shield.test
from rss_shield import train
from rss_shield.agents.load import algorithm_in, load_policy
from rss_shield.agents.vec_env import VectorEnvAdapter
from rss_shield.eval.arms import OFF_AND_ON
from rss_shield.eval.suite.tested import title_of
from rss_shield.shield.params import Rules

ENV = "highway-fast-v0"
SMALL = ["--episodes", "3", "--config.duration", "6"]
DRIVERS = """
import numpy as np

number = 3

def faster(observations):
    return np.full(len(observations), 3)

def faster_one(observation):
    assert observation.shape == (5, 5)
    return 3

def one_for_all(observations):
    return 3

def pairs(observations):
    return np.zeros((len(observations), 2), int)
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_driver.py").write_text(DRIVERS)
    monkeypatch.delitem(sys.modules, "my_driver", raising=False)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "ppo.zip"
    PPO("MlpPolicy", VectorEnvAdapter(rss_shield.make_vec(ENV, 2)), n_steps=8, batch_size=16, seed=0).save(path)
    return path


def played(*arguments):
    rss_shield.test.main([*map(str, arguments), *SMALL, "--out", "out", "--overwrite"])
    return pd.read_csv("out/episodes.csv")


def test_a_function_is_tested_with_the_shield_and_without(capsys):
    episodes = played("my_driver:faster")
    assert episodes.groupby("test", sort=False).size().to_dict() == {"off": 3, "on": 3}
    assert set(episodes["seed"]) == {10**9, 10**9 + 1, 10**9 + 2}
    assert episodes["length"].max() <= 6
    assert (episodes.loc[episodes["test"] == "on", "blame"] == "no contact").all()
    assert set(episodes.loc[episodes["test"] == "off", "blame"]) <= {"ego", "no contact"}
    out = " ".join(capsys.readouterr().out.split())
    assert f"my_driver:faster on {ENV} (config.duration 6), RSS preset simulator, 3 episodes" in out
    assert "Every episode, with its verdict: out/episodes.csv" in out
    told = json.loads(Path("out/config.json").read_text())
    assert told["config"]["config"] == {"duration": 6}
    assert told["command"].startswith("rss-shield test my_driver:faster --episodes 3")
    assert told["config"]["parameters"]["ego"] == rss_shield.PRESETS["simulator"].ego._asdict()


def refused(capsys, *arguments):
    """What is said to arguments that are refused."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        rss_shield.test.main([*map(str, arguments)])
    assert stop.value.code == 2
    return capsys.readouterr().err


def test_results_of_other_settings_are_kept(capsys):
    words = ["my_driver:faster", "--tests", "on", "--episodes", "1"]
    for _ in range(2):  # the same again is the same again
        rss_shield.test.main(words)
    folder = Path("runs") / "tested" / f"my_driver-faster-{ENV}"
    before = (folder / "episodes.csv").read_bytes()
    said = refused(capsys, *words[:3], "--episodes", "2", "--ego.mu", "0.3")
    assert f"{folder} holds results of other settings: episodes = 2, but it was written with 1; ego.mu = 0.3" in said
    assert "--overwrite replaces them, --out chooses another folder" in said and "parameters" not in said
    Path("my_driver.py").write_text(DRIVERS + "# edited\n")
    assert "the file of my_driver:faster has been changed since it was written" in refused(capsys, *words)
    assert (folder / "episodes.csv").read_bytes() == before
    rss_shield.test.main([*words[:3], "--episodes", "2", "--overwrite"])
    assert len(pd.read_csv(folder / "episodes.csv")) == 2


@pytest.mark.parametrize("record", [{"config.json": '{"config": {"arms": []}}'}, {"experiment.json": "{}"}])
def test_a_training_or_a_sweep_is_never_overwritten(record, tmp_path, capsys):
    for name, text in record.items():
        (tmp_path / name).write_text(text)
        said = refused(capsys, "my_driver:faster", "--out", tmp_path, "--overwrite")
        assert "expected a folder of its own; this one is that of a training or a sweep" in said
        assert (tmp_path / name).read_text() == text


def test_models_of_two_runs_have_folders_of_their_own(tmp_path):
    paths = [tmp_path / run / "shielded-seed0" / "model.zip" for run in ("r1", "r2")]
    for path in paths:
        path.parent.mkdir(parents=True)
        path.with_name("card.json").write_text("{}")
    assert [rss_shield.test.name_of(str(path)) for path in paths] == [f"r{k}-shielded-seed0-model" for k in (1, 2)]
    assert rss_shield.test.name_of("dqn.zip") == "dqn"


RECORD = {
    **{"policy": "model.zip", "env_id": ENV, "config": {}, "preset": "simulator", "ego": {}, "other": {}, "reward": ""},
    **{"entry": "cautious", "intent": "any", "waiting": "line", "history": 1, "backend": "fast", "episodes": 1000},
    **{"first_seed": 10**9, "shield": OFF_AND_ON},
}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "RSS preset simulator, 1000 episodes"),
        ({"config": {"lanes_count": 4}}, f"{ENV} (config.lanes_count 4), "),
        ({"preset": "slides"}, "RSS preset slides, "),
        ({"ego": {"mu": 0.3}}, "simulator (ego.mu 0.3), "),
        ({"other": {"mu": 0.3}}, "simulator (other.mu 0.3), "),
        ({"reward": "mine:reward"}, ", reward mine:reward, "),
        ({"intent": "known"}, ", intent known, "),
        ({"history": 2}, ", history 2, "),
        ({"backend": "highway-env"}, ", backend highway-env, "),
        ({"first_seed": 7}, ", 1000 episodes from seed 7 on"),
        (
            {"shield": {test: {**one, "rules": Rules(memory=False)._asdict()} for test, one in OFF_AND_ON.items()}},
            "simulator, shield rules.memory False, 1000 episodes",
        ),
        ({"shield": {**OFF_AND_ON, "on": {"shield": "override", "filter": "cbf"}}}, ", test on: filter cbf, "),
    ],
)
def test_the_title_says_what_differs_from_the_defaults(changed, said):
    assert said in title_of({**RECORD, **changed})


def test_one_by_one_gives_the_same(capsys):
    together = played("my_driver:faster", "--tests", "on")
    alone = played("my_driver:faster_one", "--one-by-one", "--tests", "on")
    columns = ["seed", "return", "length", "actions"]
    pd.testing.assert_frame_equal(alone[columns], together[columns])


def test_a_model_of_anybody_drives_as_it_predicts(model, capsys):
    episodes = played(model, "--tests", "on")
    env = rss_shield.make(ENV, config={"duration": 6})
    predict = PPO.load(model, device="cpu").predict
    for seed, ret in zip(episodes["seed"], episodes["return"], strict=True):
        observation, _ = env.reset(seed=int(seed))
        total, done = 0.0, False
        while not done:
            observation, reward, terminated, truncated, _ = env.step(int(predict(observation, deterministic=True)[0]))
            total, done = total + float(reward), terminated or truncated
        assert ret == pytest.approx(total)
    assert algorithm_in(model) is PPO


def test_a_card_says_on_which_road(model, tmp_path, capsys):
    (tmp_path / "of-a-run").mkdir()
    copy = tmp_path / "of-a-run" / "model.zip"
    copy.write_bytes(model.read_bytes())
    card = {"env_id": "merge-v0", "config": {}, "arm": "shielded", "train_seed": 4, "preset": "slides"}
    sides = {side: rss_shield.PRESETS["slides"]._asdict()[side]._asdict() for side in ("ego", "other")}
    card["parameters"] = {**sides, "source": "a test", "per_frame": False}
    (tmp_path / "of-a-run" / "card.json").write_text(json.dumps(card))
    rss_shield.test.main([str(copy), "--episodes", "2", "--tests", "off"])
    folder = tmp_path / "runs" / "tested" / f"{tmp_path.name}-of-a-run-model-merge-v0"
    told = json.loads((folder / "config.json").read_text())["config"]
    assert told["env_id"] == "merge-v0"
    assert told["parameters"]["ego"]["response_time"] == rss_shield.PRESETS["slides"].ego.response_time
    assert told["preset"] == "slides" and not told["ego"] and set(told["sources"]) == {str(copy)}
    assert set(pd.read_csv(folder / "episodes.csv")["train"]) == {"shielded"}


def test_a_model_is_tested_behind_the_shield_that_it_was_trained_behind(capsys):
    """Without anticipation the shield overrides more; and test seeds of one's own are kept, too."""
    few = ["--total-timesteps", "64", "--n-envs", "8", "--eval-episodes", "6", "--config.duration", "10"]
    seeds = ["--seeds", "0", "--first-seed", "1200000000"]
    options = ["--rules.anticipation", "0", "--replace", "decision", "--no-pages", "--replay-episodes", "0"]
    train.main(["--arms", "shielded", "--name", "a-run", *few, *seeds, *options])
    run = Path("runs") / "a-run"
    before = pd.read_csv(run / "episodes.csv")
    assert before["seed"].min() == 1_200_000_000 and before["override_share"].max() > 0
    model = str(run / "shielded-seed0" / "model.zip")
    rss_shield.test.main([model, "--episodes", "6", "--first-seed", "1200000000", "--out", "out"])
    after = pd.read_csv("out/episodes.csv")
    columns = ["test", "seed", "return", "length", "blame", "override_share", "actions"]
    pd.testing.assert_frame_equal(after[columns], before[columns])
    assert "As on the card of the model: " in capsys.readouterr().err


def test_continuous_actions_are_found_out(tmp_path, capsys):
    config = {"action": {"type": "ContinuousAction"}}
    env = VectorEnvAdapter(rss_shield.make_vec(ENV, 2, config=config))
    SAC("MlpPolicy", env, seed=0, policy_kwargs={"net_arch": [8]}).save("sac.zip")
    episodes = played("sac.zip", "--tests", "on")
    assert (episodes["blame"] == "no contact").all()
    assert load_policy(tmp_path / "sac.zip")(np.zeros((4, 5, 5), np.float32)).shape == (4, 2)


def test_algorithms_that_share_a_policy_are_told_apart(tmp_path):
    A2C("MlpPolicy", gym.make("CartPole-v1")).save("a2c.zip")
    assert algorithm_in(tmp_path / "a2c.zip") is A2C


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("nothing.zip", "nothing.zip: no such file; expected a model's .zip file or module:function"),
        ("my_driver.py", "my_driver.py: not a model of stable-baselines3"),
        ("no_module:drive", "no_module:drive: no module 'no_module'"),
        ("my_driver:drive", "my_driver:drive: module 'my_driver' has no 'drive'"),
        ("my_driver:number", "my_driver:number: int cannot be called; expected a function"),
        ("my_driver:one_for_all", "returned int 3 for 3 observations; expected one whole number from 0 to 4 for each"),
        ("my_driver:pairs", "my_driver:pairs: returned an array of shape (3, 2) and type int64, [[0, 0], [0, 0], "),
        ("my_driver:faster --tests of", "--tests of is out of range: expected some of off, on"),
        ("my_driver:faster --episodes 0", "--episodes 0 is out of range: expected at least 1"),
        ("my_driver:faster --backend slow", "--backend slow is out of range: expected one of fast, highway-env"),
        ("my_driver:faster --entry bold", "--entry bold is out of range: expected one of cautious, priority"),
        ("my_driver:faster --preset best", "--preset best is out of range: expected one of auto, simulator"),
        ("my_driver:faster --env-id no-road", "no-road"),
        ("my_driver:faster --config.lane-count 3", "the nearest is config.lanes_count"),
        ("my_driver:faster --config.initial-lane-id 7", "config.initial_lane_id = 7: expected None or a whole number"),
        ("my_driver:faster --config.action.target-speeds [20]", "target_speeds = [20]: expected two speeds or more"),
        ("MODEL --env-id intersection-v0", "made for observations (5, 5), but intersection-v0 has (15, 7)"),
        ("MODEL --env-id merge-v0 --config.observation.vehicles-count 7", "but merge-v0 has (7, 5)"),
        (f"MODEL --out {__file__}", "expected a folder"),
    ],
)
def test_what_goes_wrong_ends_in_one_line_and_exit_code_2(arguments, message, model, capsys):
    with pytest.raises(SystemExit) as stop:
        rss_shield.test.main(
            [*arguments.replace("MODEL", str(model)).split(), *SMALL[:2] * ("--episodes" not in arguments)]
        )
    assert stop.value.code == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("rss-shield test: error: ")]
    assert len(lines) == 1
    assert message in lines[0]
