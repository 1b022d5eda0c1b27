"""A blast by gas dynamics for other programs: scene, histories and fields of pressure."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, suggestion
from blast_env.files import make_folder
from blast_env.tables import Column, table_of, write_csv

if TYPE_CHECKING:  # pandas and Numba take long to import
    import pandas as pd

    from blast_env.evaluation.engines.gas import GasResult
    from blast_env.gas.engine import Recorders

HISTORY_COLUMNS: Final = (
    Column("kind", "", "bay, gauge or piece"),
    Column("name", "", "its name; of a piece with its side"),
    Column("time_s", "s", "time since the detonation"),
    Column("overpressure_pa", "Pa", "overpressure, of a bay and a side the mean over it"),
    Column("impulse_pa_s", "Pa s", "its integral until then"),
)
"""One row per bay, gauge or side of a piece and step."""

_SIDE: Final = "_pa"


def history_table(result: "GasResult") -> "pd.DataFrame":
    """Return the histories of all bays, gauges and pieces; see `HISTORY_COLUMNS`."""
    import pandas as pd

    from blast_env.response.sdof import impulses

    frames = [
        pd.DataFrame(
            {
                "kind": kind,
                "name": name,
                "time_s": time_s,
                "overpressure_pa": pressure_pa,
                "impulse_pa_s": impulses(time_s, pressure_pa),
            }
        )
        for kind, name, time_s, pressure_pa in _histories(result)
    ]
    return pd.concat(frames, ignore_index=True) if frames else table_of([], HISTORY_COLUMNS)


def _histories(result: "GasResult") -> Iterator[tuple[str, str, Any, Any]]:
    """Yield the kind, the name, the times and the overpressures of each."""
    if result.bay_loads.bays:
        time_s, pressures_pa = result.bay_loads.histories
        for filled, pressure_pa in zip(result.bay_loads.bays, pressures_pa, strict=True):
            yield "bay", filled.bay.name, time_s, pressure_pa
    for gauge in result.run.site.gauges:
        history = result.history(gauge.name)
        times_s, values = history["time_s"].to_numpy(), history["overpressure_pa"].to_numpy()
        yield "gauge", gauge.name, times_s, values
    for name in result.pieces["piece"]:
        history = result.piece_history(str(name))
        times_s = history["time_s"].to_numpy(dtype=np.float64)
        for side in history.columns[1:]:
            values = history[side].to_numpy(dtype=np.float64)
            yield "piece", f"{name} {side.removesuffix(_SIDE)}", times_s, values


def _write_scene(result: "GasResult", path: Path) -> None:
    from blast_env.io.export.scene import write_blast_scene

    write_blast_scene(result, path)


def _write_field(result: "GasResult", path: Path) -> None:
    from blast_env.io.export.fields import write_field

    write_field(result, path)


def _write_series(result: "GasResult", path: Path) -> None:
    from blast_env.io.export.fields import write_series

    write_series(result, path)


_WRITERS: Final[Mapping[str, Callable[["GasResult", Path], object]]] = MappingProxyType(
    {
        ".glb": _write_scene,
        ".csv": lambda result, path: write_csv(history_table(result), path),
        ".vti": _write_field,
        ".pvd": _write_series,
    }
)
_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {".glb": "blast.glb", ".csv": "histories.csv", ".vti": "field.vti"}
)
"""Files of a folder: all but the series, which is large."""

BLAST_SUFFIXES: Final = tuple(_WRITERS)
"""Suffixes of the formats of a blast."""

SERIES_SUFFIX: Final = ".pvd"
"""Suffix of the collection of a series of fields in time."""


def blast_recorders(target: Path, most_times: int | None = None) -> "Recorders":
    """Return what must record a blast for its export: fields of pressure, if they are asked for.

    Args:
        target: As for `export_blast`.
        most_times: Most times of a series; 40 unless given.

    Raises:
        BlastEnvError: If the number is given for another target than a series.
    """
    suffix = target.suffix.lower()
    if most_times is not None and suffix != SERIES_SUFFIX:
        raise BlastEnvError(f"a number of times is for a series (.pvd): target is {str(target)!r}")
    if suffix in (".glb", ".csv"):
        return lambda _: ()
    from blast_env.io.export.fields import TIMES, field_recorders, series_recorders

    if suffix != SERIES_SUFFIX:
        return field_recorders
    return series_recorders(TIMES if most_times is None else most_times)


def export_blast(result: "GasResult", target: Path) -> list[Path]:
    """Write a blast in the format of the suffix, or in all formats but a series to a folder.

    Args:
        result: The blast, run with `blast_recorders(target)`.
        target: `.glb` (site, barrier and loads), `.csv` (histories), `.vti` (field of pressure) or
            `.pvd` (fields in time); otherwise a folder, created if it is missing.

    Returns:
        The files.

    Raises:
        BlastEnvError: If the suffix is unknown, or a file cannot be written.
    """
    suffix = target.suffix.lower()
    if suffix in _WRITERS and not target.is_dir():
        _WRITERS[suffix](result, target)
        return [target]
    check_blast_target(target)
    make_folder(target)
    paths = [target / name for name in _NAMES.values()]
    for path in paths:
        _WRITERS[path.suffix](result, path)
    return paths


def check_blast_target(target: Path) -> None:
    """Refuse an unusable target of `export_blast` before the blast.

    Raises:
        BlastEnvError: If the suffix is unknown.
    """
    suffix = target.suffix.lower()
    if suffix and suffix not in _WRITERS and not target.is_dir():
        raise BlastEnvError(
            f"{target}: suffix is {suffix!r}{suggestion(suffix, BLAST_SUFFIXES)}, must be "
            f"{', '.join(BLAST_SUFFIXES)}, or nothing for a folder"
        )
