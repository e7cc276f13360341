"""Semantic actions on roads: the numbers of small scenes by hand, both simulators alike, the shield behind them."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from rss_shield import make, make_vec
from rss_shield.envs.semantic.outlook import (
    ACCELERATION,
    ALONG,
    AT,
    CLEARANCE,
    CLOSING_SPEED,
    DRIFT,
    FEATURES,
    FOLLOWS,
    IN_LANE,
    NEAR_FIELDS,
    PLANNED_ACCELERATION,
    TIME_TO_CONTACT,
    VALID,
    VALUE,
    look_around,
)
from rss_shield.envs.semantic.paths import POINTS_APART, straight_path
from rss_shield.envs.semantic.settings import SemanticSettings, semantic_settings
from rss_shield.envs.semantic.space import SemanticSpace
from rss_shield.shield.definitions.semantics import (
    AHEAD,
    BEHIND,
    LANE,
    LIMITS,
    NEIGHBOUR,
    NONE,
    PUSH,
    RELATION,
    SPEED,
    number_of_actions,
)

SIZE = (5.0, 2.0)  # of every car [m]
HIGHWAY, CROSSING = "highway-fast-v0", "intersection-v0"


def car(x, y, speed, heading=0.0):
    return [x, y, heading, speed, *SIZE, 0.0]


@pytest.fixture(scope="module")
def highway():
    env = make(HIGHWAY, None)
    return SemanticSpace(env.unwrapped, SemanticSettings())


def on_highway(space, *cars):
    return space.look(np.array(cars, float), 0, space.path(("0", "1", 0), "1"))


def row(space, lane, relation=NONE, slot=-1, speed=25 / 30, push=0):
    wanted = {LANE: lane, RELATION: relation, NEIGHBOUR: slot, SPEED: speed, PUSH: push}
    found = np.flatnonzero([all(np.isclose(action[f], wanted[f]) for f in wanted) for action in space.actions])
    assert len(found) == 1
    return int(found[0])


# ---------------------------------------------------------------- who is where


def test_neighbours_on_a_road_are_known_by_lane_and_the_nearest_come_first():
    lanes = np.array([0.0, 4.0, 8.0])
    points = np.array([[0.0, 0.0, 0.0, 1.0, 0.0]])
    cars = np.array(
        [car(100, 4, 25), car(140, 4, 20), car(90, 0, 30), car(80, 4, 28), car(300, 8, 20), car(130, 8, 20, 0.1)]
    )
    near, slots = np.zeros((6, NEAR_FIELDS)), np.zeros(3, np.int64)
    look_around(cars, 0, points, lanes, near, slots)
    assert slots.tolist() == [2, 3, 5]  # 10.8, 20 and 30.3 m away; the leader is 40 m away, the next one out of sight
    assert near[1, [AT, ALONG, IN_LANE, FOLLOWS]].tolist() == [140.0, 20.0, 1.0, 0.0]
    assert near[2, [AT, ALONG, IN_LANE, FOLLOWS]].tolist() == [90.0, 30.0, 0.0, 0.0]
    assert near[3, [AT, ALONG, IN_LANE, FOLLOWS]].tolist() == [80.0, 28.0, 1.0, 1.0]  # it drives behind the ego
    assert near[4, IN_LANE] == -1.0
    assert near[5, ALONG] == pytest.approx(20 * np.cos(0.1))


def test_who_crosses_the_path_is_as_far_away_as_it_has_left_to_the_crossing():
    # the path runs along x; one comes from the left, another drives away from it, a third meets the ego on its path
    x = np.arange(0.0, 100.0, POINTS_APART)
    points = np.stack([x, 0 * x, 0 * x, 1 + 0 * x, 0 * x], axis=1)
    cars = np.array(
        [car(5, 0, 8), car(20, -30, 6, np.pi / 2), car(40, 10, 6, np.pi / 2), car(70, 0, 9, np.pi), car(30, 0.5, 4)]
    )
    near, slots = np.zeros((5, NEAR_FIELDS)), np.zeros(4, np.int64)
    look_around(cars, 0, points, np.zeros(1), near, slots)
    # the first point less than 1.5 m beside its way is at 19 m, and it has 30 m left
    assert near[1, [AT, ALONG, IN_LANE]].tolist() == [pytest.approx(19.0 - 30.0), 6.0, 0.0]
    assert near[2, IN_LANE] == -1.0
    # head on: the first point before it, where the ego is, with 65 m left
    assert near[3, [AT, ALONG]].tolist() == [pytest.approx(5.0 - 65.0), 9.0]
    assert near[4, [AT, ALONG]].tolist() == [30.0, 4.0]
    assert set(slots.tolist()) == {1, 3, 4, -1}


# ---------------------------------------------------------------- what it leads to


def test_the_value_of_keeping_on_is_the_reward_of_keeping_on(highway):
    # 25 m/s is half of 20 to 30: 0.5 * 0.4; the rightmost lane: 0.1; scaled from -1...0.5 to 0...1
    seen = on_highway(highway, car(100, 8, 25))
    assert seen.value[row(highway, 2)] == pytest.approx((0.3 + 1.0) / 1.5)
    # the middle lane is half as far right
    seen = on_highway(highway, car(100, 4, 25))
    assert seen.value[row(highway, 1)] == pytest.approx((0.25 + 1.0) / 1.5)
    assert seen.features[row(highway, 1), TIME_TO_CONTACT] == 1.0
    assert seen.features[row(highway, 1), CLEARANCE] == 1.0


def test_a_contact_is_where_boxes_meet_and_nothing_is_earned_after_it(highway):
    # 55 m to one that stands; less than 1 m are left after 2.16 s, seen at 2.4 s, the twelfth frame of thirty
    seen = on_highway(highway, car(100, 8, 25), car(160, 8, 0))
    a = row(highway, 2)
    assert seen.features[a, TIME_TO_CONTACT] == pytest.approx(11 / 30)
    earned = (0.3 + 1.0) / 1.5
    assert seen.value[a] == pytest.approx((12 * earned - 1.0 / 1.5 * 5) / 30)
    # a lane on the left has nobody; it costs a share of the bonus for the right. 3 m are needed by 2.4 s: at 2 m/s^2
    # bang-bang has come 4 - (2.83 - 2.4)^2 = 3.8 m, at 1 m/s^2 4 - 0.5 * (4 - 2.4)^2 = 2.7 m
    assert seen.value[row(highway, 1, push=1)] == pytest.approx((0.25 + 1.0) / 1.5)
    assert seen.features[row(highway, 1), TIME_TO_CONTACT] == pytest.approx(11 / 30)
    assert seen.features[row(highway, 1), VALID] == 1.0
    assert highway.actions[seen.best, LANE] != 2


def test_who_drives_behind_in_the_same_lane_is_no_contact_and_who_does_in_another_is(highway):
    # to the left at 1 m/s^2 the ego is less than 1 m beside the other after 1.4 s; 20 m at 8 m/s take it 1.75 s
    seen = on_highway(highway, car(100, 8, 20), car(90, 8, 30), car(80, 4, 28))
    slow = {"speed": 20 / 30}
    assert seen.features[row(highway, 2, **slow), TIME_TO_CONTACT] == 1.0
    assert seen.features[row(highway, 1, **slow), TIME_TO_CONTACT] == pytest.approx(9 / 30)


def test_an_action_about_somebody_is_there_in_its_lane_only(highway):
    seen = on_highway(highway, car(100, 4, 25), car(120, 8, 20))
    for lane in range(3):
        for relation in (BEHIND, AHEAD):
            assert seen.valid[row(highway, lane, relation, 0)] == (lane == 2)
            assert not seen.valid[row(highway, lane, relation, 1)]
        assert seen.valid[row(highway, lane)]
    assert seen.features[row(highway, 2, BEHIND, 0), CLOSING_SPEED] == pytest.approx(0.5)
    assert np.all(seen.features[~seen.valid] == 0.0) and np.all(seen.plans[~seen.valid, :, PLANNED_ACCELERATION] == 0.0)
    missing = row(highway, 1, BEHIND, 0, push=1)
    assert highway.valid_instead(missing, seen) == row(highway, 1, push=1)
    assert highway.valid_instead(row(highway, 2, AHEAD, 0), seen) == row(highway, 2, AHEAD, 0)


def test_plans_keep_to_the_limits_of_their_push(highway):
    seen = on_highway(highway, car(100, 4, 25), car(125, 4, 20), car(110, 8, 24))
    for push, name in enumerate(highway.settings.pushes):
        chosen = seen.valid & (highway.actions[:, PUSH] == push)
        a = seen.plans[chosen, :, PLANNED_ACCELERATION]
        assert a.max() <= LIMITS[name].a_accel + 1e-9 and a.min() >= -LIMITS[name].a_brake - 1e-9
        jerk = np.abs(np.diff(a, axis=1, prepend=0.0)) / 0.2
        assert jerk.max() <= LIMITS[name].jerk + 1e-9
    changes = seen.plans[row(highway, 2), :, DRIFT]
    # from rest across the road, 1 m/s^2 for 0.2 s a frame
    np.testing.assert_allclose(changes, [0.2, 0.4, 0.6, 0.8, 1.0])
    assert np.all(np.isinf(seen.plans[row(highway, 1), :, DRIFT]))


def test_the_meta_action_goes_toward_the_lane(highway):
    names = {number: name for name, number in highway.labels.items()}
    for lane, heads_for, name in ((0, 2, "LANE_LEFT"), (1, 1, "IDLE"), (2, 1, "LANE_RIGHT"), (2, 0, "LANE_RIGHT")):
        assert names[highway.label(row(highway, lane), heads_for)] == name


# ---------------------------------------------------------------- carried out


def test_without_a_shield_the_ego_has_the_speeds_of_its_trajectory():
    env = make(HIGHWAY, None, semantic_actions=True, config={"vehicles_count": 0})
    env.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(12):
        a = int(rng.choice(np.flatnonzero(env.action_masks())))
        plan, v = env.outlook.plans[a], env.unwrapped.vehicle.speed
        for acceleration in plan[:, PLANNED_ACCELERATION]:
            v += acceleration * 0.2
        *_, info = env.step(a)
        assert env.unwrapped.vehicle.speed == pytest.approx(v, abs=1e-9)
        assert info["semantic_action"] == a and 0.0 < info["semantic_value"] <= 1.0


def test_a_calm_lane_change_takes_longer_than_a_brisk_one():
    lasted = {}
    for push in ("calm", "brisk"):
        env = make(HIGHWAY, None, semantic_actions={"pushes": (push,)}, config={"vehicles_count": 0})
        env.reset(seed=1)
        ego = env.unwrapped.vehicle
        start = int(ego.lane_index[2])
        goal = 0 if start else 1
        lasted[push], drifts = 0, []
        while abs(ego.position[1] - 4.0 * goal) > 0.5:
            before = ego.position[1]
            env.step(row(env.space, goal))
            lasted[push] += 1
            drifts.append(abs(ego.position[1] - before))
        # bang-bang over 4 m with at most a: never faster than sqrt(4 a)
        assert max(drifts) <= np.sqrt(4.0 * abs(goal - start) * LIMITS[push].a_lat) + 1e-9
    assert lasted["calm"] > lasted["brisk"]


@pytest.mark.parametrize("env_id", [HIGHWAY, CROSSING])
def test_both_simulators_have_the_same_episodes_to_the_last_bit(env_id):
    options = {"semantic_actions": {"features": True}}
    single = make(env_id, "override", **options)
    many = make_vec(env_id, 2, "override", autoreset_mode=AutoresetMode.DISABLED, **options)
    seen, _ = many.reset(seed=5)
    rng, done = np.random.default_rng(1), np.zeros(2, bool)
    chosen = [[], []]
    observed, earned = [[seen[e]] for e in range(2)], [[], []]
    while not done.all():
        actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in many.action_masks()])
        seen, rewards, terminated, truncated, _ = many.step(actions)
        for e in np.flatnonzero(~done):
            chosen[e].append(int(actions[e]))
            observed[e].append(seen[e])
            earned[e].append(rewards[e])
        done |= terminated | truncated
    for e in range(2):
        seen, _ = single.reset(seed=5 + e)
        np.testing.assert_array_equal(seen, observed[e][0])
        for t, a in enumerate(chosen[e]):
            seen, reward, *_ = single.step(a)
            assert reward == earned[e][t], (e, t)
            np.testing.assert_array_equal(seen, observed[e][t + 1])
    assert sum(map(len, chosen)) > 10


@pytest.mark.parametrize("env_id", [HIGHWAY, CROSSING])
def test_behind_the_shield_nobody_at_fault_whatever_is_chosen(env_id):
    env = make_vec(env_id, 24, "override", semantic_actions=True)
    env.reset(seed=100)
    rng, ended, verdicts = np.random.default_rng(0), 0, []
    while ended < 48:
        actions = rng.integers(env.single_action_space.n, size=24)
        _, _, terminated, truncated, infos = env.step(actions)
        over = terminated | truncated
        ended += over.sum()
        if over.any():
            final = infos["final_info"]
            verdicts += final["blame"][over].tolist()
            assert final["episode"]["l"][over].min() >= 1 and not final["cost"][over].any()
            assert "episode" not in infos and not infos["_raw_reward"][over].any()
    assert not {"ego", "both"} & set(verdicts)


def test_episodes_that_begin_in_the_same_step_are_those_begun_by_hand():
    options = {"semantic_actions": {"features": True}}
    same = make_vec(HIGHWAY, 3, "monitor", **options)
    by_hand = make_vec(HIGHWAY, 3, "monitor", autoreset_mode=AutoresetMode.DISABLED, **options)
    np.testing.assert_array_equal(same.reset(seed=7)[0], by_hand.reset(seed=7)[0])
    rng, ended = np.random.default_rng(2), 0
    while ended < 4:
        actions = rng.integers(same.single_action_space.n, size=3)
        seen, rewards, terminated, truncated, infos = same.step(actions)
        last, expected, *over, told = by_hand.step(actions)
        np.testing.assert_array_equal(rewards, expected)
        done = over[0] | over[1]
        np.testing.assert_array_equal(terminated | truncated, done)
        if done.any():
            np.testing.assert_array_equal(infos["final_obs"][done], last[done])
            assert (infos["final_info"]["episode"]["r"] == told["episode"]["r"]).all()
            last, told = by_hand.reset(options={"reset_mask": done})
        np.testing.assert_array_equal(seen, last)
        assert (infos["time"] == told["time"])[done].all() and (infos["time"][done] == 0.0).all()
        ended += done.sum()


# ---------------------------------------------------------------- what is refused


def test_settings_are_checked_where_they_enter():
    assert semantic_settings(False) is None and semantic_settings(True) == SemanticSettings()
    assert semantic_settings({"pushes": ["calm"]}).pushes == ("calm",)
    for given, said in (
        ({"neighbours": 13}, "neighbours = 13: expected a whole number, 0 to 12"),
        ({"speeds": (0.5, 1.5)}, "speeds = .*expected shares from 0 to 1"),
        ({"pushes": ("wild",)}, "expected some of calm, brisk, hard"),
        ({"headway": -1.0}, "headway = -1.0: expected 0 to 10 s"),
        ({"gap": 51}, "gap = 51: expected 0 to 50 m"),
        ({"horizon": 0.5}, "horizon = 0.5: expected 1 to 30 s"),
        ({"features": 1}, "features = 1: expected True or False"),
        ({"lanes": 2}, "expected True, False or a dict with some of neighbours"),
        ("yes", "semantic_actions = 'yes'"),
    ):
        with pytest.raises(ValueError, match=said):
            make(HIGHWAY, semantic_actions=given)


@pytest.mark.parametrize("made", [make, lambda env_id, **options: make_vec(env_id, 2, **options)])
def test_other_roads_actions_and_replacements_are_refused(made):
    with pytest.raises(ValueError, match=r"semantic_actions in MergeEnv: expected one of highway-v0"):
        made("merge-v0", semantic_actions=True)
    with pytest.raises(ValueError, match=r"action type ContinuousAction: expected DiscreteMetaAction"):
        made(HIGHWAY, semantic_actions=True, config={"action": {"type": "ContinuousAction"}})
    with pytest.raises(ValueError, match=r"without the meta-actions LANE_LEFT, LANE_RIGHT"):
        made(HIGHWAY, semantic_actions=True, config={"action": {"type": "DiscreteMetaAction", "lateral": False}})
    with pytest.raises(ValueError, match=r"replace = 'decision' with semantic_actions"):
        made(HIGHWAY, semantic_actions=True, replace="decision")


def test_the_space_is_linear_in_neighbours_and_lanes():
    for lanes, neighbours in ((3, 0), (3, 2), (5, 4)):
        env = make(HIGHWAY, None, semantic_actions={"neighbours": neighbours}, config={"lanes_count": lanes})
        assert env.action_space.n == number_of_actions(lanes, neighbours, 3, 2) == lanes * (1 + 2 * neighbours) * 6
    env = make(CROSSING, semantic_actions={"neighbours": 4, "features": True})
    assert env.action_space.n == 9 * 6 and env.observation_space.shape == (54, len(FEATURES))
    with pytest.raises(ValueError, match="expected a whole number from 0 to 53"):
        env.step(54)
    env = make(HIGHWAY, None, semantic_actions=True)
    env.reset(seed=0, options={"config": {"lanes_count": 2}})
    assert env.action_space.n == 2 * 7 * 6
    assert straight_path(make(HIGHWAY, None).unwrapped.road.network.graph["0"]["1"]).lanes.tolist() == [0, 4, 8]


def test_an_acceleration_goes_on_with_the_one_before(highway):
    # brisk: 4 m/s^3, so 0.8 m/s^2 a frame beside what was applied last
    slowing = car(100, 8, 25)
    slowing[ACCELERATION] = -3.0
    seen = on_highway(highway, slowing)
    np.testing.assert_allclose(seen.plans[row(highway, 2, speed=1.0), :3, PLANNED_ACCELERATION], [-2.2, -1.4, -0.6])
    assert 0.0 < seen.features[row(highway, 2, speed=1.0), VALUE] < 1.0
