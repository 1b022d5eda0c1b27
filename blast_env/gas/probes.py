"""Recorders of the gas: loads on faces, gauges, ground maps and snapshots.

The load at a point is its **peak specific impulse**, Pa s: the largest value of the integral of the
overpressure since the detonation, suction included. For a single pulse it is the impulse of Kingery
and Bulmash; for several pulses it is the largest value of the impulse history, which shock codes
print. Later pulses count only where they raise the history above its previous maximum. The sum of
all positive phases grows with every echo during a run, and is no measure of the load on a wall.

On a wall, the pressure in a step is the momentum that the wall took from the gas, the flux that
turned the gas round. No estimate from cells is exact in that sense: the pressure of the cell before
the wall lags by half a cell, and its peak is clipped. A gauge in the air records the pressure of
its cell.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.compilation import compiled
from blast_env.errors import BlastEnvError
from blast_env.gas.grid import GasGrid
from blast_env.gas.solver import Gas

ARRIVAL_PA: Final = 1000.0
"""Default overpressure at which a wave counts as arrived."""

# Columns of a table of loads.
_ARRIVAL, _PEAK, _PEAK_TIME, _NET, _IMPULSE, _IMPULSE_TIME = 0, 1, 2, 3, 4, 5
_RISE, _RISE_TIME, _NOW = 6, 7, 8
_COLUMNS: Final = 9


@compiled(nogil=True, error_model="numpy")
def _add_step(
    loads: NDArray[np.float64],
    overpressure: NDArray[np.float64],
    time_s: float,
    step_s: float,
    threshold: float,
    is_mean: bool,
) -> None:
    """Add a step that ended at `time_s` to a table of loads.

    Args:
        loads: The table (n, columns), updated in place.
        overpressure: Mean overpressures of the step, or those at its end (n,).
        time_s: End of the step.
        step_s: Length of the step.
        threshold: Overpressure at which a wave has arrived.
        is_mean: Whether the overpressures are means over the step.
    """
    for n in range(len(loads)):
        load = loads[n]
        now, before = overpressure[n], load[_NOW]
        if now == 0.0 and before == 0.0:
            continue
        # 1. Time and integral of the step: the midpoint rule for means over steps, else trapezoids.
        at = time_s - 0.5 * step_s if is_mean else time_s
        part = step_s * (now if is_mean else 0.5 * (before + now))
        # 2. Arrival: where the line between two steps crosses the threshold.
        if isnan(load[_ARRIVAL]) and now >= threshold:
            load[_ARRIVAL] = at - step_s * (now - threshold) / (now - before)
        # 3. The running integral; its maximum is the peak specific impulse.
        load[_NET] += part
        if load[_NET] > load[_IMPULSE]:
            load[_IMPULSE] = load[_NET]
            load[_IMPULSE_TIME] = time_s
        # 4. The steepest rise, which is the middle of a front smeared over cells, and the peak.
        if (now - before) / step_s > load[_RISE]:
            load[_RISE] = (now - before) / step_s
            load[_RISE_TIME] = at - 0.5 * step_s
        if now > load[_PEAK]:
            load[_PEAK] = now
            load[_PEAK_TIME] = at
        load[_NOW] = now


class LoadTable:
    """Loads at points, accumulated from overpressures step by step.

    Args:
        count: Number of points.
        arrival_pa: Overpressure at which a wave has arrived.
        is_mean: Whether overpressures are means over the step, or those at its end.
    """

    def __init__(self, count: int, arrival_pa: float = ARRIVAL_PA, *, is_mean: bool) -> None:
        if not arrival_pa > 0.0:
            raise BlastEnvError(f"arrival_pa is {arrival_pa}, but must be above 0")
        self._arrival_pa = arrival_pa
        self._is_mean = is_mean
        self._loads = np.zeros((count, _COLUMNS))
        self._loads[:, _ARRIVAL] = np.nan

    def add(self, overpressure: NDArray[np.float64], time_s: float, step_s: float) -> None:
        """Add a step that ended at `time_s`, with the overpressures of all points (n,)."""
        _add_step(self._loads, overpressure, time_s, step_s, self._arrival_pa, self._is_mean)

    @property
    def arrival_s(self) -> NDArray[np.float64]:
        """Time at which the overpressure first reached the threshold, NaN before arrival (n,)."""
        return self._loads[:, _ARRIVAL].copy()

    @property
    def steepest_s(self) -> NDArray[np.float64]:
        """Time of the steepest rise, NaN before arrival (n,).

        A computed shock is some cells wide. Its foot is early, while its middle is in place.
        """
        arrived = np.isfinite(self._loads[:, _ARRIVAL])
        return np.where(arrived, self._loads[:, _RISE_TIME], np.nan)

    @property
    def peak_pa(self) -> NDArray[np.float64]:
        """Largest overpressure (n,)."""
        return self._loads[:, _PEAK].copy()

    @property
    def peak_time_s(self) -> NDArray[np.float64]:
        """Time of the largest overpressure (n,)."""
        return self._loads[:, _PEAK_TIME].copy()

    @property
    def impulse_pa_s(self) -> NDArray[np.float64]:
        """Peak specific impulse up to now (n,)."""
        return self._loads[:, _IMPULSE].copy()

    @property
    def impulse_time_s(self) -> NDArray[np.float64]:
        """Time of the peak specific impulse (n,)."""
        return self._loads[:, _IMPULSE_TIME].copy()

    @property
    def net_impulse_pa_s(self) -> NDArray[np.float64]:
        """Integral of the overpressure from the detonation to now (n,)."""
        return self._loads[:, _NET].copy()

    @property
    def overpressure_pa(self) -> NDArray[np.float64]:
        """Overpressure at the last step (n,)."""
        return self._loads[:, _NOW].copy()


class FaceLoads(LoadTable):
    """Recorder of the loads on the faces of the solver."""

    def __init__(self, count: int) -> None:
        super().__init__(count, is_mean=True)

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step."""
        self.add(solver.wall_overpressure_pa(), solver.time_s, step_s)


class PatchHistories:
    """Recorder of the mean overpressure on patches of wall: bays, the sides of barrier pieces.

    Args:
        patch: Index of the patch of each of the solver's faces, -1 for none (faces,).
        count: Number of patches; each has at least one face.
        share: Weight of each face in the mean, 1 unless given (faces,).

    Attributes:
        faces: Number of faces of each patch (patches,).

    Raises:
        BlastEnvError: If a patch has no face.
    """

    def __init__(
        self, patch: NDArray[np.int64], count: int, share: NDArray[np.float64] | None = None
    ) -> None:
        self._members = np.flatnonzero(patch >= 0)
        self._patch = patch[self._members]
        self._share = np.ones(len(self._patch)) if share is None else share[self._members]
        self._area = np.bincount(self._patch, weights=self._share, minlength=count)
        self.faces = np.bincount(self._patch, minlength=count)
        if len(self.faces) != count or not self.faces.all():
            raise BlastEnvError(f"{count} patches of wall: each must have a face of a cell")
        self._times: list[float] = []
        self._steps: list[float] = []
        self._history: list[NDArray[np.float32]] = []

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step: the mean over its time, at its midpoint."""
        # The wall took the momentum of this flux; still air presses on it from behind.
        over = solver.wall_pressure[self._members] - 1.0
        sums = np.bincount(self._patch, weights=self._share * over, minlength=len(self.faces))
        self._times.append(solver.time_s - 0.5 * step_s)
        self._steps.append(step_s)
        self._history.append((solver.pressure_pa * sums / self._area).astype(np.float32))

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Midpoints of the steps, s (steps,)."""
        return np.array(self._times)

    @property
    def step_s(self) -> NDArray[np.float64]:
        """Lengths of the steps, s (steps,)."""
        return np.array(self._steps)

    @property
    def history_pa(self) -> NDArray[np.float32]:
        """Mean overpressures of the steps, Pa (patches, steps)."""
        # Without a patch, the number of steps cannot be inferred from the size.
        shape = len(self._history), len(self.faces)
        return np.array(self._history, dtype=np.float32).reshape(shape).T


class Gauges(LoadTable):
    """Recorder of the overpressure in cells of air, with its whole history.

    Args:
        grid: The grid.
        cells: The cells, x, y and z (n, 3).

    Raises:
        BlastEnvError: If a cell is solid or outside the grid.
    """

    def __init__(
        self, grid: GasGrid, cells: Sequence[tuple[int, int, int]] | NDArray[np.int64]
    ) -> None:
        self.cells = np.asarray(cells, dtype=np.int64).reshape(-1, 3)
        super().__init__(len(self.cells), is_mean=False)
        for cell in self.cells:
            if (cell < 0).any() or (cell >= grid.shape).any():
                raise BlastEnvError(f"gauge in cell {cell.tolist()}, but the grid is {grid.shape}")
            if grid.solid[tuple(cell)]:
                raise BlastEnvError(f"gauge in cell {cell.tolist()}, which is solid")
        self._times: list[float] = []
        self._history: list[NDArray[np.float64]] = []

    def add_before(self, time_s: NDArray[np.float64], overpressure_pa: NDArray[np.float64]) -> None:
        """Add the history before the first step: times (steps,), overpressures (steps, n)."""
        steps_s = np.diff(time_s, prepend=0.0)
        for time, step_s, overpressure in zip(time_s, steps_s, overpressure_pa, strict=True):
            if step_s > 0.0:
                self._times.append(float(time))
                self._history.append(overpressure)
                self.add(overpressure, float(time), float(step_s))

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step."""
        overpressure = solver.overpressure_at(self.cells)
        self._times.append(solver.time_s)
        self._history.append(overpressure)
        self.add(overpressure, solver.time_s, step_s)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Ends of the steps, s (steps,)."""
        return np.array(self._times)

    @property
    def history_pa(self) -> NDArray[np.float64]:
        """Overpressures at the ends of the steps, Pa (steps, n)."""
        return np.array(self._history).reshape(len(self._times), len(self.cells))


class GroundMap:
    """Recorder of the peak overpressure and the peak specific impulse in one layer of cells.

    Args:
        grid: The grid.
        layer: The layer, counted from the ground.
    """

    def __init__(self, grid: GasGrid, layer: int = 0) -> None:
        nz = grid.shape[2]
        if not 0 <= layer < nz:
            raise BlastEnvError(f"layer is {layer}, but must be 0 to {nz - 1}")
        self._layer = layer
        self._solid = grid.solid[:, :, layer]
        self._peak = np.zeros(self._solid.shape, dtype=np.float32)
        self._net = np.zeros(self._solid.shape, dtype=np.float32)
        self._impulse = np.zeros(self._solid.shape, dtype=np.float32)

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step."""
        over = solver.overpressure_in(2, self._layer).astype(np.float32)
        np.maximum(self._peak, over, out=self._peak)
        self._net += np.float32(step_s) * over
        np.maximum(self._impulse, self._net, out=self._impulse)

    @property
    def peak_pa(self) -> NDArray[np.float64]:
        """Largest overpressures, Pa, NaN in solid cells (nx, ny)."""
        return self._trimmed(self._peak)

    @property
    def impulse_pa_s(self) -> NDArray[np.float64]:
        """Peak specific impulses, Pa s, NaN in solid cells (nx, ny)."""
        return self._trimmed(self._impulse)

    def _trimmed(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.where(self._solid, np.nan, values.astype(np.float64))


class FieldMap:
    """Recorder of the peak overpressure and the peak specific impulse in all cells.

    Args:
        grid: The grid.
    """

    def __init__(self, grid: GasGrid) -> None:
        self._peak = np.zeros(grid.shape, dtype=np.float32)
        self._net = np.zeros(grid.shape, dtype=np.float32)
        self._impulse = np.zeros(grid.shape, dtype=np.float32)
        self._now = np.zeros(grid.shape, dtype=np.float32)

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step, layer by layer: one layer is in the cache."""
        for layer in range(self._peak.shape[2]):
            over = solver.overpressure_in(2, layer).astype(np.float32)
            peak, net, largest = (
                values[:, :, layer] for values in (self._peak, self._net, self._impulse)
            )
            np.maximum(peak, over, out=peak)
            # Trapezoids, as a gauge in each cell adds them.
            net += np.float32(0.5 * step_s) * (over + self._now[:, :, layer])
            np.maximum(largest, net, out=largest)
            self._now[:, :, layer] = over

    @property
    def peak_pa(self) -> NDArray[np.float32]:
        """Largest overpressures, Pa (nx, ny, nz); those in solid cells mean nothing."""
        return self._peak

    @property
    def impulse_pa_s(self) -> NDArray[np.float32]:
        """Peak specific impulses, Pa s (nx, ny, nz)."""
        return self._impulse

    @property
    def overpressure_pa(self) -> NDArray[np.float32]:
        """Overpressures at the last step, Pa (nx, ny, nz)."""
        return self._now


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Overpressure in a plane at a time.

    Attributes:
        time_s: End of the first step that reached the requested time.
        overpressure_pa: Values along the two axes that span the plane, NaN in solid cells.
    """

    time_s: float
    overpressure_pa: NDArray[np.float32]


class Snapshots:
    """Recorder of the overpressure in a plane of cells, for films.

    Args:
        grid: The grid.
        axis: Axis that the plane is normal to: 2 for a plan, 0 or 1 for a section.
        layer: The layer of cells along that axis.
        times_s: Times of the snapshots.
    """

    def __init__(self, grid: GasGrid, axis: int, layer: int, times_s: Sequence[float]) -> None:
        if axis not in (0, 1, 2):
            raise BlastEnvError(f"axis is {axis}, but must be 0, 1 or 2")
        if not 0 <= layer < grid.shape[axis]:
            raise BlastEnvError(f"layer is {layer}, but must be 0 to {grid.shape[axis] - 1}")
        self.axis, self.layer = axis, layer
        self.frames: list[Snapshot] = []
        self._times = sorted(times_s)
        self._solid = np.take(grid.solid, layer, axis=axis)

    def record(self, solver: Gas, step_s: float) -> None:  # noqa: ARG002
        """Take a snapshot if one is due; a single one covers all due times in a step."""
        due = 0
        while due < len(self._times) and self._times[due] <= solver.time_s:
            due += 1
        if due:
            del self._times[:due]
            self.frames.append(self.now(solver))

    def now(self, solver: Gas) -> Snapshot:
        """Return the snapshot of the present state."""
        plane = solver.overpressure_in(self.axis, self.layer)
        pressure = np.where(self._solid, np.nan, plane).astype(np.float32)
        return Snapshot(solver.time_s, pressure)
