"""Tables of a blast of gas dynamics: loads by face, module, wall, structure, building and gauge.

Impulses are peak specific impulses (`blast_env.gas.probes`) of cell faces, or their means
over the area. The `known` column states whether a load was known when the run ended
(`blast_env.gas.ending`).
"""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.gas.ending import AREA, is_known
from blast_env.gas.settings import FACE_NAMES, ROOF
from blast_env.geometry import WALLS
from blast_env.site.structures import StructureOutline
from blast_env.statistics import counted_parts, mean_over_area
from blast_env.tables import OF_MODULES, Column, as_types, table_of, texts
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.gas.engine import GasRun
    from blast_env.gas.probes import LoadTable

KNOWN_COLUMN: Final = Column("known", "", "whether the load was known when the run ended")
"""False for a load that could have grown after the end; see `blast_env.gas.ending`."""

_LOADS: Final = (
    Column("impulse_pa_s", "Pa s", "peak specific impulse, mean over the area"),
    Column("peak_pa", "Pa", "largest overpressure anywhere on it"),
    Column("arrival_s", "s", "time at which 1 kPa is reached first, from the detonation"),
    KNOWN_COLUMN,
)

FACE_COLUMNS: Final = (
    Column("structure", "", "name of the structure, or `barrier`", True),
    Column("face", "", "west, east, south, north, roof or underside", True),
    Column("module_id", "", "name of the module, made from its centre in metres", True),
    Column("x_m", "m", "centre, from the left border"),
    Column("y_m", "m", "centre, from the lower border"),
    Column("z_m", "m", "centre, above the ground"),
    *_LOADS,
)
"""One row per cell face."""

MODULE_COLUMNS: Final = (
    *OF_MODULES,
    Column("face", "", "west, east, south, north, roof or underside"),
    Column("area_m2", "m2", "area of that face over the whole height"),
    *_LOADS,
    Column("piece", "", "piece of a barrier that it is part of; empty if it is of none"),
)
"""One row per module face that touches air, or a piece that leans on it."""

WALL_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("face", "", "west, east, south, north, roof or underside"),
    Column("counts", "", "whether its load counts, if the structure is protected"),
    Column("area_m2", "m2", "its area that touches air or pieces"),
    *_LOADS,
)
"""One row per wall or roof of a structure, without the barrier."""

_OF_COUNTING_WALLS: Final = (
    Column("height_m", "m", "its height"),
    Column("faces", "", "the walls whose load counts"),
    Column("area_m2", "m2", "their area"),
    *_LOADS,
    Column("most_loaded_face", "", "the wall with the largest impulse"),
    Column("most_loaded_pa_s", "Pa s", "impulse on that wall"),
    Column("roof_impulse_pa_s", "Pa s", "impulse on the roof; NaN where it is as high as the air"),
)

STRUCTURE_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("protected", "", "whether its load counts"),
    Column("weight", "", "its weight among the protected structures"),
    *_OF_COUNTING_WALLS,
)
"""One row per structure; loads are on the counted walls."""

BUILDING_COLUMNS: Final = (
    Column("building", "", "name of the building, or of the structure that is one by itself"),
    Column("parts", "", "names of its structures"),
    Column("protected", "", "whether the load of one of them counts"),
    Column("stepped", "", "whether it has an oblique wall, whose loads are along its own normal"),
    *_OF_COUNTING_WALLS,
)
"""One row per building; loads are on the counted walls of its protected parts.

In a building without a protected part, all parts count.
"""

GAUGE_COLUMNS: Final = (
    Column("name", "", "name of the gauge"),
    Column("x_m", "m", "centre of its cell, from the left border"),
    Column("y_m", "m", "centre of its cell, from the lower border"),
    Column("z_m", "m", "centre of its cell, above the ground"),
    Column("arrival_s", "s", "time at which 1 kPa is reached first, from the detonation"),
    Column("peak_pa", "Pa", "largest overpressure"),
    Column("impulse_pa_s", "Pa s", "peak specific impulse"),
    KNOWN_COLUMN,
)
"""One row per gauge."""


def load_values(loads: "LoadTable") -> dict[str, FloatArray]:
    """Return the loads at the points of a table, by column."""
    names = [column.name for column in _LOADS if column is not KNOWN_COLUMN]
    return {name: getattr(loads, name) for name in names}


def face_table(run: "GasRun") -> "pd.DataFrame":
    """Return one row per cell face, structures and barrier; see `FACE_COLUMNS`."""
    import pandas as pd  # it takes a third of a second

    table = run.table
    names = np.array([outline.name for outline in run.site.structures], dtype=object)
    loads = load_values(run.loads)
    has_come = np.array([run.has_come(index) for index in range(len(names))])[table.structure]
    frame = pd.DataFrame(
        {
            "structure": names[table.structure],
            "face": np.array(FACE_NAMES, dtype=object)[table.face],
            "module_id": [
                run.site.structures[structure].module_name(row, column)
                for structure, row, column in zip(
                    table.structure, table.row, table.column, strict=True
                )
            ],
            "x_m": table.centre_m[:, 0],
            "y_m": table.centre_m[:, 1],
            "z_m": table.centre_m[:, 2],
            **loads,
            "row": table.row,
            "column": table.column,
            "share": table.share,
            "outward_x": table.outward[:, 0],
            "outward_y": table.outward[:, 1],
            "net_impulse_pa_s": run.loads.net_impulse_pa_s,
            "known": has_come & is_known(loads["impulse_pa_s"], run.loads.net_impulse_pa_s),
        }
    )
    return as_types(frame, {"structure": "str", "face": "str", "module_id": "str"})


def _grouped(run: "GasRun", faces: "pd.DataFrame", keys: list[str]) -> "pd.DataFrame":
    """Group faces: area means of impulses, largest peaks, first arrivals."""
    # By area: impulses and what is known are means, peaks the largest, arrivals the first.
    means = ["impulse_pa_s", "known"]
    weighed = faces.assign(**{mean: faces[mean] * faces["share"] for mean in means})
    groups: Any = weighed.groupby(keys, sort=False, observed=True)
    table: pd.DataFrame = groups.agg({"peak_pa": "max", "arrival_s": "min"})
    area = groups["share"].sum()
    table[means] = groups[means].sum().div(area, axis=0)
    table["known"] = table["known"] >= AREA
    return table.assign(area_m2=area * run.grid.cell_m**2).reset_index()


def module_table(run: "GasRun", faces: "pd.DataFrame") -> "pd.DataFrame":
    """Return one row per module face; see `MODULE_COLUMNS`.

    Args:
        faces: Its `face_table`.
    """
    table = _grouped(
        run, faces.assign(share=1.0), ["structure", "module_id", "row", "column", "face"]
    )
    outlines = run.site.structures
    # Centres of modules, from the corner of the grid of their structure.
    corners = {outline.name: outline.corner_m for outline in outlines}
    left, bottom = (table["structure"].map(lambda name, k=k: corners[name][k]) for k in (0, 1))
    table["x_m"] = left + (table["column"] + 0.5) * MODULE_SIDE_M
    table["y_m"] = bottom + (table["row"] + 0.5) * MODULE_SIDE_M
    of_pieces = {
        (outline.name, *cell): piece
        for outline in outlines
        for cell, piece in zip(outline.cells or (), outline.pieces or (), strict=False)
    }
    modules = zip(table["structure"], table["row"], table["column"], strict=True)
    table["piece"] = texts([of_pieces.get(module, "") for module in modules])
    return table[[column.name for column in MODULE_COLUMNS]]


def wall_table(run: "GasRun", faces: "pd.DataFrame") -> "pd.DataFrame":
    """Return one row per wall or roof of a structure; see `WALL_COLUMNS`.

    Args:
        faces: Its `face_table`, whose column `share` is the area ratio of real wall to face.
    """
    # The barrier has no walls of its own: its pieces stand for themselves.
    counting = {own.name: own.faces for own in run.site.structures if not own.is_barrier}
    own = faces[faces["structure"].isin(list(counting))]
    table = _grouped(run, own, ["structure", "face"])
    walls = zip(table["structure"], table["face"], strict=True)
    table["counts"] = [face in counting[structure] for structure, face in walls]
    return table[[column.name for column in WALL_COLUMNS]]


def structure_table(
    run: "GasRun",
    faces: "pd.DataFrame",
    buildings: Mapping[str, str] | None = None,
    stepped: Collection[str] = (),
) -> "pd.DataFrame":
    """Return one row per structure or building; see `STRUCTURE_COLUMNS`, `BUILDING_COLUMNS`.

    Args:
        faces: Same as for `wall_table`.
        buildings: The building of each structure, by name; `None` for one row per structure.
        stepped: The buildings with a wall that is a staircase.
    """
    together: dict[str, list[StructureOutline]] = {}
    for outline in run.site.structures:
        if not outline.is_barrier:
            owner = outline.name if buildings is None else buildings[outline.name]
            together.setdefault(owner, []).append(outline)
    rows = [
        {**_structure_row(run, faces, name, parts), "stepped": name in stepped}
        for name, parts in together.items()
    ]
    return table_of(rows, STRUCTURE_COLUMNS if buildings is None else BUILDING_COLUMNS)


def means_by_wall(faces: "pd.DataFrame", column: str) -> "pd.Series[float]":
    """Return the mean of a load over the area of each wall, by the name of the wall."""
    groups = faces.assign(load=faces[column] * faces["share"]).groupby("face", observed=True)
    means: pd.Series[float] = groups["load"].sum() / groups["share"].sum()
    return means


def _mean_load(faces: "pd.DataFrame", column: str) -> float:
    return mean_over_area(faces[column].to_numpy(), faces["share"].to_numpy())


def _structure_row(
    run: "GasRun", faces: "pd.DataFrame", name: str, parts: Sequence[StructureOutline]
) -> dict[str, object]:
    """Return the combined loads on the counted walls of structures."""
    counted = counted_parts(parts)
    structure, face = faces["structure"], faces["face"]
    counting = [(structure == part.name) & face.isin(part.faces) for part in counted]
    walls = faces[np.logical_or.reduce(counting)]
    roof = faces[structure.isin([part.name for part in counted]) & (face == ROOF)]
    # The mean over all counted walls may hide one that is hit hard: the most loaded one stands
    # beside it.
    of_walls = means_by_wall(walls, "impulse_pa_s")
    return {
        "structure": name,
        "building": name,
        "parts": " ".join(part.name for part in parts),
        "protected": any(part.protected for part in parts),
        "weight": sum(part.weight for part in counted),
        "height_m": max(part.height_m or run.site.air_height_m for part in parts),
        "faces": " ".join(wall for wall in WALLS if any(wall in part.faces for part in counted)),
        "area_m2": walls["share"].sum() * run.grid.cell_m**2,
        "impulse_pa_s": _mean_load(walls, "impulse_pa_s"),
        "peak_pa": walls["peak_pa"].max(),
        "arrival_s": walls["arrival_s"].min(),
        "known": bool((means_by_wall(walls, "known") >= AREA).all()),
        "most_loaded_face": of_walls.idxmax() if len(of_walls) else "",
        "most_loaded_pa_s": of_walls.max() if len(of_walls) else np.nan,
        "roof_impulse_pa_s": _mean_load(roof, "impulse_pa_s"),
    }


def gauge_table(run: "GasRun") -> "pd.DataFrame":
    """Return one row per gauge, in the order of the scenario; see `GAUGE_COLUMNS`."""
    import pandas as pd  # it takes a third of a second

    gauges = run.gauges
    if gauges is None:
        return table_of([], GAUGE_COLUMNS)
    loads = load_values(gauges)
    centres = np.array(run.grid.origin_m) + run.grid.cell_m * (gauges.cells + 0.5)
    frame = pd.DataFrame({"name": [gauge.name for gauge in run.site.gauges], **loads})
    frame[["x_m", "y_m", "z_m"]] = centres
    frame["known"] = run.gauges_known
    return frame[[column.name for column in GAUGE_COLUMNS]]
