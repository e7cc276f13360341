"""Traffic of `LinearVehicle` and its kinds: the same episodes as in highway-env."""

import numpy as np
import pytest
from highway_env.vehicle.behavior import AggressiveVehicle, LinearVehicle
from test_views import agree

import rss_shield
from rss_shield.envs._numpy.blas import FUSED_FIRST, FUSED_SECOND, PLAIN, ROUNDING, THREE_ARE_KNOWN, three_are_known
from rss_shield.envs.fast import linear_drivers
from rss_shield.envs.fast.config import Unsupported, compile_scenario

ENV = "highway-fast-v0"
KINDS = [name for name in linear_drivers.KINDS if not name.endswith("IDMVehicle")]
pytestmark = pytest.mark.skipif(not THREE_ARE_KNOWN, reason="numpy rounds in a way that the engine does not know")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", [ENV, "merge-v0", "exit-v1", "roundabout-v0", "intersection-v0", "u-turn-v1"])
def test_episodes_agree(env_id, kind):
    agree(env_id, config={"other_vehicles_type": kind})


@pytest.mark.parametrize("shield", ["override", "monitor"])
@pytest.mark.parametrize("env_id", [ENV, "intersection-v0"])
def test_a_shield_among_them_agrees(env_id, shield):
    agree(env_id, "faster", config={"other_vehicles_type": KINDS[1]}, shield=shield)


def test_their_habits_are_those_of_the_class_until_drawn():
    scenario = compile_scenario("merge-v0", {"other_vehicles_type": KINDS[1]})
    usual = [*AggressiveVehicle.ACCELERATION_PARAMETERS, *AggressiveVehicle.STEERING_PARAMETERS]
    np.testing.assert_array_equal(scenario.linear, [*usual, 2.0])
    assert scenario.config["time_wanted"] == LinearVehicle.TIME_WANTED == 2.5
    env = rss_shield.make_vec("merge-v0", 2, shield=None, config={"other_vehicles_type": KINDS[1]})
    env.reset(seed=0)
    cars = env.engine.batch.cars[0]
    assert (cars["gain_gap"] == AggressiveVehicle.ACCELERATION_PARAMETERS[2]).all()
    env = rss_shield.make_vec(ENV, 2, shield=None, config={"other_vehicles_type": KINDS[1]})
    env.reset(seed=0)
    gains = env.engine.batch.cars[0]["gain_gap"][1:]
    # drawn from half to one and a half times 2.0, whatever the class has
    assert len(np.unique(gains)) == len(gains)
    assert gains.min() >= 1.0
    assert gains.max() <= 3.0


def test_the_sum_of_three_products_is_asked_of_numpy():
    assert three_are_known(ROUNDING)
    assert not three_are_known(FUSED_FIRST)
    assert not all(three_are_known(way) for way in (PLAIN, FUSED_SECOND))


def test_other_traffic_is_refused_by_name(monkeypatch):
    with pytest.raises(Unsupported, match=r"Tailgater.*LinearVehicle"):
        compile_scenario(ENV, {"other_vehicles_type": "rss_shield.envs.worlds.random_roads.Tailgater"})
    monkeypatch.setattr(linear_drivers, "THREE_ARE_KNOWN", False)
    with pytest.raises(Unsupported, match="AggressiveVehicle with the way in which numpy"):
        compile_scenario(ENV, {"other_vehicles_type": KINDS[1]})
