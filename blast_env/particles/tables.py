"""The tables of a blast as data frames, with unit and meaning of all columns, and as a workbook."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray
from blast_env.particles.calibration.load_unit import LoadUnit
from blast_env.particles.objects import CollisionType, ModularObstacle
from blast_env.particles.run import CollisionArray, incidence_angle_rad
from blast_env.tables import OF_MODULES, Column, RunRecord, as_types, texts
from blast_env.workbook import EXCEL_ROWS, SheetTable, write_workbook

Columns = tuple[Column, ...]


class BlastTables(Protocol):
    """The written part of a blast: its tables, and the record to repeat it."""

    @property
    def collisions(self) -> pd.DataFrame:
        """One row per collision; the columns are `COLLISION_COLUMNS`."""

    @property
    def modules(self) -> pd.DataFrame:
        """One row per module; the columns are `MODULE_COLUMNS`."""

    @property
    def structures(self) -> pd.DataFrame:
        """One row per structure; the columns are `STRUCTURE_COLUMNS`."""

    @property
    def load_unit(self) -> LoadUnit:
        """The unit of the loads: Pa s with a calibration, else simulation units."""

    @property
    def run_record(self) -> RunRecord:
        """The record of the run, see `RunRecord`."""


COLLISION_COLUMNS: Final = (
    Column("time_s", "s", "time of the collision, from the detonation"),
    Column("particle_type", "", "ExplosionBall or AirBall", True),
    Column("particle_id", "", "index of the ball in the scene"),
    Column("mass", "sim mass", "mass of the ball before the collision"),
    Column("vx", "sim units/s", "velocity to the right before the collision"),
    Column("vy", "sim units/s", "velocity upwards before the collision"),
    Column("speed", "sim units/s", "speed before the collision"),
    Column("impulse_sim", "sim", "m |v| before the collision, the paper's measure"),
    Column("transferred_impulse_sim", "sim", "momentum that the contact really transferred"),
    Column("angle_rad", "rad", "angle of incidence, 0 is head-on"),
    Column("angle_deg", "deg", "angle of incidence, 0 is head-on"),
    Column("normal_x", "", "unit normal out of the module, to the right"),
    Column("normal_y", "", "unit normal out of the module, upwards"),
    Column("module_id", "", "module that was hit, named by its centre in metres", True),
    Column("structure", "", "structure that the module is part of", True),
    Column("earlier_collisions", "", "collisions of this ball before, with anything"),
    Column("first_contact", "", "whether this is the first hit on the module"),
)

MODULE_COLUMNS: Final = (
    *OF_MODULES,
    Column("hits", "", "collisions"),
    Column("impulse_sim", "sim", "sum of m |v| over the collisions"),
    Column("transferred_impulse_sim", "sim", "sum of the momentum really transferred"),
    Column("first_hit_s", "s", "time of the first collision"),
    Column("destroyed", "", "whether the impulse passed the module's capacity"),
    Column("piece", "", "piece of a barrier that it is part of; empty if it is of none"),
)

STRUCTURE_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("kind", "", "ConcreteSquare or ModularObstacle"),
    Column("protected", "", "whether its load counts"),
    Column("weight", "", "its weight among the protected structures"),
    Column("modules", "", "number of modules"),
    Column("hits", "", "collisions"),
    Column("impulse_sim", "sim", "sum of m |v| over the collisions"),
    Column("transferred_impulse_sim", "sim", "sum of the momentum really transferred"),
    Column("first_hit_s", "s", "time of the first collision"),
    Column("modules_destroyed", "", "modules whose impulse passed their capacity"),
)

BUILDING_COLUMNS: Final = (
    Column("building", "", "name of the building; structures that are parts of it are one"),
    *(column for column in STRUCTURE_COLUMNS if column.name not in ("structure", "kind")),
)

STRUCTURE_PA_S_COLUMNS: Final = (
    Column("impulse_pa_s", "Pa s", "impulse per area through the scenario's calibration"),
    Column("calibration_in_range", "", "yes if the calibration was made for it, or why not"),
)


def structures_in_pa_s(structures: pd.DataFrame, unit: LoadUnit) -> tuple[pd.DataFrame, Columns]:
    """Return a structure table with the loads in Pa s, and its columns.

    Args:
        structures: The structure table of a blast.
        unit: Its unit; without a calibration nothing is added.
    """
    if not unit.is_calibrated:
        return structures, STRUCTURE_COLUMNS
    loads = [unit.of_structures.get(name) for name in structures["structure"]]
    added = structures.assign(
        impulse_pa_s=[np.nan if load is None else load.scaled.pa_s for load in loads],
        calibration_in_range=texts(
            ["" if load is None else "; ".join(load.scaled.notes) or "yes" for load in loads]
        ),
    )
    return added, (*STRUCTURE_COLUMNS, *STRUCTURE_PA_S_COLUMNS)


def modules_in_pa_s(modules: pd.DataFrame, unit: LoadUnit) -> tuple[pd.DataFrame, Columns]:
    """Return a module table with the loads in Pa s, and its columns.

    Args:
        modules: The module table of a blast.
        unit: Its unit; without a calibration nothing is added.
    """
    if not unit.is_calibrated:
        return modules, MODULE_COLUMNS
    column = Column("impulse_pa_s", "Pa s", unit.label)
    return modules.assign(impulse_pa_s=unit.factor * modules["impulse_sim"]), (
        *MODULE_COLUMNS,
        column,
    )


def collision_table(
    collisions: CollisionArray, obstacles: Sequence[ModularObstacle]
) -> pd.DataFrame:
    """Return one row per collision, in the order of time; see `COLLISION_COLUMNS`.

    Args:
        collisions: Records of `COLLISION_DTYPE` (n,).
        obstacles: The obstacles of the blast, whose modules the records number in this order.
    """
    parts = [part for obstacle in obstacles for part in obstacle.parts]
    module_ids = np.array([part.module_id for part in parts], dtype=object)
    structures = np.array([part.structure for part in parts], dtype=object)
    angle = incidence_angle_rad(collisions)
    vx: FloatArray = collisions["vx"]
    vy: FloatArray = collisions["vy"]
    module: Any = collisions["module"]  # with its exact type, mypy takes seconds for the indexing
    values: dict[str, Any] = {
        "time_s": collisions["time_s"],
        "particle_type": [CollisionType(kind).name for kind in collisions["kind"]],
        "particle_id": collisions["ball"],
        "mass": collisions["mass"],
        "vx": vx,
        "vy": vy,
        "speed": np.hypot(vx, vy),
        "impulse_sim": collisions["impulse"],
        "transferred_impulse_sim": collisions["transferred_impulse"],
        "angle_rad": angle,
        "angle_deg": np.degrees(angle),
        "normal_x": collisions["normal_x"],
        "normal_y": collisions["normal_y"],
        "module_id": texts(module_ids[module]),
        "structure": texts(structures[module]),
        "earlier_collisions": collisions["earlier_collisions"],
        "first_contact": collisions["first_contact"],
    }
    table = pd.DataFrame(values)[[column.name for column in COLLISION_COLUMNS]]
    return as_types(table, {"particle_type": "str"})


def faces_hit(collisions: pd.DataFrame) -> pd.Series:
    """Return the wall (n,) that each collision hit, such as "west", from its normal.

    Args:
        collisions: A collision table.
    """
    x, y = collisions["normal_x"], collisions["normal_y"]
    sideways = np.where(x < 0.0, "west", "east")
    upright = np.where(y < 0.0, "south", "north")
    names = np.where(x.abs() >= y.abs(), sideways, upright)
    return pd.Series(names, index=collisions.index, dtype="str")


def module_table(obstacles: Sequence[ModularObstacle]) -> pd.DataFrame:
    """Return one row per module; see `MODULE_COLUMNS`."""
    rows = [
        (
            part.module_id,
            part.structure,
            part.row,
            part.column,
            *part.centre_m,
            part.hits,
            part.impulse,
            part.transferred_impulse,
            _or_nan(part.first_hit_s),
            part.destroyed,
            part.piece,
        )
        for obstacle in obstacles
        for part in obstacle.parts
    ]
    table = pd.DataFrame(rows, columns=[column.name for column in MODULE_COLUMNS])
    return as_types(table, {"module_id": "str", "structure": "str", "piece": "str"})


def structure_table(obstacles: Sequence[ModularObstacle]) -> pd.DataFrame:
    """Return one row per structure; see `STRUCTURE_COLUMNS`."""
    rows = [
        (
            obstacle.name,
            obstacle.kind,
            obstacle.protected,
            obstacle.weight,
            len(obstacle.parts),
            obstacle.hits,
            obstacle.impulse,
            obstacle.transferred_impulse,
            _or_nan(obstacle.first_hit_s),
            sum(part.destroyed for part in obstacle.parts),
        )
        for obstacle in obstacles
    ]
    table = pd.DataFrame(rows, columns=[column.name for column in STRUCTURE_COLUMNS])
    return as_types(table, {"structure": "str", "kind": "str"})


def building_table(structures: pd.DataFrame, buildings: Mapping[str, str]) -> pd.DataFrame:
    """Return one row per building; see `BUILDING_COLUMNS`.

    Args:
        structures: The structure table of a blast.
        buildings: The building of each structure, by its name; a structure without an entry, as
            the barrier, is a separate building.
    """
    together = dict.fromkeys(("modules", "hits", "modules_destroyed", "weight"), "sum")
    together |= {"impulse_sim": "sum", "transferred_impulse_sim": "sum"}
    together |= {"protected": "any", "first_hit_s": "min"}
    names = [buildings.get(name, name) for name in structures["structure"]]
    grouped = structures.assign(building=names).groupby("building", sort=False)
    table = grouped.agg(together).reset_index()
    return table[[column.name for column in BUILDING_COLUMNS]]


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


_UNITS: Final = (
    ("sim", "simulation unit of impulse: sim mass x sim unit / s"),
    ("sim mass", "simulation unit of mass"),
    ("sim units/s", "simulation units of length per second; 4 units are 1 m"),
)


def write_blast(blast: BlastTables, path: str | Path, max_rows_per_sheet: int = EXCEL_ROWS) -> Path:
    """Write a workbook with the sheets `Run`, `Structures`, `Modules`, `Collisions`, `Columns`.

    Args:
        path: The file, with the suffix `.xlsx`; an existing one is replaced.
        max_rows_per_sheet: The most rows of a table on one sheet, its header included.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
        ValueError: If `max_rows_per_sheet` is less than 2 or more than Excel allows.
    """
    tables = (
        SheetTable("Structures", *structures_in_pa_s(blast.structures, blast.load_unit)),
        SheetTable("Modules", *modules_in_pa_s(blast.modules, blast.load_unit)),
        SheetTable("Collisions", blast.collisions, COLLISION_COLUMNS),
    )
    return write_workbook(
        blast.run_record, tables, path, units=_UNITS, max_rows_per_sheet=max_rows_per_sheet
    )
