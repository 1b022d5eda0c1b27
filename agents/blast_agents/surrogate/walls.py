"""What the surrogate sees of a site: points on the walls that count, and what may stop a blast."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_agents.surrogate.relations import RELATIONS, relations
from blast_agents.surrogate.ways import SHARES, Ways
from blast_env.arrays import FloatArray, IntArray
from blast_env.calibration import kingery_bulmash
from blast_env.engines.contract import structure_response
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, Measure, standing
from blast_env.physics.scene import OUTWARDS, Charge
from blast_env.response.damage import BayDamage, TriangularLoads
from blast_env.scenario import AnyStructure, Scenario
from blast_env.scenario.facade import NamedBay
from blast_env.scenario.terraces import ground_below_m, is_open_below

_ALONG_M: Final = 1.0
_UP_M: Final = 1.5
"""Points on a wall are so far apart, or farther where there would be too many of them."""

MOST_POINTS: Final = 250
"""On all walls of a site, about. More cost time and say the same, for large walls are far away."""

_BEFORE_M: Final = 0.05
"""Points are this far before their wall, so that it does not stop what comes to them."""

_LEAST_HEIGHT_M: Final = 0.3
"""A charge on the ground begins so high: its middle."""

_LEAST_Z: Final = 0.2
"""A point that is nearer to the charge, m/kg^(1/3), has the reflected loads from there."""

_MOST_BYTES: Final = 2**26

SingleArray = NDArray[np.float32]

FEATURES: Final = 7 + 2 * SHARES
"""Numbers that a network is given about a point: geometry and ways."""

INPUTS: Final = FEATURES + RELATIONS
"""The same, and those about a solid and the point."""


@dataclass(frozen=True, eq=False)
class WallPoints:
    """Points that stand for the walls that count.

    Attributes:
        starts: The first point of each structure (structures,).
        points_m: (points, 3).
        outward: Where their wall looks (points, 2).
        area_m2: What each stands for (points,).
        to_edge_m: To the nearest upright edge of its wall (points,).
        to_roof_m: To the roof (points,).
    """

    starts: IntArray
    points_m: FloatArray
    outward: FloatArray
    area_m2: FloatArray
    to_edge_m: FloatArray
    to_roof_m: FloatArray

    @classmethod
    def on(cls, structures: Sequence[AnyStructure], air_m: float) -> "WallPoints":
        """Put points on structures: one a metre along a wall and 1.5 m of its height, or so.

        Args:
            structures: The structures.
            air_m: Height of those that have none.
        """
        heights_m = [each.height_m or air_m for each in structures]
        apart = _apart(structures, heights_m)
        tables = [_points(*each, apart) for each in zip(structures, heights_m, strict=True)]
        starts: IntArray = np.cumsum([0, *(len(each) for each in tables[:-1])])
        table = np.concatenate(tables) if tables else np.empty((0, 8))
        places_m, outward = (np.ascontiguousarray(each) for each in (table[:, :3], table[:, 3:5]))
        return cls(starts, places_m, outward, table[:, 5], table[:, 6], table[:, 7])


def _points(structure: AnyStructure, height_m: float, apart: float) -> FloatArray:
    """Return place, outward, area, and distance to edge and roof of points (points, 8)."""
    left, bottom, right, top = structure.rectangle_m
    rise_m = height_m - structure.base_m
    levels = max(1, round(rise_m / (_UP_M * apart)))
    z_m = structure.base_m + (np.arange(levels) + 0.5) * rise_m / levels
    rows = []
    for face in structure.faces:
        x_out, y_out = OUTWARDS[face]
        length_m = top - bottom if x_out else right - left
        number = max(1, round(length_m / (_ALONG_M * apart)))
        area_m2 = length_m * rise_m / (number * levels)
        for along_m in (np.arange(number) + 0.5) * length_m / number:
            if x_out:
                x_m, y_m = (left if x_out < 0 else right) + _BEFORE_M * x_out, bottom + along_m
            else:
                x_m, y_m = left + along_m, (bottom if y_out < 0 else top) + _BEFORE_M * y_out
            edge_m = min(along_m, length_m - along_m)
            rows += [(x_m, y_m, z, x_out, y_out, area_m2, edge_m, height_m - z) for z in z_m]
    return np.array(rows)


@dataclass(frozen=True, eq=False)
class Approach:
    """A charge and the walls that count: what of it no layout changes.

    Attributes:
        starts: The first point of each structure (structures,).
        ways: From the charge to the points.
        outward: Where their walls look (points, 2).
        scale_m: Cube root of the charge's mass: of lengths, m.
        on_empty: Features of each point where no barrier stands (points, FEATURES): geometry, open
            ways without and with the barrier.
        solids: Where structures stand for each point (solids, points, RELATIONS).
        log_impulse: Logarithm of Kingery and Bulmash's reflected impulse there, Pa s (points,).
        log_peak: Logarithm of their reflected overpressure there, Pa (points,).
        area_m2: What each point stands for (points,).
    """

    starts: IntArray
    ways: Ways
    outward: FloatArray
    scale_m: float
    on_empty: FloatArray
    solids: FloatArray
    log_impulse: FloatArray
    log_peak: FloatArray
    area_m2: FloatArray

    def points_of(self, structure: int) -> slice:
        """Return the points of a structure, by its number among the protected ones."""
        return slice(*[*self.starts.tolist(), len(self.area_m2)][structure : structure + 2])

    def features(self, barrier: FloatArray) -> FloatArray:
        """Return the features of all points behind a barrier (points, FEATURES).

        Args:
            barrier: Left, bottom, right, top and height of each piece, m (pieces, 5).
        """
        features = self.on_empty.copy()
        changed, shares = self.ways.behind(barrier)
        features[changed, FEATURES - SHARES :] = shares
        return features

    def relations(self, barrier: FloatArray) -> FloatArray:
        """Return where pieces stand for each point (pieces, points, RELATIONS).

        Args:
            barrier: As for `features`.
        """
        ways = self.ways
        found: FloatArray = relations(
            ways.start_m, ways.points_m, self.outward, self.scale_m, barrier
        )
        return found


class Memory:
    """Remembers arrays up to so many bytes; then it forgets all of them.

    Args:
        most_bytes: The bound.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes, self._bytes = most_bytes, 0
        self._kept: dict[Hashable, SingleArray] = {}

    def of(self, key: Hashable, make: Callable[[], SingleArray]) -> SingleArray:
        """Return the array of a key, made if it is not there; nobody may change it."""
        found = self._kept.get(key)
        if found is None:
            found = make()
            if self._bytes + found.nbytes > self._most_bytes:
                self._kept.clear()
                self._bytes = 0
            self._kept[key] = found
            self._bytes += found.nbytes
        return found


class SurrogateSite:
    """A scenario as the surrogate sees it.

    What begins above the ground, and on no terrace, stops nothing, as if it were not there: the
    surrogate never met it. Nor was it fitted to terraces: they are boxes as other structures are.

    Args:
        scenario: The scenario.
        most_bytes: Of what is remembered of pieces.

    Attributes:
        scenario: The scenario.
        memory: What surrogates remember of it.
        protected: Its protected structures.
        counts_peaks: Whether its objective counts peak overpressures.
        alternatives: The bays of its facades, where their response counts.
    """

    def __init__(self, scenario: Scenario, most_bytes: int = _MOST_BYTES) -> None:
        self.scenario = scenario
        self.memory = Memory(most_bytes)
        self.protected = tuple(each for each in scenario.structures if each.protected)
        self.counts_peaks = scenario.objective.needs_peaks
        self.alternatives = scenario.alternatives if scenario.objective.is_response else ()
        air_m = scenario.air_height_m
        self._solids = np.array(
            [
                [*each.rectangle_m, each.height_m or air_m]
                for each in scenario.structures
                if not is_open_below(each, scenario.structures)
            ]
        ).reshape(-1, 5)
        self._points = WallPoints.on(self.protected, air_m)
        self._approaches: dict[Charge, Approach] = {}
        self._triangular = {
            each.name: TriangularLoads(
                [bay for bay in self.alternatives if bay.structure == each.name]
            )
            for each in self.protected
        }
        self._responses: dict[tuple[str, frozenset[Element], float, float], float] = {}
        self._named: dict[frozenset[Element], tuple[NamedBay, ...]] = {}

    def approach(self, charge: Charge) -> Approach:
        """Return what comes from a charge to the protected structures on the empty site."""
        if charge not in self._approaches:
            self._approaches[charge] = self._approach_of(charge)
        return self._approaches[charge]

    def bay_damages(
        self, structure: str, peak_pa: float, impulse_pa_s: float
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays of a protected structure under one triangular load."""
        return self._triangular[structure].damages(peak_pa, impulse_pa_s)

    def response(
        self, structure: str, layout: Sequence[Element], peak_pa: float, impulse_pa_s: float
    ) -> float:
        """Return what counts of the response of a protected structure to one triangular load.

        Most layouts differ in what few structures get, so answers are kept.

        Args:
            structure: Its name.
            layout: The layout, whose measures harden bays.
            peak_pa: The peak.
            impulse_pa_s: The impulse.
        """
        measures = frozenset(each for each in layout if isinstance(each, Measure))
        asked = structure, measures, peak_pa, impulse_pa_s
        if asked not in self._responses:
            if measures not in self._named:
                self._named[measures] = self.scenario.named_bays(measures)
            bays = self.bay_damages(structure, peak_pa, impulse_pa_s)
            objective = self.scenario.objective
            self._responses[asked] = structure_response(bays, self._named[measures], objective)[0]
        return self._responses[asked]

    def barrier(self, layout: Sequence[Element]) -> FloatArray:
        """Return left, bottom, right, top and height of what a layout sets down, m (pieces, 5).

        Raises:
            LayoutError: If the catalogue has no such piece.
        """
        zone, air_m = self.scenario.zone, self.scenario.air_height_m
        terraces = [each for each in self.scenario.structures if each.carries]
        rows = []
        for each in standing(layout):
            rectangle_m, own_m = (
                zone.element_rectangle_m(each),
                zone.catalogue.variant(each).height_m,
            )
            top_m = ground_below_m(terraces, rectangle_m) + own_m if own_m else air_m
            rows.append([*rectangle_m, top_m])
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def _approach_of(self, charge: Charge) -> Approach:
        points = self._points
        start_m = np.array((*charge.position_m, max(charge.height_m, _LEAST_HEIGHT_M)))
        away_m = start_m - points.points_m
        distance_m = np.linalg.norm(away_m, axis=1)
        scale = float(np.cbrt(charge.tnt_kg))
        facing = (away_m[:, :2] * points.outward).sum(axis=1) / distance_m
        ways = Ways.between(start_m, points.points_m, charge.tnt_kg, self._solids)
        geometry = np.stack(
            (
                np.log(distance_m / scale),
                facing,
                np.abs(facing),
                points.points_m[:, 2] / scale,
                points.to_roof_m / scale,
                points.to_edge_m / scale,
                np.full(len(distance_m), np.log(scale)),
            ),
            axis=1,
        )
        met_m = np.maximum(distance_m, _LEAST_Z * scale)
        impulse = kingery_bulmash("reflected_impulse", met_m, charge.tnt_kg)
        peak = kingery_bulmash("reflected_overpressure", met_m, charge.tnt_kg)
        shares = ways.shares()
        return Approach(
            starts=points.starts,
            ways=ways,
            outward=points.outward,
            scale_m=scale,
            on_empty=np.hstack((geometry, shares, shares)),
            solids=relations(start_m, ways.points_m, points.outward, scale, self._solids),
            log_impulse=np.log(impulse),
            log_peak=np.log(peak),
            area_m2=points.area_m2,
        )


def _apart(structures: Sequence[AnyStructure], heights_m: Sequence[float]) -> float:
    """Return how many times as far apart points are as on a small site, not to be many."""
    area_m2 = 0.0
    for structure, height_m in zip(structures, heights_m, strict=True):
        left, bottom, right, top = structure.rectangle_m
        lengths_m = [
            top - bottom if OUTWARDS[face][0] else right - left for face in structure.faces
        ]
        area_m2 += height_m * sum(lengths_m)
    return float(max(1.0, (area_m2 / (_ALONG_M * _UP_M * MOST_POINTS)) ** 0.5))


def site_of(scenario: Scenario, most_bytes: int = _MOST_BYTES) -> SurrogateSite:
    """Return a scenario as the surrogate sees it.

    Args:
        scenario: The scenario.
        most_bytes: Of what is remembered of pieces.

    Raises:
        BlastEnvError: If nothing on it is protected.
    """
    site = SurrogateSite(scenario, most_bytes)
    if not site.protected:
        raise BlastEnvError(f"{scenario.name}: no structure is protected")
    return site
