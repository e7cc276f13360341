"""The 37 pre-crash types of NHTSA, and which scenario is one of them.

Najm, Smith, Yanagisawa, "Pre-Crash Scenario Typology for Crash Avoidance Research", DOT HS 810 767, 2007.
"""

from typing import NamedTuple

_NOT_RSS = "RSS has no rule for it: the model is about other road users"
_NO_LIGHTS = "scripted here without lights; `signalised-intersection-v0` has them"
_NOBODY_THERE = "such users are not on these roads"


class Type(NamedTuple):
    """One pre-crash type."""

    number: int
    name: str
    scenarios: tuple[str, ...] = ()  # names in the catalogues
    reason: str = ""  # why there is none, or what is missing


TYPES = (
    Type(1, "vehicle failure", reason="no car here fails; an ego that can't brake has no response"),
    Type(2, "control loss with prior vehicle action", reason="tyres do not slip on these roads"),
    Type(3, "control loss without prior vehicle action", reason="tyres do not slip on these roads"),
    Type(4, "running red light", ("a driver runs the stop line",), _NO_LIGHTS),
    Type(5, "running stop sign", ("a driver runs the stop line",)),
    Type(6, "road edge departure with prior vehicle maneuver", reason=_NOT_RSS),
    Type(7, "road edge departure without prior vehicle maneuver", reason=_NOT_RSS),
    Type(8, "road edge departure while backing up", reason=_NOT_RSS),
    Type(9, "animal crash with prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(10, "animal crash without prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(11, "pedestrian crash with prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(12, "pedestrian crash without prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(13, "pedalcyclist crash with prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(14, "pedalcyclist crash without prior vehicle maneuver", reason=_NOBODY_THERE),
    Type(15, "backing up into another vehicle", ("the leader backs up into a standing ego",)),
    Type(16, "vehicle(s) turning, same direction", ("the leader turns right",)),
    Type(17, "vehicle(s) parking, same direction", ("the leader pulls over and stops",)),
    Type(
        18,
        "vehicle(s) changing lanes, same direction",
        ("the ego changes lanes into a neighbour", "the ego cuts in before a faster car", "a slower car cuts in"),
    ),
    Type(19, "vehicle(s) drifting, same direction", ("the neighbour drifts over", "the ego drifts over")),
    Type(20, "vehicle(s) making a maneuver, opposite direction", ("the ego overtakes into oncoming traffic",)),
    Type(21, "vehicle(s) not making a maneuver, opposite direction", ("a wrong-way driver that does not brake",)),
    Type(22, "following vehicle making a maneuver", ("the ego changes lanes behind a slow car",)),
    Type(23, "lead vehicle accelerating", ("the leader brakes and drives on", "starting too early")),
    Type(24, "lead vehicle moving at lower constant speed", ("a slower leader",)),
    Type(25, "lead vehicle decelerating", ("the leader brakes as hard as allowed", "the leader slows down gently")),
    Type(26, "lead vehicle stopped", ("a stalled car", "a blocked junction")),
    Type(
        27,
        "left turn across path from opposite directions at signalized junctions",
        ("the ego turns left across oncoming traffic",),
        _NO_LIGHTS,
    ),
    Type(
        28,
        "vehicle turning right at signalized junctions",
        ("the ego turns right before crossing traffic",),
        _NO_LIGHTS,
    ),
    Type(
        29,
        "left turn across path from opposite directions at non-signalized junctions",
        ("the ego turns left across oncoming traffic", "oncoming traffic turns left across the ego"),
    ),
    Type(
        30,
        "straight crossing paths at non-signalized junctions",
        ("crossing traffic from the left", "crossing traffic from the right"),
    ),
    Type(31, "vehicle(s) turning at non-signalized junctions", ("the ego turns right before crossing traffic",)),
    Type(32, "evasive action with prior vehicle maneuver", ("the ego brakes and its follower does not",)),
    Type(33, "evasive action without prior vehicle maneuver", ("the leader crashes: it stops on the spot",)),
    Type(34, "non-collision incident", reason="there is nothing to collide with"),
    Type(35, "object crash with prior vehicle maneuver", ("cut-out before a stalled car (UN R157)",)),
    Type(36, "object crash without prior vehicle maneuver", ("an object on the road",)),
    Type(37, "other", reason="not one situation"),
)
