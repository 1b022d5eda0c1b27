"""Comparison of the gas engine's charge on the ground with Kingery and Bulmash.

Peak specific impulses, arrivals and peaks are divided by the curves, in the free field at ground
level and on a wide rigid wall. The arrival is the time of the steepest rise, in the middle of the
computed shock, which is some cells wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cbrt, ceil, hypot
from typing import Final, Literal

import numpy as np

from blast_env.curves import Quantity, kingery_bulmash
from blast_env.gas.ending import is_known
from blast_env.gas.faces import exposed_faces
from blast_env.gas.grid import FaceKind, GasGrid
from blast_env.gas.probes import FaceLoads, Gauges
from blast_env.gas.solver import GasSolver
from blast_env.gas.source import TNT, GasCharge, set_charge

Wave = Literal["reflected", "incident"]

_FREE_FIELD_START: Final = 1.0
"""Scaled radius of the front, m/kg^(1/3), at which the free field becomes three-dimensional."""
_ROUNDING: Final = 1e-9
_LATEST: Final = 1.5
"""Time limit of a run, in units of the reference's end of the positive phase."""


@dataclass(frozen=True)
class Ratio:
    """Computed values at a distance, divided by Kingery and Bulmash's.

    Attributes:
        z_m_kg: Scaled distance, m/kg^(1/3).
        impulse: Peak specific impulse.
        arrival: Time of the steepest rise.
        peak: Largest overpressure.
    """

    z_m_kg: float
    impulse: float
    arrival: float
    peak: float


def wide_wall(charge_kg: float, distance_m: float, cell_m: float) -> Ratio:
    """Return the normally reflected load at the point of a rigid wall nearest to a ground charge.

    The model is half of the scene, beside a mirror through the charge; the distance is rounded up
    to whole cells. The wall and the air behind the charge are wide enough for their ends to have no
    effect in the first positive phase.
    """
    to_wall = ceil(distance_m / cell_m - _ROUNDING)
    distance_m = to_wall * cell_m
    latest_s = _LATEST * _phase_end_s(distance_m, charge_kg)
    duration_s = kingery_bulmash("positive_duration", distance_m, charge_kg)
    wide = ceil((0.35 * distance_m + 450.0 * duration_s) / cell_m)
    behind = ceil(cbrt(charge_kg) / cell_m)
    solid = np.zeros((behind + to_wall + 1, wide, wide), dtype=np.bool_)
    solid[-1] = True
    grid = GasGrid(cell_m, solid, (-behind * cell_m, 0.0, 0.0), y_low=FaceKind.MIRROR)
    faces = exposed_faces(grid, solid)
    nearest = int(np.hypot(*faces.centres_m(grid)[:, 1:].T).argmin())
    loads = FaceLoads(len(faces))
    charge = GasCharge(charge_kg, (0.0, 0.0, 0.0), TNT)
    solver = GasSolver(grid, faces=faces, recorders=[loads], with_fuel=True, burning=charge.burning)
    set_charge(solver, charge)
    while solver.time_s < latest_s:
        solver.step()
        if is_known(loads.impulse_pa_s, loads.net_impulse_pa_s)[nearest]:
            break
    return _over_reference(
        "reflected",
        distance_m,
        charge_kg,
        float(loads.impulse_pa_s[nearest]),
        float(loads.steepest_s[nearest]),
        float(loads.peak_pa[nearest]),
    )


def free_field(charge_kg: float, z_m_kg: Sequence[float], cell_m: float) -> list[Ratio]:
    """Return the incident wave along the ground, at the centres of cells beside the axis.

    The model is a quarter of the scene, between mirrors through the charge.
    """
    unit = cbrt(charge_kg)
    gauges = free_field_gauges(charge_kg, [z * unit for z in z_m_kg], cell_m)
    return [
        _over_reference(
            "incident",
            cell_m * hypot(cell[0] + 0.5, 0.5, 0.5),
            charge_kg,
            float(gauges.impulse_pa_s[k]),
            float(gauges.steepest_s[k]),
            float(gauges.peak_pa[k]),
        )
        for k, cell in enumerate(gauges.cells)
    ]


def free_field_gauges(charge_kg: float, distances_m: Sequence[float], cell_m: float) -> Gauges:
    """Return gauges along the ground, in the cells at given distances, after the wave has passed.

    The mirror beside them represents a wall without thickness, parallel to the flow.
    """
    unit, farthest_m = cbrt(charge_kg), max(distances_m)
    along, wide = ceil((farthest_m + unit) / cell_m), ceil((0.45 * farthest_m + unit) / cell_m)
    solid = np.zeros((along, wide, wide), dtype=np.bool_)
    grid = GasGrid(cell_m, solid, x_low=FaceKind.MIRROR, y_low=FaceKind.MIRROR)
    gauges = Gauges(grid, [(int(distance_m / cell_m), 0, 0) for distance_m in distances_m])
    charge = GasCharge(charge_kg, (0.0, 0.0, 0.0), TNT)
    solver = GasSolver(grid, recorders=[gauges], with_fuel=True, burning=charge.burning)
    set_charge(solver, charge, _FREE_FIELD_START * unit)
    latest_s = _LATEST * _phase_end_s(farthest_m, charge_kg)
    while solver.time_s < latest_s:
        solver.step()
        if is_known(gauges.impulse_pa_s, gauges.net_impulse_pa_s).all():
            break
    return gauges


def _phase_end_s(distance_m: float, charge_kg: float) -> float:
    """Return the end of the positive phase by the reference, s."""
    quantities: tuple[Quantity, Quantity] = ("arrival_time", "positive_duration")
    return sum(kingery_bulmash(quantity, distance_m, charge_kg) for quantity in quantities)


def _over_reference(
    wave: Wave, distance_m: float, charge_kg: float, impulse: float, arrival_s: float, peak: float
) -> Ratio:
    reflected = wave == "reflected"
    impulses: Quantity = "reflected_impulse" if reflected else "incident_impulse"
    peaks: Quantity = "reflected_overpressure" if reflected else "incident_overpressure"
    return Ratio(
        distance_m / cbrt(charge_kg),
        impulse / kingery_bulmash(impulses, distance_m, charge_kg),
        arrival_s / kingery_bulmash("arrival_time", distance_m, charge_kg),
        peak / kingery_bulmash(peaks, distance_m, charge_kg),
    )
