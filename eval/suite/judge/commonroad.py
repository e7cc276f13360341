"""CommonRoad scenarios as traces: Althoff, Koschi, Manzinger, IEEE IV 2017; read by commonroad-io.

Scenarios have y to the left of x, traces to the right, so y and all angles change their sign.
"""

from pathlib import Path
from typing import Any

import numpy as np

from rss_shield.eval.suite.judge.trajectories import LENGTH, WIDTH, with_headings
from rss_shield.shield.trace import Lane, Trace, users_of

_KINDS = {
    **{"car": "car", "taxi": "car", "priorityVehicle": "car", "parkedVehicle": "obstacle", "truck": "truck"},
    **{"bus": "bus", "motorcycle": "motorcycle", "bicycle": "bicycle", "pedestrian": "pedestrian"},
}
_LINES = {"dashed": "striped", "broad_dashed": "striped", "no_marking": "none", "unknown": "unknown"}


def read_commonroad(path: str | Path) -> Trace:
    """Read a scenario of format 2020a. What its planning problems ask of an ego is left out: there is none yet.

    Raises:
      ModuleNotFoundError: commonroad-io is not installed.
      ValueError: the file is no scenario, or nobody moves in it.
    """
    try:
        # its own `CommonRoadFileReader` imports the protobuf reader, too, which needs protobuf before 4
        from commonroad.common.reader.file_reader_xml import XMLFileReader
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"CommonRoad scenarios need the package {error.name!r}: pip install 'rss-shield[commonroad]'"
        ) from None
    if not Path(path).exists():
        raise FileNotFoundError(f"{path}: there is no such file")
    try:
        scenario, _ = XMLFileReader(str(path)).open()
    except Exception as error:  # whatever its parser meets
        raise ValueError(f"{path}: expected a CommonRoad scenario ({type(error).__name__}: {error})") from None
    moving = list(scenario.dynamic_obstacles)
    if not moving:
        raise ValueError(f"{path}: expected a scenario with dynamic obstacles")
    states = {obstacle.obstacle_id: _states(obstacle) for obstacle in moving}
    count = 1 + max(step for one in states.values() for step in one)
    still = list(scenario.static_obstacles)
    shape = (count, len(moving) + len(still))
    x, y, heading, speed = (np.full(shape, np.nan) for _ in range(4))
    for i, obstacle in enumerate(moving):
        for step, (px, py, angle, v) in states[obstacle.obstacle_id].items():
            x[step, i], y[step, i], heading[step, i], speed[step, i] = px, -py, -angle, v
    for i, obstacle in enumerate(still, len(moving)):
        (px, py), angle = obstacle.initial_state.position, float(obstacle.initial_state.orientation)
        x[:, i], y[:, i], heading[:, i], speed[:, i] = px, -py, -angle, 0.0
    everybody = [*moving, *still]
    sizes = [_size(obstacle.obstacle_shape) for obstacle in everybody]
    users = users_of(
        [str(obstacle.obstacle_id) for obstacle in everybody],
        [_kind(obstacle) for obstacle in moving] + ["obstacle"] * len(still),
        [size[0] for size in sizes],
        [size[1] for size in sizes],
        *(x, y, heading, speed),
    )
    lanes = tuple(_lane(lanelet, scenario.lanelet_network) for lanelet in scenario.lanelet_network.lanelets)
    time = np.arange(count) * float(scenario.dt)
    return Trace(float(scenario.dt), time, users, lanes, meta={"source": Path(path).name})


def _states(obstacle: Any) -> dict[int, tuple[float, float, float, float]]:
    """By time step: x, y, orientation, speed. Accelerations, where a file has them, are noisier than estimates."""
    found = {}
    path = obstacle.prediction.trajectory.state_list if obstacle.prediction is not None else []
    for state in [obstacle.initial_state, *path]:
        position = getattr(state.position, "center", state.position)  # a set has a centre
        v, attributes = float(state.velocity), state.attributes
        if "orientation" in attributes:
            angle = state.orientation
        else:  # a point mass: velocities along x and y
            v, angle = float(np.hypot(v, state.velocity_y)), np.arctan2(state.velocity_y, v)
        found[int(state.time_step)] = float(position[0]), float(position[1]), float(angle), v
    return found


def _size(shape: Any) -> tuple[float, float]:
    if getattr(shape, "radius", None) is not None:
        return 2.0 * float(shape.radius), 2.0 * float(shape.radius)
    return float(getattr(shape, "length", LENGTH)), float(getattr(shape, "width", WIDTH))


def _kind(obstacle: Any) -> str:
    return _KINDS.get(obstacle.obstacle_type.value, "unknown")


def _lane(lanelet: Any, network: Any) -> Lane:
    centre = np.array(lanelet.center_vertices, float) * [1.0, -1.0]
    width = np.hypot(*(lanelet.left_vertices - lanelet.right_vertices).T)
    known = {other.lanelet_id for other in network.lanelets}
    left, right = (one if one in known else None for one in (lanelet.adj_left, lanelet.adj_right))
    limits = [
        element.additional_values[0]
        for sign in lanelet.traffic_signs
        for element in network.find_traffic_sign_by_id(sign).traffic_sign_elements
        if element.traffic_sign_element_id.name == "MAX_SPEED"
    ]
    return Lane(
        str(lanelet.lanelet_id),
        with_headings(centre),
        width,
        tuple(str(one) for one in lanelet.successor if one in known),
        str(left) if left is not None else "",
        str(right) if right is not None else "",
        left is not None and not lanelet.adj_left_same_direction,
        right is not None and not lanelet.adj_right_same_direction,
        _line(lanelet.line_marking_left_vertices),
        _line(lanelet.line_marking_right_vertices),
        float(limits[0]) if limits else np.inf,
    )


def _line(marking: Any) -> str:
    return _LINES.get(getattr(marking, "value", "unknown"), "continuous")
