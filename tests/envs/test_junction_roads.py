"""Roads and frame rates that plans through junctions hold for, and those that are refused."""

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.envs.roads.paths import STOCK, _starts, drive
from rss_shield.envs.roads.ways import junction_of
from rss_shield.shield.junctions.conflict_areas import cell_of, reach_beyond

GENERIC = "roundabout-generic-v0"


@pytest.mark.parametrize("config", [{"roundabout_lanes": 3}, {"roundabout_lanes": 4, "roundabout_radius": 30}])
@pytest.mark.parametrize("policy", ["faster", "random"])
def test_a_roundabout_of_many_lanes_works(config, policy):
    env = make(GENERIC, config=config)
    for seed in range(2):
        env.reset(seed=seed)
        rng, over = np.random.default_rng(seed), False
        while not over:
            action = 3 if policy == "faster" else int(rng.integers(5))
            *_, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        assert info["blame"] in ("", "other", "inherited")
        assert info["episode_broken_duties"] == 0


@pytest.mark.parametrize("lanes", [1, 2, 3, 5])
def test_every_lane_of_a_ring_leads_to_every_exit(lanes):
    env = make(GENERIC, shield=None, config={"roundabout_lanes": lanes})
    env.reset(seed=0)
    junction = junction_of(env.unwrapped.road.network)
    for index in junction.number:
        if index[:2] == ("se", "ex"):
            ends = {walk[-1][1] for walk in junction.walks if index in walk}
            assert ends == {"exr", "nxr", "wxr", "sxr"}


@pytest.mark.parametrize("lanes", [6, 8])
def test_more_lanes_than_sets_hold_are_refused(lanes):
    with pytest.raises(ValueError, match=rf"road network with {8 * lanes + 16} lanes: expected at most 63"):
        make(GENERIC, config={"roundabout_lanes": lanes})


@pytest.mark.parametrize("maker", [make, lambda env_id, **options: make_vec(env_id, 1, **options)])
@pytest.mark.parametrize(
    ("env_id", "frequency"), [("intersection-v0", 3), ("roundabout-v0", 4), ("intersection-v2", 1)]
)
def test_frames_too_long_for_plans_are_refused(maker, env_id, frequency):
    with pytest.raises(ValueError, match=rf"simulation_frequency = {frequency}: expected >= 5 where roads cross"):
        maker(env_id, config={"simulation_frequency": frequency})


@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0"])
@pytest.mark.parametrize("frequency", [5, 10, 15, 30])
def test_cars_stay_inside_what_they_sweep_at_the_frame_rate_in_force(env_id, frequency):
    """At a low frequency drivers weave; they may begin their turn anywhere between two frames."""
    env = make(env_id, shield=None)
    env.reset(seed=0)
    dt = 1 / frequency
    junction = junction_of(env.unwrapped.road.network, dt=dt, sizes=(STOCK,))
    roads, rng = junction.roads, np.random.default_rng(frequency)
    paths, lanes = roads.paths, roads.lanes
    number = junction.number
    most = -np.inf
    for p, walk in enumerate(junction.walks):
        way = np.array([number[index] for index in walk])
        start = _starts(lanes, way)
        for _ in range(3):
            speed = rng.uniform(0.3, 1.0) * junction.limit
            track = np.zeros((4000, 4))
            driven = drive(lanes, way, start, speed, dt, track, 5.0, rng.uniform(0.0, speed * dt))
            for s, x, y, heading in track[:driven]:
                i = cell_of(s, paths.cells[p])
                if 0.0 <= s < start[-1] and paths.crossed[p, i]:
                    most = max(most, *reach_beyond(paths.swept[p, i], x, y, heading, 2.5, 1.0))
    assert most < 0.1  # beyond the margin of this car; that of the other has room for it


def test_it_is_the_frequency_that_counts():
    """The check above would fail with the paths of another frequency."""
    env = make("roundabout-v0", shield=None)
    env.reset(seed=0)
    at = [junction_of(env.unwrapped.road.network, dt=1 / f).roads.paths.swept for f in (5, 15)]
    assert (at[0][..., 5] - at[1][..., 5]).max() > 0.1
