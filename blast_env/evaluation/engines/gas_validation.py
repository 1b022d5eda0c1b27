"""The validation status of gas dynamics' loads, from the place, the cells and the charge."""

from collections.abc import Mapping, Sequence
from math import cbrt
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.bays import Bay
from blast_env.evaluation.validation import NOT_KNOWN, Validation, ValidationStatus
from blast_env.gas.oblique_walls import STEPPED
from blast_env.gas.settings import cells_unchecked, distance_unchecked
from blast_env.geometry import OUTWARDS, Rectangle
from blast_env.site.blast_site import BlastSite, in_sight
from blast_env.units import MODULE_SIDE_M

_OBLIQUE: Final = 1e-6  # of the smaller part of a unit normal


def validation_of(
    scaled_m: float,
    shaded: float,
    cells: float,
    is_known: bool,
    is_stepped: bool,
    is_raised: bool,
) -> Validation:
    """Return the validation status of a load.

    Args:
        scaled_m: Scaled distance from the charge, m/kg^(1/3).
        shaded: Share of the place that is out of sight of the charge.
        cells: Cells per m/kg^(1/3) of the charge.
        is_known: Whether the impulse was captured.
        is_stepped: Whether the wall is oblique, modelled as a staircase.
        is_raised: Whether the charge is above the ground.
    """
    if not is_known:
        return Validation(ValidationStatus.OUTSIDE, NOT_KNOWN)
    if words := distance_unchecked(scaled_m):
        return Validation(ValidationStatus.OUTSIDE, words)
    if words := cells_unchecked(cells):
        return Validation(ValidationStatus.APPROXIMATE, words)
    if is_raised:
        words = "a charge above the ground: not compared with measurements"
        return Validation(ValidationStatus.APPROXIMATE, words)
    if is_stepped:
        return Validation(ValidationStatus.APPROXIMATE, STEPPED)
    if shaded > 0.0:
        part = "" if shaded == 1.0 else f"{shaded:.0%} of it "
        words = f"{part}in the shade: compared with experiments and other codes"
        return Validation(ValidationStatus.VERIFIED, words)
    return Validation(
        ValidationStatus.MEASURED, "in sight: within 6 % of Kingery and Bulmash's impulse"
    )


class BayPlaces(NamedTuple):
    """The places of bays relative to a charge.

    Attributes:
        distance_m: Distance of the middle of each bay from the charge (bays,).
        seen: Whether the middle of each bay is in sight of the charge (bays,).
    """

    distance_m: FloatArray
    seen: BoolArray


def bay_places(site: BlastSite, bays: Sequence[Bay]) -> BayPlaces:
    """Return the places of bays relative to the charge of a site."""
    points, outward = bay_middles(
        {structure.name: structure.rectangle_m for structure in site.structures}, bays
    )
    charge_m = np.array([*site.charge.position_m, site.charge.height_m])
    distance_m = np.linalg.norm(points - charge_m, axis=1)
    return BayPlaces(distance_m, in_sight(site, points + MODULE_SIDE_M * outward, outward))


def bay_middles(
    rectangles_m: Mapping[str, Rectangle], bays: Sequence[Bay]
) -> tuple[FloatArray, FloatArray]:
    """Return the middles of bays on their walls, m, and their outward normals (bays, 3).

    `rectangles_m` has the rectangle around each structure, by name.
    """
    points = np.array([_middle_m(rectangles_m[bay.structure], bay) for bay in bays])
    outward = np.array([(*_outward(bay), 0.0) for bay in bays])
    return points.reshape(-1, 3), outward.reshape(-1, 3)


def _middle_m(rectangle_m: Rectangle, bay: Bay) -> tuple[float, float, float]:
    along_m, height_m = 0.5 * (bay.left_m + bay.right_m), 0.5 * (bay.floor_m + bay.top_m)
    if bay.line is not None:
        return (*bay.line.point_at(along_m), height_m)
    left, bottom, right, top = rectangle_m
    if bay.wall in ("west", "east"):
        return left if bay.wall == "west" else right, along_m, height_m
    return along_m, bottom if bay.wall == "south" else top, height_m


def _outward(bay: Bay) -> tuple[float, float]:
    return OUTWARDS[bay.wall] if bay.line is None else bay.line.normal


def bay_validations(
    site: BlastSite, bays: Sequence[Bay], cells: float, known: Mapping[str, bool]
) -> tuple[Validation, ...]:
    """Return the validation statuses of the loads on bays.

    Args:
        site: The site with its charge, structures and barrier.
        cells: Cells per m/kg^(1/3) of the charge.
        known: Whether the loads on bays are known, by bay; those that are not named are.
    """
    places, scale = bay_places(site, bays), cbrt(site.charge.tnt_kg)
    return tuple(
        validation_of(
            float(distance_m) / scale,
            1.0 - float(seen),
            cells,
            known.get(bay.name, True),
            bay.line is not None and min(map(abs, bay.line.normal)) > _OBLIQUE,
            site.charge.is_raised,
        )
        for bay, distance_m, seen in zip(bays, *places, strict=True)
    )
