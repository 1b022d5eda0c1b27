"""How far the gas engine's charge is from Kingery and Bulmash's, on the ground.

Impulses (first positive phase), arrival and peaks over the curves, in the free field at ground
level and on a wide rigid wall, at the cells that the engine works with; then peaks and impulse at
one distance against the size of the cells. Prints Markdown tables.

Arrival is the time of the steepest rise: a shock is some cells wide, and its middle counts.
"""

from dataclasses import dataclass
from math import ceil, hypot
from typing import Annotated

import numpy as np
import typer

from blast_env.calibration import kingery_bulmash
from blast_env.calibration.references import Quantity
from blast_env.cli.output import print_line, user_errors
from blast_env.physics.gas.faces import exposed_faces
from blast_env.physics.gas.grid import FaceKind, GasGrid
from blast_env.physics.gas.probes import FaceLoads, Gauges
from blast_env.physics.gas.solver import GasSolver
from blast_env.physics.gas.source import TNT, Explosive, GasCharge, set_charge

Z_M_KG = (1.7, 2.15, 2.7, 3.45, 4.3, 5.4, 8.6)
CELLS_M = {20.0: 0.25, 100.0: 0.5, 1000.0: 0.5}
FREE_FIELD_START_Z = 1.0
"""Where the front is, m/kg^(1/3), when the free field goes over to three dimensions."""

ROUNDING = 1e-9
LATEST = 1.5
"""A run ends at this many times the reference's end of the positive phase at the latest."""


@dataclass(frozen=True)
class Ratio:
    """What was measured at a distance, over Kingery and Bulmash's."""

    z_m_kg: float
    impulse: float
    arrival: float
    peak: float


def main(
    charges: Annotated[str, typer.Option(help="kg, separated by commas.")] = "20,100,1000",
    distances: Annotated[str, typer.Option(help="m/kg^(1/3), separated by commas.")] = ",".join(
        map(str, Z_M_KG)
    ),
    peak_cells: Annotated[
        str, typer.Option(help="m, for 100 kg at 2.7 m/kg^(1/3); empty: leave that table out.")
    ] = "1,0.5,0.25",
) -> None:
    """Run blasts and print the tables."""
    wanted = [float(z) for z in distances.split(",")]
    with user_errors():
        print_line("| charge (kg) | cell (m) | | Z (m/kg^(1/3)) | impulse | arrival | peak |")
        print_line("|---|---|---|---|---|---|---|")
        for charge_kg in map(float, charges.split(",")):
            cell_m = CELLS_M.get(charge_kg, 0.5)
            reflected = [wide_wall(charge_kg, z * charge_kg ** (1 / 3), cell_m) for z in wanted]
            for what, ratios in (
                ("reflected", reflected),
                ("incident", free_field(charge_kg, wanted, cell_m)),
            ):
                for ratio in ratios:
                    print_line(
                        f"| {charge_kg:g} | {cell_m:g} | {what} | {ratio.z_m_kg:.2f} | "
                        f"{ratio.impulse:.3f} | {ratio.arrival:.3f} | {ratio.peak:.3f} |"
                    )
        if peak_cells:
            print_line("")
            print_line("| cell (m) | cells per kg^(1/3) | reflected impulse | reflected peak |")
            print_line("|---|---|---|---|")
            for cell_m in map(float, peak_cells.split(",")):
                ratio = wide_wall(100.0, 12.5, cell_m)
                print_line(
                    f"| {cell_m:g} | {100.0 ** (1 / 3) / cell_m:.1f} | "
                    f"{ratio.impulse:.3f} | {ratio.peak:.3f} |"
                )


def wide_wall(
    charge_kg: float, distance_m: float, cell_m: float, explosive: Explosive = TNT
) -> Ratio:
    """Return the load on a rigid wall, nearest to a charge on the ground, normally reflected.

    Half of the scene, beside a mirror through the charge; the distance is rounded up to cells. The
    wall and the air behind the charge are so wide that their ends are not felt in the first
    positive phase.
    """
    to_wall = ceil(distance_m / cell_m - ROUNDING)
    distance_m = to_wall * cell_m
    latest_s = LATEST * _phase_end_s(distance_m, charge_kg)
    duration_s = kingery_bulmash("positive_duration", distance_m, charge_kg)
    wide = ceil((0.35 * distance_m + 450.0 * duration_s) / cell_m)
    behind = ceil(charge_kg ** (1 / 3) / cell_m)
    solid = np.zeros((behind + to_wall + 1, wide, wide), dtype=np.bool_)
    solid[-1] = True
    grid = GasGrid(cell_m, solid, (-behind * cell_m, 0.0, 0.0), y_low=FaceKind.MIRROR)
    faces = exposed_faces(grid, solid)
    nearest = int(np.hypot(*faces.centres_m(grid)[:, 1:].T).argmin())
    loads = FaceLoads(len(faces))
    charge = GasCharge(charge_kg, (0.0, 0.0, 0.0), explosive)
    solver = GasSolver(grid, faces=faces, recorders=[loads], with_fuel=True, burning=charge.burning)
    set_charge(solver, charge)
    while solver.time_s < latest_s and not loads.first_is_over[nearest]:
        solver.step()
    return _over_reference(
        "reflected",
        distance_m,
        charge_kg,
        float(loads.first_impulse_pa_s[nearest]),
        float(loads.steepest_s[nearest]),
        float(loads.peak_pa[nearest]),
    )


def free_field(
    charge_kg: float, z_m_kg: list[float], cell_m: float, explosive: Explosive = TNT
) -> list[Ratio]:
    """Return the incident wave along the ground, at the centres of cells beside the axis.

    A quarter of the scene, between mirrors through the charge.
    """
    unit = charge_kg ** (1 / 3)
    farthest_m = max(z_m_kg) * unit
    along, wide = ceil((farthest_m + unit) / cell_m), ceil((0.45 * farthest_m + unit) / cell_m)
    solid = np.zeros((along, wide, wide), dtype=np.bool_)
    grid = GasGrid(cell_m, solid, x_low=FaceKind.MIRROR, y_low=FaceKind.MIRROR)
    cells = [(int(z * unit / cell_m), 0, 0) for z in z_m_kg]
    gauges = Gauges(grid, cells)
    charge = GasCharge(charge_kg, (0.0, 0.0, 0.0), explosive)
    solver = GasSolver(grid, recorders=[gauges], with_fuel=True, burning=charge.burning)
    set_charge(solver, charge, FREE_FIELD_START_Z * unit)
    latest_s = LATEST * _phase_end_s(farthest_m, charge_kg)
    while solver.time_s < latest_s and not gauges.first_is_over.all():
        solver.step()
    return [
        _over_reference(
            "incident",
            cell_m * hypot(cell[0] + 0.5, 0.5, 0.5),
            charge_kg,
            float(gauges.first_impulse_pa_s[k]),
            float(gauges.steepest_s[k]),
            float(gauges.peak_pa[k]),
        )
        for k, cell in enumerate(cells)
    ]


def _phase_end_s(distance_m: float, charge_kg: float) -> float:
    """Return when the positive phase is over after the reference."""
    quantities: tuple[Quantity, Quantity] = ("arrival_time", "positive_duration")
    return sum(kingery_bulmash(quantity, distance_m, charge_kg) for quantity in quantities)


def _over_reference(
    wave: str, distance_m: float, charge_kg: float, impulse: float, arrival_s: float, peak: float
) -> Ratio:
    reflected = wave == "reflected"
    impulses: Quantity = "reflected_impulse" if reflected else "incident_impulse"
    peaks: Quantity = "reflected_overpressure" if reflected else "incident_overpressure"
    return Ratio(
        distance_m / charge_kg ** (1 / 3),
        impulse / kingery_bulmash(impulses, distance_m, charge_kg),
        arrival_s / kingery_bulmash("arrival_time", distance_m, charge_kg),
        peak / kingery_bulmash(peaks, distance_m, charge_kg),
    )


if __name__ == "__main__":
    typer.run(main)
