"""Effect of the staircase of cells on the loads on a facade turned against the grid."""

from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.evaluation.engines.bays import bay_patches
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas.engine import GasRun
from blast_env.response.sdof import Resistance, System, responses
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M

FACADE_M: Final = 12.0
DEPTH_M: Final = 6.0
HEIGHT_M: Final = 6.0
DISTANCE_M: Final = 12.5
CHARGE_KG: Final = 100.0
BAY_M: Final = 3.0
_PERIOD_S: Final = 0.01
_MASS_KG_M2: Final = 50.0
_NEVER_YIELDS_PA: Final = 1e12
_SIDE_M: Final = 38.0
_CHARGE_M: Final = (10.0, 10.0)


def _block(angle_deg: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middle of the facade, its normal into the block, and its direction, in plan."""
    turn = radians(angle_deg)
    inwards, along = np.array([cos(turn), sin(turn)]), np.array([-sin(turn), cos(turn)])
    return np.array(_CHARGE_M) + DISTANCE_M * inwards, inwards, along


def _depths_m(places_m: FloatArray, angle_deg: float) -> tuple[FloatArray, FloatArray]:
    """Return the distances of places behind the facade, and along it from its middle (n,)."""
    middle, inwards, along = _block(angle_deg)
    return (places_m - middle) @ inwards, (places_m - middle) @ along


def turned_block(angle_deg: float) -> Scenario:
    """Return a block, turned against the grid, whose facade faces the charge."""
    middle, inwards, along = _block(angle_deg)
    corners = [
        middle + depth * DEPTH_M * inwards + side * 0.5 * FACADE_M * along
        for depth, side in ((0, 1), (0, -1), (1, -1), (1, 1))
    ]
    structures: list[dict[str, Any]] = [
        {
            "kind": "polygon",
            "name": "block",
            "outline_m": np.round(corners, 9).tolist(),
            "height_m": HEIGHT_M,
            "protected": True,
            "facade": {"storey_m": BAY_M, "bay_m": BAY_M, "wall": "concrete_200"},
        }
    ]
    document = {
        "schema_version": 2,
        "name": "turned_block",
        "site": {"width_m": _SIDE_M, "height_m": _SIDE_M},
        "charge": [{"kind": "point", "position_m": _CHARGE_M, "tnt_kg": CHARGE_KG}],
        "structures": structures,
    }
    return Scenario.from_document(document, "turned_block")


@dataclass(frozen=True)
class FacadeLoads:
    """Loads on a facade turned against the grid, on cell faces and along the facade's normal.

    Attributes:
        impulse_pa_s: Mean impulse over the cell faces.
        mean_peak_pa: Mean over the cell faces of the largest overpressure.
        largest_peak_pa: The largest overpressure on any of them.
        covered_pa_s: Mean impulse in the tables of the engine, along the facade's normal.
        covered_peak_pa: Mean over the bays of the largest mean overpressure along that normal.
        largest_stated_pa: The largest of these peaks.
        covered_m: Largest deflection of an elastic component of 10 ms in any bay along that normal.
    """

    impulse_pa_s: float
    mean_peak_pa: float
    largest_peak_pa: float
    covered_pa_s: float
    covered_peak_pa: float
    largest_stated_pa: float
    covered_m: float


def oblique_loads(
    angle_deg: float, cell_m: float = 0.5, until: str | float = "structures"
) -> FacadeLoads:
    """Return the loads on a facade at an angle, on cell faces and in the tables of the engine.

    Args:
        angle_deg: Angle between facade and grid; the facade faces the charge at any angle.
        cell_m: Side of the cells.
        until: Loads that the blast waits for.
    """
    result = GasBlast(turned_block(angle_deg), engine=GasEngine(cell_m=cell_m, until=until)).run()
    chosen = _facade(result.run, angle_deg)
    impulse, peak = result.run.loads.impulse_pa_s, result.run.loads.peak_pa
    covered = result.on_walls[chosen]
    bays = result.bay_loads
    names = [structure.name for structure in result.run.site.structures]
    patch = bay_patches(result.run.table, names, bays.bays)
    own = [bool(chosen[patch == index].all()) for index in range(len(bays.bays))]
    history_pa = bays.history_pa[own]
    peaks_pa = history_pa.max(axis=1)
    return FacadeLoads(
        impulse_pa_s=float(impulse[chosen].mean()),
        mean_peak_pa=float(peak[chosen].mean()),
        largest_peak_pa=float(peak[chosen].max()),
        covered_pa_s=float(np.average(covered["impulse_pa_s"], weights=covered["share"])),
        covered_peak_pa=float(peaks_pa.mean()),
        largest_stated_pa=float(peaks_pa.max()),
        covered_m=_deflection_m(bays.recorder.time_s, history_pa),
    )


def _deflection_m(time_s: FloatArray, history_pa: NDArray[np.float32]) -> float:
    """Return the largest deflection of an elastic component of 10 ms under any history, m."""
    stiffness = (2.0 * pi / _PERIOD_S) ** 2 * _MASS_KG_M2
    system = System(_MASS_KG_M2, 1.0, Resistance.elastic_plastic(stiffness, _NEVER_YIELDS_PA))
    histories = history_pa.astype(np.float64)
    return float(responses([system] * len(histories), time_s, histories).peak_m.max())


def _facade(run: GasRun, angle_deg: float) -> BoolArray:
    """Return a mask of the cell faces of the facade (n,)."""
    faces, centre_m = run.table.faces, run.table.centre_m
    _, inwards, _ = _block(angle_deg)
    behind, beside = _depths_m(centre_m[:, :2], angle_deg)
    towards = -faces.side * inwards[np.minimum(faces.axis, 1)]
    found: BoolArray = (faces.axis < 2) & (towards > 1e-6) & (behind < MODULE_SIDE_M)
    return found & (np.abs(beside) < FACADE_M / 2)
