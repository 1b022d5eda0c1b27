"""Loads on oblique walls along the normal of the wall.

An oblique wall is a staircase of modules, whose corners have peaks that the real wall lacks. The
load is therefore the momentum along the wall's normal per area of the real wall: the mean over a
bay of the overpressures on the steps, weighted by the cosine between step and wall normals.

Impulses are such means of the impulses on cell faces; peaks are the peaks of the mean.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.bays import BAY_M, STOREY_M, floors_m
from blast_env.geometry import WallLine
from blast_env.site.structures import AnyStructure

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.gas.engine import FaceTable, GasRun
    from blast_env.gas.probes import PatchHistories

STEPPED: Final = (
    "an oblique wall is a staircase of modules: its loads are those along its own normal, with"
    " which components of 10 ms bend 3 to 5 % too far"
)
"""Note on a building with an oblique wall (`python -m studies.gas oblique`)."""


def stepped_buildings(structures: Iterable[AnyStructure]) -> frozenset[str]:
    """Return the names of the buildings with an oblique wall."""
    return frozenset(
        structure.building_name
        for structure in structures
        if structure.footprint is not None
        and any(wall.is_oblique for wall in structure.footprint.walls)
    )


@dataclass(frozen=True, eq=False)
class ObliqueLoads:
    """The loads of a blast on the bays of oblique walls.

    Attributes:
        bay: Index of the oblique-wall bay of each cell face, -1 for none (faces,).
        share: Cosine between the normals of each face and its wall, 1 elsewhere (faces,).
        recorder: Mean overpressures along the normals, one patch per bay.
    """

    bay: NDArray[np.int64]
    share: FloatArray
    recorder: "PatchHistories"

    @classmethod
    def begin(cls, run: "GasRun", structures: Sequence[AnyStructure]) -> "ObliqueLoads | None":
        """Attach a recorder to a run that has not begun; return `None` without an oblique wall.

        Args:
            structures: The structures of its scenario.
        """
        from blast_env.gas.probes import PatchHistories

        bay = np.full(len(run.table.faces), -1)
        by_name = {structure.name: structure for structure in structures}
        for index, outline in enumerate(run.site.structures):
            for number, wall in enumerate(outline.walls):
                own = np.flatnonzero((run.table.structure == index) & (run.table.wall == number))
                if wall.is_oblique and len(own):
                    bays = _bays(run.table, own, wall, by_name[outline.name])
                    bay[own] = int(bay.max(initial=-1)) + 1 + bays
        if not (bay >= 0).any():
            return None
        recorder = PatchHistories(bay, int(bay.max()) + 1, run.table.share)
        run.record(recorder)
        return cls(bay, run.table.share, recorder)

    @cached_property
    def members(self) -> BoolArray:
        """Whether a face is part of an oblique wall (faces,)."""
        return np.asarray(self.bay >= 0)

    def along_normals(self, values: FloatArray) -> FloatArray:
        """Return values of faces, on oblique walls replaced by the means of bays (faces,)."""
        # The cosine turns the area of a step into that of the wall, which is the weight of the
        # mean.
        bay, share = self.bay[self.members], self.share[self.members]
        area = np.bincount(bay, weights=share)
        means = np.bincount(bay, weights=share * values[self.members]) / area
        found = values.copy()
        found[self.members] = means[bay]
        return found

    def peaks_pa(self, peak_pa: FloatArray) -> FloatArray:
        """Return the peaks of faces, on oblique walls replaced by the peaks of bays (faces,)."""
        found = peak_pa.copy()
        peaks = self.recorder.history_pa.max(axis=1, initial=0.0).astype(np.float64)
        found[self.members] = peaks[self.bay[self.members]]
        return found

    def table(self, faces: "pd.DataFrame") -> "pd.DataFrame":
        """Return a `face_table` with the loads on oblique walls along the normal of the wall."""
        columns = [face for face in map(str, faces) if face.endswith("_pa_s")]
        changed = {column: self.along_normals(faces[column].to_numpy()) for column in columns}
        peaks = self.peaks_pa(faces["peak_pa"].to_numpy())
        return faces.assign(**changed, peak_pa=peaks)


def _bays(
    table: "FaceTable", own: NDArray[np.int64], wall: WallLine, structure: AnyStructure
) -> NDArray[np.int64]:
    """Return the bay of each face of a wall, numbered by storey, then along the wall (own,).

    Args:
        table: The faces of cells.
    """
    # Bays along the wall of about the facade's width, and storeys above its base.
    facade = structure.facade
    bay_m = BAY_M if facade is None else facade.bay_m
    columns = max(1, round(wall.length_m / bay_m))
    along_m = wall.along_m(table.centre_m[own, :2])
    column = np.clip(along_m // (wall.length_m / columns), 0, columns - 1)
    above_m = table.centre_m[own, 2] - structure.base_m
    rise_m = STOREY_M * np.ceil(above_m.max() / STOREY_M)
    if structure.height_m is not None:
        rise_m = structure.height_m - structure.base_m
    own_m = () if facade is None else (facade.storey_m, facade.storeys)
    storey = np.searchsorted(floors_m(rise_m, *own_m), above_m, side="right")
    _, number = np.unique(columns * storey + column, return_inverse=True)
    return np.asarray(number.ravel())
