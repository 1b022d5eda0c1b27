"""A facade turned against the grid: what the staircase of cells does to its loads."""

from dataclasses import dataclass, field
from math import cos, pi, radians, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.engines.gas import GasBlast, GasEngine
from blast_env.geometry import stacked_runs
from blast_env.physics.gas.engine import GasRun
from blast_env.physics.gas.solver import Gas
from blast_env.response.sdof import Resistance, System, responses
from blast_env.scenario import Scenario
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
    """Return how far places are behind the facade, and along it from its middle (n,)."""
    middle, inwards, along = _block(angle_deg)
    return (places_m - middle) @ inwards, (places_m - middle) @ along


def turned_block(angle_deg: float) -> Scenario:
    """Return a block whose facade looks at the charge, turned against the grid, as its modules."""
    count = round(_SIDE_M / MODULE_SIDE_M)
    centres = MODULE_SIDE_M * (np.arange(count) + 0.5)
    places = np.stack(np.meshgrid(centres, centres), axis=-1)
    behind, beside = _depths_m(places, angle_deg)
    inside: BoolArray = (behind >= 0.0) & (behind < DEPTH_M) & (np.abs(beside) < 0.5 * FACADE_M)
    runs = stacked_runs(inside).tolist()
    structures: list[dict[str, Any]] = [
        {
            "kind": "ModularObstacle",
            "name": f"part_{number}",
            "building": "block",
            "corner_m": (column * MODULE_SIDE_M, row * MODULE_SIDE_M),
            "rows": rows,
            "columns": columns,
            "height_m": HEIGHT_M,
            "protected": True,
        }
        for number, (row, column, rows, columns) in enumerate(runs, start=1)
    ]
    document = {
        "schema_version": 2,
        "name": "turned_block",
        "site": {"width_m": _SIDE_M, "height_m": _SIDE_M},
        "charge": [{"kind": "point", "position_m": _CHARGE_M, "tnt_kg": CHARGE_KG}],
        "structures": structures,
    }
    return Scenario.from_document(document, "turned_block")


@dataclass(eq=False)
class _Projected:
    """Recorder of the momentum on bays along the facade's own normal, per area of the facade."""

    bay: NDArray[np.int64]
    share: FloatArray
    area: FloatArray
    history: list[FloatArray] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step."""
        self.time_s.append(step_s + (self.time_s[-1] if self.time_s else 0.0))
        pressure = solver.wall_overpressure_pa()
        chosen = self.bay >= 0
        sums = np.bincount(self.bay[chosen], weights=(pressure * self.share)[chosen])
        self.history.append(sums / self.area)


@dataclass(frozen=True)
class ObliqueLoads:
    """Loads on a facade that is turned against the grid.

    Attributes:
        impulse_pa_s: Mean over the faces of cells, all positive phases.
        mean_peak_pa: Mean over them of the largest overpressure.
        largest_peak_pa: The largest overpressure on one of them.
        projected_pa_s: Mean impulse along the facade's own normal.
        projected_peak_pa: Mean over its bays of the largest mean overpressure along that normal.
        largest_projected_pa: The largest of them.
        stepped_m: Largest deflection of an elastic component of 10 ms on any step of the staircase.
        projected_m: The same on any bay along that normal.
    """

    impulse_pa_s: float
    mean_peak_pa: float
    largest_peak_pa: float
    projected_pa_s: float
    projected_peak_pa: float
    largest_projected_pa: float
    stepped_m: float
    projected_m: float


def oblique_loads(
    angle_deg: float, cell_m: float = 0.5, until: str | float = "structures"
) -> ObliqueLoads:
    """Return the loads on a facade at an angle, by faces of cells and by bays along its normal.

    Args:
        angle_deg: How far it is turned against the grid; it looks at the charge all the same.
        cell_m: Side of the cells.
        until: What the blast waits for.
    """
    blast = GasBlast(turned_block(angle_deg), engine=GasEngine(cell_m=cell_m, until=until))
    run = blast.engine.start_on(blast.site)
    chosen, towards, bay = _facade(run, angle_deg)
    share = np.where(chosen, towards, 0.0)
    recorder = _Projected(
        bay, share, np.bincount(bay[chosen], weights=share[chosen]).astype(np.float64)
    )
    steps = _steps(run, chosen, bay)
    count = steps.max() + 1
    faces = np.bincount(steps[chosen], minlength=count).astype(np.float64)
    stepped = _Projected(steps, np.ones(len(share)), faces)
    run.record(recorder)
    run.record(stepped)
    while run.end_reason is None:
        run.advance(run.time_s + 1.0)
    impulse, peak = run.loads.positive_impulse_pa_s, run.loads.peak_pa
    bay_peaks = np.array(recorder.history).max(axis=0)
    return ObliqueLoads(
        impulse_pa_s=float(impulse[chosen].mean()),
        mean_peak_pa=float(peak[chosen].mean()),
        largest_peak_pa=float(peak[chosen].max()),
        projected_pa_s=float((impulse * share)[chosen].sum() / share[chosen].sum()),
        projected_peak_pa=float(bay_peaks.mean()),
        largest_projected_pa=float(bay_peaks.max()),
        stepped_m=_deflection_m(stepped),
        projected_m=_deflection_m(recorder),
    )


def _steps(run: GasRun, chosen: BoolArray, bay: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return on which tread or riser of the staircase, and storey, each face is; -1 elsewhere."""
    faces, centre_m = run.table.faces, run.table.centre_m
    axis = np.minimum(faces.axis, 1)
    plane_m = np.take_along_axis(centre_m[:, :2], axis[:, np.newaxis], axis=1)[:, 0]
    keys = np.column_stack([faces.axis, np.round(plane_m, 3), bay])
    _, number = np.unique(keys[chosen], axis=0, return_inverse=True)
    steps = np.full(len(chosen), -1)
    steps[chosen] = number.ravel()
    return steps


def _deflection_m(recorder: _Projected) -> float:
    """Return the largest deflection of an elastic component of 10 ms under any of the histories."""
    stiffness = (2.0 * pi / _PERIOD_S) ** 2 * _MASS_KG_M2
    system = System(_MASS_KG_M2, 1.0, Resistance.elastic_plastic(stiffness, _NEVER_YIELDS_PA))
    histories = np.array(recorder.history).T
    return float(
        responses([system] * len(histories), np.array(recorder.time_s), histories).peak_m.max()
    )


def _facade(run: GasRun, angle_deg: float) -> tuple[BoolArray, FloatArray, NDArray[np.int64]]:
    """Return which faces are the facade's, how far they look along it, and their bays (n,)."""
    faces, centre_m = run.table.faces, run.table.centre_m
    _, inwards, _ = _block(angle_deg)
    behind, beside = _depths_m(centre_m[:, :2], angle_deg)
    upright = faces.axis < 2
    towards = np.where(upright, -faces.side * inwards[np.minimum(faces.axis, 1)], 0.0)
    chosen = upright & (towards > 1e-6) & (behind < MODULE_SIDE_M) & (np.abs(beside) < FACADE_M / 2)
    columns = round(FACADE_M / BAY_M)
    storey = (centre_m[:, 2] // BAY_M).astype(np.int64)
    number = np.clip((beside + FACADE_M / 2) // BAY_M, 0, columns - 1).astype(np.int64)
    return chosen, towards, np.where(chosen, storey * columns + number, -1)
