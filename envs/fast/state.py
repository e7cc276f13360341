"""State of the engine: one record per car and one per environment.

A batch of E environments with room for N road users each is `cars[E, N]` and `episodes[E]`. Fields of
structured arrays are arrays: `cars["x"]` is `[E, N]`.
"""

import numpy as np

from rss_shield.envs.fast.draws import GENERATOR
from rss_shield.shield.tally import DECISION_FIELDS, EPISODE_FIELDS

# kinds of road users
TRAFFIC = 0  # `IDMVehicle`
META = 1  # `MDPVehicle`, driven by meta-actions
DIRECT = 2  # `Vehicle`, driven by acceleration and steering
OBSTACLE = 3  # `Obstacle`
UNSEEN = 4  # somebody there whom a sensor misses; only among cars as they are seen

OBSTACLE_SIZE = 2.0  # [m]

_OF_A_CAR = [
    ("x", "f8"),  # centre [m]
    ("y", "f8"),
    ("heading", "f8"),  # [rad]
    ("speed", "f8"),  # [m/s]
    ("cos", "f8"),  # of the heading
    ("sin", "f8"),
    ("acceleration", "f8"),  # command [m/s^2]
    ("steering", "f8"),  # command [rad]
    ("target_speed", "f8"),  # [m/s]
    ("timer", "f8"),  # since the last thought about a lane change [s]
    ("delta", "f8"),  # exponent of the driver's free acceleration
    ("impact_x", "f8"),  # displacement due on the next step, if `hit` [m]
    ("impact_y", "f8"),
    ("length", "f8"),  # [m]
    ("width", "f8"),
    ("kind", "i8"),
    ("group", "i8"),  # its vehicle class, among those on this road
    ("lane", "i8"),  # lane it is on
    ("target_lane", "i8"),  # lane it heads for
    ("speed_index", "i8"),  # among the target speeds, of a META car
    ("route", "i8"),  # row of the route tables, -1 = none
    ("route_step", "i8"),  # steps of the route that lie behind
    ("vice", "i8"),  # of a hostile driver, see `envs.roads.hostile`
    ("crashed", "?"),
    ("hit", "?"),  # an impact is due
    ("checks", "?"),  # looks for collisions itself
    ("changes_lane", "?"),
    ("yields", "?"),  # told to give way at an intersection
    ("was", "i8"),  # index before cars came and went, -1 = new
]
CAR = np.dtype(_OF_A_CAR, align=True)

# a driver of `LinearVehicle`, with what it weighs
LINEAR_CAR = np.dtype(
    [
        *_OF_A_CAR,
        ("gain_speed", "f8"),  # [1/s] of how much slower it is than it wants to be
        ("gain_approach", "f8"),  # [1/s] of how much faster it is than the car ahead
        ("gain_gap", "f8"),  # [1/s^2] of how much nearer that is than it wants
        ("gain_turn", "f8"),  # [1/s]
        ("gain_shift", "f8"),  # [1/s^2]
    ],
    align=True,
)

EPISODE = np.dtype(
    [
        *GENERATOR,
        ("time", "f8"),  # [s]
        ("steps", "i8"),  # decisions since reset
        ("cars", "i8"),  # road users present, obstacles included
        ("vehicles", "i8"),  # of these, vehicles; they come first
        ("ego", "i8"),  # index of the controlled vehicle
        ("ended", "?"),  # the last step ended the episode
        ("observed_lanes", "i8"),  # lanes of the road at reset, which scale the observed y
        ("return_", "f8"),  # rewards since reset
        ("road_frames", "i8"),  # since the road was made, on roads that are regulated
        ("overflow", "?"),  # a car found no room in the arrays
        # the shield on the ego
        ("frame_road", "i8"),  # road it measures along, see `LaneFrames`, -1 = none yet
        ("path", "i8"),  # through the junction, -1 = none yet
        ("go", "i8"),  # frames of throttle left in its plan through a junction, -1 = no plan
        ("held_at", "f8"),  # acceleration to which it was held back on the last frame, inf = it was not [m/s^2]
        ("wronged", "?"),  # somebody broke a duty, and it has had no plan since that stays clear of everybody
        ("refused", "?"),  # the lane change of this decision was taken back
        ("evading", "?"),  # a manoeuvre out of somebody's way has begun, and the danger lasts
        ("answers", "?"),  # a filter that looks once per decision responds in this one
        ("frames_trapped", "i8"),  # on which no plan stayed clear of everybody
        ("pairs_examined", "i8"),  # pair-frames on which plans were checked against somebody
        ("pairs_possible", "i8"),  # all pair-frames
        ("turn", "i8"),  # row of its trail that the last frame is in
        ("near", "i8"),  # how many others it measured then
        ("stands", "i8"),  # state of the road that its parameters are for, -1 = none yet
        ("nominal_acceleration", "f8"),  # last command given from outside
        ("nominal_steering", "f8"),
        *EPISODE_FIELDS,
        ("room_left", "f8"),  # beside who was alongside on the last frame [m]
        ("room_right", "f8"),
    ],
    align=True,
)

REWARDS = 5  # components of a reward, at most

STEP = np.dtype(
    [
        ("speed", "f8"),  # of the ego [m/s]
        ("crashed", "?"),
        ("success", "?"),  # has reached its goal, where there is one
        ("time", "f8"),  # since reset [s]
        *[(f"reward_{k}", "f8") for k in range(REWARDS)],
        ("raw_reward", "f8"),
        # what the shield saw and did
        *DECISION_FIELDS,
        ("episode_return", "f8"),
        ("episode_length", "i8"),
    ],
    align=True,
)
