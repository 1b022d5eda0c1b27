"""The blasts of a site, kept as a table of its own: what the data of the surrogate are made of.

Beside the loads on its structures a row has those at the points of the walls at which the surrogate
guesses. They cost nothing, and teach more than their mean.
"""

import json
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray, IntArray
from blast_env.evaluation import BlastEvaluator, BlastKey, LoadCase
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.geometry import Layout
from blast_env.parquet import SUFFIX, read_frame, write_table
from blast_env.provenance import versions
from blast_env.site import AnyStructure, Scenario
from blast_env.surrogate import WallPoints
from blast_env.surrogate.samples import UNKNOWN
from blast_env.tables import table_of
from studies.blast_table import (
    BLAST,
    COLUMNS,
    joined,
    load_row,
    named,
    text_at_points,
)
from studies.site_names import scenario_of

_TURNED_M2: Final = 1e6
"""Penalty on a point whose wall is turned away from a face, m2."""


class SiteBlasts(NamedTuple):
    """The blasts of a site that are wanted.

    Attributes:
        name: Name of the site; see `scenario_of`.
        blasts: Layouts and threats.
    """

    name: str
    blasts: tuple[tuple[Layout, LoadCase], ...]


class PointLoads(NamedTuple):
    """Loads at the points of the counted walls of a structure, NaN where no face is near.

    Attributes:
        impulse_pa_s: Mean impulse on the part of the wall that a point represents (points,).
        peak_pa: Largest overpressure there (points,).
    """

    impulse_pa_s: FloatArray
    peak_pa: FloatArray


def kept_rows(asked: SiteBlasts, engine: GasEngine, folder: Path) -> pd.DataFrame:
    """Run the blasts of a site that the folder does not have; return the rows of all of them.

    The table of the site is written whole or not at all, so an interrupted command goes on from
    there.

    Args:
        asked: The blasts.
        engine: Gas dynamics, with its cells.
        folder: Folder of the tables, one per site.

    Raises:
        BlastEnvError: As `GasBlast.run` and `write_table`, or if a table there has other columns.
    """
    path, site = path_of(folder, asked.name), scenario_of(asked.name)
    evaluator, known = BlastEvaluator(site, engine), dict([named(asked.name, site)])
    had = read_frame(path, COLUMNS) if path.exists() else table_of([], COLUMNS)
    # 1. The blasts that are missing.
    kept = {*had[list(BLAST)].itertuples(index=False, name=None)}
    keys = [evaluator.key(layout, threat) for layout, threat in asked.blasts]
    wanted = {
        _told(key): (key, threat) for key, (_, threat) in zip(keys, asked.blasts, strict=True)
    }
    missing = [blast for told, blast in wanted.items() if (site.content_hash, *told) not in kept]
    # 2. Their loads on structures, and at the points of protected ones.
    rows: list[dict[str, object]] = []
    for key, threat in missing:
        result = engine.blast(site, key.layout, 0, threat.charge).run()
        points = point_loads(result, site)
        rows += [
            load_row(known, key, load, *_texts(points.get(load.name)))
            for load in result.structure_loads
        ]
    # 3. The table with all of them.
    if rows:
        had = joined([had, table_of(rows, COLUMNS)])
        write_table(had, COLUMNS, {"blasts": len(kept) + len(missing), **versions()}, path)
    told = had[list(BLAST[1:])].itertuples(index=False, name=None)
    return had[[blast in wanted for blast in told]]


def _told(key: BlastKey) -> tuple[object, ...]:
    """Return what the columns `BLAST` tell of a blast, without its site."""
    (x_m, y_m), charge = key.charge.position_m, key.charge
    return json.dumps(key.layout), x_m, y_m, charge.height_m, charge.tnt_kg, key.seed, key.engine


def path_of(folder: Path, name: str) -> Path:
    """Return the table of a site in a folder."""
    return folder / f"{name.replace('/', '-')}{SUFFIX}"


def point_loads(result: GasResult, scenario: Scenario) -> dict[str, PointLoads]:
    """Return the loads at the points of each protected structure, by its name.

    Args:
        result: The finished blast.
        scenario: Its scenario, on whose walls `WallPoints` are.
    """
    protected = [structure for structure in scenario.structures if structure.protected]
    points, faces = WallPoints.on(protected, scenario.air_height_m), result.on_walls
    ends = [*points.starts[1:].tolist(), len(points.points_m)]
    return {
        structure.name: _at_points(faces, structure, points, slice(first, end))
        for structure, first, end in zip(protected, points.starts.tolist(), ends, strict=True)
    }


def _at_points(
    faces: pd.DataFrame, structure: AnyStructure, points: WallPoints, own: slice
) -> PointLoads:
    counted = (faces["structure"] == structure.name) & faces["face"].isin(structure.faces)
    walls = faces[counted]
    # 1. Each face belongs to the nearest point of a wall that is turned as it is.
    index, count = _nearest(walls, points, own), own.stop - own.start
    # 2. Impulses are means by area, peaks the largest.
    share = walls["share"].to_numpy()
    area = np.bincount(index, share, count)
    pa_s = np.bincount(index, share * walls["impulse_pa_s"].to_numpy(), count)
    peak_pa = np.full(count, np.nan)
    np.fmax.at(peak_pa, index, walls["peak_pa"].to_numpy())
    with np.errstate(invalid="ignore"):
        return PointLoads(pa_s / area, peak_pa)


def _nearest(walls: pd.DataFrame, points: WallPoints, own: slice) -> IntArray:
    """Return the index of the nearest point of the structure to each face (faces,)."""
    centres_m = walls[["x_m", "y_m", "z_m"]].to_numpy()
    outward = walls[["outward_x", "outward_y"]].to_numpy()
    away_m = centres_m[:, np.newaxis] - points.points_m[own]
    cosine = np.clip(outward @ points.outward[own].T, -1.0, 1.0)
    found: IntArray = ((away_m**2).sum(axis=2) + _TURNED_M2 * (1.0 - cosine)).argmin(axis=1)
    return found


def _texts(loads: PointLoads | None) -> tuple[str, str]:
    """Return impulses and peaks at points as JSON."""
    if loads is None:
        return UNKNOWN, UNKNOWN
    return text_at_points(loads.impulse_pa_s.tolist()), text_at_points(loads.peak_pa.tolist())
