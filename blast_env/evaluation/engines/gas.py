"""Gas dynamics as an engine: loads directly in Pa s and Pa, without a calibration.

Impulses are peak specific impulses (`blast_env.gas.probes`). The engine is deterministic
for a given charge and layout; a seed only draws the charge.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import UnknownNameError
from blast_env.evaluation.engines.bays import (
    LOADED_BAY_COLUMNS,
    VALIDATION_COLUMNS,
    BayLoads,
    unjudged_walls,
)
from blast_env.evaluation.engines.contract import BlastDrawing, Engine, EngineBlast, RunnableBlast
from blast_env.evaluation.engines.gas_validation import validation_of
from blast_env.evaluation.engines.pieces import PIECE_COLUMNS, PieceLoads
from blast_env.evaluation.record import BlastLoads, BlastRecord, StructureLoad, WallsWithoutVerdict
from blast_env.evaluation.validation import (
    NOT_KNOWN,
    Validation,
    ValidationStatus,
    worst_validation,
)
from blast_env.gas.cost import CostGuess, cost_of_run
from blast_env.gas.oblique_walls import STEPPED, ObliqueLoads, stepped_buildings
from blast_env.gas.settings import GasSettings, distance_unchecked
from blast_env.gas.tables import (
    BUILDING_COLUMNS,
    GAUGE_COLUMNS,
    MODULE_COLUMNS,
    STRUCTURE_COLUMNS,
    WALL_COLUMNS,
    face_table,
    gauge_table,
    load_values,
    module_table,
    structure_table,
    wall_table,
)
from blast_env.geometry import WALLS, Element, layout_text
from blast_env.layout.build_site import build_site, charge_against, draw_threat, outlines
from blast_env.provenance import versions
from blast_env.response.facade import cells_of, peak_factor, slowest_period_s
from blast_env.response.levels import BayDamage
from blast_env.results import EndReason, ScaledImpulse
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario
from blast_env.site.blast_site import BlastSite, in_sight
from blast_env.site.structures import buildings_of
from blast_env.statistics import counted_parts, mean_over_area
from blast_env.tables import table_of, texts
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.evaluation.engines.walls import WallHistories
    from blast_env.gas.engine import FaceTable, GasRun, Recorders
    from blast_env.gas.grid import GasGrid
    from blast_env.gas.solver import Recorder
    from blast_env.tables import RunRecord

_AT_SURFACE_M: Final = 1e-6  # a gauge on a wall records the air before it
_PROGRESS_CALLS: Final = 100

_FLOORED: Final = "{} cells were raised to the floor of pressure"
_SEEN_FACES: Final = 200  # of a structure, most for the share in sight

_FINAL_CELL_M: Final = 0.25
_WIDEST_UNIFORM_M: Final = 40.0
"""Side of the cells of final statements, and the widest site on which they do not grow."""


@dataclass(frozen=True)
class GasEngine(GasSettings, Engine):
    """Computes blasts in a compressible gas, in compiled code; for settings see `GasSettings`."""

    has_peaks: ClassVar[bool] = True
    is_complete: ClassVar[bool] = True
    title: ClassVar[str] = "Gas dynamics"
    validated_range: ClassVar[str] = "the validated range of gas dynamics"
    options: ClassVar[tuple[str, ...]] = ("cell_m", "cells", "until")
    medium: ClassVar[Literal["", "gas", "particles"]] = "gas"

    name: str = "gas"
    version: str = f"gas 8 (numba {version('numba')})"

    def blast(
        self,
        scenario: AnyScenario,
        layout: Sequence[Element] = (),
        seed: int = 0,
        charge: AnyCharge | None = None,
    ) -> "GasBlast":
        """Return one blast, for running and inspection."""
        return GasBlast(find_scenario(scenario), layout, seed, self, charge)

    def response_s(self, scenario: Scenario) -> float:
        """Return the natural period of the slowest component of the facades of a site, s.

        In a period a loaded component swings in and rebounds. Components that hardening may install
        are included.
        """
        hardened = (
            bay
            for alternative in scenario.alternatives
            for bay in (*alternative.glazing.values(), *alternative.wall.values())
        )
        return slowest_period_s([*scenario.bays, *hardened])

    def record(
        self,
        blast: EngineBlast,
        progress: Callable[[float], None] | None = None,
        drawing: BlastDrawing | None = None,
    ) -> BlastRecord:
        """Run a blast, draw it, and return its complete record."""
        scenario, layout, charge, seed = blast
        found = GasBlast(scenario, layout, seed, self, charge).recorded(progress, drawing)
        if drawing is not None:
            drawing.draw(found)
        return found.record

    def cost(self, scenario: Scenario, charge: AnyCharge) -> CostGuess:
        """Return an estimate of the cost of a blast, without building its grid.

        The charge in a vehicle is at its place without a layout.
        """
        site = BlastSite(
            site_m=scenario.site.rectangle_m,
            charge=charge_against(scenario, (), charge),
            structures=outlines(scenario),
            air_height_m=scenario.air_height_m,
        )
        return cost_of_run(self, site, self.response_s(scenario))

    def final(self, scenarios: Sequence[Scenario]) -> "GasEngine":
        """Return the engine with cells of 0.25 m, which grow if a site is wider than 40 m."""
        sides_m = [scenario.site.width_m for scenario in scenarios]
        sides_m += [scenario.site.height_m for scenario in scenarios]
        if max(sides_m, default=0.0) > _WIDEST_UNIFORM_M:
            return replace(self, cells="fine")
        return replace(self, cell_m=_FINAL_CELL_M)

    @property
    def coarser(self) -> "GasEngine | None":
        """The engine with cells twice as large; `None` if they would exceed a module."""
        cell_m = 2.0 * self.smallest_m
        modules = MODULE_SIDE_M / cell_m
        if modules < 1.0 - 1e-9 or abs(modules - round(modules)) > 1e-9:
            return None
        return replace(self, cell_m=cell_m, cells="coarse" if self.is_growing else self.cells)

    @property
    def words(self) -> str:
        """Its name and the side of its cells."""
        return f"{self.name}, {self.cell_words}"

    def describe(self, scenarios: Iterable[Scenario] = ()) -> str:
        """Describe the engine and its cells in one line."""
        return f"{super().describe(scenarios)}, {self.cell_words}"


@dataclass(frozen=True, eq=False)
class GasBlast(RunnableBlast):
    """One blast of the gas engine, ready to run."""

    engine: GasEngine = field(default_factory=GasEngine)

    @cached_property
    def site(self) -> BlastSite:
        """The structures, the barrier, the charge and the gauges."""
        return build_site(self.scenario, self.layout, self.seed, self.charge)

    @property
    def threat(self) -> AnyCharge:
        """The charge before the layout is known, or the vehicle that carries it."""
        return draw_threat(self.scenario, self.seed) if self.charge is None else self.charge

    def start(self, recorders: "Recorders" = lambda _: ()) -> "GasResult":
        """Return the result at time 0, whose run is to be advanced to its end.

        `recorders` makes further recorders for the grid: maps, pictures. The result keeps them in
        `run.solver.recorders`.

        Raises:
            BlastEnvError: If the grid does not fit into memory, or the charge or a gauge is in a
                solid.
        """
        from blast_env.gas.engine import GasRun  # Numba takes half a second to import

        run = GasRun(self.engine, self.site, recorders, self.engine.response_s(self.scenario))
        oblique = ObliqueLoads.begin(run, self.scenario.structures_with(self.layout))
        bays = BayLoads.begin(run, self.scenario.bays_with(self.layout))
        if bays.bays:
            run.record(bays.recorder)
        pieces = PieceLoads.begin(run, self.scenario, self.layout)
        if pieces is not None:
            run.record(pieces.recorder)
        return GasResult(self, run, bays, pieces, oblique)

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        recorders: "Recorders" = lambda _: (),
    ) -> "GasResult":
        """Run the blast to its end; see `start`. Progress is the elapsed share of the limit."""
        result = self.start(recorders)
        run = result.run
        while run.end_reason is None:
            run.advance(run.time_s + run.limit_s / _PROGRESS_CALLS)
            if progress is not None:
                progress(min(run.time_s / run.limit_s, 1.0))
        return result

    def recorded(
        self,
        progress: Callable[[float], None] | None = None,
        drawing: BlastDrawing | None = None,
    ) -> "BlastMeasurement":
        """Run the blast and return it with its complete record; `drawing` adds recorders."""
        # Here, because it imports Numba, which takes half a second.
        from blast_env.evaluation.engines.walls import WallHistories, record_of

        histories = WallHistories(buildings_of(self.scenario.structures), self.site)
        more = None if drawing is None else drawing.recorders(self)

        def recorders(grid: "GasGrid") -> "tuple[Recorder, ...]":
            return (histories, *(() if more is None else more(grid)))

        result = self.run(progress, recorders)
        return BlastMeasurement(result, histories, record_of(result, histories))


@dataclass(frozen=True, eq=False)
class BlastMeasurement:
    """A finished blast with its record.

    Attributes:
        histories: Mean overpressures on walls.
    """

    result: "GasResult"
    histories: "WallHistories"
    record: BlastRecord


@dataclass(frozen=True, eq=False)
class GasResult:
    """The outcome of a blast of the gas engine.

    Attributes:
        blast: The blast.
        run: The run, at its end.
        bay_loads: Histories of the bays of facades.
        piece_loads: Histories on both sides of the barrier's pieces; `None` if no piece has a
            height.
        oblique: Loads on oblique walls along the normal of the wall; `None` without such a wall.
    """

    blast: GasBlast
    run: "GasRun"
    bay_loads: BayLoads
    piece_loads: PieceLoads | None
    oblique: ObliqueLoads | None

    def now(self) -> "GasResult":
        """Return the result of a run that was advanced since, without the earlier tables."""
        return replace(self)

    @property
    def engine_name(self) -> str:
        """Name of the engine."""
        return self.blast.engine.name

    @property
    def engine_version(self) -> str:
        """Version of the code that computed the physics."""
        return self.blast.engine.version

    @property
    def end_reason(self) -> EndReason:
        """Reason for the end of the run."""
        return self.run.end_reason or EndReason.TIME_LIMIT

    @property
    def time_s(self) -> float:
        """Simulated time at the end."""
        return self.run.time_s

    @property
    def steps(self) -> int:
        """Number of steps of the engine."""
        return self.run.steps

    @cached_property
    def faces(self) -> "pd.DataFrame":
        """One row per cell face, structures and barrier; see `FACE_COLUMNS`."""
        return face_table(self.run)

    @cached_property
    def on_walls(self) -> "pd.DataFrame":
        """`faces` with loads on oblique walls along their normals."""
        return self.faces if self.oblique is None else self.oblique.table(self.faces)

    @cached_property
    def modules(self) -> "pd.DataFrame":
        """One row per module face; see `MODULE_COLUMNS`."""
        return module_table(self.run, self.faces)

    @cached_property
    def walls(self) -> "pd.DataFrame":
        """One row per wall or roof of a structure; see `WALL_COLUMNS`."""
        return wall_table(self.run, self.on_walls)

    @cached_property
    def structures(self) -> "pd.DataFrame":
        """One row per structure; see `STRUCTURE_COLUMNS`, and `VALIDATION_COLUMNS` of its load."""
        return self._with_validation(structure_table(self.run, self.on_walls), "structure")

    @cached_property
    def buildings(self) -> "pd.DataFrame":
        """One row per building, parts combined; see `BUILDING_COLUMNS`, `VALIDATION_COLUMNS`."""
        names = self.blast.scenario.building_names
        stepped = stepped_buildings(self.blast.scenario.structures)
        table = structure_table(self.run, self.on_walls, names, stepped)
        return self._with_validation(table, "parts")

    def _with_validation(self, table: "pd.DataFrame", column: str) -> "pd.DataFrame":
        """Return a table with the validation status of the load on the structures of a column."""
        found = [self.validation(str(names).split()) for names in table[column]]
        return table.assign(
            validation=texts([status.label for status, _ in found]),
            reason=texts([reason for _, reason in found]),
        )

    @property
    def stepped_notes(self) -> tuple[str, ...]:
        """Notes on peaks on oblique walls, one sentence per building."""
        stepped = self.buildings["stepped"].to_numpy(dtype=bool)
        return tuple(f"{name}: {STEPPED}" for name in self.buildings["building"][stepped])

    @cached_property
    def gauges(self) -> "pd.DataFrame":
        """One row per gauge, in the order of the scenario; see `GAUGE_COLUMNS`."""
        return gauge_table(self.run)

    @property
    def gauge_notes(self) -> tuple[str, ...]:
        """Notes on gauges whose load is not known or that were moved, one sentence each."""
        late = ~self.gauges["known"].to_numpy(dtype=bool)
        unknown = (f"gauge {name}: {NOT_KNOWN}" for name in self.gauges["name"][late])
        return (*unknown, *self.moved_gauges)

    @property
    def moved_gauges(self) -> tuple[str, ...]:
        """Notes on gauges inside a solid, which record the nearest air, one sentence each."""
        notes = []
        centres_m = self.gauges[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)
        for gauge, centre_m in zip(self.run.site.gauges, centres_m, strict=True):
            beyond_m = np.abs(centre_m - gauge.position_m) - 0.5 * self.run.grid.cell_m
            if beyond_m.max() > _AT_SURFACE_M:
                x_m, y_m, z_m = centre_m.tolist()
                notes.append(
                    f"gauge {gauge.name}: lies inside a solid; its load is that of the nearest air,"
                    f" at ({x_m:g}, {y_m:g}, {z_m:g}) m"
                )
        return tuple(notes)

    def history(self, gauge: str) -> "pd.DataFrame":
        """Return the overpressure at a gauge over time: `time_s`, `overpressure_pa`."""
        import pandas as pd  # it takes a third of a second

        names = [gauge.name for gauge in self.run.site.gauges]
        if gauge not in names or self.run.gauges is None:
            raise UnknownNameError("gauge", gauge, names)
        pressure = np.asarray(self.run.gauges.history_pa)[:, names.index(gauge)]
        return pd.DataFrame({"time_s": self.run.gauges.time_s, "overpressure_pa": pressure})

    @cached_property
    def bays(self) -> "pd.DataFrame":
        """One row per bay, with its load and response; see `LOADED_BAY_COLUMNS`."""
        return self.bay_loads.table(self.run)

    @cached_property
    def unjudged(self) -> tuple[WallsWithoutVerdict, ...]:
        """Walls of buildings with a facade that no verdict covers, one item per building."""
        scenario, layout = self.blast.scenario, self.blast.layout
        parts = buildings_of(scenario.structures_with(layout)).items()
        return unjudged_walls(
            self.run.table,
            self.run.site.structures,
            {name: [x.name for x in own] for name, own in parts if any(x.facade for x in own)},
            scenario.bays_with(layout),
            self._share * self.run.grid.cell_m**2,
        )

    def bay_history(self, name: str) -> "pd.DataFrame":
        """Return the mean overpressure on a bay over time: `time_s`, `overpressure_pa`."""
        return self.bay_loads.history(name)

    @cached_property
    def pieces(self) -> "pd.DataFrame":
        """One row per barrier piece, with its load and stability; see `PIECE_COLUMNS`."""
        if self.piece_loads is None:
            return table_of([], PIECE_COLUMNS)
        return self.piece_loads.table(self.time_s)

    def piece_history(self, name: str) -> "pd.DataFrame":
        """Return the mean overpressures on the sides of a piece: `time_s`, `west_pa` and others."""
        if self.piece_loads is None:
            raise UnknownNameError("piece", name, ())
        return self.piece_loads.history(name)

    def impulse(self, structure: str) -> ScaledImpulse:
        """Return the peak specific impulse on a structure, averaged over the counted walls.

        `.in_range` and `.notes` state whether the engine was checked for such a distance, charge
        and cell, and the load was known at the end of the run.

        Raises:
            UnknownNameError: If there is no structure of that name.
        """
        names = [
            structure.name for structure in self.run.site.structures if not structure.is_barrier
        ]
        if structure not in names:
            raise UnknownNameError("structure", structure, names)
        return self._scaled(names.index(structure))

    @property
    def structure_loads(self) -> tuple[StructureLoad, ...]:
        """The loads on all structures."""
        named = {structure.name: structure for structure in self.blast.scenario.structures}
        return tuple(
            StructureLoad.on(
                named[outline.name],
                scaled.pa_s,
                self._largest_pa(index),
                scaled.in_range,
                notes=scaled.notes,
                area_m2=self._area_m2(index),
                unloaded_m2=self._unloaded_m2(index),
                validation=self._validations[outline.name],
            )
            for index, outline in enumerate(self.run.site.structures)
            if not outline.is_barrier
            for scaled in [self._scaled(index)]
        )

    def validation(self, names: Collection[str]) -> Validation:
        """Return the validation status of the load on a structure, or on parts of a building."""
        counted = counted_parts(
            [structure for structure in self.run.site.structures if structure.name in names]
        )
        return worst_validation(self._validations[structure.name] for structure in counted)

    @cached_property
    def _validations(self) -> dict[str, Validation]:
        """The validation status of the load on the counted walls of each structure, by name."""
        structures = enumerate(self.run.site.structures)
        return {
            structure.name: self._validated(k)
            for k, structure in structures
            if not structure.is_barrier
        }

    def _validated(self, index: int) -> Validation:
        run, scenario = self.run, self.blast.scenario
        outline = run.site.structures[index]
        own = self._walls(index)
        own = own[np.linspace(0, len(own) - 1, min(len(own), _SEEN_FACES)).astype(int)]
        outward = np.pad(run.table.outward[own], ((0, 0), (0, 1)))  # walls are upright
        seen = in_sight(run.site, run.table.centre_m[own] + MODULE_SIDE_M * outward, outward)
        if run.solver.floored_cells:
            return Validation(
                ValidationStatus.APPROXIMATE, _FLOORED.format(run.solver.floored_cells)
            )
        return validation_of(
            run.site.scaled_distance(outline),
            1.0 - float(seen.mean()) if len(own) else 0.0,
            cells_of(peak_factor(run.grid.cell_m, run.site.charge.tnt_kg)),
            run.is_known(index),
            scenario.building_names[outline.name] in stepped_buildings(scenario.structures),
            run.site.charge.is_raised,
        )

    def loads(self) -> BlastLoads:
        """Return the loads on all structures and, for a response, the damage of all bays."""
        bays: tuple[BayDamage, ...] = ()
        if self.blast.scenario.objective.is_response:
            factor = peak_factor(self.run.grid.cell_m, self.run.site.charge.tnt_kg)
            bays = self.bay_loads.damages(self.blast.scenario.alternatives, factor)
        return BlastLoads(self.structure_loads, self.module_impulse_n_s, bays)

    def _walls(self, index: int) -> NDArray[np.int64]:
        """Return the indices of the faces on which the load on a structure is assessed (n,)."""
        from blast_env.gas.engine import counted_faces  # Numba takes half a second to import

        return counted_faces(self.run.table, self.run.site, index)

    @cached_property
    def _peak_pa(self) -> FloatArray:
        """Peaks on cell faces, Pa, on oblique walls along the normal of the wall (faces,)."""
        peak_pa = self.run.loads.peak_pa
        return peak_pa if self.oblique is None else self.oblique.peaks_pa(peak_pa)

    def _mean(self, index: int, values: FloatArray) -> float:
        """Return the mean of a load over the counted walls of a structure; NaN without any."""
        own = self._walls(index)
        along = values if self.oblique is None else self.oblique.along_normals(values)
        return mean_over_area(along[own], self._share[own])

    def _largest_pa(self, index: int) -> float:
        """Return the largest peak on the counted walls of a structure; NaN without any."""
        own_pa = self._peak_pa[self._walls(index)]
        return float(own_pa.max()) if len(own_pa) else np.nan

    def _scaled(self, index: int) -> ScaledImpulse:
        """Return the impulse on a structure, by its index in the site."""
        notes = self._notes(index)
        return ScaledImpulse(self._mean(index, self.run.loads.impulse_pa_s), not notes, notes)

    def _area_m2(self, index: int) -> float:
        """Return the area of the counted walls of a structure, m2."""
        return float(self._share[self._walls(index)].sum()) * self.run.grid.cell_m**2

    def _unloaded_m2(self, index: int) -> float:
        """Return the area of its counted walls without a load, behind pieces that fill a gap."""
        if self._unloaded is None:
            return 0.0
        from blast_env.gas.engine import counted_faces

        own = counted_faces(self._unloaded, self.run.site, index)
        return float(self._unloaded.share[own].sum()) * self.run.grid.cell_m**2

    @cached_property
    def _unloaded(self) -> "FaceTable | None":
        """The faces of walls without a load; `None` without a barrier."""
        from blast_env.gas.engine import unloaded_table_of  # Numba takes half a second to import

        site = self.run.site
        has_barrier = any(structure.is_barrier for structure in site.structures)
        return unloaded_table_of(self.run.grid, site) if has_barrier else None

    @cached_property
    def _share(self) -> FloatArray:
        """Ratio of the area of the real wall to that of each face (faces,)."""
        return self.run.table.share

    @cached_property
    def module_impulse_n_s(self) -> FloatArray:
        """Momentum on the walls of each module of the structures, N s (modules,).

        Modules are in the order of the structures, row by row.
        """
        table, sums = self.run.table, []
        for index, outline in enumerate(self.run.site.structures):
            if not outline.is_barrier:
                own = (table.structure == index) & (table.face < len(WALLS))
                momentum = np.zeros((outline.rows, outline.columns))
                values = self.run.loads.impulse_pa_s[own] * self.run.grid.cell_m**2
                np.add.at(momentum, (table.row[own], table.column[own]), values)
                sums.append(momentum[tuple(np.array(outline.filled).T)])
        return np.concatenate(sums) if sums else np.zeros(0)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all loads, the gauges, the end time and the number of steps, hexadecimal."""
        state = sha256()
        for table in (self.run.loads, self.run.gauges):
            if table is not None:
                for values in load_values(table).values():
                    state.update(np.ascontiguousarray(values).tobytes())
        state.update(np.array([self.time_s, self.steps]).tobytes())
        return state.hexdigest()

    @cached_property
    def run_record(self) -> "RunRecord":
        """The inputs and versions needed to repeat the run, and its outcome."""
        blast, charge, known = self.blast, self.run.site.charge, versions(self.engine_version)
        return {
            "scenario": blast.scenario.name,
            "scenario hash": blast.scenario.content_hash,
            "layout (row, column)": layout_text(blast.layout),
            "charge x (m)": charge.position_m[0],
            "charge y (m)": charge.position_m[1],
            "charge height (m)": charge.height_m,
            "charge TNT equivalent (kg)": charge.tnt_kg,
            "engine": self.engine_name,
            "cell (m)": blast.engine.smallest_m,
            "kind of cells": blast.engine.cells,
            "margin (m)": blast.engine.margin_m,
            "border (m)": blast.engine.border_m,
            "engine version": known["engine"],
            "blast-env version": known["blast_env"],
            "python version": known["python"],
            "numpy version": known["numpy"],
            "cells": int(np.prod(self.run.grid.shape)),
            "cell updates": self.run.solver.cell_updates,
            "cells raised to the floor": self.run.solver.floored_cells,
            "steps": self.steps,
            "simulated time (s)": self.time_s,
            "ended because": str(self.end_reason),
            "digest": self.digest,
        }

    def to_excel(self, path: str | Path) -> Path:
        """Write a workbook with structures, modules, gauges and the run record; return its path."""
        from blast_env.workbook import SheetTable, write_workbook

        tables = [
            SheetTable("Structures", self.structures, (*STRUCTURE_COLUMNS, *VALIDATION_COLUMNS)),
            SheetTable("Walls", self.walls, WALL_COLUMNS),
            SheetTable("Modules", self.modules, MODULE_COLUMNS),
            SheetTable("Gauges", self.gauges, GAUGE_COLUMNS),
        ]
        if len(self.buildings) < len(self.structures):
            tables.insert(
                0, SheetTable("Buildings", self.buildings, (*BUILDING_COLUMNS, *VALIDATION_COLUMNS))
            )
        if len(self.bays):
            tables.append(SheetTable("Bays", self.bays, LOADED_BAY_COLUMNS))
        if len(self.pieces):
            tables.append(SheetTable("Pieces", self.pieces, PIECE_COLUMNS))
        return write_workbook(self.run_record, tables, path)

    def _notes(self, index: int) -> tuple[str, ...]:
        notes = list(self.run.notes)
        outline = self.run.site.structures[index]
        if words := distance_unchecked(self.run.site.scaled_distance(outline)):
            notes.append(words)
        if not self.run.is_known(index):
            waited = self.end_reason is not EndReason.LOADS_KNOWN
            why = str(self.end_reason) if waited else "take until='walls' to wait for it"
            notes.append(f"{NOT_KNOWN}: {why}")
        if self.run.solver.floored_cells:
            notes.append(_FLOORED.format(self.run.solver.floored_cells))
        return tuple(notes)
