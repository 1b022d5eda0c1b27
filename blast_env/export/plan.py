"""What a layout file for other programs shows: everything on the site, in metres.

Coordinates are local: x to the right and y upwards from the lower left corner of the site.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any

from blast_env.geometry import Layout, Piece, Rectangle
from blast_env.physics.scene import Charge
from blast_env.physics.structure import ModularPart
from blast_env.scenario import (
    AnySource,
    AnyStructure,
    BuildZone,
    PointSource,
    RectangleSource,
    ScenarioField,
    VehicleSource,
    check_layout,
)
from blast_env.scenario.build_scene import barrier_outline
from blast_env.units import UNITS_PER_M

_DIGITS = 9  # of a metre: what is beyond is rounding

PlaceM = tuple[float, float]


class FeatureKind(StrEnum):
    """What a feature is; layers of a drawing are named after it."""

    SITE = "site"
    BUILD_ZONE = "build_zone"
    COST_AREA = "cost_area"
    KEEP_OUT = "keep_out"
    STRUCTURE = "structure"
    PROTECTED_STRUCTURE = "protected_structure"
    CHARGE_PLACE = "charge_place"
    CHARGE = "charge"
    BARRIER = "barrier"


@dataclass(frozen=True)
class Feature:
    """One thing on the site.

    Attributes:
        kind: What it is.
        places_m: One place of a point, two of a line, four of a rectangle: its corners,
            counterclockwise from the lower left one.
        name: For people: a structure's name, the reason of a keep-out, a module's identifier.
        properties: What else there is to say; plain values, units in the keys.
    """

    kind: FeatureKind
    places_m: tuple[PlaceM, ...]
    name: str
    properties: Mapping[str, str | float | bool] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LayoutPlan:
    """A layout on its site.

    Attributes:
        scenario: The scenario; its bundled name or path will do.
        layout: (row, column) of each module, or the pieces; their order is kept.
        charge: The charge that the layout was made for; `None` where it is for all the places
            where the scenario may have one, or nobody knows.
        provenance: How the layout was made: anything that JSON can hold.

    Raises:
        LayoutError: If the layout does not fit the scenario.
    """

    scenario: ScenarioField = ScenarioField()
    layout: Layout  # type: ignore[misc]  # a scenario has no default
    charge: Charge | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the layout."""
        object.__setattr__(self, "layout", check_layout(self.scenario, self.layout))

    @property
    def modules(self) -> tuple[ModularPart, ...]:
        """The modules, in the order of the layout, with the names that the blast's tables have."""
        zone = self.scenario.build_zone
        if zone is None:
            return ()
        return tuple(barrier_outline(zone, self.layout).build().parts)

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """Everything on the site; what lies on top comes last."""
        return tuple(self._features())

    def _features(self) -> Iterator[Feature]:
        scenario = self.scenario
        yield _area(FeatureKind.SITE, scenario.site.rectangle_m, scenario.name)
        if scenario.build_zone is not None:
            yield from _zone_features(scenario.build_zone)
        for structure in scenario.structures:
            kind = FeatureKind.STRUCTURE
            if structure.protected:
                kind = FeatureKind.PROTECTED_STRUCTURE
            yield _area(kind, structure.rectangle_m, structure.name, **_said_of(structure))
        for source in scenario.charge:
            yield from _charge_places(source)
        if self.charge is not None:
            name = f"charge of {self.charge.tnt_kg:g} kg TNT"
            places_m = (rounded_m(*self.charge.position_m),)
            yield Feature(FeatureKind.CHARGE, places_m, name, {"tnt_kg": self.charge.tnt_kg})
        zone = scenario.build_zone
        if zone is not None:
            yield from _piece_features(zone, self.layout) if zone.items else self._module_features()

    def _module_features(self) -> Iterator[Feature]:
        zone = self.scenario.zone
        height = {} if zone.height_m is None else {"height_m": zone.height_m}
        for part in self.modules:
            rectangle = part.rectangle.scaled(1.0 / UNITS_PER_M)
            yield _area(
                FeatureKind.BARRIER,
                rectangle,
                part.module_id,
                row=part.row,
                column=part.column,
                **height,
            )


def _piece_features(zone: BuildZone, layout: Layout) -> Iterator[Feature]:
    """Yield the pieces as wholes."""
    items = {item.name: item for item in zone.items}
    for piece in layout:
        if isinstance(piece, Piece):
            item = items[piece.item]
            yield _area(
                FeatureKind.BARRIER,
                zone.element_rectangle_m(piece),
                zone.piece_name(piece),
                **piece._asdict(),
                height_m=item.height_m,
                unit_cost=item.cost,
                stops_vehicles=item.stops_vehicles,
            )


def _said_of(structure: AnyStructure) -> dict[str, str | float]:
    """Return what there is to say of a structure beside its name."""
    said: dict[str, str | float] = {"weight": structure.weight}
    if structure.height_m is not None:
        said["height_m"] = structure.height_m
    if structure.building is not None:
        said["building"] = structure.building
    return said


def _zone_features(zone: BuildZone) -> Iterator[Feature]:
    """Yield the build zone and what else holds in parts of it."""
    conditions: dict[str, str | float] = {
        "stock": zone.stock,
        "clearance_m": zone.clearance_m,
    }
    if zone.items:
        conditions["items"] = ", ".join(f"{item.stock} {item.name}" for item in zone.items)
    else:
        conditions["module_cost"] = zone.module_cost
    if zone.budget is not None:
        conditions["budget"] = zone.budget
    if zone.access_way is not None:
        conditions["access_way"] = zone.access_way.description
    yield _area(FeatureKind.BUILD_ZONE, zone.rectangle_m, "build zone", **conditions)
    for area in zone.cost_areas:
        costs = area.model_dump(include={"module_cost", "cost_factor"}, exclude_none=True)
        yield _area(FeatureKind.COST_AREA, area.rectangle_m, area.reason, **costs)
    for keep_out in zone.keep_outs:
        yield _area(FeatureKind.KEEP_OUT, keep_out.rectangle_m, keep_out.reason)


def _charge_places(source: AnySource) -> Iterator[Feature]:
    """Yield where a charge may be: a point, a line or an area, or the entries of a vehicle."""
    name = f"charge of {source.tnt_kg:g} kg TNT may be here"
    properties = {"tnt_kg": source.tnt_kg, "weight": source.weight}
    if isinstance(source, RectangleSource):
        yield _area(FeatureKind.CHARGE_PLACE, source.rectangle_m, name, **properties)
        return
    if isinstance(source, VehicleSource):
        name = f"vehicle with {source.tnt_kg:g} kg TNT enters here"
        properties |= {"width_m": source.width_m}
    for ends_m in source.lines_m:
        line_m = ends_m[:1] if isinstance(source, PointSource) else ends_m
        places_m = tuple(rounded_m(*place) for place in line_m)
        yield Feature(FeatureKind.CHARGE_PLACE, places_m, name, properties)


def _area(kind: FeatureKind, rectangle: Rectangle, name: str, **properties: str | float) -> Feature:
    left, bottom, right, top = rectangle
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return Feature(kind, tuple(rounded_m(x, y) for x, y in corners), name, properties)


def rounded_m(x_m: float, y_m: float) -> PlaceM:
    """Return a place without what is but rounding."""
    return round(x_m, _DIGITS), round(y_m, _DIGITS)
