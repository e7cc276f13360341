"""The environment's configuration from files and command lines, checked against what the environment knows."""

import json
from functools import partial

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.eval.config_option import read_config, split_arguments, with_values


def test_a_configuration_is_read_from_json_toml_and_text(tmp_path):
    expected = {"lanes_count": 4, "observation": {"type": "Kinematics", "clip": False}}
    (tmp_path / "road.json").write_text(json.dumps(expected))
    (tmp_path / "road.toml").write_text('lanes_count = 4\n[observation]\ntype = "Kinematics"\nclip = false\n')
    assert read_config(str(tmp_path / "road.json")) == expected
    assert read_config(str(tmp_path / "road.toml")) == expected
    assert read_config(json.dumps(expected)) == expected


@pytest.mark.parametrize("name", ["road.yaml", "road.YML"])
def test_a_configuration_in_yaml(name, tmp_path):
    (tmp_path / name).write_text("lanes_count: 4\nobservation: {type: Kinematics}\n")
    assert read_config(str(tmp_path / name)) == {"lanes_count": 4, "observation": {"type": "Kinematics"}}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.json", "[1, 2]", "expected keys with values, found \\[1, 2\\]"),
        ("a.json", "{", "cannot be read: Expecting property name"),
        ("a.toml", "lanes_count: 4", "cannot be read: "),
        ("a.yaml", "{lanes_count: 4", "cannot be read: "),
        ("a.ini", "", "expected a file .json, .toml, .yaml or .yml, or JSON itself"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(name, content, message, tmp_path):
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=message):
        read_config(str(tmp_path / name))


@pytest.mark.parametrize(
    ("arguments", "keys", "value"),
    [
        ("--config.lanes-count 4", ("lanes_count",), 4),
        ("--config.lanes_count=4", ("lanes_count",), 4),
        ("--config.duration 1e1", ("duration",), 10.0),
        ("--config.collision-reward -1.5", ("collision_reward",), -1.5),
        ("--config.normalize-reward false", ("normalize_reward",), False),
        ("--config.offroad-terminal True", ("offroad_terminal",), True),
        ("--config.initial-lane-id null", ("initial_lane_id",), None),
        ("--config.initial-lane-id None", ("initial_lane_id",), None),
        ("--config.destination o1", ("destination",), "o1"),
        ("--config.reward-speed-range 20 30", ("reward_speed_range",), [20, 30]),
        ("--config.action.target-speeds [0,4.5,9]", ("action", "target_speeds"), [0, 4.5, 9]),
        ("--config.observation.features presence x y", ("observation", "features"), ["presence", "x", "y"]),
        ("--config.lanes-count 3 --config.lanes-count 5", ("lanes_count",), 5),
    ],
)
def test_single_values_are_taken_out_of_a_command_line(arguments, keys, value):
    others, values = split_arguments(["--seeds", "1", "2", *arguments.split(), "--resume"])
    assert others == ["--seeds", "1", "2", "--resume"]
    assert values == {keys: value}
    assert type(values[keys]) is type(value)


def test_single_values_win_and_nested_ones_keep_what_is_beside_them():
    defaults = {"observation": {"type": "Kinematics", "absolute": True}, "action": {"type": "DiscreteMetaAction"}}
    file = {"lanes_count": 2, "vehicles_count": 10, "action": {"type": "DiscreteMetaAction", "lateral": False}}
    values = {
        ("lanes_count",): 4,
        ("observation", "vehicles_count"): 8,
        ("action", "target_speeds"): (10, 20),
    }
    assert with_values(file, values, defaults) == {
        "lanes_count": 4,
        "vehicles_count": 10,
        "observation": {"type": "Kinematics", "absolute": True, "vehicles_count": 8},
        "action": {"type": "DiscreteMetaAction", "lateral": False, "target_speeds": [10, 20]},
    }
    assert file["lanes_count"] == 2
    assert defaults["observation"] == {"type": "Kinematics", "absolute": True}


@pytest.mark.parametrize("order", [1, -1])
def test_another_type_leaves_the_keys_of_the_default_aside(order):
    defaults = {"observation": {"type": "Kinematics", "absolute": True}}
    values = {("observation", "horizon"): 5, ("observation", "type"): "TimeToCollision"}
    assert with_values({}, dict(list(values.items())[::order]), defaults) == {
        "observation": {"type": "TimeToCollision", "horizon": 5}
    }


IDS = [
    "highway-fast-v0",
    "exit-v0",
    "merge-v0",
    "intersection-v0",
    "roundabout-v0",
    "u-turn-v0",
    "two-way-v0",
    "signalised-intersection-v0",
]


@pytest.mark.parametrize("env_id", IDS)
def test_what_an_environment_has_by_default_it_knows(env_id):
    check_config(env_id, default_config(env_id))
    check_config(env_id, {"duration": 20})


@pytest.mark.parametrize(
    ("env_id", "config", "message"),
    [
        (
            "highway-fast-v0",
            {"lane_count": 4},
            "config.lane_count is not known to highway-fast-v0; the nearest is config.lanes_count",
        ),
        ("exit-v0", {"vehicle_density": 1}, "the nearest is config.vehicles_density"),
        ("intersection-v0", {"vehicles_count": 9}, "the nearest is config.initial_vehicle_count"),
        ("merge-v0", {"colision_reward": -1}, "the nearest is config.collision_reward"),
        (
            "highway-v0",
            {"observation": {"type": "Kinematic"}},
            "config.observation.type = 'Kinematic': .*; the nearest is Kinematics",
        ),
        (
            "highway-v0",
            {"observation": {"vehicles_count": 4}},
            "config.observation.type = None: expected one of TimeToCollision",
        ),
        (
            "highway-v0",
            {"observation": {"type": "Kinematics", "feature": ["x"]}},
            "nearest is config.observation.features",
        ),
        (
            "exit-v0",
            {"action": {"type": "DiscreteMetaAction", "target_speed": [1]}},
            "nearest is config.action.target_speeds",
        ),
        (
            "signalised-intersection-v0",
            {"signal": {"gren": 5}},
            "config.signal.gren is not known; the nearest is config.signal.green",
        ),
        ("highway-v0", {"vehicles_count": 4.5}, "config.vehicles_count = 4.5: expected a whole number >= 0"),
        ("highway-v0", {"vehicles_count": True}, "config.vehicles_count = True: expected a whole number >= 0"),
        ("highway-v0", {"duration": "long"}, "config.duration = 'long': expected a finite number, such as 40"),
        ("highway-v0", {"duration": float("nan")}, "config.duration = nan: expected a finite number"),
        ("highway-v0", {"normalize_reward": 0}, "config.normalize_reward = 0: expected true or false"),
        ("highway-v0", {"observation": "Kinematics"}, "config.observation = 'Kinematics': expected keys with values"),
        (
            "highway-v0",
            {"reward_speed_range": [30, 20]},
            "config.reward_speed_range = .*: expected two numbers, the smaller first",
        ),
        (
            "exit-v0",
            {"observation": {"type": "ExitObservation", "clip": 1}},
            "config.observation.clip = 1: expected true or false",
        ),
        ("CartPole-v1", {"length": 1}, "expected an environment of highway-env; this one has no configuration"),
        ("no-such-road-v0", {}, "env_id = 'no-such-road-v0'"),
    ],
)
def test_what_an_environment_would_ignore_or_not_understand_is_named(env_id, config, message):
    with pytest.raises(ValueError, match=message):
        check_config(env_id, config)


@pytest.mark.parametrize(
    ("env_id", "config"),
    [
        ("merge-v0", {"duration": 30}),
        ("roundabout-v0", {"on_road_reward": 1}),
        ("highway-v0", {"on_road_reward": 0.1}),
        ("exit-v0", {"initial_lane_id": 2, "other_vehicles_type": "highway_env.vehicle.behavior.DefensiveVehicle"}),
        ("highway-v0", {"observation": {"type": "TimeToCollision", "horizon": 5}}),
        ("highway-v0", {"observation": {"type": "LidarObservation", "maximum_range": 45}}),
    ],
)
def test_what_it_knows_without_a_default_is_taken(env_id, config):
    check_config(env_id, config)


SPEEDS = "expected two speeds or more \\[m/s\\], each greater than the one before"
META, DISCRETE = {"type": "DiscreteMetaAction"}, {"type": "DiscreteAction"}
WRONG = [
    ("highway-fast-v0", {"initial_lane_id": 3}, "initial_lane_id = 3: expected None or a whole number from -3 to 2"),
    ("highway-fast-v0", {"initial_lane_id": -4}, "initial_lane_id = -4: expected None or a whole number from -3 to 2"),
    ("highway-fast-v0", {"lanes_count": 2, "initial_lane_id": 2}, "expected None or a whole number from -2 to 1"),
    ("exit-v0", {"lanes_count": 1}, "config.lanes_count = 1: expected >= 2"),
    ("exit-v0", {"lanes_count": 4.0}, "config.lanes_count = 4.0: expected a whole number >= 1"),
    ("highway-fast-v0", {"action": META | {"target_speeds": [20]}}, "config.action.target_speeds = .*: " + SPEEDS),
    ("highway-fast-v0", {"action": META | {"target_speeds": [20, float("nan")]}}, SPEEDS),
    ("highway-fast-v0", {"action": META | {"target_speeds": [30, 20]}}, SPEEDS),
    ("highway-fast-v0", {"action": META | {"target_speeds": 20}}, SPEEDS),
    (
        "intersection-multi-agent-v0",
        {"action": {"type": "MultiAgentAction", "action_config": META | {"target_speeds": [9]}}},
        "config.action.action_config.target_speeds = .*: " + SPEEDS,
    ),
    (
        "highway-fast-v0",
        {"action": DISCRETE | {"actions_per_axis": 2.5}},
        "config.action.actions_per_axis = 2.5: expected a whole number >= 1",
    ),
    ("highway-fast-v0", {"action": "DiscreteAction"}, "config.action = 'DiscreteAction': expected keys with values"),
    ("highway-fast-v0", {"action": {"type": []}}, r"config.action.type = \[\]: expected one of ContinuousAction"),
    ("roundabout-v0", {"incoming_vehicle_destination": 3}, "destination = 3: expected None or a whole number from 0"),
    ("roundabout-v1", {"incoming_vehicle_destination": "exr"}, "destination = 'exr': expected None or a whole number"),
    ("highway-fast-v0", {"controlled_vehicles": 0}, "config.controlled_vehicles = 0: expected a whole number >= 1"),
    ("merge-v0", {"controlled_vehicles": 0}, "config.controlled_vehicles = 0: expected a whole number >= 1"),
    ("intersection-v0", {"spawn_probability": 2}, "config.spawn_probability = 2: expected a number from 0 to 1"),
    ("intersection-v0", {"simulation_frequency": 0}, "config.simulation_frequency = 0: expected a number > 0"),
    ("merge-v0", {"other_vehicles_type": None}, "config.other_vehicles_type = None: expected a text"),
    ("highway-fast-v0", {"duration": None}, "config.duration = None: expected a finite number"),
    ("highway-fast-v0", [1], r"config = \[1\]: expected keys with values"),
    *(
        (env_id, {"other_vehicles_type": kind}, f"other_vehicles_type = {kind!r}: expected the path of a class")
        for env_id, kind in (
            ("highway-fast-v0", "highway_env.vehicle.controller.ControlledVehicle"),
            ("intersection-v0", "highway_env.vehicle.kinematics.Vehicle"),
            ("highway-fast-v0", "highway_env.vehicle.behavior.NoSuchVehicle"),
            ("merge-v0", "IDMVehicle"),
        )
    ),
]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (
            {"lane_count": 4},
            r"config\.lane_count is not known to .*; the nearest is config\.lanes_count, and it is ign",
        ),
        (
            {"observation": {"type": "Kinematics", "vehicle_count": 4}},
            r"the nearest is config\.observation\.vehicles_co",
        ),
    ],
)
def test_of_a_key_that_only_somebodys_own_code_could_read_there_is_a_warning(config, message):
    for maker in (make, partial(make_vec, num_envs=1), partial(make_vec, num_envs=1, backend="highway-env")):
        with pytest.warns(UserWarning, match=message):
            maker("highway-fast-v0", config=config)


@pytest.mark.parametrize(("env_id", "config", "message"), WRONG)
def test_what_an_environment_cannot_run_with_is_named_on_either_backend(env_id, config, message):
    with pytest.raises(ValueError, match=message):
        make(env_id, config=config)
    for backend in ("fast", "highway-env"):
        with pytest.raises(ValueError, match=message):
            make_vec(env_id, 1, backend=backend, config=config)


@pytest.mark.parametrize(
    ("env_id", "config"),
    [
        ("highway-fast-v0", {"lanes_count": np.int64(2), "initial_lane_id": 1, "duration": np.float32(9)}),
        ("highway-fast-v0", {"action": META | {"target_speeds": np.array([10, 20, 30])}}),
        ("exit-v0", {"lanes_count": 2}),
        ("merge-v0", {"controlled_vehicles": 1, "duration": 9}),
        ("roundabout-v0", {"destination": "exr", "incoming_vehicle_destination": 2}),
    ],
)
def test_what_an_environment_can_run_with_is_taken_on_either_backend(env_id, config):
    make(env_id, config=config).reset(seed=0)
    make_vec(env_id, 1, config=config)
    make_vec(env_id, 1, backend="highway-env", config=config).reset(seed=0)
