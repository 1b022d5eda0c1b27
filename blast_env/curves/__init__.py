"""Reference curves of blast waves in the open: Kingery & Bulmash, Friedlander."""

from blast_env.curves.friedlander import Friedlander, impulse_share_until
from blast_env.curves.kingery_bulmash import (
    CURVES_SCALED_M,
    SURFACE_BURST_SCALED_M,
    Burst,
    Quantity,
    burst_of,
    in_the_open,
    kingery_bulmash,
    largest_reflected_peak_pa,
    oblique,
    scaled_distance,
    within_curves,
)

__all__ = [
    "CURVES_SCALED_M",
    "SURFACE_BURST_SCALED_M",
    "Burst",
    "Friedlander",
    "Quantity",
    "burst_of",
    "impulse_share_until",
    "in_the_open",
    "kingery_bulmash",
    "largest_reflected_peak_pa",
    "oblique",
    "scaled_distance",
    "within_curves",
]
