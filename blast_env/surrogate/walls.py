"""Sites as the surrogate represents them: points on protected walls, and obstacles to the blast."""

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.calibration import kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.evaluation.record import structure_response
from blast_env.geometry import Element, Measure, Rectangle, WallLine, standing
from blast_env.response.damage import TriangularLoads
from blast_env.response.levels import BayDamage
from blast_env.site import AnyStructure, Scenario
from blast_env.site.blast_site import OUTWARDS, Charge
from blast_env.site.facade import BayComponents
from blast_env.site.terraces import ground_below_m, is_open_below
from blast_env.surrogate.pieces import Box, Memory
from blast_env.surrogate.relations import RELATIONS, solid_relations
from blast_env.surrogate.ways import SHARES, Ways
from blast_env.units import MODULE_SIDE_M

_ALONG_M: Final = 1.0
_UP_M: Final = 1.5
"""Spacing of points along and up a wall; larger where there would be too many points."""

MOST_POINTS: Final = 250
"""Approximate largest number of points on all walls of a site.

More points cost time and do not change the loads, since large walls are far away.
"""

_BEFORE_M: Final = 0.05
"""Distance of points in front of their wall, so that the wall does not obstruct their paths."""

_LEAST_HEIGHT_M: Final = 0.3
"""Least height of the centre of a charge above the ground."""

_LEAST_Z: Final = 0.2
"""Least scaled distance, m/kg^(1/3): nearer points have the reflected loads at this distance."""

_MOST_APPROACH_BYTES: Final = 2**28
"""Bound on the paths of the charges of a site: some 130 charges with the most points."""

FEATURES: Final = 7 + 2 * SHARES
"""Inputs of a network per point: geometry and path shares."""

INPUTS: Final = FEATURES + RELATIONS
"""Inputs per point, plus those per solid and point."""


@dataclass(frozen=True, eq=False)
class WallPoints:
    """Points that represent the protected walls.

    Attributes:
        starts: Index of the first point of each structure (structures,).
        points_m: Positions (points, 3).
        outward: Outward normals of their walls, in plan (points, 2).
        area_m2: Wall area represented by each point (points,).
        to_edge_m: Distance to the nearest vertical edge of the wall (points,).
        to_roof_m: Distance to the roof (points,).
    """

    starts: IntArray
    points_m: FloatArray
    outward: FloatArray
    area_m2: FloatArray
    to_edge_m: FloatArray
    to_roof_m: FloatArray

    @classmethod
    def on(cls, structures: Sequence[AnyStructure], air_m: float) -> "WallPoints":
        """Place points on structures, about one per metre of length and 1.5 m of height.

        Args:
            structures: The structures.
            air_m: Height of structures without a height of their own.
        """
        heights_m = [structure.height_m or air_m for structure in structures]
        apart = _apart(structures, heights_m)
        tables = [_points(*item, apart) for item in zip(structures, heights_m, strict=True)]
        starts: IntArray = np.cumsum([0, *(len(table) for table in tables[:-1])])
        table = np.concatenate(tables) if tables else np.empty((0, 8))
        places_m, outward = (np.ascontiguousarray(item) for item in (table[:, :3], table[:, 3:5]))
        return cls(starts, places_m, outward, table[:, 5], table[:, 6], table[:, 7])


def _points(structure: AnyStructure, height_m: float, apart: float) -> FloatArray:
    """Return position, outward normal, area, and distances to edge and roof (points, 8)."""
    # 1. Levels of points over the height; 2. along each wall, points in the middle of equal parts,
    # in the air before it.
    left, bottom, right, top = structure.rectangle_m
    rise_m = height_m - structure.base_m
    levels = max(1, round(rise_m / (_UP_M * apart)))
    z_m = structure.base_m + (np.arange(levels) + 0.5) * rise_m / levels
    rows = []
    for length_m, (x_out, y_out), line in _walls(structure):
        number = max(1, round(length_m / (_ALONG_M * apart)))
        area_m2 = length_m * rise_m / (number * levels)
        for along_m in (np.arange(number) + 0.5) * length_m / number:
            if line is not None:
                before_m = MODULE_SIDE_M if line.is_oblique else _BEFORE_M  # of the steps
                x_m, y_m = line.point_at(along_m) + before_m * np.array(line.normal)
            elif x_out:
                x_m, y_m = (left if x_out < 0 else right) + _BEFORE_M * x_out, bottom + along_m
            else:
                x_m, y_m = left + along_m, (bottom if y_out < 0 else top) + _BEFORE_M * y_out
            edge_m = min(along_m, length_m - along_m)
            rows += [(x_m, y_m, z, x_out, y_out, area_m2, edge_m, height_m - z) for z in z_m]
    return np.array(rows)


def _walls(
    structure: AnyStructure,
) -> Iterator[tuple[float, tuple[float, float], WallLine | None]]:
    """Yield length, outward normal and, of a polygon, line of each counted wall."""
    left, bottom, right, top = structure.rectangle_m
    if structure.footprint is not None:
        own = (wall for wall in structure.footprint.walls if wall.side in structure.faces)
        yield from ((wall.length_m, wall.normal, wall) for wall in own)
        return
    for face in structure.faces:
        yield top - bottom if OUTWARDS[face][0] else right - left, OUTWARDS[face], None


@dataclass(frozen=True, eq=False)
class Approach:
    """The layout-independent data of a charge and the protected walls.

    Attributes:
        starts: Index of the first point of each structure (structures,).
        ways: Paths from the charge to the points.
        outward: Outward normals of their walls, in plan (points, 2).
        scale_m: Scaling length: the cube root of the charge's mass in kg.
        on_empty: Features of each point on the empty site (points, FEATURES): geometry, then open
            path shares without and with the barrier, which are equal here.
        solids: Relations of each structure to each point (solids, points, RELATIONS).
        log_impulse: Logarithm of Kingery and Bulmash's reflected impulse, Pa s (points,).
        log_peak: Logarithm of their reflected overpressure, Pa (points,).
        area_m2: Wall area represented by each point (points,).
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
        """Return the slice of a structure's points, by its index among the protected ones."""
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
        """Return the relations of each piece to each point (pieces, points, RELATIONS).

        Args:
            barrier: As for `features`.
        """
        ways = self.ways
        found: FloatArray = solid_relations(
            ways.start_m, ways.points_m, self.outward, self.scale_m, barrier
        )
        return found


class SurrogateSite:
    """A scenario as the surrogate represents it.

    Structures that begin above the ground, and on no terrace, do not obstruct the blast: the fit of
    the surrogate contained none. It contained no terraces either, which are boxes like other
    structures.

    Args:
        scenario: The scenario.
        memory: The cache of pieces, which sites may share; by default a separate one.

    Attributes:
        scenario: The scenario.
        memory: The cache of pieces.
        protected: The protected structures.
        counts_peaks: Whether the objective needs peak overpressures.
        alternatives: The bays of the facades, if the objective counts their response.
    """

    def __init__(self, scenario: Scenario, memory: Memory | None = None) -> None:
        self.scenario = scenario
        self.memory = Memory() if memory is None else memory
        self.protected = tuple(
            structure for structure in scenario.structures if structure.protected
        )
        self.counts_peaks = scenario.objective.needs_peaks
        self.alternatives = scenario.alternatives if scenario.objective.is_response else ()
        air_m = scenario.air_height_m
        self._solids = np.array(
            [
                [*box, structure.height_m or air_m]
                for structure in scenario.structures
                if not is_open_below(structure, scenario.structures)
                for box in structure.boxes_m
            ]
        ).reshape(-1, 5)
        self._points = WallPoints.on(self.protected, air_m)
        self._approaches: OrderedDict[Charge, Approach] = OrderedDict()
        self._boxes: dict[Element, Box | None] = {}  # none of a measure
        self._triangular = {
            structure.name: TriangularLoads(
                [bay for bay in self.alternatives if bay.structure == structure.name]
            )
            for structure in self.protected
        }
        self._responses: dict[tuple[str, frozenset[Element], float, float], float] = {}
        self._named: dict[frozenset[Element], tuple[BayComponents, ...]] = {}

    def approach(self, charge: Charge) -> Approach:
        """Return the layout-independent data of a charge and the protected structures."""
        if charge not in self._approaches:
            made = self._approach_of(charge)
            self._approaches[charge] = made
            if len(self._approaches) * made.ways.weights.nbytes > _MOST_APPROACH_BYTES:
                self._approaches.popitem(last=False)
        self._approaches.move_to_end(charge)
        return self._approaches[charge]

    def bay_damages(
        self, structure: str, peak_pa: float, impulse_pa_s: float
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays of a protected structure under one triangular load."""
        return self._triangular[structure].damages(peak_pa, impulse_pa_s)

    def response(
        self, structure: str, layout: Sequence[Element], peak_pa: float, impulse_pa_s: float
    ) -> float:
        """Return the objective's response measure of a protected structure under a triangular load.

        Most layouts differ in the loads of few structures, so results are cached.

        Args:
            structure: Its name.
            layout: The layout, whose measures harden bays.
            peak_pa: The peak overpressure.
            impulse_pa_s: The impulse per area.
        """
        measures = frozenset(element for element in layout if isinstance(element, Measure))
        asked = structure, measures, peak_pa, impulse_pa_s
        if asked not in self._responses:
            if measures not in self._named:
                self._named[measures] = self.scenario.named_bays(measures)
            bays = self.bay_damages(structure, peak_pa, impulse_pa_s)
            objective = self.scenario.objective
            self._responses[asked] = structure_response(bays, self._named[measures], objective)[0]
        return self._responses[asked]

    def barrier(self, layout: Sequence[Element]) -> FloatArray:
        """Return left, bottom, right, top and height of a layout's pieces, m (pieces, 5).

        Modules side by side are one wall.

        Raises:
            LayoutError: If the catalogue has no such piece.
        """
        return np.array(self.boxes(layout), dtype=np.float64).reshape(-1, 5)

    def boxes(self, layout: Sequence[Element]) -> list[Box]:
        """Return the same piece by piece."""
        zone = self.scenario.zone
        if not zone.items:
            sides = [zone.element_rectangle_m(element) for element in standing(layout)]
            return [self._box(in_line, zone.height_m) for in_line in _in_lines(sides)]
        boxes = self._boxes
        for element in layout:
            if element not in boxes:
                boxes[element] = None
                if not isinstance(element, Measure):
                    height_m = zone.catalogue.variant(element).height_m
                    boxes[element] = self._box(zone.element_rectangle_m(element), height_m)
        return [box for element in layout if (box := boxes[element]) is not None]

    def _box(self, rectangle_m: Rectangle, own_m: float | None) -> Box:
        """Return the rectangle and the top of a piece of a height, on its ground."""
        if not own_m:
            return (*rectangle_m, self.scenario.air_height_m)
        terraces = [structure for structure in self.scenario.structures if structure.carries]
        return (*rectangle_m, ground_below_m(terraces, rectangle_m) + own_m)

    def _approach_of(self, charge: Charge) -> Approach:
        # 1. Distances, and the cosine of the angle between the ray and the normal in plan.
        points = self._points
        start_m = np.array((*charge.position_m, max(charge.height_m, _LEAST_HEIGHT_M)))
        away_m = start_m - points.points_m
        distance_m = np.linalg.norm(away_m, axis=1)
        scale = float(np.cbrt(charge.tnt_kg))
        facing = (away_m[:, :2] * points.outward).sum(axis=1) / distance_m
        ways = Ways.between(start_m, points.points_m, charge.tnt_kg, self._solids)
        # 2. What each point knows of itself, in scaled lengths (Hopkinson & Cranz).
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
        # 3. Loads in the open that the networks correct; the curves begin at a least scaled
        # distance.
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
            solids=solid_relations(start_m, ways.points_m, points.outward, scale, self._solids),
            log_impulse=np.log(impulse),
            log_peak=np.log(peak),
            area_m2=points.area_m2,
        )


def _in_lines(boxes: Sequence[Rectangle]) -> list[Rectangle]:
    """Return boxes with those side by side as one, along x or along y: as few as possible."""
    # One direction at a time: a corner belongs to either of its walls.
    return min((_lines(boxes, along) for along in (0, 1)), key=len)


def _lines(boxes: Sequence[Rectangle], along: int) -> list[Rectangle]:
    """Return boxes of one size with those side by side along an axis as one."""
    lines: list[Rectangle] = []
    for box in sorted(boxes, key=lambda box: (box[1 - along], box[along])):
        last = lines[-1] if lines else None
        if last is not None and last[1 - along] == box[1 - along] and last[2 + along] == box[along]:
            lines[-1] = Rectangle(*last[:2], *box[2:])
        else:
            lines.append(box)
    return lines


def _apart(structures: Sequence[AnyStructure], heights_m: Sequence[float]) -> float:
    """Return the factor on the spacing of points that keeps their number near `MOST_POINTS`."""
    # Points are per area: their number falls with the square of their distance.
    area_m2 = 0.0
    for structure, height_m in zip(structures, heights_m, strict=True):
        area_m2 += height_m * sum(length_m for length_m, *_ in _walls(structure))
    return float(max(1.0, (area_m2 / (_ALONG_M * _UP_M * MOST_POINTS)) ** 0.5))


def site_of(scenario: Scenario, memory: Memory | None = None) -> SurrogateSite:
    """Return a scenario as the surrogate represents it.

    Args:
        scenario: The scenario.
        memory: As for `SurrogateSite`.

    Raises:
        BlastEnvError: If no structure is protected.
    """
    site = SurrogateSite(scenario, memory)
    if not site.protected:
        raise BlastEnvError(f"{scenario.name}: no structure is protected")
    return site
