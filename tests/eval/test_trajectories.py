"""CSV files of trajectories, ours and those of public data sets, are the cars that they were written from."""

import re

import numpy as np
import pandas as pd
import pytest

from rss_shield.cli import main
from rss_shield.eval.suite.judge.trajectories import FORMATS, Format, read_csv, read_lanes, straight_lanes

DT, FOOT = 0.1, 0.3048
TIME = np.arange(41) * DT
# centres of two cars [m]: one along x at 20 m/s, one that turns to the right (y grows to the right of x) at 10 m/s
ANGLE = 10.0 * TIME / 50.0
X = np.stack([20.0 * TIME, 100.0 + 50.0 * np.sin(ANGLE)], axis=1)
Y = np.stack([0.0 * TIME, 50.0 * (1.0 - np.cos(ANGLE))], axis=1)
HEADING = np.stack([0.0 * TIME, ANGLE], axis=1)
SPEED = np.array([20.0, 10.0])
SIZES = ((5.0, 2.0), (12.0, 2.5))


def rows(**columns):
    """One row per car and time."""
    frames = []
    for i in range(2):
        one = {name: values[:, i] if np.ndim(values) == 2 else values for name, values in columns.items()}
        frames.append(pd.DataFrame({"id": 7 + i, **one}))
    return pd.concat(frames, ignore_index=True)


def written(table, tmp_path, name="log.csv"):
    table.sample(frac=1.0, random_state=3).to_csv(tmp_path / name, index=False)  # in no order
    return tmp_path / name


def check(trace, heading_within=0.02, speed_within=0.1):
    users = trace.users
    assert users.ids in (("7", "8"), ("8", "7")) and trace.dt == pytest.approx(DT)
    order = [users.ids.index(name) for name in ("7", "8")]
    np.testing.assert_allclose(users.x[:, order], X, atol=0.02)
    np.testing.assert_allclose(users.y[:, order], Y, atol=0.02)
    np.testing.assert_allclose(users.heading[:, order], HEADING, atol=heading_within)
    np.testing.assert_allclose(users.speed[:, order], np.broadcast_to(SPEED, X.shape), atol=speed_within)


@pytest.mark.parametrize("y", ["up", "down"])
def test_a_plain_file(tmp_path, y):
    side = -1.0 if y == "up" else 1.0
    path = written(rows(t=TIME, x=X, y=side * Y, heading=side * HEADING), tmp_path)
    check(read_csv(path, Format(y_up=y == "up")), heading_within=1e-9)


def test_heading_and_speed_are_derived_where_they_are_missing(tmp_path):
    check(read_csv(written(rows(t=TIME, x=X, y=Y), tmp_path), Format(y_up=False)))


def test_other_names_and_units(tmp_path):
    table = rows(when=TIME * 1e3, px=X / FOOT, py=Y / FOOT, yaw=np.degrees(HEADING), kmh=np.tile(SPEED * 3.6, (41, 1)))
    known = Format(
        "id",
        "when",
        "px",
        "py",
        "yaw",
        "kmh",
        units={"t": "ms", "x": "ft", "y": "ft", "heading": "deg", "speed": "km/h"},
    )
    check(read_csv(written(table, tmp_path), known._replace(y_up=False)), 1e-9, 1e-9)


def test_highd_has_corners_of_boxes_and_frames_of_25_hertz(tmp_path):
    """A car of 5 m x 2 m with its centre at (20 t, 10): its box begins 2.5 m before and 1 m above. One comes back."""
    t = np.arange(51) / 25.0
    x, y = np.stack([20.0 * t, 200.0 - 30.0 * t], axis=1), np.stack([10.0 + 0.0 * t, 4.0 + 0.0 * t], axis=1)
    length, width = np.array([5.0, 12.0]), np.array([2.0, 2.5])
    table = rows(frame=np.arange(51) + 1, x=x - length / 2, y=y - width / 2)
    table["width"], table["height"] = np.repeat(length, 51), np.repeat(width, 51)  # along and across the road
    trace = read_csv(written(table, tmp_path), "highd")
    order = [trace.users.ids.index(name) for name in ("7", "8")]
    assert trace.dt == pytest.approx(0.04)
    np.testing.assert_allclose(trace.users.x[:, order], x, atol=1e-9)
    np.testing.assert_allclose(trace.users.y[:, order], y, atol=1e-9)
    assert trace.users.length[order].tolist() == [5.0, 12.0] and trace.users.width[order].tolist() == [2.0, 2.5]
    np.testing.assert_allclose(np.cos(trace.users.heading[0, order]), [1.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(trace.users.speed[10, order], [20.0, 30.0], atol=1e-9)


def test_ngsim_has_the_front_bumper_along_and_across_in_feet(tmp_path):
    """Its x is ours y. The front of a car of 15 ft is 7.5 ft before its centre."""
    table = rows(Frame_ID=np.arange(41) + 100, Local_Y=(20.0 * TIME + 2.286) / FOOT, Local_X=3.0 / FOOT)
    table = table.rename(columns={"id": "Vehicle_ID"})
    table["v_Length"], table["v_Width"], table["v_Vel"], table["v_Class"] = 15.0, 6.0, 20.0 / FOOT, 2
    trace = read_csv(written(table[table["Vehicle_ID"] == 7], tmp_path), "ngsim")
    np.testing.assert_allclose(trace.users.x[:, 0], 20.0 * TIME, atol=1e-9)
    np.testing.assert_allclose(trace.users.y[:, 0], 3.0, atol=1e-9)
    assert trace.users.length[0] == pytest.approx(4.572) and trace.users.kinds == ("car",)
    np.testing.assert_allclose(trace.users.speed, 20.0)


def test_gaps_stay_gaps_and_other_steps_are_interpolated(tmp_path):
    table = rows(t=TIME, x=X, y=Y)
    table = table[~((table["id"] == 8) & table["t"].between(0.95, 2.05))]
    trace = read_csv(written(table, tmp_path), Format(y_up=False))
    there = trace.users.present[:, trace.users.ids.index("8")]
    assert not there[11:20].any() and there[:10].all() and there[21:].all()
    finer = read_csv(written(rows(t=TIME, x=X, y=Y), tmp_path), Format(y_up=False), dt=0.05)
    assert finer.dt == 0.05 and len(finer.time) == 81
    np.testing.assert_allclose(finer.users.x[:, finer.users.ids.index("7")], 20.0 * finer.time, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows.drop(columns="x"), "no column 'x' for x: expected one of id, t, y"),
        (
            lambda rows: rows.assign(y=["1"] * 40 + ["none"] + ["1"] * 41),
            "y = 'none' in row .*: expected a finite number",
        ),
        (lambda rows: pd.concat([rows, rows.iloc[:1]]), "id = 7 is there twice at t = 0"),
        (lambda rows: rows.assign(t=np.append(rows["t"].to_numpy()[:-1], 4.04)), "t = 4.04 s is no multiple of 0.1 s"),
        (lambda rows: rows.assign(t=1.0).drop_duplicates("id"), "all rows have one time"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        read_csv(written(change(rows(t=TIME, x=X, y=Y)), tmp_path))


def test_formats_and_units_are_known_ones(tmp_path):
    path = written(rows(t=TIME, x=X, y=Y), tmp_path)
    with pytest.raises(ValueError, match="format = 'interaction': expected one of plain, highd, ngsim"):
        read_csv(path, "interaction")
    with pytest.raises(ValueError, match="unit of x = 'yards': expected a length in m, ft"):
        read_csv(path, Format(units={"x": "yards"}))
    with pytest.raises(ValueError, match="unit of width = 'deg': expected a length"):
        read_csv(path, Format(units={"width": "deg"}))  # of which the file has none


def test_lanes_come_from_a_file_or_from_offsets(tmp_path):
    path = tmp_path / "lanes.json"
    path.write_text('{"lanes": [{"id": 1, "centre": [[0, 0], [100, 0], [150, 50]], "width": 3, "successors": []}]}')
    (lane,) = read_lanes(path)
    np.testing.assert_allclose(lane.centre[:, 2], [0.0, np.pi / 8, np.pi / 4])  # halfway at the corner
    assert lane.id == "1" and lane.width.tolist() == [3.0] * 3
    left, right = straight_lanes([3.5, 0.0], 3.5, -10.0, 90.0)
    assert (left.centre[0, 1], right.centre[0, 1], left.right, right.left) == (0.0, 3.5, right.id, left.id)
    path.write_text('{"lanes": [{"id": 1, "centre": [[0, 0], [1, 0]], "colour": "red"}]}')
    with pytest.raises(ValueError, match="unknown field 'colour'"):
        read_lanes(path)
    path.write_text("none")
    with pytest.raises(ValueError, match="expected JSON with a list 'lanes'"):
        read_lanes(path)


def test_a_file_is_judged_from_the_command_line(tmp_path, capsys):
    """20 m/s toward a car that stands 60 m ahead; nobody brakes: 66 m and more would have been needed."""
    still = np.stack([20.0 * TIME, 65.0 + 0.0 * TIME], axis=1)
    table = rows(t=TIME, x=still, y=0.0)
    main(["judge", str(written(table, tmp_path)), "--lanes-at", "0", "--params", "slides"])
    out = capsys.readouterr().out
    assert "7 in danger with 8 (inherited, rear)" in out and "contact of 7 and 8" in out and "at fault: 7" in out
    for option, message in (
        (["--columns", "z=alt"], "--columns z"),
        (["--lanes-at", "left"], "expected finite numbers"),
    ):
        assert message in refused(capsys, "judge", str(tmp_path / "log.csv"), *option)


def refused(capsys, *arguments):
    """The one line in which a command says why it does nothing."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    said = capsys.readouterr()
    assert end.value.code == 2 and not said.out and said.err.count("\n") == 1
    return said.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--lane-width 0", "--lane-width 0: expected a number > 0"),
        ("--lane-width nan", "--lane-width nan"),
        ("--lanes-at nan", "--lanes-at nan: expected finite numbers"),
        ("--dt nan", "--dt nan: expected a number > 0"),
        ("--dt 0", "--dt 0: expected a number > 0"),
        (
            "--dt 5",
            "dt = 5: expected >= 8e-07 s, which makes 5000000 samples, and <= 4 s, which is how long the log is",
        ),
        ("--dt 1e-9", "log.csv: dt = 1e-09: expected >= 8e-07 s"),
        ("--units x=s", "unit of x = 's': expected a length in m, ft, km"),
        ("--units speed=deg", "unit of speed = 'deg': expected a speed in m/s, km/h, mph, ft/s"),
        ("--units t=m", "unit of t = 'm': expected a time in s, ms, us"),
        ("--units t=frame", "unit of t = 'frame': expected a time in s, ms, us"),
        ("--units kind=m", "unit of kind = 'm': expected none, but of t, heading"),
        ("--units x=ft,x=m", "--units x=ft,x=m: x is there 2 times: expected once"),
        ("--columns x=east,y=north,x=px", "x is there 2 times: expected once"),
        ("--columns x=id", "--columns x=id: column id would be id and x: expected one for each"),
        ("--columns x=px,speed=px", "column px would be x and speed"),
        ("--response-time -1", "--response-time -1: expected a number > 0 and <= 60"),
        ("--preset carlo", "preset = 'carlo': expected one of"),
    ],
)
def test_options_out_of_range_are_named(tmp_path, capsys, options, message):
    assert message in refused(capsys, "judge", str(written(rows(t=TIME, x=X, y=Y), tmp_path)), *options.split())


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("empty.csv", "", "empty.csv: expected a header and rows; it is empty"),
        ("log.csv", "id;t;x;y\n1;0;0;0\n", "expected commas"),
        ("log.csv", "id,t,x,y\n1,0,0,0\n1,0.1,1,0,5,6\n", "line 3"),
        ("log.csv", "id,t,x,y\n1,0,0,0,9\n", "row 2 has more values than the header has columns: expected 4"),
        ("log.csv", "id,t,x,y\n1,0,0,0\n1,0.1,1\n", "row 3 has no y"),
        ("log.csv", "id,t,x,y\n1,0,0,0\n1,0.1,inf,1\n", "x = inf in row 3: expected a finite number"),
        ("log.csv", "id,t,x,y,kind\n1,0,0,0,car\n1,0.1,1,1,tank\n", "log.csv: kind = 'tank' in row 3: expected one of"),
        ("log.csv", "id,t,x,y,length\n1,0,0,0,4\n1,0.1,1,1,-4\n", "length = -4 in row 3: expected a number > 0"),
        ("table.yaml", "ego: {}", "table.yaml: expected a file .npz"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, capsys, name, text, message):
    (tmp_path / name).write_text(text)
    said = refused(capsys, "judge", str(tmp_path / name))
    assert message in said and "np." not in said


def test_times_that_are_far_apart_make_no_more_samples_than_there_is_room_for(tmp_path):
    table = rows(t=np.append(TIME[:-1] * 1e-8, 4e9), x=X, y=Y)
    with pytest.raises(ValueError, match="in steps of 1e-09 s: expected 5000000 samples at most; give dt"):
        read_csv(written(table, tmp_path))


def test_frames_may_be_told_in_seconds(tmp_path):
    """highD counts frames of 25 Hz; who has put times into that column says so."""
    table = rows(frame=TIME, x=X, y=Y).assign(width=5.0, height=2.0)
    known = FORMATS["highd"]
    assert read_csv(written(table, tmp_path), known._replace(units={"t": "s"})).dt == pytest.approx(DT)


@pytest.mark.parametrize("dt", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("start", [0.0, 1.6e9])
def test_in_other_steps_nobody_is_where_the_log_does_not_have_them(tmp_path, dt, start):
    """At 30 m/s all along, from the first row of each to the last; steps that end in between show neither's end."""
    tables = []
    for name, first, last in (("a", 0, 30), ("b", 1, 29), ("c", 4, 26)):
        t = np.round(0.1 * np.arange(first, last + 1), 3)
        tables.append(pd.DataFrame({"id": name, "t": start + t, "x": 30.0 * t, "y": 4.0 * first}))
    users = read_csv(written(pd.concat(tables), tmp_path), dt=dt).users
    time = dt * np.arange(len(users.x))
    for name, first, last in (("a", 0.0, 3.0), ("b", 0.1, 2.9), ("c", 0.4, 2.6)):
        i = users.ids.index(name)
        inside = (time >= first - 1e-4) & (time <= last + 1e-4)
        np.testing.assert_array_equal(users.present[:, i], inside)
        np.testing.assert_allclose(users.x[inside, i], 30.0 * time[inside], atol=1e-4)
        np.testing.assert_allclose(users.speed[inside, i], 30.0, atol=1e-2)


def test_nothing_that_is_read_is_overwritten_and_nothing_written_twice(tmp_path, capsys):
    path = written(rows(t=TIME, x=X, y=Y), tmp_path)
    before = path.read_bytes()
    assert f"{path} would be overwritten" in refused(capsys, "judge", str(path), "--out", str(tmp_path))
    (tmp_path / "b").mkdir()
    another = written(rows(t=TIME, x=X, y=Y), tmp_path / "b")
    said = refused(capsys, "judge", str(path), str(another), "--out", str(tmp_path / "out"))
    assert "2 files are called log" in said
    assert path.read_bytes() == before and not (tmp_path / "out").exists()


def test_options_of_csv_files_are_for_these_only(capsys):
    assert "--dt 0.1: expected with .csv files only; a.npz" in refused(capsys, "judge", "a.npz", "--dt", "0.1")


@pytest.mark.parametrize(
    ("lane", "message"),
    [
        ('"centre": [[0, 0], [9, 0]], "width": -3', "lane 1: width = -3: expected a number > 0"),
        ('"centre": [[0, 0]]', "lane 1: centre = [[0, 0]]: expected two points"),
        ('"centre": [[0, 0], [1]]', "expected two points"),
    ],
)
def test_lanes_that_are_none_are_named(tmp_path, lane, message):
    (tmp_path / "lanes.json").write_text(f'{{"lanes": [{{"id": 1, {lane}}}]}}')
    with pytest.raises(ValueError, match=re.escape(message)):
        read_lanes(tmp_path / "lanes.json")


def test_who_is_alone_has_nobody_to_be_judged_against(tmp_path, capsys):
    table = rows(t=TIME, x=X, y=Y)
    path = written(table[table["id"] == 7], tmp_path)
    assert "log.csv: 1 road user: nobody to judge against" in refused(capsys, "judge", str(path))
