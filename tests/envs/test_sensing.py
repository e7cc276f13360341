"""What goes wrong between the world and a shield on highway-env: off changes nothing, the judge sees what is there."""

import copy
import math
import pickle

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.senses import Senses, semantic_errors
from rss_shield.envs.sensing import (
    ALONG,
    GHOST,
    HISTORY,
    MISS,
    NEVER,
    PERCEPT,
    Sensing,
    age_of,
    drawn,
    goes_wrong,
    haunt,
    meet,
    mixed,
    perceive,
    position_of,
)
from rss_shield.shield.definitions.signals import GREEN, RED, YELLOW

DT = 1 / 15
EVERYTHING = dict(along=0.5, across=0.3, speed=1.0, heading=0.02, misses=0.2, ghosts=0.3, wrong_lane=0.1, latency=0.1)


def drive(env, seed, steps=25, action=3):
    """Observations, speeds and infos of an episode."""
    told = [env.reset(seed=seed)[0]]
    infos = []
    for _ in range(steps):
        observation, _, terminated, truncated, info = env.step(action)
        told.append(observation)
        infos.append(info)
        if terminated or truncated:
            break
    return np.array(told), infos


def watched(sensing, frames, x=100.0, speed=20.0, seed=0):
    """What is known of a car that drives on at one speed: `[T]` of (seen, x error, age)."""
    sensor, percept = sensing.sensor(DT), np.zeros(1, PERCEPT)[0]
    meet(percept, mixed(np.uint64(seed), 0), 0, x, 4.0, 0.0, speed, DT)
    rows = []
    for frame in range(frames):
        x_now = x + speed * frame * DT
        seen = perceive(percept, frame, x_now, 4.0, 0.0, speed, 50.0, sensor)
        rows.append((seen, position_of(percept, frame, sensor)[0] - x_now, age_of(percept, frame, sensor)))
    return np.array(rows, float)


# ---------------------------------------------------------------- the numbers


def test_draws_are_uniform_and_depend_on_everything_they_are_drawn_for():
    numbers = np.array([drawn(np.uint64(7), ALONG, 0, block) for block in range(20000)])
    counts = np.histogram(numbers, bins=20, range=(0.0, 1.0))[0]
    assert numbers.min() >= 0.0 and numbers.max() < 1.0
    assert ((counts - 1000.0) ** 2 / 1000.0).sum() < 43.8  # chi^2 of 19 degrees of freedom at 0.001
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 0.03
    for others in (
        [drawn(np.uint64(8), ALONG, 0, block) for block in range(2000)],
        [drawn(np.uint64(7), MISS, 0, block) for block in range(2000)],
        [drawn(np.uint64(7), ALONG, 1, block) for block in range(2000)],
    ):
        assert abs(np.corrcoef(numbers[:2000], others)[0, 1]) < 0.08


def test_two_of_three_err_together_as_often_as_the_binomial_says():
    # 3 p^2 (1 - p) + p^3 for p = 0.3: 0.216
    n = 20000
    wrong = sum(goes_wrong(np.uint64(3), MISS, block, 0.3, 3) for block in range(n))
    assert wrong / n == pytest.approx(0.216, abs=4 * math.sqrt(0.216 * 0.784 / n))


def test_bounded_errors_stay_within_bounds_and_gaussian_ones_have_their_deviation():
    rows = watched(Sensing(along=0.5), 3000)
    assert np.abs(rows[:, 1]).max() <= 0.5 and rows[:, 1].std() == pytest.approx(0.5 / math.sqrt(3.0), rel=0.05)
    rows = watched(Sensing(along=0.5, noise="gaussian"), 3000)
    assert np.abs(rows[:, 1]).max() > 1.0 and rows[:, 1].std() == pytest.approx(0.5, rel=0.05)


def test_the_middle_of_three_errs_less():
    # variance of the median of three uniform numbers in [-1, 1]: 1/5 instead of 1/3
    rows = watched(Sensing(along=1.0, subsystems=3), 4000)
    assert rows[:, 1].std() == pytest.approx(math.sqrt(0.2), rel=0.05)


def test_an_error_lasts_for_its_time():
    errors = watched(Sensing(along=0.5, hold=1.0), 150)[:, 1]
    assert len(np.unique(np.round(errors, 9))) in (10, 11)


def test_latency_shows_what_was():
    rows = watched(Sensing(latency=0.2), 50)
    assert rows[:, 1] == pytest.approx(-20.0 * 3 * DT) and rows[:, 2] == pytest.approx(3 * DT)


def test_a_shield_that_inflates_moves_on_what_it_has_seen():
    rows = watched(Sensing(latency=0.2, misses=0.3, inflate=True), 300)
    assert rows[:, 0].all() and rows[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert rows[:, 2].max() == pytest.approx(6 * DT)  # three frames late, and not seen for three


def test_misses_take_their_share_and_are_never_longer_than_said():
    seen = watched(Sensing(misses=0.3, miss_duration=0.2), 9000)[:, 0]
    assert 1.0 - seen.mean() == pytest.approx(0.3, abs=0.03) and seen[:3].all()
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[1.0], seen, [1.0]]))))[::2]
    assert runs.max() == 3


def test_excess_breaks_the_promise():
    rows = watched(Sensing(along=0.5, latency=0.1, excess=2.0), 500)  # 0.2 s are three frames, 0.1 s are two
    assert 0.9 < np.abs(rows[:, 1] + 20.0 * 3 * DT).max() <= 1.0  # twice the error, three frames instead of two
    assert rows[:, 2] == pytest.approx(2 * DT)  # said to be two frames old


def test_out_of_range_nobody_is_seen():
    sensor, percept = Sensing(range=80.0, inflate=True).sensor(DT), np.zeros(1, PERCEPT)[0]
    meet(percept, np.uint64(1), 0, 90.0, 0.0, 0.0, 20.0, DT)
    assert percept["stamp"] == NEVER
    assert not perceive(percept, 0, 90.0, 0.0, 0.0, 20.0, 90.0, sensor)
    assert perceive(percept, 1, 79.0, 0.0, 0.0, 20.0, 79.0, sensor)
    assert not perceive(percept, 2, 81.0, 0.0, 0.0, 20.0, 81.0, sensor)


def test_ghosts_take_their_share_and_drive_on():
    sensor, ghost = Sensing(ghosts=0.3, ghost_duration=0.5).sensor(DT), np.zeros(1, PERCEPT)[0]
    ghost["since"], there, places = -1, [], []
    for frame in range(8000):
        there.append(haunt(ghost, np.uint64(5), frame, 0.0, 0.0, 0.0, 20.0, sensor))
        places.append((float(ghost["x"]), float(ghost["y"]), int(ghost["since"]), float(ghost["speed"])))
    assert np.mean(there) == pytest.approx(0.3, abs=0.04)
    for frame in np.flatnonzero(there)[:500]:
        x, y, since, speed = places[frame]
        assert 10.0 <= x - speed * (frame - since) * DT <= 60.0 and abs(y) in (0.0, 4.0) and 0.0 <= speed <= 20.0
    assert any(drawn(np.uint64(5), GHOST, 0, block) < 0.3 for block in range(10))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (dict(along=-1.0), r"sensing.along = -1.0: expected a finite number >= 0"),
        (dict(misses=0.6), r"sensing.misses = 0.6: expected a finite number >= 0 and <= 0.5"),
        (dict(noise="pink"), r"sensing.noise = 'pink': expected one of bounded, gaussian"),
        (dict(subsystems=2), r"sensing.subsystems = 2: expected one of 1, 3"),
        (dict(range=0.0), r"sensing.range = 0.0: expected a number > 0"),
        (dict(inflate=1), r"sensing.inflate = 1: expected True or False"),
        (dict(across=1.0, inflate=True), r"sensing.across = 1.0 with inflate: expected .* <= 0.9 m"),
        (dict(across=0.4, noise="gaussian", inflate=True), r"sensing.across = 0.4 with inflate"),
        (dict(latency=4.0, excess=2.0), r"sensing.latency = 4.0 with excess = 2.0: expected <= 6 s in all"),
        (dict(fog=1.0), r"sensing has an unknown field 'fog'"),
    ],
)
def test_nonsense_is_refused_by_name(given, message):
    with pytest.raises(ValueError, match=message):
        make("highway-fast-v0", sensing=given).reset(seed=0)


@pytest.mark.parametrize(
    ("env_id", "shield", "given", "message"),
    [
        ("highway-fast-v0", None, dict(), "expected None without a shield"),
        ("intersection-v0", "override", dict(inflate=True), "expected False where roads cross"),
        ("intersection-v0", "override", dict(wrong_light=0.1), "expected 0 where there are no lights"),
        ("intersection-multi-agent-v0", "override", dict(agent=True), "expected False for several agents"),
    ],
)
def test_what_makes_no_sense_somewhere_is_refused_there(env_id, shield, given, message):
    with pytest.raises(ValueError, match=message):
        make(env_id, shield, sensing=given)


# ---------------------------------------------------------------- episodes


def test_sensing_without_errors_changes_nothing():
    plain, sensed = make("highway-fast-v0"), make("highway-fast-v0", sensing={})
    for seed in (0, 3):
        (seen, infos), (seen_too, infos_too) = drive(plain, seed), drive(sensed, seed)
        assert np.array_equal(seen, seen_too)
        for info, other in zip(infos, infos_too, strict=True):
            assert info["shield"].items() == other["shield"].items() and info["cost"] == other["cost"]


def test_errors_have_a_seed_and_leave_the_traffic_alone():
    runs = [drive(make("highway-fast-v0", sensing=EVERYTHING | {"seed": seed}), 5)[1] for seed in (0, 0, 1)]
    shares = [[info["shield"]["override_fraction"] for info in infos] for infos in runs]
    assert shares[0] == shares[1] != shares[2]
    first = [make("highway-fast-v0", sensing=given).reset(seed=5)[0] for given in (None, EVERYTHING)]
    assert np.array_equal(*first)


def test_who_is_never_seen_is_driven_into_and_the_judge_knows():
    blind = make("highway-fast-v0", sensing=dict(range=0.1))
    infos = drive(blind, 0, 40)[1]
    assert infos[-1]["crashed"] and infos[-1]["blame"] == "ego"
    assert infos[-1]["episode_dangerous_pairs"] > 0
    assert not any(info["shield"]["intervened"] for info in infos)
    contact = blind._egos[0].judge.contact
    assert contact == blind._egos[0].contact and contact["partner"] >= 0


def test_an_agent_may_observe_what_is_sensed():
    given = dict(along=5.0, hold=10.0, ghosts=1.0)
    (there, _), (sensed, _) = (
        drive(make("highway-fast-v0", "monitor", sensing=given | {"agent": agent}), 2, 5, action=1)
        for agent in (False, True)
    )
    assert np.array_equal(there, drive(make("highway-fast-v0", "monitor"), 2, 5, action=1)[0])
    assert np.array_equal(there[:, 0], sensed[:, 0])  # the ego knows itself
    assert not np.array_equal(there, sensed)
    missing = make("highway-fast-v0", "monitor", sensing=dict(range=0.1, agent=True)).reset(seed=2)[0]
    assert missing[0, 0] == 1.0 and not missing[1:].any()


def test_an_environment_is_copied_with_its_sensors():
    env = make("highway-fast-v0", sensing=EVERYTHING)
    env.reset(seed=4)
    for _ in range(3):
        env.step(3)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = [env.step(3)[0] for _ in range(5)]
    for other in copies:
        assert np.array_equal(expected, [other.step(3)[0] for _ in range(5)])


def test_masks_change_nothing_of_what_is_sensed():
    asked, silent = (make("highway-fast-v0", sensing=EVERYTHING | {"inflate": True}) for _ in range(2))
    asked.reset(seed=6), silent.reset(seed=6)
    for _ in range(8):
        asked.action_masks()
        assert np.array_equal(asked.step(3)[0], silent.step(3)[0])


def test_a_shield_that_inflates_keeps_its_distance_where_another_does_not():
    # on a road where everybody is seen 3 m ahead of where he is
    crashes = {}
    for inflate in (False, True):
        env = make("highway-fast-v0", sensing=dict(along=4.0, speed=2.0, hold=3.0, inflate=inflate))
        ends = [drive(env, seed, 40)[1][-1] for seed in range(6)]
        crashes[inflate] = sum(end["blame"] == "ego" for end in ends)
    assert crashes[True] == 0


def test_semantic_errors_are_measured_on_recorded_episodes():
    # 0.3 m across lanes of 4 m, and of 0.5 m along a car that changes lanes a third; along, at most half of 1 m
    env = make("highway-fast-v0", sensing=dict(across=0.3, along=0.5, misses=0.2, ghosts=0.2), record=True)
    drive(env, 1, 10)
    errors = semantic_errors(env._egos[0].senses)
    assert errors.frames > 30 and len(errors.lon) == len(errors.lat) > 100
    assert 0.9 * 0.3 < 4 * errors.lat.max() <= 0.3 + 0.5 / 3 and errors.lon.max() <= 0.5
    assert errors.missed > 0 and errors.ghosts > 0
    with pytest.raises(ValueError, match="record = False"):
        semantic_errors(Senses(Sensing().sensor(DT), np.uint64(0)))


def test_lights_are_mistaken_for_each_other():
    senses = Senses(Sensing(wrong_light=1.0).sensor(DT), np.uint64(0))
    assert [senses.colour(light) for light in (GREEN, RED, YELLOW)] == [RED, GREEN, YELLOW]
    passes = []
    for given in ({}, dict(wrong_light=1.0)):
        env = make("signalised-intersection-v0", sensing=given, config={"signal": {"offset": 0.0}})
        drive(env, 3, 1, action=2)
        passes.append(env._egos[0].may_pass)
        assert env._egos[0].judge.may_pass == passes[0]
    assert passes[0] != passes[1]


@pytest.mark.parametrize("env_id", ["intersection-v0", "merge-v0", "exit-v0", "u-turn-v0"])
def test_every_road_can_be_sensed(env_id):
    inflates = env_id != "intersection-v0"
    infos = drive(make(env_id, sensing=EVERYTHING | {"inflate": inflates}), 0, 8, action=1)[1]
    assert infos


def test_more_is_kept_than_the_longest_latency():
    assert Sensing(latency=(HISTORY - 2) * DT).sensor(DT).delay == HISTORY - 2
