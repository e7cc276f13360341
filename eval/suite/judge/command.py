"""`rss-shield judge`: who was to blame in any log."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from rss_shield.eval.files import atomic, folder_for, refuse, write_json
from rss_shield.eval.suite.judge.findings import json_of, pair_frames, text_of
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.judge.risk import risk_lines, risk_table
from rss_shield.eval.suite.judge.trajectories import FORMATS, Format, read_csv, read_lanes, straight_lanes
from rss_shield.eval.suite.judge.units import check_units
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, preset_in
from rss_shield.shield.params import Preset
from rss_shield.shield.trace import Lane, Trace, load

FIELDS = 10  # of `Format` that name columns
# options that say what is in a CSV file, and what they are where they are not given
_OF_CSV = {"format": "plain", "columns": "", "units": "", "y": None, "point": None, "dt": None, "lanes": None} | {
    "lanes_at": "",
    "lane_width": 3.5,
}


def run(arguments: list[str] | None = None) -> None:
    """Judge the files that the command line names."""
    options = _parser().parse_args(arguments)
    try:
        _check(options)
        traces = [read(path, options) for path in options.files]
        for path, trace in zip(options.files, traces, strict=True):
            _check_users(path, trace, options)
        if options.out is not None:
            _check_outputs(options.files, options.out)
            folder_for(options.out)
        for path, trace in zip(options.files, traces, strict=True):
            _judge(path, trace, options)
    except (ValueError, OSError, ModuleNotFoundError) as error:
        refuse("rss-shield judge", error)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rss-shield judge", description="Who was in danger, who owed what and broke it, and who is to blame."
    )
    parser.add_argument(
        "files", nargs="+", type=Path, help="a trace (.npz), trajectories (.csv) or a CommonRoad scenario (.xml)"
    )
    parser.add_argument("--preset", "--params", help=f"to judge by: {KNOWN_PRESETS} (that of the trace, else slides)")
    parser.add_argument("--response-time", type=float, help="of everybody, instead of the preset's [s]")
    parser.add_argument("--ego", action="append", default=[], metavar="ID", help="judge from this user's view only")
    parser.add_argument("--out", type=Path, help="folder for NAME.json, NAME.csv (pair-frames) and NAME.png")
    parser.add_argument("--risk", action="store_true", help="the driving safety field, too, beside TTC, THW and DRAC")
    parser.add_argument("--all-frames", action="store_true", help="safe pair-frames in the CSV, too")
    csv = parser.add_argument_group("trajectories in CSV files")
    csv.add_argument("--format", default="plain", help=f"columns: {', '.join(FORMATS)}")
    csv.add_argument("--columns", default="", metavar="FIELD=NAME,...", help="other names: x=pos_x,t=time")
    csv.add_argument("--units", default="", metavar="FIELD=UNIT,...", help="x=ft,speed=km/h,heading=deg")
    csv.add_argument("--y", choices=("up", "down"), help="does y grow to the left of x (up), or to the right?")
    csv.add_argument("--point", choices=("centre", "front", "corner"), help="what x and y are of")
    csv.add_argument("--dt", type=float, help="interpolate positions to this step [s]")
    csv.add_argument("--lanes", type=Path, help="JSON file with lanes")
    csv.add_argument("--lanes-at", default="", metavar="Y,...", help="straight lanes along x with these middles [m]")
    csv.add_argument("--lane-width", type=float, default=3.5, help="[m]")
    return parser


def _check(options: argparse.Namespace) -> None:
    """Can these options be meant, and of these files?

    Raises:
      ValueError: names one that can not.
    """
    for option, value, most in (
        ("--lane-width", options.lane_width, 100.0),
        ("--dt", options.dt, np.inf),
        ("--response-time", options.response_time, 60.0),
    ):
        if value is not None and not (0.0 < value <= most and np.isfinite(value)):
            reach = f" and <= {most:g}" if np.isfinite(most) else ""
            raise ValueError(f"{option} {value:g}: expected a number > 0{reach}")
    if options.preset is not None:
        preset_in(options.preset)
    _format(options)
    _offsets(options)
    if options.lanes is not None and options.lanes_at:
        raise ValueError(f"--lanes-at {options.lanes_at}: expected either it or --lanes")
    other = next((path for path in options.files if path.suffix != ".csv"), None)
    given = [name for name, default in _OF_CSV.items() if getattr(options, name) != default]
    if other is not None and given:
        option = f"--{given[0].replace('_', '-')}"
        raise ValueError(
            f"{option} {getattr(options, given[0])}: expected with .csv files only; {other} says it itself"
        )


def _check_outputs(files: list[Path], out: Path) -> None:
    """Is every file that will be written another one, and none of those that are read?

    Raises:
      ValueError: names a file that would be lost.
    """
    stems = [path.stem for path in files]
    twice = next((path for path in files if stems.count(path.stem) > 1), None)
    if twice is not None:
        raise ValueError(f"{twice}: {stems.count(twice.stem)} files are called {twice.stem}, and so is what is written")
    read_ones = {path.resolve(): path for path in files}
    for stem in stems:
        lost = read_ones.get((out / f"{stem}.csv").resolve()) or read_ones.get((out / f"{stem}-risk.csv").resolve())
        if lost is not None:
            raise ValueError(f"--out {out}: {lost} would be overwritten; expected another folder")


def _check_users(path: Path, trace: Trace, options: argparse.Namespace) -> None:
    if len(trace.users.ids) < 2:
        raise ValueError(f"{path}: {len(trace.users.ids)} road user: nobody to judge against; expected two at least")
    unknown = [name for name in options.ego if name not in trace.users.ids]
    if unknown:
        raise ValueError(f"--ego {unknown[0]}: expected one of {', '.join(trace.users.ids)}")


def _judge(path: Path, trace: Trace, options: argparse.Namespace) -> None:
    out = options.out
    users = [trace.users.ids.index(name) for name in options.ego] or None
    judgement = judge_trace(trace, _table(trace, options), users=users)
    print(text_of(judgement, path.name))
    risk = risk_table(trace, users or range(len(trace.users.ids))) if options.risk else None
    if risk is not None:
        print("\n".join(risk_lines(risk)))
    if out is not None:
        from rss_shield.eval.suite.judge.pictures import draw

        write_json(out / f"{path.stem}.json", json_of(judgement, path.name))
        with atomic(out / f"{path.stem}.csv") as temporary:
            pair_frames(judgement, not options.all_frames).to_csv(temporary, index=False)
        draw(judgement, out / f"{path.stem}.png")
        if risk is not None:
            with atomic(out / f"{path.stem}-risk.csv") as temporary:
                risk.to_csv(temporary, index=False)
        print(f"written to {out}: {path.stem}.json, {path.stem}.csv, {path.stem}.png")


def _table(trace: Trace, options: argparse.Namespace) -> Preset | None:
    rho = options.response_time
    if rho is None:
        return None if options.preset is None else preset_in(options.preset)
    if options.preset is None and "judge_params" in trace.meta:
        raise ValueError("--response-time: expected --preset beside it where the trace has a table of its own")
    preset = preset_in(options.preset or "slides")
    ego, other = (params._replace(response_time=rho) for params in (preset.ego, preset.other))
    return preset._replace(ego=ego, other=other)


def read(path: Path, options: argparse.Namespace) -> Trace:
    """The trace that a file is, or amounts to."""
    if path.suffix == ".csv":
        return read_csv(path, _format(options), _lanes(path, options), options.dt)
    if path.suffix == ".xml":
        from rss_shield.eval.suite.judge.commonroad import read_commonroad

        return read_commonroad(path)
    return load(path)


def _format(options: argparse.Namespace) -> Format:
    if options.format not in FORMATS:
        raise ValueError(f"--format {options.format}: expected one of {', '.join(FORMATS)}")
    known = FORMATS[options.format]
    names: dict[str, Any] = _pairs("--columns", options.columns)
    units = _pairs("--units", options.units)
    for option, pairs in (("--columns", names), ("--units", units)):
        for name in pairs:
            if name not in Format._fields[:FIELDS]:
                raise ValueError(f"{option} {name}=...: expected one of {', '.join(Format._fields[:FIELDS])}")
    known = known._replace(**names, units={**known.units, **units})
    _check_apart(known, options.columns)
    check_units(known.units, known.frame_rate)
    if options.y:
        known = known._replace(y_up=options.y == "up")
    return known._replace(point=options.point) if options.point else known


def _check_apart(known: Format, text: str) -> None:
    """Does every column say one thing? Only a length and a width may be the same number.

    Raises:
      ValueError: one of them is to be two fields.
    """
    fields: dict[str, str] = {}
    for field in known._fields[:FIELDS]:
        column = getattr(known, field)
        if column in fields and {field, fields[column]} != {"length", "width"}:
            raise ValueError(
                f"--columns {text}: column {column} would be {fields[column]} and {field}: expected one for each"
            )
        if column:
            fields[column] = field


def _pairs(option: str, text: str) -> dict[str, str]:
    pairs = [pair.split("=", 1) for pair in text.split(",") if pair]
    if any(len(pair) != 2 for pair in pairs):
        raise ValueError(f"{option} {text}: expected FIELD=VALUE, separated by commas")
    names = [name.strip() for name, _ in pairs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"{option} {text}: {twice} is there {names.count(twice)} times: expected once")
    return {name: value.strip() for name, (_, value) in zip(names, pairs, strict=True)}


def _lanes(path: Path, options: argparse.Namespace) -> tuple[Lane, ...]:
    if options.lanes is not None:
        return read_lanes(options.lanes)
    if not options.lanes_at:
        return ()
    offsets = _offsets(options)
    reach = read_csv(path, _format(options), (), options.dt).users.x
    return straight_lanes(offsets, options.lane_width, float(np.nanmin(reach)) - 500.0, float(np.nanmax(reach)) + 500.0)


def _offsets(options: argparse.Namespace) -> list[float]:
    """Middles of straight lanes."""
    try:
        offsets = [float(y) for y in options.lanes_at.split(",")] if options.lanes_at else []
    except ValueError:
        offsets = [np.nan]
    if not np.isfinite(offsets).all():
        raise ValueError(f"--lanes-at {options.lanes_at}: expected finite numbers, separated by commas [m]")
    return offsets
