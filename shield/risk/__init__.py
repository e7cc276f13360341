"""Driving safety field: how risky a scene is, beside whether RSS calls it safe. A measure, never a filter.

Nothing in `shield/` imports this package.
"""

from rss_shield.shield.risk.classes import KNOWN_SAFE, KNOWN_UNSAFE, STATES, UNKNOWN, classify, steady
from rss_shield.shield.risk.factors import Factors, driver_factor, road_factor
from rss_shield.shield.risk.field import SOURCE, field, road_users
from rss_shield.shield.risk.markings import MARKING, marking, marking_risk
from rss_shield.shield.risk.scene import SceneRisk, neighbours, scene_risk
from rss_shield.shield.risk.settings import RiskSettings, assumed
from rss_shield.shield.risk.standard import SourceRisk, risk_of
from rss_shield.shield.risk.stays import BandRisk, band_risk
from rss_shield.shield.risk.surrogates import Surrogates, toward_leader

__all__ = [
    "KNOWN_SAFE",
    "KNOWN_UNSAFE",
    "MARKING",
    "SOURCE",
    "STATES",
    "UNKNOWN",
    "BandRisk",
    "Factors",
    "RiskSettings",
    "SceneRisk",
    "SourceRisk",
    "Surrogates",
    "assumed",
    "band_risk",
    "classify",
    "driver_factor",
    "field",
    "marking",
    "marking_risk",
    "neighbours",
    "risk_of",
    "road_factor",
    "road_users",
    "scene_risk",
    "steady",
    "toward_leader",
]
