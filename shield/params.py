"""What every driver is assumed to do: the one published table that safety and blame refer to.

Symbols as in Shalev-Shwartz, Shammah, Shashua, "On a Formal Model of Safe and Scalable Self-driving
Cars" (arXiv:1708.06374). Braking parameters are positive magnitudes.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class RSSParams(NamedTuple):
    """RSS parameters of one driver. A NamedTuple of floats passes straight into compiled code."""

    response_time: float  # rho                [s]      delay before a driver must have reacted
    a_max_accel: float  # a_max,accel        [m/s^2]  strongest forward acceleration
    a_min_brake: float  # a_min,brake        [m/s^2]  weakest braking we may rely on
    a_max_brake: float  # a_max,brake        [m/s^2]  hardest braking a leader may apply
    a_min_brake_correct: float  # a_min,brake,correct [m/s^2] braking asked of the car in its own lane
    a_lat_max_accel: float  # a_max,accel^lat    [m/s^2]  strongest lateral acceleration
    a_lat_min_brake: float  # a_min,brake^lat    [m/s^2]  weakest lateral braking
    mu: float  # mu                 [m]      lateral wobble width
    standstill_gap: float  # lambda             [m]      gap left when both stand
    v_cap: float  # v_cap              [m/s]    speed above which nobody accelerates

    @classmethod
    def validated(cls, **fields: float) -> "RSSParams":
        """Build parameters from keyword arguments and check each one.

        Raises:
          ValueError: a field is missing, unknown, not a finite number or outside its range; the
            message names field, value and range.
        """
        for name in fields:
            if name not in cls._fields:
                raise ValueError(f"unknown RSS parameter {name!r}; expected one of {', '.join(cls._fields)}")
        values = {}
        for name, (low, strict) in _RANGES.items():
            if name not in fields:
                raise ValueError(f"RSS parameter {name} is missing")
            try:
                value = math.nan if isinstance(fields[name], bool) else float(fields[name])
            except (TypeError, ValueError):
                raise ValueError(f"{name} = {fields[name]!r} is not a number") from None
            finite = not math.isnan(value) and (name == "v_cap" or not math.isinf(value))
            if not finite or value < low or (strict and value == low):
                accepted = f"> {low:g}" if strict else f">= {low:g}"
                kind = "a number" if name == "v_cap" else "a finite number"
                raise ValueError(f"{name} = {fields[name]!r} is out of range: expected {kind} {accepted}")
            values[name] = value
        params = cls(**values)
        _check_order(params, "a_min_brake", "a_max_brake")
        _check_order(params, "a_min_brake_correct", "a_min_brake")
        return params


# lower end of each range, and whether that end is excluded
_RANGES = {
    "response_time": (0.0, True),
    "a_max_accel": (0.0, False),
    "a_min_brake": (0.0, True),
    "a_max_brake": (0.0, True),
    "a_min_brake_correct": (0.0, True),
    "a_lat_max_accel": (0.0, False),
    "a_lat_min_brake": (0.0, True),
    "mu": (0.0, False),
    "standstill_gap": (0.0, False),
    "v_cap": (0.0, True),
}


def _check_order(params: RSSParams, smaller: str, larger: str) -> None:
    low, high = getattr(params, smaller), getattr(params, larger)
    if low > high:
        raise ValueError(f"{smaller} = {low:g} is out of range: expected at most {larger} = {high:g}")


class Preset(NamedTuple):
    """Parameters of the ego and of everybody else, and where they come from.

    `per_frame` says that the ego's response time means "as fast as the simulator allows": it is
    raised to one simulation frame where a frame is longer. Without it, a response time below one
    frame is an error, because no shield can react faster than it is called.
    """

    ego: RSSParams
    other: RSSParams
    source: str
    per_frame: bool = False


def _slides(**changes: float) -> RSSParams:
    fields = dict(
        response_time=1.0,
        a_max_accel=3.5,
        a_min_brake=4.0,
        a_max_brake=8.0,
        a_min_brake_correct=4.0,
        a_lat_max_accel=0.2,
        a_lat_min_brake=0.8,
        mu=0.1,
        standstill_gap=1.0,
        v_cap=math.inf,
    )
    return RSSParams.validated(**(fields | changes))


def _simulator(response_time: float, a_max_accel: float = 3.0) -> RSSParams:
    return RSSParams.validated(
        response_time=response_time,
        a_max_accel=a_max_accel,
        a_min_brake=5.0,
        a_max_brake=6.0,
        a_min_brake_correct=3.0,
        a_lat_max_accel=1.0,
        a_lat_min_brake=1.5,
        mu=0.1,
        standstill_gap=1.0,
        v_cap=40.0,
    )


def _parking(response_time: float) -> RSSParams:
    return _simulator(response_time, a_max_accel=2.5)._replace(
        a_min_brake=4.0, a_max_brake=5.0, standstill_gap=0.0, mu=0.0, v_cap=5.0
    )


class Road(NamedTuple):
    """Friction between tyres and a road [1]: at least, which is to be relied on, and at most, which is to be feared."""

    low: float
    high: float


# Noon, "Engineering Analysis of Vehicular Accidents", CRC Press 1994: asphalt to concrete; dry and wet, snow and ice
ROADS = {"dry": Road(0.65, 0.75), "wet": Road(0.50, 0.60), "snow": Road(0.20, 0.25), "ice": Road(0.10, 0.15)}
GRAVITY = 9.81  # [m/s^2]


def on_road(params: RSSParams, road: Road) -> RSSParams:
    """What the same driver is assumed to do on a road of this friction.

    Nobody accelerates or brakes harder than the road admits at best. Braking that is relied on is what it admits at
    worst, along and across at once: the tyres share their grip, so both shrink alike until b^2 + b_lat^2 fits in it
    (hole H13).

    Raises:
      ValueError: friction that is not positive, or more at least than at most.
    """
    if not 0.0 < road.low <= road.high < math.inf:
        raise ValueError(f"friction = {tuple(road)} is out of range: expected 0 < low <= high, both finite")
    relied, feared = road.low * GRAVITY, road.high * GRAVITY
    share = min(1.0, relied / math.hypot(params.a_min_brake, params.a_lat_min_brake))
    return params._replace(
        a_max_accel=min(params.a_max_accel, feared),
        a_min_brake=share * params.a_min_brake,
        a_max_brake=min(params.a_max_brake, feared),
        a_min_brake_correct=min(params.a_min_brake_correct, share * params.a_min_brake),
        a_lat_max_accel=min(params.a_lat_max_accel, feared),
        a_lat_min_brake=share * params.a_lat_min_brake,
    )


def _simulator_on(name: str) -> Preset:
    road = ROADS[name]
    return Preset(
        ego=on_road(_simulator(response_time=2 / 15), road),
        other=on_road(_simulator(response_time=1.0), road),
        source=f"as simulator, where friction is {road.low:g} to {road.high:g} ({name}: Noon, Engineering Analysis of "
        "Vehicular Accidents, 1994); counts where everybody drives by it",
        per_frame=True,
    )


def _both(params: RSSParams, source: str) -> Preset:
    return Preset(params, params, source)


PRESETS: dict[str, Preset] = {
    "simulator": Preset(
        ego=_simulator(response_time=2 / 15),
        other=_simulator(response_time=1.0),
        source="limits of highway-env (IDM brakes at 6 m/s^2 at most); the ego reacts within two frames at 15 Hz",
        per_frame=True,
    ),
    "intersection": Preset(
        ego=_simulator(response_time=2 / 15, a_max_accel=6.0),
        other=_simulator(response_time=1.0, a_max_accel=6.0),
        source="as simulator, but at highway-env's intersections IDM accelerates at up to 6 m/s^2",
        per_frame=True,
    ),
    "parking": Preset(
        ego=_parking(response_time=1 / 15),
        other=_parking(response_time=0.4),
        source="a car park: the limits of highway-env's continuous actions, and no faster than 18 km/h; everybody "
        "in it is driven by a machine that responds within 0.4 s",
        per_frame=True,
    ),
    "slides": Preset(
        ego=_slides(),
        other=_slides(response_time=2.0),
        source="parameter table of the RSS lecture slides (head-on: both brake at a_min_brake)",
    ),
    "ad-rss": Preset(
        ego=_slides(a_min_brake_correct=3.0, standstill_gap=0.0, v_cap=100.0),
        other=_slides(response_time=2.0, a_min_brake_correct=3.0, standstill_gap=0.0, v_cap=100.0),
        source="ad-rss-lib 5.0.0, parameter discussion (conservative start)",
    ),
    "carla": Preset(
        ego=_slides(response_time=0.5, a_max_accel=5.0, a_min_brake_correct=3.0, standstill_gap=0.0, v_cap=100.0),
        other=_slides(response_time=0.5, a_max_accel=5.0, a_min_brake_correct=3.0, standstill_gap=0.0, v_cap=100.0),
        source="CARLA, Python example of the RSS sensor (vehicles)",
    ),
    "rodionova-conservative": _both(
        RSSParams.validated(
            response_time=1.94,
            a_max_accel=5.91,
            a_min_brake=4.13,
            a_max_brake=9.50,
            a_min_brake_correct=1.86,
            a_lat_max_accel=0.45,
            a_lat_min_brake=0.86,
            mu=0.07,
            standstill_gap=0.0,
            v_cap=math.inf,
        ),
        source="Rodionova et al., IEEE IV 2020 (9304756), mined in CARLA, 'conservative'",
    ),
    "rodionova-assertive": _both(
        RSSParams.validated(
            response_time=0.53,
            a_max_accel=4.10,
            a_min_brake=4.64,
            a_max_brake=8.03,
            a_min_brake_correct=1.76,
            a_lat_max_accel=0.43,
            a_lat_min_brake=0.96,
            mu=0.07,
            standstill_gap=0.0,
            v_cap=math.inf,
        ),
        source="Rodionova et al., IEEE IV 2020 (9304756), mined in CARLA, 'assertive'",
    ),
    **{name: _simulator_on(name) for name in ROADS},
}


def with_parameters(preset: Preset, ego: Mapping[str, float], other: Mapping[str, float]) -> Preset:
    """A preset with some of its parameters replaced.

    Args:
      preset: `Preset`.
      ego, other: name -> value, of the ego and of everybody else.

    Raises:
      ValueError: an unknown name, or a value out of range; the message begins with "ego" or "other".
    """
    for side, values in (("ego", ego), ("other", other)):
        try:
            params = RSSParams.validated(**{**getattr(preset, side)._asdict(), **values})
        except ValueError as error:
            raise ValueError(f"{side}: {error}") from None
        preset = preset._replace(**{side: params})  # type: ignore[arg-type]
    if "response_time" in ego:  # asked for, so never raised to one frame silently
        preset = preset._replace(per_frame=False)
    return preset


class Rules(NamedTuple):
    """Which duties and margins are in force: the second half of the published table.

    The default is the shield with its proof. Switching something off is for ablations; each switch
    costs the guarantee, and a test shows for each how the guarantee is lost.
    """

    longitudinal: bool = True  # answer lost longitudinal distance by braking (Def. 4)
    lateral: bool = True  # answer lost lateral distance by stopping laterally (Def. 8)
    limits: bool = True  # always-on limits of acceleration and lateral speed (C1, C1y)
    memory: bool = True  # respond on the axis that was safe last (C7); off: on the longitudinal one
    no_credit: bool = True  # lateral distance without credit for receding (hole H22)
    present_duties: bool = True  # in danger, also answer the situation as it is now (holes H6, H23)
    brake_if_inherited: bool = True  # brake at a_max_brake where danger was never anybody's doing
    take_back: bool = True  # a blocked lane change is taken back, one half done completed
    anticipation: float = 2.0  # kappa: rate at which margins may shrink before there is danger, 0 = any [1/s]
    heading_bound: float = 0.1  # largest sine of the angle between car and lane [1]; 1 = no bound
    discretisation_margin: bool = True  # C5: explicit Euler, the last partial braking step
    overlap_margin: float = 0.1  # the simulator flags *predicted* contact, with slip left out [m]
    reverse_speed: float = 1.5  # fastest that the ego may back up (hole H12): walking speed; 0 = never [m/s]


class Table(NamedTuple):
    """The published table that a pair is held to, both by the shield and by the judge."""

    ego: RSSParams  # response times of both in whole frames
    other: RSSParams
    rules: Rules
    dt: float  # length of a frame [s]
    others: Any = None  # `[K, 10]` rows of those who are not like `other` (`shield.ground`); None = all are
