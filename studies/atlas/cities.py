"""Streets of a city of equal blocks, beside what others computed.

A thesis at the Technion (repository ofekSro/thesis-compare on GitHub; solver Viper::Blast, cells of
0.15 m) has 96 cities of square blocks: peaks of the overpressure on the floor of the street with
the charge over those of open ground. They are means over slices of 0.5 m across half of the street,
smoothed over 2.5 m. The largest one beyond the first crossing is in the file
outputs/check_results/street_anchors.csv, which was read in full. Gas dynamics runs some of them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.site import Scenario

_ROWS: Final = 2  # of blocks on each side of the street
_BACK_M: Final = 20.0  # the city behind the charge
_AHEAD_M: Final = 12.0  # beyond the farthest gauge
_ACROSS: Final = 3  # gauges across half of the street
_SMOOTH: Final = 3  # slices of 1 m
_UP_M: Final = 0.25


@dataclass(frozen=True)
class City:
    """A city of the thesis.

    Attributes:
        name: Its number there.
        at_crossing: Whether the charge stands on a crossing, else in the middle of a block's side.
        block_m: Side of the blocks.
        street_m: Width of the streets.
        high_m: Height of the blocks.
        tnt_kg: The charge, on the ground.
        peak: Largest peak there over that of open ground.
        at_m: Its distance from the charge.
    """

    name: str
    at_crossing: bool
    block_m: float
    street_m: float
    high_m: float
    tnt_kg: float
    peak: float
    at_m: float

    @property
    def first_m(self) -> float:
        """Distance from which the street is looked at: beyond the first crossing."""
        beside_m = 0.5 * self.street_m if self.at_crossing else self.street_m
        return self.block_m + beside_m


CITIES: Final = (
    City("73", False, 10.0, 8.0, 10.0, 250.0, 1.83, 22.25),
    City("77", False, 10.0, 12.0, 10.0, 250.0, 1.05, 47.75),
    City("81", True, 10.0, 8.0, 10.0, 250.0, 1.78, 31.25),
    City("89", False, 10.0, 5.0, 15.0, 250.0, 2.63, 18.75),
    City("93", True, 10.0, 5.0, 15.0, 250.0, 2.14, 14.75),
)
"""Cities of blocks of 10 m with 250 kg, copied from the table of the thesis."""


def street_peaks(city: City, cell_m: float, most_m: float) -> tuple[FloatArray, FloatArray]:
    """Return distances along the street, and the peak there over that of open ground."""
    along_m = np.arange(city.first_m, most_m + 0.5, 1.0)
    with_city, open_ground = (
        _peaks(_site(city, along_m, blocks), cell_m, len(along_m)) for blocks in (True, False)
    )
    ratio = with_city / open_ground
    kernel = np.ones(_SMOOTH) / _SMOOTH
    smooth = np.convolve(ratio, kernel, mode="valid")
    cut = (_SMOOTH - 1) // 2
    return along_m[cut:-cut], smooth


def rows(cell_m: float, most_m: float) -> Iterator[tuple[str, ...]]:
    """Yield one row per city: largest peak over open ground and its place, theirs and ours."""
    for city in CITIES:
        along_m, ratio = street_peaks(city, cell_m, most_m)
        best = int(ratio.argmax())
        yield (
            city.name,
            "on a crossing" if city.at_crossing else "beside a block",
            f"{city.street_m:g} m wide, {city.high_m:g} m high",
            f"{city.peak:.2f} at {city.at_m:.0f} m",
            f"{ratio[best]:.2f} at {along_m[best]:.0f} m",
            f"{ratio[best] / city.peak:.2f}",
        )


def _site(city: City, along_m: FloatArray, has_blocks: bool) -> Scenario:
    pitch_m, half_m = city.block_m + city.street_m, 0.5 * city.street_m
    far_m = float(along_m[-1]) + _AHEAD_M
    wide_m = _ROWS * pitch_m + half_m
    # Blocks along the street from the one nearest to the charge, which stands at (0, 0).
    first_m = half_m if city.at_crossing else -0.5 * city.block_m
    starts_m = first_m + pitch_m * np.arange(-np.ceil(_BACK_M / pitch_m), np.ceil(far_m / pitch_m))
    blocks = [
        (float(x), side * half_m + min(side, 0) * city.block_m + side * row * pitch_m)
        for x in starts_m
        for row in range(_ROWS)
        for side in (1, -1)
        if x >= -_BACK_M and x + city.block_m <= far_m
    ]
    if not has_blocks:
        blocks = [(-_BACK_M, wide_m - city.block_m)]
    structures = [
        {
            "kind": "ModularObstacle",
            "name": f"block{number}",
            "corner_m": [x + _BACK_M, y + wide_m],
            "rows": round(2.0 * (city.block_m if has_blocks else 0.5)),
            "columns": round(2.0 * (city.block_m if has_blocks else 0.5)),
            "height_m": city.high_m if has_blocks else 0.5,
            "protected": number == 0,
        }
        for number, (x, y) in enumerate(blocks)
    ]
    across_m = half_m * (np.arange(_ACROSS) + 0.5) / _ACROSS
    gauges = [
        {"name": f"g{i}_{k}", "position_m": [float(x) + _BACK_M, float(y) + wide_m, _UP_M]}
        for i, x in enumerate(along_m)
        for k, y in enumerate(across_m)
    ]
    document: dict[str, Any] = {
        "schema_version": 2,
        "name": f"city{city.name}",
        "site": {
            "width_m": _BACK_M + far_m,
            "height_m": 2.0 * wide_m,
            "air_height_m": city.high_m + 4.0,
        },
        "charge": [{"kind": "point", "position_m": [_BACK_M, wide_m], "tnt_kg": city.tnt_kg}],
        "structures": structures,
        "gauges": gauges,
    }
    return Scenario.from_document(document, f"city{city.name}")


def _peaks(site: Scenario, cell_m: float, slices: int) -> FloatArray:
    """Return the mean peak of each slice across half of the street, Pa."""
    found = GasBlast(site, engine=GasEngine(cell_m=cell_m)).run().gauges
    peaks = found["peak_pa"].to_numpy(dtype=float).reshape(slices, _ACROSS)
    return np.asarray(peaks.mean(axis=1))
