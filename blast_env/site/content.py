"""The content of a scenario file: all its sections and heights, without the checks between them."""

from collections.abc import Iterable, Iterator
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from pydantic import AfterValidator, Field, StrictInt

from blast_env.arrays import any_in_windows, counts_before
from blast_env.geometry import WALLS, Element, Rectangle, Wall
from blast_env.problems import Problem, extent
from blast_env.response.components import Component
from blast_env.sections import (
    FOR_PEOPLE,
    AnyGeoreference,
    GaugeSection,
    HashMark,
    Name,
    Section,
    Site,
)
from blast_env.site.objective import ObjectiveSection
from blast_env.site.parameters import SimulationParameters, SimulationSection
from blast_env.site.sources import AnySource, VehicleSource
from blast_env.site.structures import AnyStructure, ground_m, loaded_walls
from blast_env.site.zone import BuildZone, Surroundings, usable_cells
from blast_env.vehicles.vehicle import CrashPiece, Obstacles

if TYPE_CHECKING:
    from blast_env.vehicles.drive import VehicleGround


SCHEMA_VERSION: Final = 2
"""The version of the file format."""

MOST_NOTES: Final = 100
"""Most notes of an import in a scenario."""

MOST_NOTE: Final = 1000
"""Most characters of one of them."""

Sources = Annotated[tuple[AnySource, ...], Field(min_length=1, max_length=100)]
"""The sources of the charge."""


def _check_version(version: int) -> int:
    """Refuse a file of another version of the format."""
    if version != SCHEMA_VERSION:
        raise ValueError(f"must be {SCHEMA_VERSION}, the version of this release")
    return version


LEAST_AIR_HEIGHT_M: Final = 12.0
"""Least default height of the air."""

AIR_ABOVE_M: Final = 6.0
"""Air above the highest structure or barrier, so that the blast can pass over it."""

_MOST_GROUNDS: Final = 64
"""Most grounds of vehicles that a scenario keeps: a charge of another mass is another vehicle."""


class Content(Section):
    """The sections of a scenario; see `Scenario`."""

    schema_version: Annotated[StrictInt, AfterValidator(_check_version), HashMark.NEVER]
    name: Annotated[Name, HashMark.NEVER]
    description: Annotated[str, Field(max_length=2000), FOR_PEOPLE, HashMark.NEVER] = ""
    import_notes: Annotated[
        tuple[Annotated[str, Field(max_length=MOST_NOTE), FOR_PEOPLE], ...],
        Field(max_length=MOST_NOTES),
        HashMark.NEVER,
    ] = ()
    site: Site
    charge: Sources
    structures: Annotated[tuple[AnyStructure, ...], Field(min_length=1, max_length=100)]
    build_zone: BuildZone | None = None
    simulation: Annotated[SimulationSection, HashMark.NEVER] = SimulationSection()
    calibration: Name | None = None
    gauges: Annotated[tuple[GaugeSection, ...], Field(max_length=100), HashMark.IF_SET] = ()
    objective: Annotated[ObjectiveSection, HashMark.IF_SET] = ObjectiveSection()
    georeference: Annotated[AnyGeoreference | None, HashMark.NEVER] = None
    components: Annotated[
        dict[Name, Component], Field(max_length=100), HashMark.IF_SET, HashMark.IF_RESPONSE
    ] = Field(default_factory=dict)

    @cached_property
    def parameters(self) -> SimulationParameters:
        """The parameters of the particle model."""
        return self.simulation.parameters

    @cached_property
    def vehicles(self) -> tuple[VehicleSource, ...]:
        """The sources that are vehicles."""
        return tuple(source for source in self.charge if isinstance(source, VehicleSource))

    @property
    def charge_radius_m(self) -> float:
        """Radius of the charge's disc at the start, m."""
        return self.parameters.charge_radius_m

    @cached_property
    def air_height_m(self) -> float:
        """Height of the simulated air, m: that of `site`, or the default.

        The default is 12 m, or 6 m more than the highest structure or barrier if that is more.
        """
        if self.site.air_height_m is not None:
            return self.site.air_height_m
        return self.default_air_height_m

    @property
    def default_air_height_m(self) -> float:
        """The height of the air of a site that gives none."""
        tops_m = [structure.height_m or 0.0 for structure in self.structures]
        zone = self.build_zone
        barrier_m = None if zone is None else highest_top_m(zone, self.structures)
        return max(LEAST_AIR_HEIGHT_M, max(*tops_m, barrier_m or 0.0) + AIR_ABOVE_M)

    @property
    def height_notes(self) -> tuple[str, ...]:
        """The features of the scenario that an engine without heights ignores, in sentences."""
        zone = self.build_zone
        walls = any(structure.height_m is not None for structure in self.structures)
        walls |= zone is not None and bool(zone.items or zone.height_m)
        notes = []
        if walls:
            notes.append(
                "The model has no heights: every structure and module counts as endlessly high, so"
                " that nothing goes over it and barriers seem to protect more than they do."
            )
        if any(source.height_m > 0.0 for source in self.charge):
            notes.append("The model has no heights: the charge counts as if it lay on the ground.")
        if any(structure.faces != WALLS for structure in self.structures):
            notes.append("The load on all walls counts, not only on those that the scenario names.")
        if self.gauges:
            notes.append("The model has no air pressure: the scenario's gauges record nothing.")
        return tuple(notes)

    def surroundings(self, zone: BuildZone) -> Surroundings:
        """Return a build zone with all that decides its usable cells."""
        radius_m = self.charge_radius_m
        return Surroundings(zone, self.structures, self.charge, radius_m, self.site)

    @property
    def loaded_walls(self) -> tuple[Wall, ...]:
        """The walls of protected structures whose load counts."""
        return loaded_walls(self.structures)

    def vehicle_ground(
        self, source: VehicleSource, layout: Iterable[Element] = ()
    ) -> "VehicleGround":
        """Return a vehicle's ground without barriers and the structures that a layout removes."""
        zone = self.build_zone
        away = frozenset() if zone is None or not zone.removable else zone.taken_away(layout)
        # By identity first: the hash of a vehicle takes longer than the look.
        known = self._grounds_by_identity.get((id(source), away))
        if known is not None and known[0] is source:
            return known[1]
        key = source, away
        if key not in self._grounds:
            if len(self._grounds) >= _MOST_GROUNDS:
                self._grounds.clear()
            left = tuple(item for item in self.structures if item.name not in away)
            self._grounds[key] = self._ground_of(source, left)
        if len(self._grounds_by_identity) >= _MOST_GROUNDS:
            self._grounds_by_identity.clear()
        self._grounds_by_identity[id(source), away] = source, self._grounds[key]
        return self._grounds[key]

    @cached_property
    def _grounds(self) -> dict[tuple[VehicleSource, frozenset[str]], "VehicleGround"]:
        return {}

    @cached_property
    def _grounds_by_identity(
        self,
    ) -> dict[tuple[int, frozenset[str]], tuple[VehicleSource, "VehicleGround"]]:
        return {}

    @cached_property
    def obstacles_met(self) -> dict[Element, Obstacles]:
        """The obstacles that elements of layouts are, each found once; see `obstacles_of`."""
        return {}

    def _ground_of(
        self, source: VehicleSource, structures: tuple[AnyStructure, ...]
    ) -> "VehicleGround":
        from blast_env.vehicles.drive import VehicleGround  # most sites have no vehicle

        way = None if self.build_zone is None else self.build_zone.access_way
        closed: tuple[Rectangle, ...] = ()
        rated: tuple[CrashPiece, ...] = ()
        if way is not None and way.gate is not None:
            where, rating = way.gate.rectangle_m, way.gate.crash_rating
            if rating is None:
                closed = (where,)
            else:
                rated = (CrashPiece(where, rating, "the gate"),)
        standing_m = tuple(box for s in structures if not s.lets_through for box in s.boxes_m)
        return VehicleGround(
            source,
            self.site,
            standing_m,
            loaded_walls(structures),
            closed,
            rated,
            self.charge_radius_m,
        )


def outside_site(
    scenario: Content, key: str, description: str, rectangle: Rectangle
) -> Iterator[Problem]:
    """Yield a problem if a rectangle is not inside the site."""
    if not scenario.site.rectangle_m.contains(rectangle):
        site = extent(scenario.site.rectangle_m)
        yield Problem(key, f"{description} must lie inside the site ({site})")


def highest_top_m(zone: BuildZone, structures: Iterable[AnyStructure]) -> float | None:
    """Return the largest height of a barrier's top, m; `None` is the height of the air.

    It is the largest sum of an item's height and the highest ground on which it can stand.
    """
    grounds_m = highest_grounds_m(zone, structures)
    if not zone.items:
        return None if zone.height_m is None else zone.height_m + grounds_m[0]
    return max(item.height_m + ground for item, ground in zip(zone.items, grounds_m, strict=True))


def highest_grounds_m(zone: BuildZone, structures: Iterable[AnyStructure]) -> tuple[float, ...]:
    """Return the highest ground on which each item, or a single module, can stand, m.

    Charges and vehicles are ignored. An item that fits nowhere has 0.
    """
    structures = tuple(structures)
    zone_m = zone.rectangle_m
    has_terrace = any(
        box.overlaps(zone_m)
        for structure in structures
        if structure.carries
        for box in structure.boxes_m
    )
    return _grounds_m(zone, structures) if has_terrace else (0.0,) * max(len(zone.items), 1)


@lru_cache(maxsize=16)
def _grounds_m(zone: BuildZone, structures: tuple[AnyStructure, ...]) -> tuple[float, ...]:
    free = usable_cells(Surroundings(zone, structures, (), 0.0, None))
    ground = ground_m(structures, zone.boxes)
    variants = [variant for variant in zone.catalogue.variants if not variant.is_measure]
    found = [0.0] * max(len(zone.items), 1)
    for height_m in np.unique(ground[free]).tolist():  # the lowest first
        taken = counts_before(~free | (ground != height_m))
        for variant in variants:
            if not any_in_windows(taken, variant.rows, variant.columns).all():
                found[variant.item] = height_m
    return tuple(found)
