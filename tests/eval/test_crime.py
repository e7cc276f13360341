"""Our measures of criticality beside CommonRoad-CriMe's own code, on small scenes.

CriMe does not install beside our other tests: it asks for an older protobuf, osqp and opencv. In an environment of its
own: `pip install commonroad-crime --no-deps`, likewise commonroad-io, -clcs, -drivability-checker, -reach,
-route-planner and -vehicle-models, then what these import.
"""

import math

import numpy as np
import pytest

pytest.importorskip("commonroad_crime", reason="commonroad-crime is not installed")
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure.acceleration.a_long_req import ALongReq
from commonroad_crime.measure.time.thw import THW
from commonroad_crime.measure.time.ttc import TTC
from commonroad_crime.measure.velocity.delta_v import DeltaV

from rss_shield.shield.risk.meter import EpisodeMeter

DT, STEPS, LANE = 0.1, 150, 1
EGO, OTHER = 10, 11
LENGTH, WIDTH = 5.0, 2.0
# CriMe takes a lane that runs exactly along x for one that is not there, and projects speeds by the lane's angle to x
ANGLE = 1e-3
SCENES = [  # speed of the ego, of the car ahead [m/s], gap between bumpers [m]
    (20.0, 10.0, 30.0),
    (20.0, 19.0, 12.0),
    (30.0, 0.5, 80.0),
    (15.0, 15.0, 10.0),
    (15.0, 20.0, 10.0),
]


def lane():
    s = np.linspace(-50.0, 600.0, 200)
    middle = np.column_stack([s * math.cos(ANGLE), s * math.sin(ANGLE)])
    across = 2.0 * np.array([-math.sin(ANGLE), math.cos(ANGLE)])
    return Lanelet(middle + across, middle, middle - across, LANE)


def car(number, s, speed, heading):
    states = [
        {
            "position": (s + speed * DT * k) * np.array([math.cos(ANGLE), math.sin(ANGLE)]),
            "orientation": heading,
            "velocity": speed,
            "time_step": k,
        }
        for k in range(STEPS)
    ]
    initial = InitialState(**states[0], acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    shape = Rectangle(LENGTH, WIDTH)
    prediction = TrajectoryPrediction(
        Trajectory(1, [CustomState(**state) for state in states[1:]]),
        shape,
        center_lanelet_assignment={k: {LANE} for k in range(STEPS)},
        shape_lanelet_assignment={k: {LANE} for k in range(STEPS)},
    )
    return DynamicObstacle(number, ObstacleType.CAR, shape, initial, prediction, {LANE}, {LANE})


def crime(v_ego, v_other, gap, heading=ANGLE):
    """A configuration of CriMe: the ego, and a car `gap` ahead of it."""
    scenario = Scenario(DT)
    scenario.add_objects(LaneletNetwork.create_from_lanelet_list([lane()]))
    scenario.add_objects([car(EGO, 0.0, v_ego, ANGLE), car(OTHER, gap + LENGTH, v_other, heading)])
    configuration = CriMeConfiguration()
    configuration.update(ego_id=EGO, sce=scenario)
    return configuration


def ours(v_ego, v_other, gap, heading=0.0):
    """Measures of one frame of the same scene."""
    meter = EpisodeMeter(DT, crossing=False)
    poses = np.array([[gap + LENGTH, 0.0, heading, v_other], [0.0, 0.0, 0.0, v_ego]])
    meter.look(poses, np.full((2, 2), [LENGTH, WIDTH]))
    meter.touch(poses, 0)
    return meter.measures


def told(measure, scene):
    """A number of CriMe's."""
    return measure(crime(*scene)).compute(vehicle_id=OTHER, time_step=0, verbose=False)


@pytest.mark.parametrize("scene", SCENES)
def test_times_to_collision_are_crimes(scene):
    assert min(told(TTC, scene), 100.0) == pytest.approx(ours(*scene).min_ttc_ahead, rel=2e-3, abs=0.01)


@pytest.mark.parametrize("scene", SCENES)
def test_headways_are_crimes_to_its_time_step(scene):
    # CriMe takes the first sample at which the ego is beyond where the other's rear was
    assert told(THW, scene) - ours(*scene).min_thw_ahead == pytest.approx(DT / 2, abs=DT / 2 + 1e-6)


@pytest.mark.parametrize("scene", SCENES)
def test_required_braking_is_minus_crimes_while_the_gap_shrinks(scene):
    v_ego, v_other, _ = scene
    if v_ego <= v_other:  # CriMe squares the relative speed, whatever its sign
        assert ours(*scene).max_drac_ahead == 0.0
        return
    assert ours(*scene).max_drac_ahead == pytest.approx(-told(ALongReq, scene), rel=5e-3, abs=0.01)


@pytest.mark.parametrize(("v_ego", "v_other", "heading"), [(20.0, 0.0, 0.0), (20.0, 10.0, math.pi), (20.0, 10.0, 0.0)])
def test_the_change_of_velocity_is_half_of_the_relative_one(v_ego, v_other, heading):
    measured = ours(v_ego, v_other, 10.0, heading).delta_v
    # equal masses that stick together: |v_ego - v_other| / 2, of vectors
    assert measured == pytest.approx(0.5 * math.hypot(v_ego - v_other * math.cos(heading), v_other * math.sin(heading)))
    theirs = DeltaV(crime(v_ego, v_other, 10.0, heading + ANGLE)).compute(0, OTHER, verbose=False)
    # release 0.4.5 adds what it should subtract: right for a car that stands only
    assert theirs == pytest.approx(0.5 * (v_ego + v_other * math.cos(heading)), abs=0.02)
    assert (abs(theirs - measured) < 0.02) == (v_other == 0.0)
