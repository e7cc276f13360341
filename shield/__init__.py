"""Responsibility-Sensitive Safety (RSS) as compiled functions. Imports numpy and numba, nothing else."""

from rss_shield.shield.definitions.lateral import d_min_lateral, mu_lateral_velocity
from rss_shield.shield.definitions.longitudinal import (
    d_min_longitudinal,
    d_min_opposite_direction,
    d_min_same_direction,
)
from rss_shield.shield.params import PRESETS, ROADS, Preset, Road, RSSParams, Rules, Table, on_road
from rss_shield.shield.table import table_for

__all__ = [
    "PRESETS",
    "ROADS",
    "Preset",
    "RSSParams",
    "Road",
    "Rules",
    "Table",
    "d_min_lateral",
    "d_min_longitudinal",
    "d_min_opposite_direction",
    "d_min_same_direction",
    "mu_lateral_velocity",
    "on_road",
    "table_for",
]
