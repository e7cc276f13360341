"""The command that a page prints asks for what the run was: read again, it gives the same options."""

import json
import shlex

import pytest

from rss_shield.eval import pages
from rss_shield.eval.config_option import as_text, split_arguments
from rss_shield.eval.report import USUAL_OPTIONS, title_of
from rss_shield.eval.run_folder import open_run
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.eval.suite.comparison.reading import started
from rss_shield.eval.suite.comparison.record import options_of, words_of

ROAD = {"lanes_count": 2, "observation": {"type": "Kinematics", "vehicles_count": 8}, "reward_speed_range": [20, 35]}
COMMANDS = {
    "nothing": "",
    "preset": "--env-id merge-v0 --preset slides",
    "parameters": "--ego.response-time 0.5 --ego.mu 0.2 --other.a-min-brake 4",
    "rules": "--rules.memory False --rules.anticipation 2 --rules.overlap-margin 0.5",
    "configuration": f"--config {shlex.quote(json.dumps(ROAD))}",
    "keys": "--config.lanes-count 2 --config.observation.vehicles-count 8 --config.duration 12.5",
    "learning": "--hyperparameters.learning-rate 3e-4 --hyperparameters.policy-kwargs '{\"net_arch\": [64, 32]}'"
    " --history 3 --network attention --n-envs 4 --total-timesteps 6000 --seeds 0 4",
    "tests": "--backend highway-env --eval-episodes 7 --first-seed 1000000500 --replay-episodes 0 --no-pages"
    " --removal-checks 3 --removal-episodes 11 --risk",
    "arms": "--arms shielded lazy penalty-0.1 --intervention-penalty 0.1 --penalty-on change --cost-limit 0.2",
    "junction": "--env-id intersection-v0 --entry priority --intent known --waiting anywhere --examine all",
    "filter": "--filter ttc --filter-at 2.5 --correction response --replace decision",
}


def run_of(words: list[str], tmp_path) -> tuple[dict, Config]:
    """A run as it is begun: its record and its options."""
    config, folder = started([*words, "--runs-dir", str(tmp_path)])
    open_run(folder, options_of(config), resume=False, overwrite=False, command=words_of(config))
    return json.loads((folder / "config.json").read_text()), config


@pytest.mark.parametrize("name", COMMANDS)
def test_the_printed_command_asks_for_the_same(name, tmp_path):
    record, config = run_of(shlex.split(COMMANDS[name]), tmp_path)
    program, command, *words = shlex.split(pages.command(record))
    assert (program, command) == ("rss-shield", "train")
    assert options_of(started(words)[0]) == options_of(config)


def test_what_is_usual_is_not_printed(tmp_path):
    record, _ = run_of(["--env-id", "merge-v0"], tmp_path)
    assert pages.command(record) == "rss-shield train --env-id merge-v0 --total-timesteps 200000 --seeds 0 1 2"


@pytest.mark.parametrize(
    "value", ["circle", "4", "true", "None", "-h", "--a", "", 4, 2.5, None, True, [1, "2"], {"a": "1"}]
)
def test_a_value_is_read_as_it_was_written(value):
    others, values = split_arguments(["--config.key", as_text(value), "--risk"])
    assert others == ["--risk"] and values == {("key",): value}


def test_names_that_a_command_line_would_alter_are_given_as_a_whole():
    words = words_of(Config(config={"lanes-count": 2}))
    assert words[2:4] == ["--config", '{"lanes-count": 2}']


def test_a_run_that_has_not_recorded_its_command_has_as_much_as_is_known():
    config = {"env_id": "merge-v0", "total_timesteps": 5, "seeds": [0], "parameters": {}, "intervention_penalty": 0.0}
    assert pages.command({"config": config}) == "rss-shield train --env-id merge-v0 --total-timesteps 5 --seeds 0"
    seeing = {"config": {"duration": 9}, "history": 2, "network": "sets", "hyperparameters": {"gamma": 0.9}}
    words = shlex.split(pages.command({"config": {**config, **seeing, "eval_episodes": 200}}))[2:]
    options, _ = started(words)
    assert (options.config, options.history, options.network) == ({"duration": 9}, 2, "sets")
    assert (options.hyperparameters, options.eval_episodes) == ({"gamma": 0.9}, 200)


def test_a_command_is_no_part_of_what_a_run_is(tmp_path):
    open_run(tmp_path, {"seeds": [0]}, resume=False, overwrite=False, command=["--seeds", "0"])
    assert (
        open_run(tmp_path, {"seeds": [0]}, resume=True, overwrite=False, command=["--seeds", "0", "--new", "1"]) == []
    )


def title(words: str) -> str:
    config, _ = started(shlex.split(words))
    return title_of({**options_of(config), "parameters": {"roads_cross": False}})


def test_a_title_says_what_is_unusual():
    assert title("") == (
        "PPO on highway-fast-v0, RSS preset simulator, 200000 timesteps per arm, no intervention penalty, 3 training "
        "seeds"
    )
    said = title("--rules.memory False --ego.mu 0.2 --filter ttc --filter-at 2.5 --config.lanes-count 2")
    assert said.startswith(
        "PPO on highway-fast-v0 (config.lanes_count 2), RSS preset simulator (ego.mu 0.2) (rules.memory False), filter "
        "ttc, filter_at 2.5, 200000"
    )
    assert "gamma 0.9)" in title("--hyperparameters.gamma 0.9 --history 3")


def test_where_nobody_learns_a_title_has_no_training():
    said = title("--arms lazy idm --seeds 0 1 2 3 4")
    assert said == "Drivers on highway-fast-v0, RSS preset simulator, nobody learns"


def test_what_a_title_takes_for_usual_is_the_default():
    usual = options_of(Config())
    assert {name: usual[name] for name in USUAL_OPTIONS} == USUAL_OPTIONS
