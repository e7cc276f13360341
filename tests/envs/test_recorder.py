"""A recorded episode is the one that would have been played anyway, and its numbers are the simulator's."""

import gymnasium as gym
import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.recorder import Film, record_trace
from rss_shield.envs.roads.lanes import road_through
from rss_shield.shield.trace import CHANGED_BY, load, save

FASTER = 3
SMALL = {"vehicles_count": 12, "duration": 12}


def faster(observation):
    return FASTER


def play(env, seed):
    env.reset(seed=seed)
    rewards, ended = [], False
    while not ended:
        _, reward, terminated, truncated, info = env.step(FASTER)
        rewards.append(reward)
        ended = terminated or truncated
    return rewards, [tuple(v.position) for v in env.unwrapped.road.vehicles], info


@pytest.mark.parametrize("mode", ["override", "monitor", None])
def test_filming_changes_nothing(mode):
    env = make("highway-fast-v0", mode, config=SMALL)
    expected, places, info = play(env, 4)
    env = make("highway-fast-v0", mode, config=SMALL)
    env.reset(seed=4)
    film, rewards, ended = Film(env, 4), [], False
    while not ended:
        _, reward, terminated, truncated, filmed = env.step(FASTER)
        film.look_for_contacts()
        rewards.append(reward)
        ended = terminated or truncated
    trace = film.develop(filmed)
    assert rewards == expected
    assert filmed.get("blame") == info.get("blame")
    users = trace.users
    assert [(users.x[-1, i], users.y[-1, i]) for i in range(len(users.ids))] == places
    assert len(trace.time) == 5 * len(rewards) + 1  # 5 frames a decision, and where everybody has got to


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v0", "intersection-v0"])
def test_commands_move_everybody_from_one_sample_to_the_next(env_id):
    """highway-env's equations, by explicit Euler: the centre moves at the slip angle, wheels turn the rear axle."""
    trace = record_trace(make(env_id), lambda observation: 1, 3)
    u, dt = trace.users, trace.dt
    slip = np.arctan(0.5 * np.tan(u.steering[:-1]))
    x = u.x[:-1] + u.speed[:-1] * np.cos(u.heading[:-1] + slip) * dt
    speed = u.speed[:-1] + u.acceleration[:-1] * dt
    heading = u.heading[:-1] + u.speed[:-1] * np.sin(slip) / (u.length / 2) * dt
    known = np.isfinite(x) & u.present[1:] & ~u.crashed[1:]
    assert known.sum() > 500
    for expected, found in ((x, u.x[1:]), (speed, u.speed[1:]), (heading, u.heading[1:])):
        np.testing.assert_allclose(found[known], expected[known], atol=1e-9)


def test_what_the_shield_did_is_in_the_trace(tmp_path):
    trace = record_trace(make("highway-fast-v0", config=SMALL), faster, 4)
    save(trace, tmp_path / "one.npz")
    trace = load(tmp_path / "one.npz")
    (ego,) = trace.egos
    executed = trace.users.acceleration[:, ego.user]
    changed = ego.changed_by == CHANGED_BY.index("response")
    assert changed.any()
    assert (executed[changed] < ego.wanted_acceleration[changed]).any()
    free = (ego.changed_by == 0)[:-1]
    np.testing.assert_array_equal(executed[:-1][free], ego.wanted_acceleration[:-1][free])
    # bumper to bumper, by hand: the road is straight along x, cars are 5 m long
    t, ahead = next((t, i) for t, i in enumerate(ego.neighbour[:, 0]) if i >= 0)
    gap = trace.users.x[t, ahead] - trace.users.x[t, ego.user] - 5.0
    assert ego.gap[t, 0] == pytest.approx(gap, abs=0.2)  # a car at an angle is a little longer
    kinds = [event.kind for event in trace.events]
    assert kinds.count("response begins") >= kinds.count("response ends") > 0


def test_a_contact_and_its_verdict_are_in_the_trace():
    trace = record_trace(make("highway-fast-v0", "monitor", config=SMALL), faster, 4)
    (contact,) = trace.contacts
    assert contact.verdict == trace.meta["blame"] == "ego"
    assert contact.evidence["ego_duty"]
    verdict = next(event for event in trace.events if event.kind == "verdict")
    hit = next(event for event in trace.events if event.kind == "contact")
    assert verdict.partner == contact.partner and {hit.user, hit.partner} == {0, contact.partner}


def test_a_bare_environment_can_be_filmed():
    trace = record_trace(gym.make("highway-fast-v0", config=SMALL), faster, 4)
    assert trace.meta["mode"] == "off" and not trace.contacts
    assert np.isnan(trace.egos[0].wanted_acceleration).all()


def test_lights_and_plans_are_in_the_trace():
    trace = record_trace(make("signalised-intersection-v0", config={"duration": 8}), lambda o: 1, 2)
    assert {light.id for light in trace.lights} == {"o0", "o1", "o2", "o3"}
    vertical, horizontal = (next(x.signal for x in trace.lights if x.id == name) for name in ("o0", "o1"))
    assert not ((vertical == 0) & (horizontal == 0)).any()  # never green together
    (ego,) = trace.egos
    t = 20
    x, y = (np.interp(ego.path_s[t], *trace.paths[ego.path[t]][:, [0, k]].T) for k in (1, 2))
    assert np.hypot(x - trace.users.x[t, ego.user], y - trace.users.y[t, ego.user]) < 1.0
    assert (ego.plan_end[:-1] >= ego.path_s[:-1]).all()


@pytest.mark.parametrize("env_id", ["merge-v0", "u-turn-v0", "roundabout-v0", "two-way-v0"])
def test_lanes_are_where_they_are_in_the_simulator(env_id):
    env = make(env_id)
    env.reset(seed=0)
    trace = Film(env).develop()
    network = env.unwrapped.road.network
    for lane, index in zip(trace.lanes, network.lanes_dict(), strict=True):
        real = network.get_lane(index)
        for x, y, heading in lane.centre:
            s, lateral = real.local_coordinates((x, y))
            assert abs(lateral) < 1e-6
            assert np.cos(heading - real.heading_at(s)) == pytest.approx(1.0)
        nodes = {tuple(one.split(":")[0].split(">")) for one in lane.successors}
        # where a lane just ends, the nearest one beside it
        assert all(start in (index[1], index[0]) for start, _ in nodes)
    assert len(road_through(network, next(iter(network.lanes_dict()))))


def test_an_oncoming_lane_is_a_neighbour():
    """two-way-v0: y = 0 one way and back, y = 4 one way. Who drives back has the latter on its left."""
    env = make("two-way-v0")
    env.reset(seed=0)
    lanes = {lane.id: lane for lane in Film(env).develop().lanes}
    oncoming = {lane.id: lane.left for lane in lanes.values() if lane.left_runs_opposite or lane.right_runs_opposite}
    assert oncoming == {"b>a:0": "a>b:1"}
    assert (lanes["a>b:1"].left, lanes["a>b:0"].right) == ("a>b:0", "a>b:1")
