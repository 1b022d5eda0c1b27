"""A lower bound on the cell updates of block-structured refinement."""

from dataclasses import dataclass
from time import process_time
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas.engine import GasRun
from blast_env.layout.build_scene import build_site
from blast_env.site import Scenario

BLOCK: Final = 4
"""Number of cells along the side of a block."""

_STILL: Final = 0.001
"""Overpressure, in units of still air's pressure, up to which air counts as still."""

_COARSER: Final = 1.0 / 16.0
"""Ratio of updates with cells of 1 m to those of 0.5 m: an eighth of the cells, half the steps."""

_FINER: Final = 16.0
"""The same ratio for cells of 0.25 m."""


@dataclass(frozen=True)
class Refinement:
    """Cell updates with perfect refinement, without any overhead.

    Attributes:
        threshold: Jump of pressure between cells, over the lower of the two pressures, above which
            a block is refined.
        share: Mean share of refined blocks among those that the blast has reached.
        coarse: Ratio of updates, with cells of 0.5 m in refined blocks and 1 m elsewhere, to those
            with 0.5 m everywhere.
        fine: The same ratio with 0.25 m in refined blocks.
    """

    threshold: float
    share: float
    coarse: float
    fine: float


@dataclass(frozen=True, eq=False)
class RefinedBlast:
    """A blast with uniform cells of 0.5 m, and the bounds for its refinement.

    Attributes:
        updates: Number of its cell updates, two per step.
        cpu_s: CPU time for these updates.
        found: One per threshold.
    """

    updates: int
    cpu_s: float
    found: tuple[Refinement, ...]


def refined_blast(scenario: Scenario, thresholds: list[float], every_s: float) -> RefinedBlast:
    """Run a blast with uniform cells of 0.5 m, and count blocks at regular times.

    Args:
        scenario: The site.
        thresholds: Thresholds of refinement; see `Refinement.threshold`.
        every_s: Interval between these times.
    """
    run = GasEngine(cell_m=0.5).start_on(build_site(scenario))
    walls, rows, cpu_s, steps = _at_walls(run), [], 0.0, 0
    while run.end_reason is None:
        began_s = process_time()
        run.advance(run.time_s + every_s)
        cpu_s += process_time() - began_s
        overpressure, jump = _waves(run)
        reached, steep = _most(np.abs(overpressure)) > _STILL, _most(jump)
        refined = [((steep > each) | walls) & reached for each in thresholds]
        rows.append([(run.steps - steps) * each.sum() for each in (reached, *refined)])
        steps = run.steps
    whole, *parts = np.sum(rows, axis=0)
    found = []
    for threshold, part in zip(thresholds, parts, strict=True):
        share = float(part / whole)
        rest = _COARSER * (1.0 - share)
        found.append(Refinement(threshold, share, share + rest, _FINER * share + rest))
    return RefinedBlast(run.solver.cell_updates, cpu_s, tuple(found))


def _waves(run: GasRun) -> tuple[FloatArray, FloatArray]:
    """Return the overpressure in units of still air's, and the largest relative jump (x, y, z).

    A jump is the difference from a neighbouring cell over the lower pressure. Solids count as still
    air, without jumps.
    """
    gas, air = run.solver, ~run.grid.solid
    layers = [gas.overpressure_in(2, layer) for layer in range(run.grid.shape[2])]
    overpressure = np.where(air, np.stack(layers, axis=2), 0.0) / gas.pressure_pa
    jump = np.zeros_like(overpressure)
    for axis in range(3):
        low = tuple(slice(None, -1) if each == axis else slice(None) for each in range(3))
        high = tuple(slice(1, None) if each == axis else slice(None) for each in range(3))
        lower = 1.0 + np.minimum(overpressure[low], overpressure[high])
        step = np.abs(np.diff(overpressure, axis=axis)) / lower * (air[low] & air[high])
        jump[low] = np.maximum(jump[low], step)
        jump[high] = np.maximum(jump[high], step)
    return overpressure, jump


def _most(cells: FloatArray) -> FloatArray:
    """Return the largest value in each block."""
    padded = np.pad(cells, [(0, -length % BLOCK) for length in cells.shape])
    x, y, z = (length // BLOCK for length in padded.shape)
    most: FloatArray = padded.reshape(x, BLOCK, y, BLOCK, z, BLOCK).max(axis=(1, 3, 5))
    return most


def _at_walls(run: GasRun) -> BoolArray:
    """Return a mask of the blocks that touch protected structures."""
    cells = np.zeros(run.grid.shape)
    protected = np.array([each.protected for each in run.site.structures])
    cells[tuple(run.table.faces.air[protected[run.table.structure]].T)] = 1.0
    return _most(cells) > 0.0
