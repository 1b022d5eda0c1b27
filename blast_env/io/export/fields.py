"""The air of a blast as image data of VTK (.vti), at its end or in time (.pvd), for ParaView."""

import sys
import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasResult
from blast_env.files import make_folder, write_atomically, write_text
from blast_env.gas.engine import Recorders
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import FieldMap
from blast_env.gas.solver import Gas
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.values import whole_number

TIMES: Final = 40
"""Default of the most times of a series."""

MOST_SERIES_BYTES: Final = 1_000_000_000
"""Largest series before compression, bytes."""

_SOUND_M_S: Final = 340.0
_LEAST_TIMES: Final = 2
_MOST_TIMES: Final = 1000
_FASTEST: Final = 1  # of zlib's levels
_TYPES: Final = {"f4": "Float32", "u1": "UInt8"}


def field_recorders(grid: GasGrid) -> tuple[FieldMap, ...]:
    """Return the recorders that `write_field` needs, for `GasBlast.run(recorders=...)`."""
    return (FieldMap(grid),)


def write_field(result: GasResult, path: Path) -> None:
    """Write the peaks and impulses in all cells.

    Cell arrays: `peak_overpressure_pa`, `impulse_pa_s` (the peak specific impulse of the air, side
    on), `overpressure_pa` at the end of the run, and `is_solid`. x, y and z are those of the site,
    in metres. Solid cells have 0.

    Args:
        result: A blast that was run with `field_recorders`.
    """
    maps = [recorder for recorder in result.run.solver.recorders if isinstance(recorder, FieldMap)]
    if not maps:
        raise BlastEnvError("the blast has no field: run it with recorders=field_recorders")
    grid, found = result.run.grid, maps[0]
    peak_pa, impulse_pa_s = _with_opening(result, found)
    is_air = ~grid.solid
    fields: dict[str, NDArray[Any]] = {
        "peak_overpressure_pa": peak_pa,
        "impulse_pa_s": impulse_pa_s,
        "overpressure_pa": found.overpressure_pa,
    }
    blocks = {
        name: ("f4", _packed(np.where(is_air, values, 0.0).astype("f4")))
        for name, values in fields.items()
    }
    blocks["is_solid"] = ("u1", _packed(grid.solid.astype("u1")))
    _write_blocks(path, grid, blocks)


def _with_opening(
    result: GasResult, found: FieldMap
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return peaks and impulses with those of the spherical stage before the grid took over."""
    grid = result.run.grid
    opening = spherical_stage(result.run.charge, result.run.remap_radius_m)
    squares = [(grid.centres_m(axis) - opening.centre_m[axis]) ** 2 for axis in range(3)]
    distance_m = np.sqrt(
        squares[0][:, None, None] + squares[1][None, :, None] + squares[2][None, None, :]
    )
    # The running integral goes on from what the first stage left: the larger of its own maximum,
    # and of that plus what came on the grid.
    net_pa_s, largest_pa_s = opening.impulses_pa_s(distance_m)
    peak_pa = np.maximum(found.peak_pa, opening.peak_pa(distance_m))
    return peak_pa, np.maximum(largest_pa_s, net_pa_s + found.impulse_pa_s)


class FieldSeries:
    """Recorder of the overpressure in all cells, at times about equally far apart.

    A time is the end of the first step that reaches it. A run does not tell its end beforehand. So
    the recorder begins with short distances, and doubles them whenever there are too many times, of
    which it then keeps every second one.

    Args:
        grid: The grid.
        most_times: Most times that are kept; at least half of them are, of a run of as many steps.
    """

    def __init__(self, grid: GasGrid, most_times: int = TIMES) -> None:
        self._most = whole_number("times", most_times, _LEAST_TIMES, _MOST_TIMES)
        cells = grid.solid.size
        size = self._most * cells * np.dtype("f4").itemsize
        if size > MOST_SERIES_BYTES:
            raise BlastEnvError(
                f"a series of {self._most} times of {cells:,} cells has {size:,} bytes, must have "
                f"at most {MOST_SERIES_BYTES:,}: ask for fewer times or larger cells"
            )
        self._solid = grid.solid
        self._every_s = grid.cell_m / _SOUND_M_S
        self._frames: dict[int, tuple[float, bytes]] = {}

    def record(self, solver: Gas, step_s: float) -> None:  # noqa: ARG002
        """Keep the overpressure if a time is due."""
        # One frame in each interval, by its number. Doubled intervals halve the numbers, of which
        # the even ones are the first halves.
        number = int(solver.time_s / self._every_s)
        if number in self._frames:
            return
        layers = [solver.overpressure_in(2, layer) for layer in range(self._solid.shape[2])]
        pressure_pa = np.where(self._solid, 0.0, np.stack(layers, axis=2)).astype("f4")
        self._frames[number] = solver.time_s, _packed(pressure_pa)
        while len(self._frames) > self._most:
            self._every_s *= 2.0
            self._frames = {
                number // 2: frame for number, frame in self._frames.items() if number % 2 == 0
            }

    @property
    def frames(self) -> tuple[tuple[float, bytes], ...]:
        """Times since the detonation, s, with the overpressures as compressed blocks of VTK."""
        return tuple(self._frames.values())


def series_recorders(most_times: int) -> Recorders:
    """Return the recorders that `write_series` needs, for `GasBlast.run(recorders=...)`."""
    return partial(_series, most_times)


def _series(most_times: int, grid: GasGrid) -> tuple[FieldSeries, ...]:
    return (FieldSeries(grid, most_times),)


def write_series(result: GasResult, path: Path) -> None:
    """Write the overpressure in all cells over time.

    Files of image data, with `overpressure_pa` and `is_solid` as in `write_field`, go to a folder
    with the name of the collection without its suffix. The collection has their times, s. It is
    written last, so that it never names a file that is not there.

    Args:
        result: A blast that was run with `series_recorders`.
        path: The collection (.pvd).
    """
    found = [own for own in result.run.solver.recorders if isinstance(own, FieldSeries)]
    if not found:
        raise BlastEnvError("the blast has no series: run it with recorders=series_recorders(...)")
    grid, folder = result.run.grid, path.with_suffix("")
    make_folder(folder)
    solid = _packed(grid.solid.astype("u1"))
    entries = []
    for number, (time_s, pressure) in enumerate(found[0].frames):
        name = f"{number:04d}.vti"
        blocks = {"overpressure_pa": ("f4", pressure), "is_solid": ("u1", solid)}
        _write_blocks(folder / name, grid, blocks)
        entries.append(
            f'<DataSet timestep="{time_s!r}" group="" part="0" file="{folder.name}/{name}"/>'
        )
    write_text(
        path,
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
        + "\n".join(entries)
        + "\n</Collection>\n</VTKFile>\n",
    )


def _packed(values: NDArray[Any]) -> bytes:
    """Return cells (nx, ny, nz) as a compressed block of VTK: x runs fastest.

    Source: docs.vtk.org, VTK XML formats: number of blocks, size of each before compression, size
    of a last partial block or 0, compressed size of each, then the blocks.
    """
    content = values.tobytes(order="F")
    packed = zlib.compress(content, _FASTEST)
    return np.array([1, len(content), 0, len(packed)], dtype=np.uint64).tobytes() + packed


def _write_blocks(path: Path, grid: GasGrid, blocks: Mapping[str, tuple[str, bytes]]) -> None:
    """Write cell arrays, each a type and a block, as image data with a binary appendix.

    Source: docs.vtk.org, VTK XML formats: raw appended data.
    """
    extent = " ".join(f"0 {count}" for count in grid.shape)
    origin = " ".join(repr(float(value)) for value in grid.origin_m)
    spacing = " ".join([repr(float(grid.cell_m))] * 3)
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    entries, offset = [], 0
    for name, (kind, block) in blocks.items():
        entries.append(
            f'<DataArray type="{_TYPES[kind]}" Name="{name}" format="appended" offset="{offset}"/>'
        )
        offset += len(block)
    head = (
        f'<?xml version="1.0"?>\n<VTKFile type="ImageData" version="1.0" byte_order="{order}" '
        f'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<ImageData '
        f'WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}">\n<Piece '
        f'Extent="{extent}">\n<CellData Scalars="{next(iter(blocks))}">\n'
        + "\n".join(entries)
        + "\n</CellData>\n</Piece>\n</ImageData>\n"
        '<AppendedData encoding="raw">\n_'
    )
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        file.write(head.encode())
        file.writelines(block for _, block in blocks.values())
        file.write(b"\n</AppendedData>\n</VTKFile>\n")
