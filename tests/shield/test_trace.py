"""A trace is what it was after it has been to a file, and a file that is none says so."""

import json

import numpy as np
import pytest

from rss_shield.shield.trace import (
    Contact,
    Event,
    Lane,
    Light,
    Trace,
    ego_of,
    load,
    save,
    straight_lane,
    users_of,
)


def a_trace(**changes):
    still = np.zeros((3, 2))
    users = users_of(
        ["7", "truck"], ["car", "truck"], [5.0, 12.0], 2.0, still + np.array([0.0, 20.0]), still, still, still + 9.0
    )
    ego = ego_of(0, 3, areas=2)
    ego.gap[1] = 1.0, 2.0, np.nan, 4.0
    bend = Lane("b", np.array([[10.0, 0.0, 0.0], [11.0, 1.0, np.pi / 2]]), np.full(2, 4.0), right_line="continuous")
    parts = {
        "lanes": (straight_lane("a", (0.0, 0.0), (10.0, 0.0), successors=("b",), speed_limit=30.0), bend),
        "lights": (Light("l", ("a",), 9.0, 0.0, 0.0, np.array([0, 1, 2])),),
        "paths": (np.array([[0.0, 1.0, 2.0], [0.5, 1.5, 2.0]]),),
        "egos": (ego,),
        "events": (Event(0.1, "danger begins", 0, 1, "longitudinal"),),
        "contacts": (Contact(0.2, 0, 1, "both", {"ego_excess": np.float64(0.5), "danger": "lateral"}),),
        "meta": {"env_id": "made up", "seed": 3, "limit": np.inf},
    }
    return Trace(0.1, np.arange(3) * 0.1, users, **parts | changes)


def arrays_of(record, found, name=""):
    if isinstance(record, np.ndarray):
        found[name] = record
    elif isinstance(record, tuple):
        for i, one in enumerate(record):
            arrays_of(one, found, f"{name}.{i}")
    elif hasattr(record, "__dataclass_fields__"):
        for field in record.__dataclass_fields__:
            arrays_of(getattr(record, field), found, f"{name}.{field}")
    return found


def test_a_trace_comes_back_from_its_file(tmp_path):
    trace = a_trace()
    save(trace, tmp_path / "one.npz")
    again = load(tmp_path / "one.npz")
    before, after = arrays_of(trace, {}), arrays_of(again, {})
    assert before.keys() == after.keys() and len(before) > 30
    for name, array in before.items():
        np.testing.assert_array_equal(after[name], array, err_msg=name)
        assert after[name].dtype == array.dtype, name
    assert again.users.ids == ("7", "truck") and again.lanes[0].successors == ("b",)
    assert (again.lanes[0].speed_limit, again.lanes[1].speed_limit) == (30.0, np.inf)
    assert again.events == trace.events
    assert again.contacts[0].evidence == {"ego_excess": 0.5, "danger": "lateral"}
    assert again.meta == {"env_id": "made up", "seed": 3, "limit": "inf"}
    assert again.ego_users == (0,)
    assert list(tmp_path.iterdir()) == [tmp_path / "one.npz"]  # nothing else is left behind


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 half an archive"])
def test_a_file_that_is_no_trace_is_named(tmp_path, content):
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"other\.npz: expected a file with a trace"):
        load(path)


def test_half_a_file_is_refused(tmp_path):
    path = tmp_path / "half.npz"
    save(a_trace(), path)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(ValueError, match=r"half\.npz: expected"):
        load(path)


def test_another_version_and_missing_parts_are_refused(tmp_path):
    path = tmp_path / "one.npz"
    save(a_trace(), path)
    with np.load(path) as file:
        arrays = dict(file)
    text = json.loads(arrays["text"].tobytes())
    arrays["text"] = np.frombuffer(json.dumps(text | {"version": 99}).encode(), np.uint8)
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match="version 99 of the format: expected 1"):
        load(path)
    arrays["text"] = np.frombuffer(json.dumps(text).encode(), np.uint8)
    del arrays["users.x"]
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=r"users\.x.*expected all parts"):
        load(path)
    np.savez(path, something=np.zeros(2))
    with pytest.raises(ValueError, match="expected a file with a trace"):
        load(path)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": 0.0}, r"dt = 0\.0: expected a length of time"),
        ({"time": np.zeros(4)}, r"users\.x: shape \(3, 2\): expected \(4, 2\)"),
        ({"lanes": (straight_lane("a", (0, 0), (1, 0)),) * 2}, "two have the same id"),
        ({"lanes": (straight_lane("a", (0, 0), (1, 0), successors=("c",)),)}, "'c': expected one of 'a'"),
        ({"lanes": (straight_lane("a", (0, 0), (1, 0), left_line="dotted"),)}, "'dotted': expected one of 'none'"),
        ({"egos": (ego_of(2, 3),)}, r"ego\.user = 2: expected the index of one of 2 users"),
        ({"egos": (ego_of(0, 4),)}, "4 samples: expected 3"),
        ({"events": (Event(0.0, "boom", 0),)}, "'boom': expected one of 'danger begins'"),
    ],
)
def test_what_does_not_fit_together_is_named(changes, message):
    changes = {"lights": (), **changes}
    with pytest.raises(ValueError, match=message):
        a_trace().replaced(**changes)


def test_users_are_who_they_are():
    still = np.zeros((2, 2))
    with pytest.raises(ValueError, match="'a' is there twice"):
        Trace(0.1, np.zeros(2), users_of("aa", ["car"] * 2, 5, 2, still, still, still, still))
    with pytest.raises(ValueError, match="'tank': expected one of 'car'"):
        Trace(0.1, np.zeros(2), users_of("ab", ["car", "tank"], 5, 2, still, still, still, still))
    with pytest.raises(ValueError, match=r"users\.speed is NaN where users\.x is not"):
        Trace(0.1, np.zeros(2), users_of("ab", ["car"] * 2, 5, 2, still, still, still, still + np.nan))
    with pytest.raises(ValueError, match="expected numbers > 0"):
        Trace(0.1, np.zeros(2), users_of("ab", ["car"] * 2, 0, 2, still, still, still, still))
