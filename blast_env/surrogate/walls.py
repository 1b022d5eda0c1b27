"""Sites as the surrogate represents them: points on protected walls, and obstacles to the blast."""

from collections import Counter, OrderedDict
from collections.abc import Sequence
from functools import cached_property
from math import nan
from operator import attrgetter
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.record import structure_response
from blast_env.geometry import Element, Layout, Measure, Rectangle, standing
from blast_env.layout.build_site import barrier_outline, outlines
from blast_env.response.damage import TriangularLoads
from blast_env.response.levels import BayDamage
from blast_env.site import Scenario
from blast_env.site.blast_site import BlastSite, Charge
from blast_env.site.facade import BayComponents
from blast_env.site.structures import ground_below_m, is_open_below
from blast_env.surrogate.approach import Approach, curves
from blast_env.surrogate.hiding import Gaps
from blast_env.surrogate.load_arrays import SiteArrays
from blast_env.surrogate.neighbours import piece_traits
from blast_env.surrogate.pieces import Box, Memory
from blast_env.surrogate.points import CLOSE, WIDE, Spacing, WallPoints

_MOST_APPROACHES: Final = 16
"""Number of charges of a site kept for a fit, each of up to two megabytes."""


_STEP: Final = 0.02
"""Step of the logarithms of the loads by which bays respond."""


class SurrogateSite:
    """A scenario as the surrogate represents it.

    Structures that begin above the ground, and on no terrace, do not obstruct the blast: the fit of
    the surrogate contained none. It contained no terraces either, which are boxes like other
    structures.

    Args:
        scenario: The scenario.
        memory: The cache of pieces, which sites may share; by default a separate one.
        spacing: Of the points on walls, for loads on structures alone; by default what the
            objective needs, with points on each bay where their response counts.

    Attributes:
        scenario: The scenario.
        memory: The cache of pieces.
        protected: The protected structures.
        counts_peaks: Whether the objective needs peak overpressures.
        alternatives: The bays of the facades of protected structures, if the objective counts
            their response.
    """

    def __init__(
        self, scenario: Scenario, memory: Memory | None = None, spacing: Spacing | None = None
    ) -> None:
        self.scenario = scenario
        self.memory = Memory() if memory is None else memory
        self.protected = tuple(
            structure for structure in scenario.structures if structure.protected
        )
        self.counts_peaks = scenario.objective.needs_peaks
        names = {structure.name for structure in self.protected}
        responds = scenario.objective.is_response and spacing is None
        self.alternatives = tuple(
            bay for bay in (scenario.alternatives if responds else ()) if bay.structure in names
        )
        air_m = scenario.air_height_m
        self._solids = np.array(
            [
                [*box, structure.height_m or air_m]
                for structure in scenario.structures
                if not is_open_below(structure, scenario.structures)
                for box in structure.boxes_m
            ]
        ).reshape(-1, 5)
        self._spacing = spacing
        bays = [item.bay for item in scenario.named_bays()] if responds else []
        needed = spacing or (CLOSE if self.counts_peaks else WIDE)
        self._points = WallPoints.on(self.protected, air_m, needed, bays)
        self._approaches: OrderedDict[Charge, Approach] = OrderedDict()
        self._terraces = list(filter(attrgetter("carries"), scenario.structures))
        self._boxes: dict[Element, Box | None] = {}  # none of a measure
        of_structures = [bay.structure for bay in self.alternatives]
        self._bays = {
            name: slice(of_structures.index(name), of_structures.index(name) + count)
            for name, count in Counter(of_structures).items()
        }
        self._triangular = {
            name: TriangularLoads(self.alternatives[own]) for name, own in self._bays.items()
        }
        self._gaps = Gaps(self.protected, scenario)
        self._hidden: dict[Layout, list[bool]] = {}
        self._left: dict[frozenset[str], SurrogateSite] = {}
        self._named: dict[frozenset[Element], tuple[BayComponents, ...]] = {}

    @property
    def lets_go(self) -> bool:
        """Whether layouts may take structures away."""
        zone = self.scenario.build_zone
        return zone is not None and bool(zone.removable)

    def by_structures(
        self, layouts: Sequence[Sequence[Element]]
    ) -> "list[tuple[SurrogateSite, list[int]]]":
        """Return the sites with the structures that layouts leave, and the numbers of the layouts.

        There is at least one site.
        """
        if not (self.lets_go and layouts):
            return [(self, [*range(len(layouts))])]
        of_sites: dict[frozenset[str], list[int]] = {}
        for number, layout in enumerate(layouts):
            of_sites.setdefault(self.scenario.zone.taken_away(layout), []).append(number)
        return [(self._without(away), numbers) for away, numbers in of_sites.items()]

    def _without(self, away: frozenset[str]) -> "SurrogateSite":
        """Return the site without some structures, which are not protected."""
        if not away:
            return self
        if away not in self._left:
            scenario = self.scenario
            # The air stays as high as it is with all structures.
            site = scenario.site.model_copy(update={"air_height_m": scenario.air_height_m})
            left = tuple(own for own in scenario.structures if own.name not in away)
            zone = scenario.zone.model_copy(update={"removable": ()})
            changed = {"site": site, "structures": left, "build_zone": zone}
            own = scenario.model_copy(update=changed)
            self._left[away] = SurrogateSite(own, self.memory, self._spacing)
        return self._left[away]

    def hidden(self, layouts: Sequence[Sequence[Element]]) -> BoolArray | None:
        """Return which protected structures have no load behind layouts (layouts, structures).

        No air touches their assessed walls: other structures stand there, or pieces fill the gap
        before these. `None` where nothing can hide any.
        """
        if self._gaps.are_none:
            return None
        return np.array([self._hidden_by(layout) for layout in layouts])

    def _hidden_by(self, layout: Sequence[Element]) -> list[bool]:
        if not self._gaps.may_be_filled(self.boxes(layout)):
            return [False] * len(self.protected)
        barrier = tuple(sorted(standing(layout)))
        if barrier not in self._hidden:
            from blast_env.gas.engine import structures_without_air

            scenario = self.scenario
            structures = outlines(scenario)
            if barrier:
                structures += (barrier_outline(scenario, barrier),)
            site = BlastSite(
                site_m=scenario.site.rectangle_m,
                charge=Charge(scenario.site.rectangle_m.centre, 1.0),  # no wall depends on it
                structures=structures,
                air_height_m=scenario.air_height_m,
            )
            names = structures_without_air(site)
            self._hidden[barrier] = [own.name in names for own in self.protected]
        return self._hidden[barrier]

    @property
    def without_load(self) -> tuple[str, ...]:
        """The protected buildings without a load where no barrier stands."""
        hidden = self.hidden([()])
        if hidden is None:
            return ()
        names = [own.building_name for own in self.protected]
        loaded = {name for name, is_hidden in zip(names, hidden[0], strict=True) if not is_hidden}
        return tuple(dict.fromkeys(name for name in names if name not in loaded))

    @cached_property
    def areas_m2(self) -> FloatArray:
        """Area of the assessed walls of each protected structure (structures,)."""
        return np.add.reduceat(self._points.area_m2, self._points.starts)

    @cached_property
    def _parts(self) -> list[list[int]]:
        """The numbers of the protected parts of each building that has several."""
        parts: dict[str, list[int]] = {}
        for number, structure in enumerate(self.protected):
            parts.setdefault(structure.building_name, []).append(number)
        return [own for own in parts.values() if len(own) > 1]

    def of_buildings(
        self, impulse_pa_s: FloatArray, peak_pa: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the impulses on buildings in the place of those on their parts, and the peaks.

        Impulses are means over the area of the parts with a load. The peak on a part without one
        counts as 0 if others have one. All have the shape (layouts, structures).
        """
        if not self._parts:
            return impulse_pa_s, peak_pa
        impulse_pa_s, peak_pa = impulse_pa_s.copy(), peak_pa.copy()
        for own in self._parts:
            parts = impulse_pa_s[:, own]
            area_m2 = np.where(np.isnan(parts), 0.0, self.areas_m2[own])
            whole_m2 = area_m2.sum(axis=1)
            total = (area_m2 * np.nan_to_num(parts)).sum(axis=1)
            mean = np.divide(total, whole_m2, out=np.full(len(total), nan), where=whole_m2 > 0.0)
            impulse_pa_s[:, own] = mean[:, np.newaxis]
            is_part = np.isnan(parts) & (whole_m2 > 0.0)[:, np.newaxis]
            peak_pa[:, own] = np.where(is_part, 0.0, peak_pa[:, own])
        return impulse_pa_s, peak_pa

    @cached_property
    def arrays(self) -> SiteArrays:
        """The site as compiled code takes it."""
        return SiteArrays(self._points, self._solids, curves())

    def approach(self, charge: Charge) -> Approach:
        """Return the layout-independent data of a charge and the protected structures."""
        if charge not in self._approaches:
            self._approaches[charge] = Approach.between(charge, self._points, self._solids)
            if len(self._approaches) > _MOST_APPROACHES:
                self._approaches.popitem(last=False)
        self._approaches.move_to_end(charge)
        return self._approaches[charge]

    def traits(self, approach: Approach, barrier: FloatArray) -> FloatArray:
        """Return the traits of the pieces of a barrier against a charge (pieces, TRAITS)."""
        return piece_traits(approach.ways.start_m, approach.scale_m, self._solids, barrier)

    @property
    def columns(self) -> int:
        """Number of loads of a layout: on protected structures, then on bays that respond."""
        return len(self.protected) + len(self.alternatives)

    def with_structures(self, logs: FloatArray, powers: FloatArray) -> FloatArray:
        """Return the logarithms of the loads on structures before those on their bays.

        Args:
            logs: Those on the parts that have a load of their own (members, layouts, parts).
            powers: Exponents of the means over the walls (members,).

        Returns:
            Shape (members, layouts, columns).
        """
        points = self._points
        if not self.alternatives:
            return logs
        # The power mean over a structure is that of the ones over its parts.
        area_m2 = np.add.reduceat(points.area_m2, points.parts)
        first = np.searchsorted(points.parts, points.starts)
        own = powers[:, np.newaxis, np.newaxis]
        sums = np.add.reduceat(area_m2 * np.exp(own * logs), first, axis=2)
        of_structures = np.log(sums / np.add.reduceat(area_m2, first)) / own
        has_bays = np.array([structure.name in self._bays for structure in self.protected])
        counts = np.diff([*first.tolist(), len(area_m2)])
        return np.concatenate((of_structures, logs[:, :, np.repeat(has_bays, counts)]), axis=2)

    def bay_damages(
        self, structure: str, peak_pa: FloatArray, impulse_pa_s: FloatArray, peak_factor: float
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays of a protected structure under triangular loads.

        Args:
            structure: Its name.
            peak_pa: The peak overpressures on the bays of all structures (bays,).
            impulse_pa_s: Their impulses per area (bays,).
            peak_factor: Factor on peaks that makes them as sharp as in the open; the worse counts.
        """
        own = self._bays.get(structure)
        if own is None:
            return ()
        loads = _rounded(peak_pa[own]), _rounded(impulse_pa_s[own])
        return self._triangular[structure].damages(*loads, peak_factor)

    def response(
        self,
        structure: str,
        layout: Sequence[Element],
        peak_pa: FloatArray,
        impulse_pa_s: FloatArray,
        peak_factor: float,
    ) -> float:
        """Return the objective's response measure of a protected structure under such loads.

        Args:
            structure: As for `bay_damages`.
            layout: The layout, whose measures harden bays.
            peak_pa: As for `bay_damages`.
            impulse_pa_s: As for `bay_damages`.
            peak_factor: As for `bay_damages`.
        """
        if structure not in self._bays:
            return 0.0
        measures = frozenset(element for element in layout if isinstance(element, Measure))
        if measures not in self._named:
            self._named[measures] = self.scenario.named_bays(measures)
        bays = self.bay_damages(structure, peak_pa, impulse_pa_s, peak_factor)
        return structure_response(bays, self._named[measures], self.scenario.objective)[0]

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
                    (row, column), variant = element[:2], zone.catalogue.variant(element)
                    own_m = zone.cells_rectangle_m(row, column, variant.rows, variant.columns)
                    boxes[element] = self._box(own_m, variant.height_m)
        return [box for element in layout if (box := boxes[element]) is not None]

    def _box(self, rectangle_m: Rectangle, own_m: float | None) -> Box:
        """Return the rectangle and the top of a piece of a height, on its ground."""
        if not own_m:
            return (*rectangle_m, self.scenario.air_height_m)
        if self._terraces:
            own_m += ground_below_m(self._terraces, rectangle_m)
        return (*rectangle_m, own_m)


def _rounded(loads: FloatArray) -> FloatArray:
    """Return guesses of loads in steps of 2 %, finer than their errors: few loads to respond to."""
    found: FloatArray = np.exp(_STEP * np.rint(np.log(loads) / _STEP))
    return found


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


def site_of(
    scenario: Scenario, memory: Memory | None = None, spacing: Spacing | None = None
) -> SurrogateSite:
    """Return a scenario as the surrogate represents it.

    Args:
        scenario: The scenario.
        memory: As for `SurrogateSite`.
        spacing: As for `SurrogateSite`.

    Raises:
        BlastEnvError: If no structure is protected.
    """
    site = SurrogateSite(scenario, memory, spacing)
    if not site.protected:
        raise BlastEnvError(f"{scenario.name}: no structure is protected")
    return site
