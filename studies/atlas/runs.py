"""Runs of the atlas: one file per group of scenes, so that a command goes on where it stopped."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import process_time
from typing import Any, Final

from blast_env.documents import parse_json
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import make_folder, write_text
from blast_env.units import MODULE_SIDE_M
from studies.atlas.families import FAMILIES
from studies.atlas.scenes import Scene, loads_of

COARSE: Final = GasEngine(cell_m=MODULE_SIDE_M)
"""Cells of a twelfth of the scaled metre: 0.39 m for 100 kg."""

FINE: Final = GasEngine(cell_m=0.5 * MODULE_SIDE_M)
"""Halved cells."""

_OF_A_ROUND: Final = {"shadow": 4}
_DIGITS: Final = 2


def rounds(names: Sequence[str], count: int) -> Iterator[tuple[str, int, bool]]:
    """Yield family, group and whether it runs on halved cells, families in turn.

    Each round runs one family's group on halved cells too, without the other obstacles.
    """
    for number in range(count):
        for name in names:
            share = _OF_A_ROUND.get(name, 1)
            for group in range(number * share, (number + 1) * share):
                yield name, group, False
        checked = names[number % len(names)]
        yield checked, number * _OF_A_ROUND.get(checked, 1), True


def run_group(name: str, number: int, fine: bool, folder: Path) -> int:
    """Run the blasts of a group unless its file exists; return the number of blasts run."""
    path = folder / name / f"{number:04d}{'_fine' if fine else ''}.json"
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


def groups_in(folder: Path, fine: bool = False) -> Iterator[dict[str, Any]]:
    """Yield the groups that were run, by family and number."""
    for path in sorted(folder.glob("*/*.json")):
        if path.stem.endswith("_fine") == fine:
            yield parse_json(path.read_text("utf-8"))
