"""The gas engine: deterministic blasts in three dimensions.

The site becomes a grid of cubic cells, in which structures, barrier and ground are solid. Around
and above the site, cells grow outwards to distant open borders. The charge expands with spherical
symmetry until its front reaches the first structure or the build zone. Then the solver takes over
until the loads on the structures are known.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from math import cbrt, ceil
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.compilation import compilation_notice
from blast_env.errors import BlastEnvError
from blast_env.gas.coarsening import CoarseningSolver, shape_to_double
from blast_env.gas.cost import cost_of_run
from blast_env.gas.enclosure import room_around
from blast_env.gas.ending import AREA, corners_m, is_known, limit_s, sound_s, watched_structures
from blast_env.gas.faces import Faces, exposed_faces, leaning_faces
from blast_env.gas.grid import GasGrid, layers_to
from blast_env.gas.probes import FaceLoads, Gauges
from blast_env.gas.settings import FACE_NAMES, GasSettings, cells_unchecked
from blast_env.gas.solver import Gas, GasSolver, Recorder, Settling
from blast_env.gas.source import (
    GasCharge,
    clearance_m,
    largest_radius_m,
    least_clearance_m,
    set_charge,
)
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.geometry import OUTWARDS, WALLS
from blast_env.results import EndReason
from blast_env.site.blast_site import BlastSite
from blast_env.site.structures import StructureOutline
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:
    from blast_env.site.footprint import Footprint

_HOTTEST: Final = 4.0  # temperature limit of settled products, in units of still air's
_LOOK_EVERY: Final = 4  # steps between two checks of the loads

Recorders = Callable[[GasGrid], Sequence[Recorder]]


def _notice() -> AbstractContextManager[None]:
    return compilation_notice("gas dynamics (some 20 s)")


def _none(_: GasGrid) -> Sequence[Recorder]:
    return ()


@dataclass(frozen=True, eq=False)
class FaceTable:
    """The cell faces of structures and barrier; see `face_table_of` for those behind pieces.

    Attributes:
        faces: The faces for the solver, on which the loads act (n,).
        structure: Index into the site's structures (n,).
        row: Row of the module in its structure (n,).
        column: Column of the module (n,).
        face: Index into `FACE_NAMES`; of a wall of a polygon, the side that it mostly faces (n,).
        centre_m: Centres (n, 3).
        wall: Index of the wall of a polygon, -1 for other faces (n,).
        share: Area of the wall per area of the face: the cosine between their normals (n,).
        outward: Normals of the walls in plan, 0 for roofs and undersides (n, 2).
    """

    faces: Faces
    structure: NDArray[np.int64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    face: NDArray[np.int64]
    centre_m: FloatArray
    wall: NDArray[np.int64]
    share: FloatArray
    outward: FloatArray


class GasRun:
    """One blast in progress.

    Attributes:
        site: The structures, the barrier, the charge and the gauges.
        settings: The settings of the run.
        cost: Estimate of its cost.
        grid: The grid.
        solver: The solver.
        charge: The charge.
        remap_radius_m: Radius of the front at which the grid takes over: the distance to the
            first structure, to the ground below a charge in the air, or to the build zone, with or
            without a barrier in it; at least `least_clearance_m`. It is the same for all layouts
            of a scenario with the same charge.
        table: The faces on which loads are recorded.
        loads: The loads on them.
        gauges: The gauges, `None` without any.
        response_s: Minimum duration of the run after the last load has arrived, for facades to
            peak and rebound.
        limit_s: Time limit of the run.
        end_reason: Reason for the end of the run; `None` before it.
        notes: Reasons to distrust the result, one sentence each.
    """

    def __init__(
        self,
        settings: GasSettings,
        site: BlastSite,
        recorders: Recorders = _none,
        response_s: float = 0.0,
    ) -> None:
        self.settings, self.site, self.response_s = settings, site, response_s
        # 1. What the run waits for, and its cost: too large a run is refused before it is laid out.
        watched = watched_structures(site, settings.until)
        self.cost = cost_of_run(settings, site, response_s)
        self.cost.check(settings)
        # 2. The cells and the charge in them, with the recorders.
        with self.cost.within_memory(settings):
            self._lay_out(recorders)
        self.end_reason: EndReason | None = None
        # 3. When the run may end.
        self._groups = _groups(self.table, site, settings.until, watched)
        self._watches_gauges = settings.until == "gauges" and self.gauges is not None
        places_m = [gauge.position_m for gauge in site.gauges] if self._watches_gauges else []
        self._travel_s = sound_s(site, [*corners_m(site, watched), *places_m])
        self._end_s: float | None = None
        asked_s = settings.until_s
        self.limit_s = limit_s(site, self._travel_s) + response_s if asked_s is None else asked_s

    def _lay_out(self, recorders: Recorders) -> None:
        """Make the grid, the recorders and the solver, with the charge in it."""
        settings, site = self.settings, self.site
        # 1. The cells, and the charge as a sphere on them. Its radius leaves out the whole build
        # zone, so that all layouts have the same source.
        self.grid = _grid(settings, site)
        self.charge = GasCharge(site.charge.tnt_kg, (*site.charge.position_m, site.charge.height_m))
        reserved = None if site.build_zone is None else _cells_of(site.build_zone, self.grid, site)
        self.remap_radius_m = largest_radius_m(self.grid, self.charge, reserved)
        self.notes = self._notes()
        # 2. The recorders.
        self.table = face_table_of(self.grid, site)
        self.loads = FaceLoads(len(self.table.faces))
        self.gauges = _gauges(self.grid, site)
        scale = self._scale = cbrt(self.charge.mass_kg / 100.0)
        own = [self.loads] if self.gauges is None else [self.loads, self.gauges]
        solver = GasSolver(
            self.grid,
            faces=self.table.faces,
            recorders=(*own, *recorders(self.grid)),
            with_fuel=True,
            burning=self.charge.burning,
            settling=Settling(settings.settled_s * scale, _HOTTEST),
            threads=settings.threads,
        )
        # 3. The charge on the grid, and when its front has run far enough for larger cells.
        with _notice():
            set_charge(solver, self.charge, self.remap_radius_m)
            doubled_s = [self.charge.profile(run_m).time_s for run_m in settings.doubled_m]
        self.solver: Gas = CoarseningSolver(solver, doubled_s) if doubled_s else solver
        if self.gauges is not None:
            _add_opening(self.gauges, self.grid, self.charge, self.remap_radius_m)

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return self.solver.time_s

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.solver.steps

    def record(self, recorder: Recorder) -> None:
        """Add a recorder before the first step.

        Raises:
            ValueError: If the run has begun.
        """
        if self.solver.steps:
            raise ValueError(f"the run is at step {self.solver.steps}: record before the first")
        self.solver.recorders = (*self.solver.recorders, recorder)

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`, or the run has ended.

        The division of a run into calls does not change its results.

        Raises:
            BlastEnvError: If the memory of this computer does not suffice.
        """
        with self.cost.within_memory(self.settings):
            while self.end_reason is None and self.solver.time_s < until_s:
                with _notice():
                    self.solver.step()
                asked = self.settings.until_s is not None
                if self.solver.time_s >= self.limit_s:
                    self.end_reason = EndReason.TIME_ASKED if asked else EndReason.TIME_LIMIT
                elif not asked and self.solver.steps % _LOOK_EVERY == 0:
                    self._look()

    def has_come(self, index: int) -> bool:
        """Return whether sound has reached all corners of a structure in plan, by its index."""
        return self.solver.time_s >= sound_s(self.site, corners_m(self.site, [index]))

    def is_known(self, index: int) -> bool:
        """Return whether the loads on the counted walls of a structure are known, by its index.

        With `until` of "walls", all its faces are included.
        """
        groups = _groups(self.table, self.site, self.settings.until, [index])
        return not groups or (self.has_come(index) and self._are_known(groups))

    @property
    def gauges_known(self) -> NDArray[np.bool_]:
        """Whether the load of each gauge is known (n,)."""
        if self.gauges is None:
            return np.empty(0, dtype=bool)
        come_s = np.array([sound_s(self.site, [gauge.position_m]) for gauge in self.site.gauges])
        known = is_known(self.gauges.impulse_pa_s, self.gauges.net_impulse_pa_s)
        return known & (self.solver.time_s >= come_s)

    def _look(self) -> None:
        """End the run if its loads are known and facades have had the time to respond."""
        if self._end_s is None and self.solver.time_s >= self._travel_s:
            gauges = not self._watches_gauges or bool(self.gauges_known.all())
            if gauges and self._are_known(self._groups):
                self._end_s = self._reached_s() + self.response_s
        if self._end_s is not None and self.solver.time_s >= self._end_s:
            self.end_reason = EndReason.LOADS_KNOWN

    def _reached_s(self) -> float:
        """Return the time of the last known load on the walls that the run waits for, s."""
        known = is_known(self.loads.impulse_pa_s, self.loads.net_impulse_pa_s)
        reached_s = np.where(known, self.loads.impulse_time_s, 0.0)
        return max((float(reached_s[faces].max()) for faces in self._groups), default=0.0)

    def _are_known(self, walls: Sequence[NDArray[np.int64]]) -> bool:
        """Return whether the loads on all walls are known, given the faces of each."""
        on_faces = is_known(self.loads.impulse_pa_s, self.loads.net_impulse_pa_s)
        return all(on_faces[faces].mean() >= AREA for faces in walls)

    def _notes(self) -> tuple[str, ...]:
        """Return the reasons why this blast is outside the validated range of the source."""
        clear, least = (
            clearance_m(self.grid, self.charge),
            least_clearance_m(self.grid, self.charge),
        )
        notes = []
        if clear < least:
            notes.append(
                f"the charge is {clear:.2g} m from a solid, below the {least:.2g} m "
                "that its source needs"
            )
        if room := room_around(self.grid, self.charge.position_m):
            notes.append(room.note(self.charge.mass_kg, self.charge.explosive))
        if words := cells_unchecked(cbrt(self.charge.mass_kg) / self.settings.smallest_m):
            notes.append(words)
        return tuple(notes)


def _grid(settings: GasSettings, site: BlastSite) -> GasGrid:
    """Return the grid with its solid cells."""
    cell_m = settings.smallest_m
    # 1. Whole cells that cover the site and its margin, as many as can be halved in number later.
    margin = ceil(settings.margin_m / cell_m)
    low = np.array([site.site_m.left, site.site_m.bottom])
    high = np.array([site.site_m.right, site.site_m.top])
    plan = np.ceil(np.round((high - low) / cell_m, 9)).astype(int) + 2 * margin
    shape = (int(plan[0]), int(plan[1]), ceil(round(site.air_height_m / cell_m, 9)))
    buffer_layers = layers_to(settings.border_m / cell_m)
    shape = shape_to_double(shape, buffer_layers, len(settings.doubled_m))
    origin = low - margin * cell_m
    grid = GasGrid(
        cell_m,
        np.broadcast_to(np.False_, shape),
        (float(origin[0]), float(origin[1]), 0.0),
        buffer_layers=buffer_layers,
    )
    grid = replace(grid, solid=np.zeros(shape, dtype=bool))
    # 2. A cell is solid if its centre is in a module.
    z_m = grid.centres_m(2)
    for outline in site.structures:
        row, column = _modules_at(outline, grid)
        x, y = np.nonzero(row >= 0)
        base_m, top_m = _ends_m(outline, site.air_height_m)[:, row[x, y], column[x, y], np.newaxis]
        grid.solid[x, y] |= (base_m <= z_m) & (z_m < top_m)
    return grid


def _cells_of(outline: StructureOutline, grid: GasGrid, site: BlastSite) -> NDArray[np.bool_]:
    """Return the cells that a structure fills (nx, ny, nz)."""
    row, column = _modules_at(outline, grid)
    base_m, top_m = _ends_m(outline, site.air_height_m)[:, row, column, np.newaxis]
    z_m = grid.centres_m(2)
    return np.asarray((row >= 0)[:, :, np.newaxis] & (base_m <= z_m) & (z_m < top_m))


def _modules_at(
    outline: StructureOutline, grid: GasGrid
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and column of the module at each column of cells (nx, ny), -1 for none."""
    x_m, y_m = grid.centres_m(0), grid.centres_m(1)
    left, bottom = outline.corner_m
    column = np.floor((x_m - left) / MODULE_SIDE_M).astype(np.int64)[:, np.newaxis]
    row = np.floor((y_m - bottom) / MODULE_SIDE_M).astype(np.int64)[np.newaxis, :]
    here = (column >= 0) & (column < outline.columns) & (row >= 0) & (row < outline.rows)
    if outline.cells is not None:
        present = np.zeros((outline.rows, outline.columns), dtype=bool)
        present[tuple(np.array(outline.cells).T)] = True
        here &= present[np.clip(row, 0, outline.rows - 1), np.clip(column, 0, outline.columns - 1)]
    return np.where(here, row, -1), np.where(here, column, -1)


def _ends_m(outline: StructureOutline, air_height_m: float) -> FloatArray:
    """Return the heights of the base and the top of each module of an outline (2, rows, columns).

    Values without a module are arbitrary.
    """
    ends_m = np.empty((2, outline.rows, outline.columns))
    both = (outline.base_m, outline.bases_m), (outline.height_m, outline.heights_m)
    for end_m, (whole_m, of_cells_m) in zip(ends_m, both, strict=True):
        end_m[...] = air_height_m if whole_m is None else whole_m
        if outline.cells is not None and of_cells_m is not None:
            known_m = [air_height_m if height_m is None else height_m for height_m in of_cells_m]
            end_m[tuple(np.array(outline.cells).T)] = known_m
    return ends_m


def face_table_of(grid: GasGrid, site: BlastSite) -> FaceTable:
    """Return the cell faces of the structures and the barrier of a site.

    A part of a wall that pieces of the barrier lean on touches no air. What pushes a piece pushes
    the wall behind it, so that part has the load of the outer face of the pieces before it.
    """
    # 1. Faces that touch air, and those of walls behind pieces.
    exposed = exposed_faces(grid, grid.solid)
    leaning = leaning_faces(grid, _barrier_cells(grid, site))
    faces = exposed.followed_by(leaning.outer)
    # 2. Their structures, modules and walls.
    return _table_of(grid, site, faces, np.concatenate((exposed.solid, leaning.cells)))


def unloaded_table_of(grid: GasGrid, site: BlastSite) -> FaceTable:
    """Return the cell faces of walls without a load, since pieces fill the gap before them."""
    faces = leaning_faces(grid, _barrier_cells(grid, site)).unloaded
    return _table_of(grid, site, faces, faces.solid)


def _table_of(grid: GasGrid, site: BlastSite, faces: Faces, cells: NDArray[np.int64]) -> FaceTable:
    """Return the table of faces.

    Args:
        grid: The grid.
        site: The site.
        faces: The faces (n,).
        cells: The solid cell that takes the load of each face (n, 3): the one behind it, or that of
            the wall on which its piece leans.
    """
    # 1. Structures and modules.
    behind = tuple(cells.T)
    z_m = grid.centres_m(2)[behind[2]]
    structure, row, column = np.full((3, len(faces)), -1)
    for index, outline in enumerate(site.structures):
        rows, columns = _modules_at(outline, grid)
        here = np.flatnonzero(rows[behind[:2]] >= 0)
        of_row, of_column = (
            indices[behind[0][here], behind[1][here]] for indices in (rows, columns)
        )
        base_m, top_m = _ends_m(outline, site.air_height_m)[:, of_row, of_column]
        inside = (base_m <= z_m[here]) & (z_m[here] < top_m)
        own = here[inside]
        structure[own] = index
        row[own], column[own] = of_row[inside], of_column[inside]
    # 2. West, east, south, north by axis and side; upward faces are roofs, downward ones
    # undersides.
    upright = 2 * faces.axis + (faces.side > 0)
    face = np.where(faces.axis == 2, len(WALLS) + (faces.side < 0), upright)
    table = FaceTable(
        faces=faces,
        structure=structure,
        row=row,
        column=column,
        face=face,
        centre_m=faces.centres_m(grid),
        wall=np.full(len(faces), -1),
        share=np.ones(len(faces)),
        outward=np.array([*OUTWARDS.values(), (0.0, 0.0), (0.0, 0.0)])[face],
    )
    # 3. The walls of polygons, from the places on them.
    places_m = faces.of_cells(cells).centres_m(grid)[:, :2]
    for index, outline in enumerate(site.structures):
        if outline.footprint is not None:
            _assign_walls(table, index, outline.footprint, places_m)
    return table


def _barrier_cells(grid: GasGrid, site: BlastSite) -> NDArray[np.bool_]:
    """Return the cells that the barrier fills (nx, ny, nz)."""
    cells = np.zeros(grid.shape, dtype=bool)
    for outline in site.structures:
        if outline.is_barrier:
            cells |= _cells_of(outline, grid, site)
    return cells


def _assign_walls(
    table: FaceTable, index: int, footprint: "Footprint", places_m: FloatArray
) -> None:
    """Assign the upright faces of a structure to the walls of its polygon."""
    own = np.flatnonzero((table.structure == index) & (table.face < len(WALLS)))
    table.wall[own], table.share[own] = footprint.walls_of(places_m[own], table.outward[own])
    sides = np.array([WALLS.index(wall.side) for wall in footprint.walls])
    table.face[own] = sides[table.wall[own]]
    table.outward[own] = np.array([wall.normal for wall in footprint.walls])[table.wall[own]]


def counted_faces(table: FaceTable, site: BlastSite, index: int) -> NDArray[np.int64]:
    """Return the indices of the faces on which the load on a structure is assessed (n,).

    Args:
        table: The faces.
        site: The site.
        index: Index of the structure in the site.
    """
    counting = [FACE_NAMES.index(name) for name in site.structures[index].faces]
    return np.flatnonzero((table.structure == index) & np.isin(table.face, counting))


def structures_without_air(site: BlastSite) -> frozenset[str]:
    """Return the structures of which no air touches a counted wall, which have no load.

    Air before pieces that lean on a wall counts. No blast is run.
    """
    grid = _grid(GasSettings(), site)
    table = face_table_of(grid, site)
    return frozenset(
        outline.name
        for index, outline in enumerate(site.structures)
        if not (outline.is_barrier or len(counted_faces(table, site, index)))
    )


def _groups(
    table: FaceTable, site: BlastSite, until: str | float, watched: Sequence[int]
) -> list[NDArray[np.int64]]:
    """Return the faces of each wall that a run waits for: counted walls, or all of them."""
    groups = [
        np.flatnonzero((table.structure == index) & (table.face == FACE_NAMES.index(name)))
        for index in watched
        for name in (FACE_NAMES if until == "walls" else site.structures[index].faces)
    ]
    return [members for members in groups if len(members)]


def _gauges(grid: GasGrid, site: BlastSite) -> Gauges | None:
    """Return the gauges, each in the nearest cell of air."""
    if not site.gauges:
        return None
    return Gauges(grid, [_air_cell(grid, gauge.name, gauge.position_m) for gauge in site.gauges])


def _add_opening(gauges: Gauges, grid: GasGrid, charge: GasCharge, radius_m: float) -> None:
    """Add the histories of gauges within a radius before the grid took over."""
    centres_m = np.array(grid.origin_m) + grid.cell_m * (gauges.cells + 0.5)
    x_m, y_m, z_m = charge.position_m
    centre_m = np.array([x_m, y_m, 0.0 if charge.on_ground else z_m])
    distance_m = np.sqrt(((centres_m - centre_m) ** 2).sum(axis=1))
    if distance_m.min() < radius_m:
        opening = spherical_stage(charge, radius_m)
        gauges.add_before(opening.time_s, opening.overpressures_pa(distance_m))


def _air_cell(
    grid: GasGrid, name: str, position_m: tuple[float, float, float]
) -> tuple[int, int, int]:
    cell = grid.cell_at(position_m)
    if not grid.solid[cell]:
        return cell
    # A gauge may lie as deep in a structure as a module is wide, and under pieces of any size.
    around, air = ceil(MODULE_SIDE_M / grid.cell_m), np.empty((0, 3))
    while len(air) == 0 and around < 2 * max(grid.shape):
        near = [slice(max(at - around, 0), at + around + 1) for at in cell]
        air = np.argwhere(~grid.solid[tuple(near)]) + [part.start for part in near]
        around *= 2
    if len(air) == 0:
        raise BlastEnvError(f"gauge {name!r} at {position_m}: there is no air on the site")
    centres = np.array(grid.origin_m) + grid.cell_m * (air + 0.5)
    nearest = air[np.argmin(((centres - position_m) ** 2).sum(axis=1))]
    return int(nearest[0]), int(nearest[1]), int(nearest[2])
