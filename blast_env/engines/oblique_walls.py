"""Loads on oblique walls along the normal of the wall.

An oblique wall is a staircase of modules, whose corners have peaks that the real wall lacks. The
load is therefore the momentum along the wall's normal per area of the real wall: the mean over a
bay of the overpressures on the steps, weighted by the cosine between step and wall normals.

Impulses are such means of the impulses on cell faces; peaks are the peaks of the mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.physics.gas.settings import FACE_NAMES
from blast_env.physics.scene import OUTWARDS, WALLS
from blast_env.response.facade import BAY_M, STOREY_M, storeys_in
from blast_env.scenario.sections import AnyStructure
from blast_env.scenario.staircase import Edge, ObliqueWall, oblique_walls
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.physics.gas.engine import FaceTable, GasRun
    from blast_env.physics.gas.probes import PatchHistories


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
            run: The run.
            structures: The structures of its scenario.
        """
        from blast_env.physics.gas.probes import PatchHistories

        walls = oblique_walls(structures)
        if not walls:
            return None
        bay = np.full(len(run.table.faces), -1)
        share = np.ones(len(bay))
        by_name = {each.name: each for each in structures}
        owners = [by_name.get(each.name) for each in run.site.structures]
        for wall in walls:
            _add_bays(run.table, owners, wall, bay, share)
        recorder = PatchHistories(bay, int(bay.max()) + 1, share)
        run.record(recorder)
        return cls(bay, share, recorder)

    @cached_property
    def members(self) -> BoolArray:
        """Whether a face is part of an oblique wall (faces,)."""
        return np.asarray(self.bay >= 0)

    def along_normals(self, values: FloatArray) -> FloatArray:
        """Return values of faces, on oblique walls replaced by the means of bays (faces,)."""
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
        columns = [each for each in map(str, faces) if each.endswith("_pa_s")]
        changed = {each: self.along_normals(faces[each].to_numpy()) for each in columns}
        peaks = self.peaks_pa(faces["peak_pa"].to_numpy())
        return faces.assign(**changed, peak_pa=peaks, share=self.share)

    def bay_of(self, patch: NDArray[np.int64], count: int) -> NDArray[np.int64]:
        """Return the oblique-wall bay of each patch of faces, -1 for none (count,).

        A patch belongs to the bay with most of its faces, if more than half lie on such a wall.

        Args:
            patch: The patch of each face, -1 for none (faces,).
            count: Number of patches.
        """
        found = np.full(count, -1)
        for index in range(count):
            own = self.bay[patch == index]
            on_wall = own[own >= 0]
            if 2 * len(on_wall) > len(own):
                found[index] = np.bincount(on_wall).argmax()
        return found


def _add_bays(
    table: "FaceTable",
    owners: Sequence[AnyStructure | None],
    wall: ObliqueWall,
    bay: NDArray[np.int64],
    share: FloatArray,
) -> None:
    """Add the bays of a wall, numbered after the existing ones by storey, then along the wall.

    Args:
        table: The faces of cells.
        owners: The structure of each index; `None` for the barrier.
        wall: The wall.
        bay: Bays of the faces, updated in place.
        share: Cosines between the normals of faces and walls, updated in place.
    """
    parts = {i: each for i, each in enumerate(owners) if each and _is_part(each, wall)}
    of_building = np.flatnonzero(np.isin(table.structure, list(parts)) & (table.face < len(WALLS)))
    own = of_building[[each in wall.edges for each in _edges(table, of_building, wall)]]
    if not len(own):
        return
    outwards = np.array([OUTWARDS[FACE_NAMES[each]] for each in table.face[own].tolist()])
    normal = np.array(wall.normal)
    share[own] = outwards @ normal
    facade = next((each.facade for each in parts.values() if each.facade is not None), None)
    bay_m = BAY_M if facade is None else facade.bay_m
    storey_m = STOREY_M if facade is None else facade.storey_m
    along_m = table.centre_m[own, :2] @ np.array([-normal[1], normal[0]])
    length_m = MODULE_SIDE_M * sum(np.dot(OUTWARDS[each.wall], normal) for each in wall.edges)
    columns = max(1, round(length_m / bay_m))
    start_m = 0.5 * (along_m.min() + along_m.max() - length_m)
    column = np.clip((along_m - start_m) // (length_m / columns), 0, columns - 1)
    base_m = np.array([parts[each].base_m for each in table.structure[own].tolist()])
    storey = np.floor((table.centre_m[own, 2] - base_m) / storey_m)
    highest = [
        np.inf if part.height_m is None else storeys_in(part.height_m - part.base_m, storey_m) - 1
        for part in (parts[each] for each in table.structure[own].tolist())
    ]
    keys = columns * np.minimum(storey, highest) + column
    _, number = np.unique(keys, return_inverse=True)
    bay[own] = int(bay.max(initial=-1)) + 1 + number.ravel()


def _is_part(structure: AnyStructure, wall: ObliqueWall) -> bool:
    return structure.building_name == wall.building


def _edges(table: "FaceTable", faces: NDArray[np.int64], wall: ObliqueWall) -> list[Edge]:
    """Return the module edge under each cell face, in the plan of a building."""
    names = [WALLS[each] for each in table.face[faces].tolist()]
    outwards = np.array([OUTWARDS[each] for each in names]).reshape(-1, 2)
    inside_m = table.centre_m[faces, :2] - 0.5 * MODULE_SIDE_M * outwards - wall.corner_m
    columns, rows = np.floor(inside_m / MODULE_SIDE_M).astype(np.int64).T.tolist()
    return [Edge(*each) for each in zip(rows, columns, names, strict=True)]
