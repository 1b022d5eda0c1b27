"""Loads on walls in the open over rigid ground, for charges on it and above it.

A charge on the ground has the curves of the hemispherical burst. One above it has two waves, each
by the curves of the burst in free air: its own, and that of its mirror image in the ground. Their
impulses add up, each by its angle of incidence. Their peaks add up to one shock, which the wall
reflects: two weak shocks that meet, or merge into a Mach stem, have about that peak. The mirrored
one is as much larger as the ground reflects a strong shock by more than twice (`reflected_pa`).
Waves that arrive one after the other have less, so this is on the safe side.

Near the ground the two become the surface burst. Between a charge on the ground and one at a scaled
height of 0.4 m/kg^(1/3), where the charts of air bursts begin (UFC 3-340-02, chapter 2), the load
goes from the first to the second with the square root of the height. `python -m studies.response
raised` compares it with gas dynamics.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.curves.kingery_bulmash import (
    SURFACE_BURST_SCALED_M,
    Burst,
    Quantity,
    oblique,
    within_curves,
)
from blast_env.curves.reflection import normally_reflected_pa, reflected_pa

Load = Literal["overpressure", "impulse"]
"""Peaks, Pa, or impulses, Pa s."""


class Ways(NamedTuple):
    """Ways of the two waves to places on walls.

    Attributes:
        away_m: Distances from the charge.
        cosine: Cosines of the angles between the walls' normals and the ways to the charge.
        mirrored_m: Distances from the mirror image of the charge in the ground.
        mirrored_cosine: Cosines for the image.
        ground_cosine: Cosines of the angles of incidence at which the ground reflects to them.
        seen: Whether the charge sees the places.
    """

    away_m: FloatArray
    cosine: FloatArray
    mirrored_m: FloatArray
    mirrored_cosine: FloatArray
    ground_cosine: FloatArray
    seen: BoolArray

    @classmethod
    def between(
        cls,
        charge_m: tuple[float, float, float],
        places_m: FloatArray,
        outward: FloatArray,
        seen: BoolArray,
    ) -> "Ways":
        """Return the ways from a charge to places (n, 3) with outward normals (n, 3)."""

        def way(height_m: float) -> tuple[FloatArray, FloatArray]:
            # The image in a rigid ground lies as deep as the charge is high.
            way_m = np.array([*charge_m[:2], height_m]) - places_m
            away_m: FloatArray = np.linalg.norm(way_m, axis=-1)
            # A place right at the charge faces it.
            cosine = np.ones(away_m.shape)
            np.divide((way_m * outward).sum(axis=-1), away_m, out=cosine, where=away_m > 0.0)
            return away_m, cosine

        own, mirrored = way(charge_m[2]), way(-charge_m[2])
        return cls(*own, *mirrored, (places_m[..., 2] + charge_m[2]) / mirrored[0], seen)


def in_the_open(load: Load, ways: Ways, charge_kg: float, height_m: float) -> FloatArray:
    """Return peaks or impulses on walls without obstacles, Pa or Pa s.

    In sight of the charge they go by the angle of incidence, peaks by `reflected_pa`, impulses by
    `oblique`; elsewhere they are those of the incident wave at the same distance.

    Args:
        charge_kg: TNT-equivalent mass, above 0.
        height_m: Height of the charge above the ground.
    """
    share = float(air_share(height_m, charge_kg))
    on_ground = _surface(load, ways, charge_kg)
    if share == 0.0:
        return on_ground
    return (1.0 - share) * on_ground + share * _in_the_air(load, ways, charge_kg)


def normally_reflected(
    load: Load, distance_m: FloatArray, charge_kg: float | FloatArray, height_m: float
) -> FloatArray:
    """Return peaks or impulses at normal incidence, Pa or Pa s.

    Both waves of a raised charge come from the same distance, which is on the safe side.

    Args:
        charge_kg: TNT-equivalent mass, above 0; broadcast against the distances.
        height_m: Height of the charge above the ground.
    """
    reflected = _NAMES[load][0]
    share = air_share(height_m, charge_kg)
    on_ground = within_curves(reflected, distance_m, charge_kg, "hemispherical")
    if load == "impulse":
        in_air = 2.0 * within_curves(reflected, distance_m, charge_kg, "spherical")
    else:
        incident = within_curves(_NAMES[load][1], distance_m, charge_kg, "spherical")
        # Two incident waves as one shock, which the wall reflects as one.
        in_air = normally_reflected_pa(2.0 * incident)
    return np.asarray((1.0 - share) * on_ground + share * in_air)


def air_share(height_m: float, charge_kg: float | FloatArray) -> FloatArray:
    """Return how much a charge counts as one in the air: 0 on the ground, 1 from 0.4 m/kg^(1/3)."""
    scaled = height_m / (SURFACE_BURST_SCALED_M * np.cbrt(charge_kg))
    return np.asarray(np.sqrt(np.minimum(scaled, 1.0)))


_NAMES: Final[Mapping[Load, tuple[Quantity, Quantity]]] = MappingProxyType(
    {
        "overpressure": ("reflected_overpressure", "incident_overpressure"),
        "impulse": ("reflected_impulse", "incident_impulse"),
    }
)


def _surface(load: Load, ways: Ways, charge_kg: float) -> FloatArray:
    """Return the loads of a hemispherical burst."""
    reflected, incident = (
        within_curves(name, ways.away_m, charge_kg, "hemispherical") for name in _NAMES[load]
    )
    if load == "impulse":
        return np.where(ways.seen, oblique(reflected, incident, ways.cosine), incident)
    # by the curve at normal incidence, by theory relative to it at others
    share = reflected_pa(incident, ways.cosine) / normally_reflected_pa(incident)
    facing = ways.seen & (ways.cosine > 0.0)
    return np.where(facing, np.maximum(reflected * share, incident), incident)


def _in_the_air(load: Load, ways: Ways, charge_kg: float) -> FloatArray:
    """Return the loads of a burst in free air and of its mirror image."""
    burst: Burst = "spherical"
    both_m = ways.away_m, ways.mirrored_m
    cosines = ways.cosine, ways.mirrored_cosine
    incident = [within_curves(_NAMES[load][1], item, charge_kg, burst) for item in both_m]
    side_on = incident[0] + incident[1]
    if load == "impulse":
        reflected = [within_curves(_NAMES[load][0], item, charge_kg, burst) for item in both_m]
        own, mirrored = (oblique(*wave) for wave in zip(reflected, incident, cosines, strict=True))
        return np.where(ways.seen, own + mirrored, side_on)
    # (1) How much the ground reflects; (2) side-on, both waves as one shock, the mirrored one
    # increased by what the ground reflects beyond twice; (3) on the wall by the angle of either
    # wave, the larger.
    on_ground = reflected_pa(incident[0], ways.ground_cosine) / incident[0]
    side_on = incident[0] + np.maximum(on_ground - 1.0, 1.0) * incident[1]
    peaks = [reflected_pa(side_on, cosine) for cosine in cosines]
    return np.where(ways.seen, np.maximum(*peaks), side_on)
