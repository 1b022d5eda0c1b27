"""Overpressure histories of two codes at the same places, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import import_extra
from blast_env.response.sdof import impulses
from blast_env.units import MS_PER_S

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = 2
_KPA = 1e-3


@dataclass(frozen=True, eq=False)
class Histories:
    """Overpressures computed by a code.

    Attributes:
        time_s: Times (steps,).
        overpressure_pa: Overpressures (steps, cells).
        cell_updates: Cells times steps.
        cpu_s: CPU time of the steps.
    """

    time_s: FloatArray
    overpressure_pa: FloatArray
    cell_updates: float
    cpu_s: float

    @cached_property
    def peak_pa(self) -> FloatArray:
        """Largest overpressures (cells,)."""
        return np.asarray(self.overpressure_pa.max(axis=0))

    @cached_property
    def impulse_pa_s(self) -> FloatArray:
        """Peak specific impulses (cells,)."""
        return np.asarray(impulses(self.time_s, self.overpressure_pa.T).max(axis=1))


def histories_figure(
    title: str, names: Sequence[str], codes: Sequence[tuple[str, Histories]]
) -> "Figure":
    """Draw the histories of all codes over each other, one panel per place.

    Args:
        title: Title of the figure.
        names: Names of the places.
        codes: Name and histories of each code; the histories have the places as columns.
    """
    # Imported here, because it needs the extra `render`, and running the codes does not.
    with import_extra("render", "pictures"):
        import matplotlib.pyplot as plt
    rows = -(-len(names) // _COLUMNS)
    figure, grid = plt.subplots(
        rows, _COLUMNS, figsize=(10.0, 2.3 * rows + 0.8), layout="constrained", squeeze=False
    )
    figure.suptitle(title)
    for place, (name, axes) in enumerate(zip(names, grid.ravel(), strict=False)):
        for k, (code, found) in enumerate(codes):
            axes.plot(
                MS_PER_S * found.time_s,
                _KPA * found.overpressure_pa[:, place],
                label=code,
                linewidth=1.4,
                linestyle="-" if k % 2 == 0 else "--",
            )
        axes.set_title(name, fontsize=10)
        axes.grid(alpha=0.3)
        axes.set_ylabel("overpressure (kPa)", fontsize=8)
    for axes in grid.ravel()[len(names) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("time (ms)")
    grid[0, 0].legend(fontsize=8)
    return figure
