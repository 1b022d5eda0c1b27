"""Bays of facades under a gas-dynamics blast: pressure histories, response and damage.

The history of a bay is the mean overpressure on its cell faces at each step. Bays that no air
touches, as in a wall between two parts of a building, have none and are left out.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cbrt
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.bays import Bay
from blast_env.errors import UnknownNameError
from blast_env.evaluation.engines.gas_validation import bay_validations
from blast_env.evaluation.record import WallsWithoutVerdict
from blast_env.evaluation.validation import Validation
from blast_env.gas.ending import is_known
from blast_env.gas.settings import FACE_NAMES
from blast_env.gas.tables import KNOWN_COLUMN
from blast_env.response.components import Alternatives, FacadeBay
from blast_env.response.damage import bay_damages
from blast_env.response.facade import FacadeResponse, respond
from blast_env.response.glass import GlazingCondition
from blast_env.response.levels import BayDamage
from blast_env.response.sdof import impulses
from blast_env.site.structures import StructureOutline
from blast_env.tables import Column, table_of

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.gas.engine import FaceTable, GasRun
    from blast_env.gas.probes import PatchHistories

BAY_COLUMNS: Final = (
    Column("bay", "", "structure/wall/storey/number"),
    Column("structure", "", "name of the structure"),
    Column("wall", "", "west, east, south or north"),
    Column("storey", "", "counted from 1 at the ground"),
    Column("number", "", "counted from 1 along the wall, from west or from south"),
    Column("area_m2", "m2", "area of the bay"),
    Column("peak_pa", "Pa", "largest mean overpressure on the bay"),
    Column("impulse_pa_s", "Pa s", "peak specific impulse of that mean"),
    Column("panes", "", "panes in the bay"),
    Column("break_probability", "", "share of such panes that break"),
    Column("condition", "", "performance condition of glazing, GSA: 1, 2, 3a, 3b, 4, 5"),
    Column("rating", "", "hazard rating of glazing, ISO 16933: A to F"),
    Column("flight_m", "m", "how far the fragments of panes that break fly; 0 where they are held"),
    Column("ductility", "", "of the wall panel: largest deflection over that at yield"),
    Column("rotation_deg", "degrees", "support rotation of the wall panel"),
    Column("damage", "", "damage of the wall panel in the terms of PDC-TR 06-08"),
    Column("edge_force_n_m", "N/m", "force per length of pane edge that frames have to carry"),
    Column("support_force_n_m", "N/m", "force per length of support of the wall panel"),
)
"""One row per bay; values for components that a bay lacks are empty."""

VALIDATION_COLUMNS: Final = (
    Column("validation", "", "status of the load: measured, verified, approximate or outside"),
    Column("reason", "", "reason for the status"),
)
"""The validation status of the load of a row."""

LOADED_BAY_COLUMNS: Final = (*BAY_COLUMNS, KNOWN_COLUMN, *VALIDATION_COLUMNS)
"""One row per bay under a blast."""


@dataclass(frozen=True, eq=False)
class BayLoads:
    """The pressure histories of the bays under a blast.

    Attributes:
        bays: The bays that air touches.
        recorder: Their histories along the normals of the walls, one patch each.
    """

    bays: tuple[FacadeBay, ...]
    recorder: "PatchHistories"

    @classmethod
    def begin(cls, run: "GasRun", bays: Sequence[FacadeBay]) -> "BayLoads":
        """Return the loads of a run that has not begun, to be recorded by `GasRun.record`."""
        from blast_env.gas.probes import PatchHistories

        patch = bay_patches(run.table, [structure.name for structure in run.site.structures], bays)
        seen = np.unique(patch[patch >= 0])
        renumbered = np.full(len(bays) + 1, -1)  # the last is for no bay
        renumbered[seen] = np.arange(len(seen))
        shown = tuple(bays[index] for index in seen.tolist())
        return cls(shown, PatchHistories(renumbered[patch], len(shown), run.table.share))

    @property
    def history_pa(self) -> NDArray[np.float32]:
        """Mean overpressures along the normals of the walls, Pa (bays, steps)."""
        return self.recorder.history_pa

    @cached_property
    def response(self) -> FacadeResponse:
        """The response of the windows and wall panels in the bays."""
        return respond(self.bays, *self.histories)

    def damages(
        self, alternatives: Sequence[Alternatives], peak_factor: float
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays with each of their possible components.

        The factor on peaks makes them as sharp as in the open.
        """
        by_name = {alternative.name: alternative for alternative in alternatives}
        own = [by_name[bay.bay.name] for bay in self.bays]
        return bay_damages(own, *self.histories, peak_factor) if own else ()

    @property
    def histories(self) -> tuple[FloatArray, FloatArray]:
        """Two or more times, s (times,), and the overpressures at them, Pa (bays, times).

        A run of fewer than two steps is padded to two times.
        """
        time_s, step_s = self.recorder.time_s, self.recorder.step_s
        history_pa = self.history_pa.astype(np.float64)
        if len(time_s) > 1:
            return time_s, history_pa
        if not len(time_s):
            return np.array([0.0, 1.0]), np.zeros((len(self.bays), 2))
        return time_s + 0.5 * step_s * np.array([-1.0, 1.0]), np.repeat(history_pa, 2, axis=1)

    def history(self, name: str) -> "pd.DataFrame":
        """Return the mean overpressure on a bay over time: `time_s`, `overpressure_pa`."""
        import pandas as pd

        names = [bay.bay.name for bay in self.bays]
        if name not in names:
            raise UnknownNameError("bay", name, names)
        history = self.history_pa[names.index(name)]
        return pd.DataFrame({"time_s": self.recorder.time_s, "overpressure_pa": history})

    def table(self, run: "GasRun") -> "pd.DataFrame":
        """Return one row per bay of the run that recorded them; see `LOADED_BAY_COLUMNS`."""
        if not self.bays:
            return table_of([], LOADED_BAY_COLUMNS)
        known = self.known(run)
        cells = cbrt(run.site.charge.tnt_kg) / run.grid.cell_m
        validations = bay_validations(run.site, [bay.bay for bay in self.bays], cells, known)
        return table_of(bay_rows(self.response, known, validations), LOADED_BAY_COLUMNS)

    def known(self, run: "GasRun") -> dict[str, bool]:
        """Return whether the load of each bay was known at the end of the run, by its name."""
        names = [structure.name for structure in run.site.structures]
        come = {name: run.has_come(index) for index, name in enumerate(names)}
        net = impulses(*self.histories)
        known = is_known(net.max(axis=1, initial=0.0), net[:, -1])
        return {
            filled.bay.name: come[filled.bay.structure] and is_one
            for filled, is_one in zip(self.bays, known.tolist(), strict=True)
        }


def unjudged_walls(
    table: "FaceTable",
    outlines: Sequence[StructureOutline],
    buildings: Mapping[str, Collection[str]],
    bays: Sequence[FacadeBay],
    area_m2: FloatArray,
) -> tuple[WallsWithoutVerdict, ...]:
    """Return the walls that no verdict covers, one item per building with any.

    A building whose walls no air touches has no verdict at all, and an item with all of its parts.

    Args:
        table: The faces of the run.
        outlines: The structures of the run.
        buildings: The parts of each building with a facade, by its name.
        bays: The bays of all facades.
        area_m2: Area of each face along the normal of its wall (faces,).
    """
    structures = [outline.name for outline in outlines]
    left_out, counts = bay_patches(table, structures, bays) < 0, np.zeros(len(table.face), bool)
    for index, outline in enumerate(outlines):
        walls = [FACE_NAMES.index(name) for name in outline.faces]
        counts |= (table.structure == index) & np.isin(table.face, walls)
    found = []
    for building, names in buildings.items():
        own = counts & np.isin(table.structure, [structures.index(name) for name in names])
        without = own & left_out
        if not own.any():
            found.append(WallsWithoutVerdict(building, 0.0, 0.0, tuple(names)))
        elif without.any():
            parts = tuple(structures[i] for i in np.unique(table.structure[without]).tolist())
            left_m2, of_m2 = float(area_m2[without].sum()), float(area_m2[own].sum())
            found.append(WallsWithoutVerdict(building, left_m2, of_m2, parts))
    return tuple(found)


def bay_rows(
    found: FacadeResponse, known: Mapping[str, bool], validations: Sequence[Validation]
) -> list[dict[str, object]]:
    """Return the response of bays, one row each, with the keys of `LOADED_BAY_COLUMNS`.

    Args:
        known: Whether the loads are known, by bay.
        validations: The validation status of each load.
    """
    # Each bay has all columns; those of a part that it lacks stay empty.
    panes = {index: row for row, index in enumerate(found.glazed.tolist())}
    panels = {index: row for row, index in enumerate(found.walled.tolist())}
    rows = []
    for index, filled in enumerate(found.bays):
        bay = filled.bay
        pressure = found.pressure_pa[index]
        row: dict[str, object] = {
            "bay": bay.name,
            "structure": bay.structure,
            "wall": bay.wall,
            "storey": bay.storey,
            "number": bay.number,
            "area_m2": bay.area_m2,
            "peak_pa": pressure.max(),
            "impulse_pa_s": impulses(found.time_s, pressure).max(),
            "panes": filled.panes,
            "break_probability": np.nan,
            "condition": "",
            "rating": "",
            "flight_m": np.nan,
            "ductility": np.nan,
            "rotation_deg": np.nan,
            "damage": "",
            "edge_force_n_m": np.nan,
            "support_force_n_m": np.nan,
            "known": known.get(bay.name, False),
            "validation": validations[index].status.label,
            "reason": validations[index].reason,
        }
        if index in panes:
            pane = panes[index]
            row["flight_m"] = found.glazing.flight_m[pane]
            row["break_probability"] = found.glazing.break_probability[pane]
            condition = GlazingCondition(int(found.glazing.condition[pane]))
            row["condition"], row["rating"] = condition.label, condition.rating
            row["edge_force_n_m"] = found.glazing.edge_force_n_m[pane]
        if index in panels:
            panel = panels[index]
            row["ductility"] = found.walls.ductility[panel]
            row["rotation_deg"] = found.walls.rotation_deg[panel]
            row["damage"] = found.walls.levels[panel].name.lower()
            row["support_force_n_m"] = found.walls.support_force_n_m[panel]
        rows.append(row)
    return rows


def bay_patches(
    table: "FaceTable", structures: Sequence[str], bays: Sequence[FacadeBay]
) -> NDArray[np.int64]:
    """Return the index of the bay of each cell face, -1 for none (faces,)."""
    patch = np.full(len(table.faces), -1)
    walls: dict[tuple[str, str], list[int]] = {}
    for index, item in enumerate(bays):
        walls.setdefault((item.bay.structure, item.bay.wall), []).append(index)
    for (structure, wall), members in walls.items():
        own = np.flatnonzero(
            (table.structure == structures.index(structure))
            & (table.face == FACE_NAMES.index(wall))
        )
        for index in members:
            bay = bays[index].bay
            patch[own[_inside(bay, table, own)]] = index
    return patch


def _inside(bay: Bay, table: "FaceTable", own: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of some faces of its side lie in a bay (own,)."""
    places_m, height_m = table.centre_m[own, :2], table.centre_m[own, 2]
    inside = (height_m >= bay.floor_m) & (height_m < bay.top_m)
    left_m, right_m = bay.left_m, bay.right_m
    if bay.line is None:
        along_m = places_m[:, 1 if bay.wall in ("west", "east") else 0]
    else:
        along_m = bay.line.along_m(places_m)
        inside &= table.wall[own] == bay.line_number
        # Steps at corners may lie beyond the ends of the wall.
        left_m = -np.inf if left_m == 0.0 else left_m
        right_m = np.inf if right_m >= bay.line.length_m else right_m
    return np.asarray(inside & (along_m >= left_m) & (along_m < right_m))
