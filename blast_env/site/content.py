"""The content of a scenario file: all its sections, without the checks between them."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import AfterValidator, Field, StrictInt

from blast_env.geometry import Element, Rectangle, Wall
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
from blast_env.site.heights import default_air_height_m
from blast_env.site.objective import ObjectiveSection
from blast_env.site.parameters import SimulationParameters, SimulationSection
from blast_env.site.sources import AnySource, VehicleSource
from blast_env.site.structures import AnyStructure, loaded_walls
from blast_env.site.zone import BuildZone, Surroundings
from blast_env.vehicles.crash_rating import CrashPiece, Obstacles

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

    @property
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
        return default_air_height_m(self.structures, self.build_zone)

    def surroundings(self, zone: BuildZone) -> Surroundings:
        """Return a build zone with all that decides its usable cells."""
        radius_m = self.charge_radius_m
        return Surroundings(zone, self.structures, self.charge, radius_m, self.site)

    def structures_with(self, layout: Iterable[Element]) -> tuple[AnyStructure, ...]:
        """Return the structures that remain with a layout."""
        zone = self.build_zone
        if zone is None or not zone.removable:
            return self.structures
        away = zone.taken_away(layout)
        return tuple(structure for structure in self.structures if structure.name not in away)

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
            self._grounds[key] = self._ground_of(source, self.structures_with(layout))
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
