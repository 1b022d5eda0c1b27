"""Loads of a charge of another mass or at another place, from the histories of a blast.

Hopkinson-Cranz scaling: at the distance of each bay, Kingery and Bulmash's reflected peak and
impulse of both charges give the factors on the pressures and on the times of its history. This
leaves shielding and echoes as they are.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.consequences import BuildingResponse, Consequences
from blast_env.evaluation.places import bay_places
from blast_env.particles.calibration.references import (
    Quantity,
    burst_of,
    within_curves,
)
from blast_env.response.facade import rescaled, respond
from blast_env.site.scene import Charge

MASS_RANGE: Final = 1.3
"""Largest factor on the mass of a charge, and on its inverse, for which histories are scaled."""


def load_factors(
    charge: Charge,
    distance_m: FloatArray | float,
    other_kg: FloatArray | float,
    other_m: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Return the factors on pressures and on times for another mass or distance.

    Distances are those from the charge and from the other one; the masses of the other one have a
    shape that broadcasts with them.
    """
    old = np.broadcast_arrays(distance_m, charge.tnt_kg, other_m, other_kg)[:2]
    new = np.broadcast_arrays(other_m, other_kg, distance_m)[:2]
    peaks, impulses = (
        _curve(quantity, charge, *new) / _curve(quantity, charge, *old)
        for quantity in ("reflected_overpressure", "reflected_impulse")
    )
    return peaks, impulses / peaks


def _curve(
    quantity: Quantity, charge: Charge, distance_m: FloatArray, tnt_kg: FloatArray
) -> FloatArray:
    return within_curves(quantity, distance_m, tnt_kg, burst_of(charge.height_m, charge.tnt_kg))


def scaled_to(judged: Consequences, charge: Charge) -> Consequences:
    """Return the consequences of another charge for buildings with a facade, without a blast.

    It may be of another mass or at another place than the one charge of `judged`.
    """
    return Consequences(
        tuple(_scaled(each, charge) for each in judged.responses),
        unchecked=judged.unchecked,
        unjudged=judged.unjudged,
    )


def _scaled(response: BuildingResponse, charge: Charge) -> BuildingResponse:
    assert response.site is not None
    facade, old = response.on_cells, response.site.charge
    site = replace(response.site, charge=charge)
    other_m = bay_places(site, [each.bay for each in facade.bays]).distance_m
    factors = load_factors(old, response.places.distance_m, charge.tnt_kg, other_m)
    histories = rescaled(facade.time_s, facade.pressure_pa, *factors)
    return replace(response, charge=charge, site=site, on_cells=respond(facade.bays, *histories))
