"""Who held the ego back at a junction."""

import numpy as np
import pytest

from rss_shield import make, make_vec


def _episodes(env, seeds, action, steps=16):
    for seed in seeds:
        env.reset(seed=seed)
        for _ in range(steps):
            *_, terminated, truncated, info = env.step(action)
            yield info, env.unwrapped
            if terminated or truncated:
                break


@pytest.mark.parametrize(
    ("env_id", "action", "options"),
    [
        ("intersection-v0", 2, {"intent": "known"}),
        ("intersection-v2", 2, {}),
        ("roundabout-v0", 3, {}),
        ("intersection-v0", 2, {"waiting": "anywhere", "entry": "assertive"}),
    ],
)
def test_whenever_the_ego_is_held_back_somebody_is_named_also_while_it_stands(env_id, action, options):
    standing = 0
    for info, env in _episodes(make(env_id, **options), range(3), action):
        said = info["shield"]
        if said["response"] != "none":
            partner = env.road.vehicles[said["partner"]] if said["partner"] >= 0 else None
            assert partner is not None and partner is not env.vehicle
            standing += env.vehicle.speed < 0.1
        elif not said["intervened"]:
            assert said["partner"] == -1
    assert standing > 0


@pytest.mark.parametrize("seed", [3, 8, 21])
def test_the_only_other_car_is_who_holds_the_ego_back(seed):
    env = make("intersection-v0", config={"initial_vehicle_count": 1, "spawn_probability": 0.0})
    for info, world in _episodes(env, [seed], 2):
        others = [i for i, car in enumerate(world.road.vehicles) if car is not world.vehicle]
        assert info["shield"]["partner"] in (others if info["shield"]["response"] != "none" else [-1, *others])


def test_a_red_light_is_nobody():
    env = make("signalised-intersection-v0", config={"initial_vehicle_count": 0, "spawn_probability": 0.0})
    held = [info["shield"] for info, world in _episodes(env, range(4), 2) if info["shield"]["intervened"]]
    assert held and all(said["partner"] == -1 for said in held)


@pytest.mark.parametrize("env_id", ["intersection-v0", "intersection-v2", "roundabout-v0", "roundabout-v1"])
def test_both_backends_name_the_same_partner(env_id):
    fast, original = (make_vec(env_id, 2, backend=backend, intent="any") for backend in ("fast", "highway-env"))
    fast.reset(seed=4)
    original.reset(seed=4)
    named = 0
    for _ in range(24):
        actions = np.full(2, fast.single_action_space.n - 1 if "inter" in env_id else 3)
        infos, infos_original = (env.step(actions)[4]["shield"] for env in (fast, original))
        np.testing.assert_array_equal(infos["partner"], infos_original["partner"])
        named += (infos["partner"] >= 0).sum()
    assert named > 3
