"""What a risk is relative to: the standard DSI*, and the thresholds RDSI1*, RDSI2* (Section 6 of the paper).

The paper rests them on a headway of 1 s and a time to collision of 4 s; its exact rule is lost. Here the source is
frozen as observed, but at a distance and closing at a speed such that both hold at once, on the reference road, with no
person driving: bad roads and bad drivers raise the risk, while type, mass and speed of the source do not move the
standard against itself.
"""

from typing import NamedTuple

from rss_shield.shield._numba.compiled import compiled, inner, larger
from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.risk.field import bearing, coupling, dsi, dsi_at, energy, force, mass_of, speed_of, virtual_mass
from rss_shield.shield.risk.settings import CAR, SAME


class SourceRisk(NamedTuple):
    """Risk of one source to the ego, beside the thresholds of its class."""

    rdsi: float  # RDSI
    lower: float  # RDSI1*: below is known safe
    upper: float  # RDSI2*: above is known unsafe
    dsi: float  # DSI
    energy: float  # SPE
    rate: float  # dSPE/dt
    standard: float  # DSI*
    distance: float  # r [m] between the centres
    closing: float  # [m/s] at which it shrinks


class LaneChange(NamedTuple):
    """Distances between centres at which a lane change becomes unknown, and known unsafe [m]."""

    comfortable: float  # D1
    emergency: float  # D2


@compiled
def risk_of(ego, source, lane_change, settings):
    """`SourceRisk` of one source ((7) of the paper).

    Args:
      ego, source: `SOURCE` records.
      lane_change: thresholds are those of a lane change, whoever is in front; else those of following and cut-in.
      settings: `RiskSettings`.
    """
    sight = bearing(ego, source, settings)
    r, felt = max(sight.distance, settings.nearest), coupling(ego, source, settings)
    stored = energy(r, felt, sight, settings)
    rate = force(r, felt, sight, settings) * sight.closing
    index = dsi(stored, rate, settings)
    reference = _reference(ego, source, felt, sight, settings)
    r_star = standard_distance(ego, settings)
    gap_star = r_star - settings.length_offset
    energy_star = energy(r_star, reference, sight, settings)
    standard = dsi(energy_star, force(r_star, reference, sight, settings) * (gap_star / settings.ttc), settings)
    lower, upper = settings.energy_weight * energy_star / standard, 1.0
    if lane_change:
        spacing = lane_change_distances(ego, source, settings)
        closing = max(sight.closing, 0.0)  # opening would make the thresholds negative and turn their order round
        lower = dsi_at(spacing.comfortable, closing, reference, sight, settings) / standard
        upper = dsi_at(spacing.emergency, closing, reference, sight, settings) / standard
    weight = _lateral_weight(ego, source, settings)
    return SourceRisk(
        weight * index / standard, lower, upper, index, stored, rate, standard, sight.distance, sight.closing
    )


@compiled
def standard_distance(ego, settings):
    """r* [m]: where the ego has the standard headway."""
    return max(speed_of(ego) * settings.headway, settings.least_standard_gap) + settings.length_offset


@compiled
def lane_change_distances(ego, source, settings):
    """`LaneChange` between the ego and a source before or behind it.

    The "dynamic minimal safe distance" of the paper, whose formula is lost: the rear driver responds, brakes as hard as
    the one in front, and a distance is left.
    """
    ahead = (source.x - ego.x) * ego.vx + (source.y - ego.y) * ego.vy > 0.0
    v_ego, v_source = speed_of(ego), speed_of(source)
    v_rear, v_front = (v_ego, v_source) if ahead else (v_source, v_ego)
    return LaneChange(
        _spacing(v_rear, v_front, settings.comfortable_response, settings.comfortable_brake, settings.least_distance),
        _spacing(v_rear, v_front, settings.emergency_response, settings.emergency_brake, settings.least_distance),
    )


@inner
def _spacing(v_rear, v_front, tau, b, d0):
    return v_rear * tau + larger(0.0, stopping_distance(v_rear, b) - stopping_distance(v_front, b)) + d0


@inner
def _reference(ego, source, felt, sight, settings):
    """`coupling` of the pair that the standard is about."""
    if settings.standard == SAME:
        return felt
    mass = mass_of(source, settings)
    if settings.standard == CAR:
        mass = virtual_mass(settings.reference_mass, 1.0, sight.speed, settings)
    masses = mass_of(ego, settings) * mass  # in the order of `coupling`, so that equal pairs are equal to the last bit
    return settings.field_constant * settings.reference_road * settings.reference_road * masses


@inner
def _lateral_weight(ego, source, settings):
    """H of what is beside the ego's way (Jing et al., IEEE T-ITS 23(12), 2022, (31)); 1 at an exponent of 0."""
    speed = speed_of(ego)
    if settings.lateral_exponent == 0.0 or speed == 0.0:
        return 1.0
    beside = abs((source.x - ego.x) * ego.vy - (source.y - ego.y) * ego.vx) / speed
    if 2.0 * beside <= settings.lane_width:
        return 1.0
    return (settings.lane_width / (2.0 * beside)) ** settings.lateral_exponent
