"""Defs. 3, 7 and 9: when a pair is dangerous, since when, and which axis was safe last."""

import itertools

import numpy as np
import pytest

from rss_shield.shield.definitions.response import LAT, LON, NEITHER, step_threshold
from rss_shield.shield.lanes.memory import MEMORY, owes

S, U = True, False  # safe, unsafe


def follow(safe_lon, safe_lat):
    """(dangerous, sample of the threshold, axes safe there) at every sample of one pair."""
    axes, since, seen_safe, history = NEITHER, 0, False, []
    for k, (lon, lat) in enumerate(zip(safe_lon, safe_lat, strict=True)):
        axes, since = step_threshold(axes, since, lon, lat)
        seen_safe = seen_safe or lon or lat
        threshold = (k - since if seen_safe else None) if since > 0 else None
        history.append((since > 0, threshold, axes if since > 0 else None))
    return history


SAFE = (False, None, None)


def test_tailgating_in_one_lane_is_answered_on_the_longitudinal_axis():
    # side by side is never possible in one lane: only the distance ahead was ever safe
    assert follow([S, S, U, U], [U, U, U, U]) == [SAFE, SAFE, (True, 1, LON), (True, 1, LON)]


def test_a_cut_in_is_answered_on_the_lateral_axis():
    assert follow([U, U, U, U], [S, S, U, U]) == [SAFE, SAFE, (True, 1, LAT), (True, 1, LAT)]


def test_the_axis_that_was_safe_last_counts_not_the_one_lost_first():
    assert follow([S, U, U, U], [S, S, S, U]) == [SAFE, SAFE, SAFE, (True, 2, LAT)]
    assert follow([S, S, S, U], [S, U, U, U]) == [SAFE, SAFE, SAFE, (True, 2, LON)]


def test_both_axes_lost_in_one_sample_are_both_answered():
    assert follow([S, S, U], [S, S, U]) == [SAFE, SAFE, (True, 1, LON | LAT)]


def test_side_by_side_driving_is_longitudinally_unsafe_and_harmless():
    assert follow([U] * 4, [S] * 4) == [SAFE] * 4


def test_danger_from_the_start_has_no_threshold():
    assert follow([U, U], [U, U]) == [(True, None, NEITHER), (True, None, NEITHER)]


def test_a_new_episode_starts_a_new_threshold():
    history = follow([S, U, U, S, U], [U, U, U, U, U])
    assert history == [SAFE, (True, 0, LON), (True, 0, LON), SAFE, (True, 3, LON)]
    # inherited danger ends for good at the first safe sample
    assert follow([U, S, U], [U, U, U]) == [(True, None, NEITHER), SAFE, (True, 1, LON)]


@pytest.mark.parametrize("length", [1, 2, 3, 4])
def test_every_short_history_obeys_the_definition(length):
    for safe in itertools.product(itertools.product((S, U), repeat=2), repeat=length):
        lon, lat = zip(*safe, strict=True)
        for k, (dangerous, threshold, axes) in enumerate(follow(lon, lat)):
            assert dangerous == (not lon[k] and not lat[k])
            last_safe = [i for i in range(k + 1) if lon[i] or lat[i]]
            if dangerous and last_safe:
                assert threshold == last_safe[-1]
                assert axes == (LON if lon[threshold] else NEITHER) | (LAT if lat[threshold] else NEITHER)
            elif dangerous:
                assert (threshold, axes) == (None, NEITHER)


def test_a_pair_owes_a_response_only_in_danger_and_only_on_the_axes_that_were_safe():
    memory = np.zeros(1, MEMORY)[0]
    for axes in (NEITHER, LON, LAT, LON | LAT):
        memory["axes"], memory["since"] = axes, 0
        assert not owes(memory, LON) and not owes(memory, LAT)
        memory["since"] = 3
        assert owes(memory, LON) == (axes in (NEITHER, LON, LON | LAT))
        assert owes(memory, LAT) == (axes in (NEITHER, LAT, LON | LAT))


def test_a_new_memory_is_all_zeros_and_not_dangerous():
    memory = np.zeros(1, MEMORY)[0]
    assert not owes(memory, LON) and not owes(memory, LAT)
    assert step_threshold(memory["axes"], memory["since"], U, U) == (NEITHER, 1)
