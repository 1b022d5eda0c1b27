"""Reference curves of blast waves in the open: Kingery & Bulmash, Friedlander."""

from blast_env.curves.friedlander import Friedlander, impulse_share_until
from blast_env.curves.kingery_bulmash import (
    CURVES_SCALED_M,
    SURFACE_BURST_SCALED_M,
    Burst,
    Quantity,
    burst_of,
    kingery_bulmash,
    oblique,
    scaled_distance,
    within_curves,
)
from blast_env.curves.over_ground import Load, Ways, air_share, in_the_open, normally_reflected
from blast_env.curves.reflection import AMBIENT_PA, normally_reflected_pa, reflected_pa

__all__ = [
    "AMBIENT_PA",
    "CURVES_SCALED_M",
    "SURFACE_BURST_SCALED_M",
    "Burst",
    "Friedlander",
    "Load",
    "Quantity",
    "Ways",
    "air_share",
    "burst_of",
    "impulse_share_until",
    "in_the_open",
    "kingery_bulmash",
    "normally_reflected",
    "normally_reflected_pa",
    "oblique",
    "reflected_pa",
    "scaled_distance",
    "within_curves",
]
