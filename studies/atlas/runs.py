"""Runs of the atlas: one file per group of scenes, so that a command goes on where it stopped."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import process_time
from types import MappingProxyType
from typing import Any, Final

import pandas as pd

from blast_env.documents import parse_json
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import make_folder, write_text
from blast_env.tables import Column, table_of
from blast_env.units import MODULE_SIDE_M
from studies.atlas.families import FAMILIES
from studies.atlas.scenes import Scene, loads_of

COARSE: Final = GasEngine(cell_m=MODULE_SIDE_M)
"""Cells of a twelfth of the scaled metre: 0.39 m for 100 kg."""

FINE: Final = GasEngine(cell_m=0.5 * MODULE_SIDE_M)
"""Halved cells."""

OF_A_ROUND: Final = MappingProxyType(
    {"shadow": 4, "rows": 2, "tee": 2, "open": 2, "near": 2, "beyond": 2, "yard": 4}
)
"""Groups of a round of families whose groups have few blasts; one of the others."""

_CHECKED: Final = (0, 5, 2)  # families of a round on halved cells; the last one in every other
_DIGITS: Final = 2


def rounds(names: Sequence[str], count: int) -> Iterator[tuple[str, int, bool]]:
    """Yield family, group and whether it runs on halved cells, families in turn.

    Each round runs a group of two or three families on halved cells too, without the other
    obstacles.
    """
    checked = [name for name in names if FAMILIES[name].obstacles or name == "shadow"]
    for number in range(count):
        for name in names:
            share = OF_A_ROUND.get(name, 1)
            for group in range(number * share, (number + 1) * share):
                yield name, group, False
        several = _CHECKED[: (2 + number % 2) * bool(checked)]
        for name in dict.fromkeys(checked[(number + more) % len(checked)] for more in several):
            yield name, number, True


def run_group(name: str, number: int, fine: bool, folder: Path) -> int:
    """Run the blasts of a group unless its file exists; return the number of blasts run."""
    path = _path(folder, name, number, fine)
    if path.exists():
        return 0
    make_folder(path.parent)
    scenes = FAMILIES[name].group(number)
    if fine:
        scenes = scenes[:2]
    engine = FINE if fine else COARSE
    found = [_with_loads(scene, engine) for scene in scenes]
    about = {"family": name, "group": number, "cell_m": engine.cell_m, "engine": engine.version}
    write_text(path, json.dumps({**about, "scenes": found}))
    return len(found)


def _with_loads(scene: Scene, engine: GasEngine) -> dict[str, Any]:
    """Run the blast of a scene; return the scene and its loads as plain data."""
    began_s = process_time()
    loads = loads_of(scene, engine)
    return {
        **scene.described(),
        "bays": [*loads.bays],
        "middles": loads.middles.round(4).tolist(),
        "normals": loads.normals.round(4).tolist(),
        "impulse": loads.impulse.round(_DIGITS).tolist(),
        "peak": loads.peak.round(_DIGITS).tolist(),
        "known": loads.known,
        "seconds": round(process_time() - began_s, 2),
    }


COLUMNS: Final = (
    Column("family", "", "family of the designed experiment", True),
    Column("group", "", "number of the group: a site without and with obstacles"),
    Column("scene", "", "number in the group; 0 is what the others are compared with"),
    Column("cell_m", "m", "side of the cells; a module is 0.5 m, the charge 216 kg"),
    Column("engine", "", "engine and its version", True),
    Column("boxes", "", "JSON: numbers, judged box, walls with loads, other boxes, height", True),
    Column("loads", "", "JSON: bays, middles, normals, impulses over the cube root, peaks", True),
)
"""One row per blast."""

_OF_LOADS: Final = ("bays", "middles", "normals", "impulse", "peak", "known", "seconds")


def restore(table: pd.DataFrame, folder: Path) -> int:
    """Write the groups of a table as files of a folder; return the number of blasts."""
    count = 0
    for engine in dict.fromkeys(table["engine"].tolist()):
        for cells in (COARSE, FINE):
            for group in groups_of(table[table["engine"] == engine], cells.cell_m):
                path = _path(folder, group["family"], group["group"], cells is FINE)
                if not path.exists():
                    make_folder(path.parent)
                    whole = {**group, "cell_m": cells.cell_m, "engine": engine}
                    write_text(path, json.dumps(whole))
                    count += len(group["scenes"])
    return count


def _path(folder: Path, name: str, number: int, fine: bool) -> Path:
    return folder / name / f"{number:04d}{'_fine' if fine else ''}.json"


def table_of_runs(folder: Path) -> tuple[pd.DataFrame, int]:
    """Return the table of a folder's blasts, and their number."""
    rows = []
    for fine in (False, True):
        for group in groups_in(folder, fine):
            for number, scene in enumerate(group["scenes"]):
                loads = {name: scene.pop(name) for name in _OF_LOADS}
                rows.append(
                    {
                        **{name: group[name] for name in ("family", "group", "cell_m", "engine")},
                        "scene": number,
                        "boxes": json.dumps(scene),
                        "loads": json.dumps(loads),
                    }
                )
    return table_of(rows, COLUMNS), len(rows)


def groups_of(table: pd.DataFrame, cell_m: float) -> Iterator[dict[str, Any]]:
    """Yield the groups of a table that were run on cells of a size."""
    chosen = table[table["cell_m"] == cell_m]
    for (family, _), own in chosen.groupby(["family", "group"]):
        rows = own.sort_values("scene")
        scenes = [
            {**parse_json(boxes), **parse_json(loads)}
            for boxes, loads in zip(rows["boxes"], rows["loads"], strict=True)
        ]
        yield {"family": family, "group": int(rows["group"].iloc[0]), "scenes": scenes}


def groups_in(folder: Path, fine: bool = False) -> Iterator[dict[str, Any]]:
    """Yield the groups that were run, by family and number."""
    for path in sorted(folder.glob("*/*.json")):
        if path.stem.endswith("_fine") == fine:
            yield parse_json(path.read_text("utf-8"))
