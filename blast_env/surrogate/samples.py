"""Samples for a fit of the surrogate: loads of structures, with what its networks see of them."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, Piece
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.surrogate.approach import Approach
from blast_env.surrogate.layers import HalfArray, SingleArray
from blast_env.surrogate.neighbours import TRAITS
from blast_env.surrogate.network import IMPULSE_POWER, PEAK_POWER
from blast_env.surrogate.points import CLOSE, Spacing
from blast_env.surrogate.relations import RELATIONS, columns_of
from blast_env.surrogate.rooms import BYTE, Counts
from blast_env.surrogate.views import HUNDREDTHS, VIEW, solid_views
from blast_env.surrogate.walls import SurrogateSite, site_of

_BLOCK: Final = 2**24
"""Numbers of relations, or of views, that are copied at once."""

UNKNOWN: Final = "[]"
"""Loads at points that were not recorded."""

_LEAST_LOAD: Final = 1.0
"""Least load at a point before its logarithm, Pa s or Pa: where no wave came, it is 0."""

_CHARGE: Final = ("charge_x_m", "charge_y_m", "charge_height_m", "tnt_kg")


@dataclass(frozen=True, eq=False)
class Loads:
    """One kind of load on the structures of samples: impulses, Pa s, or peaks, Pa.

    Attributes:
        known: Logarithm of Kingery and Bulmash's load at all points (points,).
        target: Logarithm of the load by gas dynamics (samples,).
        at_points: Logarithm of the load by gas dynamics at all points, NaN where it is not known
            (points,).
        power: Exponent of the mean over the points of a structure.
    """

    known: FloatArray
    target: FloatArray
    at_points: SingleArray
    power: float


@dataclass(frozen=True, eq=False)
class Samples:
    """Loads of structures, with the features of the points on their walls.

    Attributes:
        features: Features of all points (points, FEATURES).
        relations: Relations of solids to points, ordered by sample, solid and point, in half
            precision: there are gigabytes of them (rows, RELATIONS).
        traits: Traits of pieces, ordered by sample and piece (pieces, TRAITS).
        views: Views of structures and of pieces from each column of points, in hundredths
            (columns, 2, VIEW).
        column: Index of the column of each point (points,).
        area_m2: Wall area represented by each point (points,).
        counts: Number of points of each sample (samples,).
        solids: Number of structures and pieces of each sample (samples,).
        structures: Number of structures of each sample, before its pieces (samples,).
        impulse: The impulses.
        peak: The peak overpressures.
        site: Index of the site (samples,).
        scenario: Name of the site, or "" (samples,).
        case: Index of the combination of site, structure and charge (samples,).
        layout: Index of the combination of site and layout (samples,).
    """

    features: FloatArray
    relations: HalfArray
    traits: FloatArray
    views: Counts
    column: IntArray
    area_m2: FloatArray
    counts: np.ndarray
    solids: np.ndarray
    structures: np.ndarray
    impulse: Loads
    peak: Loads
    site: np.ndarray
    scenario: np.ndarray
    case: np.ndarray
    layout: np.ndarray

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.counts)

    @property
    def pieces(self) -> IntArray:
        """Number of pieces of each sample (samples,)."""
        found: IntArray = self.solids - self.structures
        return found

    @classmethod
    def of(
        cls, blasts: pd.DataFrame, scenarios: dict[str, Scenario], spacing: Spacing = CLOSE
    ) -> "Samples":
        """Return the loads on protected structures of a table of `studies.blast_table`.

        Args:
            blasts: The table.
            scenarios: Scenarios by content hash; rows of others are omitted.
            spacing: Of the points. Tables have loads at those of `CLOSE`; at others none are known.

        Raises:
            BlastEnvError: If no row remains.
        """
        known = blasts["protected"] & blasts["scenario_hash"].isin(list(scenarios))
        rows = blasts[known & (blasts["impulse_pa_s"] > 0.0) & (blasts["peak_pa"] > 0.0)]
        if rows.empty:
            raise BlastEnvError("no load of a protected structure of a known scenario")
        # 1. The points of each structure: a sample. Relations are copied at once.
        samples = []
        related, seen = _Rows(np.dtype(np.float16), RELATIONS), _Rows(BYTE, 2 * VIEW)
        for sample, relations, views_of in _samples(rows, scenarios, spacing):
            samples.append(sample)
            related.add(relations)
            seen.add(views_of)
        features, traits, area_m2, solids, structures, impulses, peaks, columns = zip(
            *samples, strict=True
        )
        # 2. The samples in a row, and the cases in which layouts compete.
        place = rows[["scenario_hash", "structure", *_CHARGE]]
        counts = np.array([len(feature) for feature in features])
        unknown = [UNKNOWN] * len(rows)
        impulses_at, peaks_at = (
            _at_points(rows[name] if spacing == CLOSE else unknown, counts)
            for name in ("point_impulses_pa_s", "point_peaks_pa")
        )
        return cls(
            features=np.concatenate(features),
            relations=related.joined(),
            traits=np.concatenate([own.reshape(-1, TRAITS) for own in traits]),
            views=seen.joined().reshape(-1, 2, VIEW),
            column=_numbered(columns),
            area_m2=np.concatenate(area_m2),
            counts=counts,
            solids=np.array(solids),
            structures=np.array(structures),
            impulse=Loads(
                np.concatenate(impulses),
                np.log(rows["impulse_pa_s"].to_numpy()),
                impulses_at,
                IMPULSE_POWER,
            ),
            peak=Loads(
                np.concatenate(peaks),
                np.log(rows["peak_pa"].to_numpy()),
                peaks_at,
                PEAK_POWER,
            ),
            site=rows.groupby("scenario_hash").ngroup().to_numpy(),
            scenario=rows["scenario"].to_numpy(),
            case=place.groupby(list(place.columns)).ngroup().to_numpy(),
            layout=rows.groupby(["scenario_hash", "layout"]).ngroup().to_numpy(),
        )


class _Sample(NamedTuple):
    """The points of a structure in a blast; see `Samples` and `Loads`, without the relations."""

    features: SingleArray
    traits: SingleArray
    area_m2: FloatArray
    solids: int
    structures: int
    log_impulse: FloatArray
    log_peak: FloatArray
    column: IntArray


def _samples(
    rows: pd.DataFrame, scenarios: dict[str, Scenario], spacing: Spacing
) -> Iterator[tuple[_Sample, FloatArray, FloatArray]]:
    """Yield the sample of each row, its relations (solids, points, RELATIONS), and its views."""
    # 1. Each blast once, with the features of all points of its walls. Blasts on one site follow
    # each other, and thousands of sites would take gigabytes.
    site_at = lru_cache(maxsize=1)(lambda name: site_of(scenarios[name], spacing=spacing))
    wanted = ("scenario_hash", "layout", *_CHARGE, "structure")
    columns: list[list[Any]] = [rows[name].tolist() for name in wanted]
    of_blast = groupby(zip(*columns, strict=True), key=lambda row: row[:-1])
    for (scenario_hash, layout, *numbers), loads in of_blast:
        site = site_at(scenario_hash)
        x_m, y_m, height_m, tnt_kg = map(float, numbers)
        approach = site.approach(Charge((x_m, y_m), tnt_kg, height_m))
        barrier = site.barrier(elements(layout))
        features = approach.features(barrier).astype(np.float32)
        relations = np.concatenate((approach.solids, approach.relations(barrier)))
        traits = site.traits(approach, barrier).astype(np.float32)
        names = [structure.name for structure in site.protected]
        # 2. Of these, the points of each protected structure.
        for *_, structure in loads:
            own = approach.points_of(names.index(structure))
            sample = _Sample(
                features[own],
                traits,
                approach.area_m2[own],
                len(relations),
                len(approach.solids),
                approach.log_impulse[own],
                approach.log_peak[own],
                columns_of(approach.ways.points_m[own], approach.outward[own]),
            )
            yield sample, relations[:, own], _views(site, approach, barrier, own)


def _views(site: SurrogateSite, approach: Approach, barrier: FloatArray, own: slice) -> FloatArray:
    """Return the views of structures and pieces from columns of points (columns, 2, VIEW)."""
    ways = approach.ways
    where = ways.start_m, ways.points_m[own], approach.outward[own], approach.scale_m
    seen = np.stack(
        [solid_views(*where, solids) for solids in (site.arrays.solids, barrier)], axis=1
    )
    return np.rint(seen * HUNDREDTHS)


def _numbered(columns: Iterable[IntArray]) -> IntArray:
    """Return the columns of the points of all samples, numbered one after the other (points,)."""
    found, first = [], 0
    for own in columns:
        found.append(own + first)
        first += own[-1] + 1
    return np.concatenate(found)


class _Rows:
    """Numbers of samples one after the other, in blocks: there are gigabytes of them.

    Many small arrays would leave as much memory behind as they took, so they are copied early.

    Args:
        dtype: Type in which they are kept.
        width: Numbers of a row.
    """

    def __init__(self, dtype: np.dtype[Any], width: int) -> None:
        self._dtype, self._width = dtype, width
        self._blocks: list[NDArray[Any]] = []
        self._parts: list[NDArray[Any]] = []
        self._count = 0

    def add(self, numbers: FloatArray) -> None:
        """Add the rows of a sample."""
        self._parts.append(numbers.astype(self._dtype).reshape(-1, self._width))
        self._count += self._parts[-1].size
        if self._count >= _BLOCK:
            self._end_block()

    def joined(self) -> NDArray[Any]:
        """Return all of them (rows, width), and forget them."""
        self._end_block()
        rows = sum(map(len, self._blocks))
        found, first = np.empty((rows, self._width), self._dtype), 0
        self._blocks.reverse()
        while self._blocks:
            block = self._blocks.pop()
            found[first : first + len(block)] = block
            first += len(block)
        return found

    def _end_block(self) -> None:
        if self._parts:
            self._blocks.append(np.concatenate(self._parts))
        self._parts, self._count = [], 0


def _at_points(texts: Iterable[str], counts: IntArray) -> SingleArray:
    """Return the logarithms of the loads at points, NaN where they are not known (points,).

    Args:
        texts: The loads at the points of each sample, as JSON; `[]` if they are not known.
        counts: Number of points of each sample (samples,).

    Raises:
        BlastEnvError: If a sample has loads at another number of points.
    """
    found = np.full(counts.sum(), np.nan, dtype=np.float32)
    for text, end, count in zip(texts, np.cumsum(counts).tolist(), counts.tolist(), strict=True):
        if text == UNKNOWN:
            continue
        loads = np.array(json.loads(text), dtype=np.float64)
        if len(loads) != count:
            raise BlastEnvError(f"a row has loads at {len(loads)} points, must have {count}")
        found[end - count : end] = np.log(np.maximum(loads, _LEAST_LOAD))
    return found


def elements(text: str) -> tuple[Element, ...]:
    """Return the layout of a row of the table."""
    found = (tuple(load) for load in json.loads(text))
    return tuple(prediction if len(prediction) == 2 else Piece(*prediction) for prediction in found)
