"""Who judges a log afterwards says what the shield said on the spot, from whichever side the log is looked at."""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from rss_shield import make
from rss_shield.cli import main
from rss_shield.envs.highway.hostile import HOSTILE
from rss_shield.envs.highway.recorder import Film, record_trace
from rss_shield.eval.suite.judge.judgement import _joined, judge_trace
from rss_shield.eval.suite.judge.lanes import see_all, table_of
from rss_shield.eval.suite.judge.pictures import _gaps
from rss_shield.eval.suite.judge.smoothing import filled_in
from rss_shield.shield.params import PRESETS
from rss_shield.shield.trace import Trace, load, save, straight_lane, users_of
from rss_shield.shield.verdicts import DUTIES

CROWD = {"vehicles_count": 6, "vehicles_density": 1.5, "lanes_count": 3, "duration": 20}
FASTER = 3


def recorded(env_id, mode, seed, config=None, **options):
    env = make(env_id, mode, config=config or {}, **options)
    rng, space = np.random.default_rng(seed), env.action_space
    names = getattr(env.unwrapped.action_type, "actions_indexes", None)
    if names is None:
        return record_trace(env, lambda o: tuple(int(rng.integers(one.n)) for one in space), seed)
    if seed % 2:
        return record_trace(env, lambda o: names["FASTER"], seed)
    return record_trace(env, lambda o: int(rng.integers(space.n)), seed)


def agrees(trace):
    """The evidence of every verdict, on the spot and afterwards."""
    judgement = judge_trace(trace, users=list(trace.ego_users))
    views = {(i, sum(b.users) - i): v for b in judgement.blames for i, v in b.views.items() if i in trace.ego_users}
    for contact in trace.contacts:
        view = dict(views.pop((contact.user, contact.partner)))
        view.pop("frame")
        assert {"verdict": contact.verdict, **contact.evidence} == pytest.approx(view, abs=1e-6)
        assert judgement.verdict_of(contact.user) == contact.verdict
    # several may be touched at once; the shield says of one
    assert {i for i, _ in views} <= {contact.user for contact in trace.contacts}
    return len(trace.contacts)


def test_verdicts_agree_with_those_of_the_shield_among_hostile_drivers():
    found = [
        agrees(recorded("highway-fast-v0", mode, seed, CROWD | {"other_vehicles_type": driver}))
        for driver in HOSTILE.values()
        for seed in range(20, 26)
        for mode in ("monitor", "override")[: 1 + (seed > 24)]
    ]
    assert sum(found) >= 40


@pytest.mark.parametrize("env_id", ["merge-v0", "exit-v0", "u-turn-v0", "two-way-v0"])
def test_verdicts_agree_on_roads_that_wind_fork_and_merge(env_id):
    assert sum(agrees(recorded(env_id, "monitor", seed)) for seed in range(4)) >= 1


@pytest.mark.parametrize(
    ("env_id", "seeds"),
    [("intersection-v0", (1, 12, 17)), ("roundabout-v0", (0, 3)), ("signalised-intersection-v0", (13,))],
)
def test_verdicts_agree_where_roads_cross(env_id, seeds):
    found = [agrees(recorded(env_id, "monitor", seed)) for seed in seeds]
    agrees(recorded(env_id, "override", seeds[0]))
    assert env_id == "roundabout-v0" or sum(found) >= 1


def test_on_a_ring_who_follows_across_its_seam_is_behind():
    """The lanes of a racetrack begin anew somewhere: 12 m behind the ego there is not 365 m ahead."""
    env = make("racetrack-v0", "monitor", config={"other_vehicles": 1, "duration": 3, "controlled_vehicles": 1})
    env.reset(seed=0)
    road, network = env.unwrapped.road, env.unwrapped.road.network
    ego, other = env.unwrapped.vehicle, next(v for v in road.vehicles if v is not env.unwrapped.vehicle)
    before = next(index for index in network.lanes_dict() if index[1] == "a" and index[2] == 0)
    for vehicle, index, s, speed in (
        (ego, ("a", "b", 0), 2.0, 5.0),
        (other, before, network.get_lane(before).length - 10.0, 12.0),
    ):
        lane = network.get_lane(index)
        vehicle.position, vehicle.heading, vehicle.speed = lane.position(s, 0.0), lane.heading_at(s), speed
        vehicle.lane_index, vehicle.lane = index, lane
    film, ended, info = Film(env, 0), False, {}
    while not ended:
        _, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
        film.look_for_contacts()
        ended = terminated or truncated
    trace = film.develop(info)
    frames = see_all(trace, table_of(trace), [0])[0].frames
    row = next(row for row in range(len(trace.users.ids)) if row != trace.ego_users[0])
    assert -20.0 < trace.users.x[0, row] - trace.users.x[0, 0] < 0.0
    assert not frames["ego_is_rear"][0, row] and 5.0 < frames["gap_lon"][0, row] < 7.0  # less what boxes grow in bends
    assert frames["dangerous"].sum() == trace.meta["dangerous_pairs"] > 0
    agrees(trace)


def test_dangerous_pairs_and_broken_duties_are_counted_as_the_shield_counts_them():
    for seed in (1, 4):
        trace = recorded("highway-fast-v0", "monitor", seed, CROWD)
        frames = see_all(trace, table_of(trace), [0])[0].frames
        assert frames["dangerous"].sum() == trace.meta["dangerous_pairs"] > 0
        assert (frames["duty"] > 0).sum() == trace.meta["broken_duties"]


# ---------------------------------------------------------------- the same log from elsewhere


def moved(trace, angle=0.0, shift=(0.0, 0.0), mirror=False, order=None):
    """The same episode turned, shifted, mirrored, with its users in another order; roads from its lanes alone."""
    u = trace.users
    side = -1.0 if mirror else 1.0
    cos, sin = np.cos(angle), np.sin(angle)
    order = list(range(len(u.ids))) if order is None else order

    def place(x, y):
        y = side * y
        return x * cos - y * sin + shift[0], x * sin + y * cos + shift[1]

    x, y = place(u.x, u.y)
    users = users_of(
        [u.ids[i] for i in order],
        [u.kinds[i] for i in order],
        *(values[order] for values in (u.length, u.width)),
        *(values[:, order] for values in (x, y, side * u.heading + angle, u.speed, u.acceleration, side * u.steering)),
        *(values[:, order] for values in (u.crashed, u.lane)),
    )
    lanes = []
    for lane in trace.lanes:
        px, py = place(lane.centre[:, 0], lane.centre[:, 1])
        lanes.append(replace(lane, centre=np.column_stack([px, py, side * lane.centre[:, 2] + angle])))
    new = {i: k for k, i in enumerate(order)}
    return Trace(
        trace.dt,
        trace.time,
        users,
        tuple(lanes),
        egos=tuple(replace(ego, user=new[ego.user]) for ego in trace.egos),
        events=tuple(replace(one, user=new[one.user], partner=new.get(one.partner, -1)) for one in trace.events),
        meta={name: trace.meta[name] for name in ("judge_params", "judge_rules", "integration")},
    )


def said(judgement):
    """Dangers and blames by name. Who starts exactly behind somebody is on neither side: it gets one by lot."""
    u = judgement.trace.users
    dangers = set()
    for d in judgement.dangers:
        dx, dy = u.x[0, d.partner] - u.x[0, d.user], u.y[0, d.partner] - u.y[0, d.user]
        aside = -dx * np.sin(u.heading[0, d.user]) + dy * np.cos(u.heading[0, d.user])
        duty = d.duty if d.axis != "inherited" or abs(aside) > 1e-6 else ""
        dangers.add((u.ids[d.user], u.ids[d.partner], round(d.start, 3), round(d.end, 3), d.axis, duty))
    names = [
        (b, frozenset(u.ids[i] for i in b.users), frozenset(u.ids[i] for i in b.at_fault)) for b in judgement.blames
    ]
    return dangers, {(users, b.time, at_fault) for b, users, at_fault in names}


@pytest.mark.parametrize(
    "change",
    [
        {"angle": 0.7, "shift": (300.0, -80.0)},
        {"angle": np.pi},
        {"mirror": True},
        {"order": [3, 1, 6, 2, 0, 5, 4]},
    ],
    ids=["turned and shifted", "turned round", "mirrored", "in another order"],
)
@pytest.mark.parametrize("driver", ["squeezer", "brakechecker"])
def test_it_does_not_matter_how_a_log_is_looked_at(driver, change):
    trace = recorded("highway-fast-v0", "monitor", 3, CROWD | {"other_vehicles_type": HOSTILE[driver]})
    plain = said(judge_trace(moved(trace)))
    assert plain[0] and plain[1]
    assert said(judge_trace(moved(trace, **change))) == plain


def test_lanes_of_a_trace_say_as_much_as_the_network_of_the_simulator():
    trace = recorded("merge-v0", "monitor", 1)
    exact, drawn = judge_trace(trace, users=[0]), judge_trace(trace.replaced(meta=moved(trace).meta), users=[0])
    assert exact.blames and said(drawn)[1] == said(exact)[1]


# ---------------------------------------------------------------- two cars, by hand

RHO, A, B, FRONT_B, STANDSTILL = 0.5, 2.0, 4.0, 8.0, 1.0
HAND = PRESETS["slides"]._replace(
    ego=PRESETS["slides"].ego._replace(response_time=RHO, a_max_accel=A, standstill_gap=STANDSTILL),
    other=PRESETS["slides"].other._replace(response_time=RHO, a_max_accel=A, standstill_gap=STANDSTILL),
)


def driven(v, phases, time):
    """Distance and speed at `time` of a car that starts at speed v; phases: (until, acceleration), exactly."""
    s, t, places, speeds = 0.0, 0.0, np.full(len(time), np.nan), np.full(len(time), np.nan)
    for until, a in [*phases, (np.inf, 0.0)]:
        stops = t - v / a if a < 0.0 else np.inf
        here = (time >= t - 1e-9) & (time < until - 1e-9)
        moving = np.minimum(time[here], stops) - t
        places[here], speeds[here] = s + v * moving + 0.5 * a * moving**2, np.maximum(v + a * moving, 0.0)
        if np.isfinite(until):
            rolled = min(until, stops) - t
            s, v, t = s + v * rolled + 0.5 * a * rolled**2, max(v + a * rolled, 0.0), until
    return places, speeds


def following(gap, front_phases, rear_phases, v=20.0, dt=0.1, seconds=8.0, commands=True):
    """Two cars of 5 m in one lane."""
    time = np.arange(round(seconds / dt) + 1) * dt
    rear, v_rear = driven(v, rear_phases, time)
    front, v_front = driven(v, front_phases, time)
    x, speed = np.stack([rear, front + gap + 5.0], axis=1), np.stack([v_rear, v_front], axis=1)
    still = np.zeros_like(x)
    acceleration = np.full_like(x, np.nan)
    if commands:
        acceleration[:-1] = np.diff(speed, axis=0) / dt
    users = users_of(["rear", "front"], ["car"] * 2, 5.0, 2.0, x, still, still, speed, acceleration, still)
    return Trace(dt, time, users, (straight_lane("only", (-100.0, 0.0), (900.0, 0.0)),))


# A leader at 20 m/s brakes from t = 1 s. d_min = 20 0.5 + 2 0.25 / 2 + 21^2 / 8 - 20^2 / 16 + 1 = 41.375 m.
CASES = {
    "the follower does nothing": (50.0, [(1.0, 0.0), (9.0, -8.0)], [], ("rear",)),
    "the follower answers in time": (50.0, [(1.0, 0.0), (9.0, -8.0)], [(1.8, 0.0), (9.0, -4.2)], None),
    "the leader brakes beyond a_max_brake": (42.5, [(1.0, 0.0), (9.0, -30.0)], [(1.4, 0.0), (9.0, -4.2)], ("front",)),
    "and the follower brakes too little": (
        42.5,
        [(1.0, 0.0), (9.0, -30.0)],
        [(1.4, 0.0), (9.0, -2.0)],
        ("front", "rear"),
    ),
}


@pytest.mark.parametrize("dt", [0.1, 0.05, 0.02])
@pytest.mark.parametrize("case", CASES)
def test_a_verdict_is_the_same_however_often_the_log_is_sampled(case, dt):
    gap, front, rear, expected = CASES[case]
    judgement = judge_trace(following(gap, front, rear, dt=dt), HAND)
    ids = judgement.trace.users.ids
    at_fault = [tuple(sorted(ids[i] for i in blame.at_fault)) for blame in judgement.blames]
    assert at_fault == ([] if expected is None else [expected])


@pytest.mark.parametrize("commands", [True, False])
def test_danger_begins_when_the_gap_is_less_than_required_by_hand(commands):
    """gap = 50 - 4 tau^2 and d_min = 41.375 + 20 tau - 4 tau^2, tau after the leader brakes: equal at 0.431 s."""
    judgement = judge_trace(following(50.0, [(1.0, 0.0), (9.0, -8.0)], [], commands=commands), HAND)
    danger = next(one for one in judgement.dangers if one.user == 0)
    # boxes that may be turned are 0.17 m longer, and a leader that may turn slower by 0.5 %: not 0.03 s earlier
    assert danger.start == pytest.approx(1.5)
    assert (danger.axis, danger.role) == ("longitudinal", "rear")
    # the sample before is the threshold, and from 0.5 s after it braking is owed
    assert danger.brakes_from == pytest.approx(danger.start - 0.1 + RHO)
    assert danger.duty == "braked less than the proper response asks [m/s^2]"
    assert danger.excess == pytest.approx(B, abs=0.05)
    front = [one for one in judgement.dangers if one.user == 1]
    assert not any(one.duty for one in front)
    (blame,) = judgement.blames
    # 20 tau = 50 + 20^2 / 16 at tau = 3.75 s; predicted one sample before, with boxes a little longer
    assert blame.time == pytest.approx(4.7, abs=0.051)


def test_a_verdict_from_positions_alone_says_how_sure_it_is():
    rng = np.random.default_rng(5)
    trace = following(50.0, [(1.0, 0.0), (9.0, -8.0)], [], commands=False)
    exact = judge_trace(trace, HAND)
    assert exact.noise.position < 0.02
    noisy = replace(trace.users, x=trace.users.x + rng.normal(0.0, 0.1, trace.users.x.shape))
    judgement = judge_trace(trace.replaced(users=noisy), HAND)
    assert judgement.noise.position == pytest.approx(0.1, rel=0.25)
    assert any("accelerations are estimated" in note for note in judgement.notes)
    clear = [one for one in judgement.dangers if one.duty.startswith("braked less") and one.excess > 3.0]
    assert clear and all(one.is_sure for one in clear)
    # who brakes with 3.9 m/s^2 where 4 are owed is not surely to blame
    slow = following(50.0, [(1.0, 0.0), (9.0, -8.0)], [(1.8, 0.0), (9.0, -3.9)], commands=False)
    noisy = replace(slow.users, x=slow.users.x + rng.normal(0.0, 0.1, slow.users.x.shape))
    unsure = [one for one in judge_trace(slow.replaced(users=noisy), HAND).dangers if one.user == 0]
    assert unsure and not any(one.is_sure for one in unsure if 0.0 < one.excess < 0.5)


def test_stretches_too_short_for_a_whole_fit_say_nothing_of_the_noise():
    """A fit through six of ten samples leaves less of the noise than one through eleven."""
    rng = np.random.default_rng(6)
    trace = following(50.0, [], [], commands=False)
    x = trace.users.x + rng.normal(0.0, 0.1, trace.users.x.shape) * [0.0, 1.0]
    x[10::11, 1] = np.nan  # the front car is seen for ten samples at a time, the rear one all along
    _, noise = filled_in(trace.replaced(users=replace(trace.users, x=x)))
    assert noise.position < 0.01  # that of the rear car, which is exact


def test_a_contact_is_sure_however_doubtful_another_is():
    trace = following(50.0, [], [])
    seen = {pair: view_of("inherited") for pair in ((0, 1), (1, 0))} | {(2, 3): view_of("ego", DUTIES[1])}
    sure = seen | {(2, 3): view_of("inherited")}
    certain, doubtful = _joined(trace, seen, sure)
    assert certain.is_sure and not doubtful.is_sure


def view_of(verdict, duty=""):
    return {"frame": 3, "verdict": verdict, "ego_duty": duty, "other_duty": ""}


# ---------------------------------------------------------------- the command


def test_the_command_judges_and_draws(tmp_path, capsys):
    save(following(50.0, [(1.0, 0.0), (9.0, -8.0)], []), tmp_path / "one.npz")
    main(["judge", str(tmp_path / "one.npz"), "--out", str(tmp_path / "out"), "--params", "slides"])
    out = capsys.readouterr().out
    assert "at fault: rear" in out and "braked less than the proper response asks" in out
    found = json.loads((tmp_path / "out" / "one.json").read_text())
    assert found["contacts"][0]["at_fault"] == ["rear"]
    assert (tmp_path / "out" / "one.png").read_bytes()[:4] == b"\x89PNG"
    header, *rows = (tmp_path / "out" / "one.csv").read_text().splitlines()
    assert header.startswith("time,user,partner,dangerous,gap_lon,required_lon") and len(rows) > 20


def test_the_command_records(tmp_path, capsys):
    out = tmp_path / "episode.npz"
    main(["record", "highway-fast-v0", "--shield", "off", "--seed", "4", "--out", str(out)])
    assert "blame: ego" in capsys.readouterr().out
    main(["judge", str(out), "--ego", "0"])
    assert "at fault: 0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["judge", "{}/none.npz"], r"judge: .*/none\.npz: no such file or directory$"),
        (["judge", "{}/none.csv"], r"judge: .*/none\.csv: no such file or directory$"),
        (["judge", "{}/one.npz", "--params", "carlo"], "preset = 'carlo': expected one of"),
        (["judge", "{}/one.npz", "--ego", "middle"], "--ego middle: expected one of rear, front"),
        (["record", "highway-fast-v0", "--policy", "nobody:here", "--out", "x.npz"], "nobody:here: no module 'nobody'"),
        (["record", "highway-fast-v0", "--out", "{}"], r"--out .*: expected a file"),
        (["judge", "{}/one.npz", "--out", "{}/one.npz"], r"--out .*: expected a folder"),
        (["record", "highway-fast-v0", "--seed", "-1"], "--seed -1: expected a whole number >= 0"),
        (["record", "motorway-v7", "--out", "x.npz"], "motorway-v7"),
    ],
)
def test_what_can_not_be_done_is_said(tmp_path, arguments, message, capsys):
    save(following(50.0, [], []), tmp_path / "one.npz")
    with pytest.raises(SystemExit) as end:
        main([one.format(tmp_path) for one in arguments])
    said = capsys.readouterr().err
    assert end.value.code == 2 and said.count("\n") == 1 and re.search(message, said)


def test_a_picture_shows_the_whole_required_distance():
    axes = Figure().subplots()
    _gaps(axes, judge_trace(following(60.0, [], [], v=40.0), "ad-rss"), 0, 1)
    required = max(np.nanmax(line.get_ydata()) for line in axes.lines if "required along" in line.get_label())
    assert 120.0 < required < axes.get_ylim()[1]


def test_a_driver_and_a_table_of_ones_own_are_recorded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", list(sys.path))
    (tmp_path / "slow_driver.py").write_text("def drive(seen):\n    return [4] * len(seen)\n")
    (tmp_path / "mine.yaml").write_text("ego: {response_time: 0.6}")
    main(["record", "highway-fast-v0", "--policy", "slow_driver:drive", "--preset", "mine.yaml"])
    assert load("highway-fast-v0-seed0.npz").meta["judge_params"]["ego"]["response_time"] >= 0.6


def test_duties_have_units_that_noise_can_be_compared_with():
    units = {text.rsplit(" ", 1)[-1] for text in DUTIES if "[" in text}
    assert units == {"[m]", "[m/s]", "[m/s^2]", "[rad]"}  # the last in open space, of which logs are not judged
