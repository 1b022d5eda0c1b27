"""The air of a blast as image data of VTK (.vti), for ParaView."""

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasResult
from blast_env.files import write_atomically
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import FieldMap
from blast_env.gas.spherical_stage import spherical_stage

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
        path: The file.

    Raises:
        BlastEnvError: If it was run without the recorders, or the file cannot be written.
    """
    maps = [recorder for recorder in result.run.solver.recorders if isinstance(recorder, FieldMap)]
    if not maps:
        raise BlastEnvError("the blast has no field: run it with recorders=field_recorders")
    grid, found = result.run.grid, maps[0]
    peak_pa, impulse_pa_s = _with_opening(result, found)
    is_air = ~grid.solid
    arrays = {
        "peak_overpressure_pa": np.where(is_air, peak_pa, 0.0).astype("f4"),
        "impulse_pa_s": np.where(is_air, impulse_pa_s, 0.0).astype("f4"),
        "overpressure_pa": np.where(is_air, found.overpressure_pa, 0.0).astype("f4"),
        "is_solid": grid.solid.astype("u1"),
    }
    _write_image(path, grid.origin_m, grid.cell_m, arrays)


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
    net_pa_s, largest_pa_s = opening.impulses_pa_s(distance_m)
    peak_pa = np.maximum(found.peak_pa, opening.peak_pa(distance_m))
    return peak_pa, np.maximum(largest_pa_s, net_pa_s + found.impulse_pa_s)


def _write_image(
    path: Path, origin_m: tuple[float, float, float], cell_m: float, arrays: dict[str, Any]
) -> None:
    """Write arrays of cells (nx, ny, nz) as image data with a binary appendix.

    Source: docs.vtk.org, VTK XML formats: raw appended data, each block after its length.
    """
    shape = next(iter(arrays.values())).shape
    extent = " ".join(f"0 {count}" for count in shape)
    origin, spacing = (
        " ".join(f"{value!r}" for value in values)
        for values in (tuple(map(float, origin_m)), (float(cell_m),) * 3)
    )
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    entries, blocks, offset = [], [], 0
    for name, values in arrays.items():
        kind = _TYPES[values.dtype.str[1:]]
        entries.append(
            f'<DataArray type="{kind}" Name="{name}" format="appended" offset="{offset}"/>'
        )
        content = values.tobytes(order="F")  # x runs fastest
        blocks.append(np.uint64(len(content)).tobytes() + content)
        offset += len(blocks[-1])
    head = (
        f'<?xml version="1.0"?>\n<VTKFile type="ImageData" version="1.0" byte_order="{order}" '
        f'header_type="UInt64">\n<ImageData WholeExtent="{extent}" Origin="{origin}" '
        f'Spacing="{spacing}">\n<Piece Extent="{extent}">\n<CellData '
        f'Scalars="peak_overpressure_pa">\n' + "\n".join(entries) + "\n</CellData>\n</Piece>\n"
        '</ImageData>\n<AppendedData encoding="raw">\n_'
    )
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        file.write(head.encode())
        file.writelines(blocks)
        file.write(b"\n</AppendedData>\n</VTKFile>\n")
