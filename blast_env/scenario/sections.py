"""The sections of a scenario: site, charge, structures, gauges, simulation; not the build zone.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground, which is flat. Last comes where on a map or drawing the site lies.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import chain
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    StrictBool,
    StrictFloat,
    StrictInt,
    ValidationError,
    model_serializer,
)

from blast_env.errors import type_word
from blast_env.geometry import Rectangle
from blast_env.physics.parameters import PRESETS, SimulationParameters, preset, with_overrides
from blast_env.physics.scene import WALLS, Charge, WallName
from blast_env.response.facade import BAY_M, STOREY_M, Bay
from blast_env.scenario.problems import (
    Problem,
    ScenarioError,
    problems_from,
    unknown_key,
    unknown_name,
)
from blast_env.units import MODULE_SIDE_M
from blast_env.values import STEERING

Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(gt=0.0, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]

Height = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0)]
"""Of something that stands: a module at least."""

Count = Annotated[StrictInt, Field(ge=1, le=1000)]

VehicleMass = Annotated[StrictFloat, Field(ge=50.0, le=200_000.0)]
"""Of a vehicle, kg."""

Speed = Annotated[StrictFloat, Field(ge=1.0, le=300.0)]
"""Of a vehicle, km/h."""


def _check_text(text: str) -> str:
    """Refuse characters that would steer whatever shows the text; lines may end."""
    wrong = STEERING.search(text)
    if wrong is not None:
        raise ValueError(f"must not have the character {wrong[0]!r}")
    return text


FOR_PEOPLE: Final = AfterValidator(_check_text)
"""Annotation of what somebody wrote for people."""

Reason = Annotated[str, Field(min_length=1, max_length=200), FOR_PEOPLE]


def _check_name(name: str) -> str:
    """Refuse a name that could not be a part of a file name or of a column heading."""
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", name) is None:
        raise ValueError("must be 1 to 40 letters, digits, '_' or '-', the first one a letter")
    return name


Name = Annotated[str, AfterValidator(_check_name)]


class Section(BaseModel):
    """Base of all parts of a scenario: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Site(Section):
    """The simulated area; what leaves it is gone.

    Attributes:
        width_m: Its extent along x.
        height_m: Its extent along y.
        air_height_m: How high the simulated air is; without it, `Scenario.air_height_m` decides.
    """

    width_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
    height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
    air_height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)] | None = None

    @property
    def rectangle_m(self) -> Rectangle:
        """The whole site."""
        return Rectangle(0.0, 0.0, self.width_m, self.height_m)


class ChargeSource(Section):
    """Base of the places that a charge may come from.

    Attributes:
        tnt_kg: TNT-equivalent mass of a charge from this source.
        weight: How likely this source is, relative to the others.
        height_m: Height of the charge's centre above the ground; 0 lies on it.
    """

    tnt_kg: Annotated[StrictFloat, Field(ge=0.01, le=100_000.0)]
    weight: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0
    height_m: Coordinate = 0.0


class PointSource(ChargeSource):
    """A charge at a fixed point."""

    kind: Literal["point"] = "point"
    position_m: PointM

    @classmethod
    def at(cls, charge: Charge) -> Self:
        """Return the source of one charge.

        Raises:
            ValidationError: If the charge is out of bounds.
        """
        return cls(position_m=charge.position_m, tnt_kg=charge.tnt_kg, height_m=charge.height_m)

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the diagonal that the source spans."""
        return self.position_m, self.position_m

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The point as a line without a length."""
        return (self.segment_m,)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:  # noqa: ARG002
        """Return the point; nothing is drawn."""
        return self.position_m


class SegmentSource(ChargeSource):
    """A charge anywhere on a segment, each place as likely: a vehicle on a road."""

    kind: Literal["segment"]
    start_m: PointM
    end_m: PointM

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the segment."""
        return self.start_m, self.end_m

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines on which the charge may be."""
        return (self.segment_m,)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the segment."""
        share = rng.random()
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


class RectangleSource(ChargeSource):
    """A charge anywhere in a rectangle, each place as likely: a parking area."""

    kind: Literal["rectangle"]
    corner_m: PointM
    size_m: SizeM

    @property
    def rectangle_m(self) -> Rectangle:
        """The area that the charge may be in."""
        return Rectangle.from_corner(self.corner_m, self.size_m)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the rectangle."""
        x_share, y_share = rng.random(2)
        return (
            self.corner_m[0] + float(x_share) * self.size_m[0],
            self.corner_m[1] + float(y_share) * self.size_m[1],
        )


class Ground(Section):
    """A rectangle of the site."""

    corner_m: PointM
    size_m: SizeM

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle."""
        return Rectangle.from_corner(self.corner_m, self.size_m)


class Area(Ground):
    """A rectangle of the site for which something else holds, and why."""

    reason: Reason


class Entry(Section):
    """A part of the site's border through which a vehicle can drive.

    Attributes:
        start_m: One end of it.
        end_m: The other one, on the same side of the border.
    """

    start_m: PointM
    end_m: PointM

    @property
    def bounds_m(self) -> Rectangle:
        """The segment as a rectangle without a width."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))

    @property
    def length_m(self) -> float:
        """Length of a segment along a side of the site."""
        left, bottom, right, top = self.bounds_m
        return max(right - left, top - bottom)

    def side(self, site: Site) -> WallName | None:
        """Return the side of the site that the segment lies on; `None` if on none."""
        bounds, border = self.bounds_m, site.rectangle_m
        if not border.contains(bounds):
            return None
        sides: tuple[tuple[WallName, float, float], ...] = (
            ("west", bounds.right, border.left),
            ("east", border.right, bounds.left),
            ("south", bounds.top, border.bottom),
            ("north", border.top, bounds.bottom),
        )
        return next((side for side, high, low in sides if high <= low + 1e-9), None)

    def strip_m(self, site: Site, side: WallName, width_m: float) -> Rectangle:
        """Return the ground just inside the border, as deep as a vehicle is wide."""
        left, bottom, right, top = self.bounds_m
        border = site.rectangle_m
        return {
            "west": Rectangle(border.left, bottom, border.left + width_m, top),
            "east": Rectangle(border.right - width_m, bottom, border.right, top),
            "south": Rectangle(left, border.bottom, right, border.bottom + width_m),
            "north": Rectangle(left, border.top - width_m, right, border.top),
        }[side]


_SlowSize = Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
"""Less would lie between the places at which speeds are worked out."""


class SlowArea(Section):
    """Ground on which a vehicle can be no faster, and why: a speed table, a chicane.

    Attributes:
        corner_m: Lower left corner.
        size_m: Its size.
        speed_km_h: The largest speed on it.
        reason: What slows the vehicle.
    """

    corner_m: PointM
    size_m: tuple[_SlowSize, _SlowSize]
    speed_km_h: Speed
    reason: Reason

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle."""
        return Rectangle.from_corner(self.corner_m, self.size_m)


class Motion(Section):
    """How a vehicle drives: what decides its speed where it hits a barrier.

    Attributes:
        mass_kg: Its mass, with the load.
        max_speed_km_h: Its largest speed.
        acceleration_m_s2: How fast it gains speed, at any speed.
        entry_speed_km_h: Its speed when it has just entered the site; without it, the largest.
        grip: Coefficient of friction between tyres and ground, which limits speed in turns.
        slow: Ground on which it can be no faster.
    """

    mass_kg: VehicleMass
    max_speed_km_h: Speed
    acceleration_m_s2: Annotated[StrictFloat, Field(ge=0.1, le=20.0)]
    entry_speed_km_h: Annotated[StrictFloat, Field(ge=0.0, le=300.0)] | None = None
    grip: Annotated[StrictFloat, Field(ge=0.1, le=2.0)] = 1.0
    slow: Annotated[tuple[SlowArea, ...], Field(max_length=100)] = ()

    @property
    def entry_km_h(self) -> float:
        """Its speed when it has just entered the site, at most the largest."""
        entry = self.max_speed_km_h if self.entry_speed_km_h is None else self.entry_speed_km_h
        return min(entry, self.max_speed_km_h)


class VehicleSource(ChargeSource):
    """A charge in a vehicle, which goes off at one of the worst places that it can get to.

    Where it gets to depends on the layout: see `blast_env.scenario.vehicles`.

    Attributes:
        entries: Where it enters the site.
        width_m: Its width, and the side of the square of ground that it takes up.
        drivable: The ground on which it can drive; without any, all of the site.
        keep_outs: Ground that is closed to it all the same, and why.
        places: How many of the worst places count; the charge goes off at one after the other.
        apart_m: Least distance between two of them; without it, the width.
        motion: How it drives; without it, whatever stops vehicles stops it at any speed.
    """

    kind: Literal["vehicle"]
    entries: Annotated[tuple[Entry, ...], Field(min_length=1, max_length=100)]
    width_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=100.0)]
    drivable: Annotated[tuple[Ground, ...], Field(max_length=100)] = ()
    keep_outs: Annotated[tuple[Area, ...], Field(max_length=100)] = ()
    places: Annotated[StrictInt, Field(ge=1, le=100)] = 4
    apart_m: Length | None = None
    motion: Motion | None = None

    @model_serializer(mode="wrap")
    def _without_motion(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out a motion that is not there."""
        dump: dict[str, Any] = handler(self)
        return {key: dump[key] for key in dump if key != "motion" or dump[key] is not None}

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines along which it enters."""
        return tuple((entry.start_m, entry.end_m) for entry in self.entries)

    @property
    def least_apart_m(self) -> float:
        """Least distance between two of the places."""
        return self.width_m if self.apart_m is None else self.apart_m


PlaceSource = PointSource | SegmentSource | RectangleSource
"""A source whose places are known before any layout."""

AnySource = Annotated[PlaceSource | VehicleSource, Field(discriminator="kind")]


def _check_faces(faces: tuple[WallName, ...]) -> tuple[WallName, ...]:
    """Refuse a wall that is named twice, and return the walls in the usual order."""
    for wall in WALLS:
        if faces.count(wall) > 1:
            raise ValueError(f"must name each wall at most once, not {wall!r} twice")
    return tuple(wall for wall in WALLS if wall in faces)


Walls = Annotated[tuple[WallName, ...], Field(min_length=1, max_length=4)]

Storeys = Annotated[
    tuple[Annotated[StrictInt, Field(ge=1, le=200)], ...], Field(min_length=1, max_length=200)
]


class FacadePart(Section):
    """Bays that have other components than the rest of the facade.

    Attributes:
        walls: On which walls; on all unless given.
        storeys: In which storeys, from 1; in all unless given.
        glazing: Name of the component of their windows; as the facade's unless given.
        wall: Name of the component of their walls, in the same way.
    """

    walls: Walls = WALLS
    storeys: Storeys | None = None
    glazing: Name | None = None
    wall: Name | None = None

    def covers(self, bay: Bay) -> bool:
        """Return whether a bay is one of them."""
        return bay.wall in self.walls and (self.storeys is None or bay.storey in self.storeys)


class FacadeSection(Section):
    """What the walls of a structure are made of.

    Attributes:
        storey_m: Height of a storey.
        bay_m: Width of a bay; bays of a wall are made equally wide.
        glazing: Name of the component of its windows; none unless given.
        wall: Name of the component of its walls; none unless given.
        parts: Bays with other components; the last one that covers a bay counts.
    """

    storey_m: Annotated[StrictFloat, Field(ge=2.0, le=20.0)] = STOREY_M
    bay_m: Annotated[StrictFloat, Field(ge=0.5, le=50.0)] = BAY_M
    glazing: Name | None = None
    wall: Name | None = None
    parts: Annotated[tuple[FacadePart, ...], Field(max_length=100)] = ()

    def names(self) -> Iterator[tuple[str, str]]:
        """Yield where a component is named, and its name."""
        for key in ("glazing", "wall"):
            if (name := getattr(self, key)) is not None:
                yield key, name
            for index, part in enumerate(self.parts):
                if (name := getattr(part, key)) is not None:
                    yield f"parts[{index}].{key}", name


PASSAGE_M: Final = 2.0
"""What begins so high above the ground, or higher, stops no vehicle: a car passes below."""


class StructureSection(Section):
    """Base of the structures.

    Attributes:
        name: Name in tables and pictures; `barrier` is taken by the modules of a layout.
        corner_m: Lower left corner.
        protected: Whether the load on it counts.
        weight: How much its load counts among the protected structures.
        peak_weight: How much its peak overpressure counts, where the objective counts peaks; as
            much as `weight` says unless given.
        module_capacity: Impulse, simulation units, that a module bears before it is removed;
            without it modules never fail.
        height_m: Height of its top above the ground; without it, as high as the air.
        base_m: Height of its underside: above 0 it is a canopy, or a storey over a passage. For gas
            dynamics only.
        carries: Whether it is a terrace: solid from the ground, and barriers may stand on its top.
            For gas dynamics only.
        faces: The walls whose load counts; a wall is named by the side that it looks to.
        building: The building that the structure is a part of, where several make one; for
            people and tables, no result depends on it.
        facade: What its walls are made of; no load depends on it.
    """

    name: Name
    corner_m: PointM
    protected: StrictBool = False
    weight: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0
    peak_weight: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] | None = None
    module_capacity: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None
    height_m: Height | None = None
    base_m: Coordinate = 0.0
    carries: StrictBool = False
    faces: Annotated[
        tuple[WallName, ...],
        Field(min_length=1, max_length=len(WALLS)),
        AfterValidator(_check_faces),
    ] = WALLS
    building: Name | None = None
    facade: FacadeSection | None = None

    @property
    def lets_through(self) -> bool:
        """Whether people and vehicles pass below it: it begins at least `PASSAGE_M` up."""
        return self.base_m >= PASSAGE_M

    @property
    def building_name(self) -> str:
        """The building that it is a part of, or its own name where it is one by itself."""
        return self.building or self.name

    @property
    def counted_peak_weight(self) -> float:
        """How much its peak counts: `peak_weight`, or `weight` where that is not given."""
        return self.weight if self.peak_weight is None else self.peak_weight


class ModularObstacleSection(StructureSection):
    """A `ModularObstacle`: a rectangle of rows x columns modules."""

    kind: Literal["ModularObstacle"]
    rows: Count
    columns: Count

    @property
    def rectangle_m(self) -> Rectangle:
        """The footprint."""
        size = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size)


class ConcreteSquareSection(StructureSection):
    """A `ConcreteSquare`: as many rows as columns of modules."""

    kind: Literal["ConcreteSquare"]
    side_modules: Count

    @property
    def rows(self) -> int:
        """Rows of modules."""
        return self.side_modules

    @property
    def columns(self) -> int:
        """Columns of modules."""
        return self.side_modules

    @property
    def rectangle_m(self) -> Rectangle:
        """The footprint."""
        side = self.side_modules * MODULE_SIDE_M
        return Rectangle.from_corner(self.corner_m, (side, side))


AnyStructure = Annotated[
    ModularObstacleSection | ConcreteSquareSection, Field(discriminator="kind")
]


class GaugeSection(Section):
    """A place in the air where overpressure is recorded.

    Attributes:
        name: Name in tables and pictures.
        position_m: X, y, and height above the ground.
    """

    name: Name
    position_m: tuple[Coordinate, Coordinate, Coordinate]


def _check_preset(name: str) -> str:
    """Refuse the name of a preset that does not exist."""
    if name not in PRESETS:
        raise ScenarioError("preset", [Problem("", unknown_name("preset", name, PRESETS))])
    return name


def _check_overrides(overrides: dict[str, Any]) -> dict[str, Any]:
    """Refuse overrides of parameters that do not exist and values out of bounds."""
    groups = (_group_problems(group, values) for group, values in overrides.items())
    problems = tuple(chain.from_iterable(groups))
    if problems:
        raise ScenarioError("overrides", problems)
    return overrides


def _group_problems(group: str, values: object) -> tuple[Problem, ...]:
    """Return what is wrong with the overrides of one group of parameters."""
    field = SimulationParameters.model_fields.get(group)
    if field is None:
        return (unknown_key((group,), SimulationParameters.model_fields),)
    model = field.annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise TypeError(f"SimulationParameters.{group} is not a group of parameters")
    if not isinstance(values, Mapping):
        return (Problem(group, f"is {type_word(values)}, must be a table"),)
    try:
        # A group's values are independent of each other and all have defaults, so the overrides
        # can be checked alone and every complaint is about a key that was written.
        model.model_validate(values, strict=True)
    except ValidationError as error:
        return problems_from(error, model, (group,))
    return ()


class SimulationSection(Section):
    """The blast model's parameters: a preset by name, and what differs from it.

    Attributes:
        preset: Name of one of `blast_env.physics.parameters.PRESETS`.
        overrides: Nested like `SimulationParameters`: `{"air": {"spacing_units": 3.0}}`.
    """

    preset: Annotated[str, AfterValidator(_check_preset)] = "ballistic"
    overrides: Annotated[dict[str, Any], AfterValidator(_check_overrides)] = Field(
        default_factory=dict
    )

    @cached_property
    def parameters(self) -> SimulationParameters:
        """The preset with the overrides applied."""
        return with_overrides(preset(self.preset), self.overrides)


Degrees = Annotated[StrictFloat, Field(ge=-180.0, le=180.0)]


class Georeference(Section):
    """Base of the georeferences.

    Attributes:
        rotation_deg: From east, or the drawing's x axis, to the site's x axis, counterclockwise.
    """

    rotation_deg: Degrees = 0.0


class MapGeoreference(Georeference):
    """The place of a site on the Earth.

    The site's metres are those of a transverse Mercator projection around its lower left corner
    (WGS 84, scale 1): true lengths to within 1e-7 over 2 km, and true north there.

    Attributes:
        longitude_deg: Longitude of the site's lower left corner, WGS 84.
        latitude_deg: Its latitude.
        crs: Coordinate reference system in which layouts go back to the map, as pyproj reads it:
            `EPSG:4326` (longitude, latitude), `EPSG:25832`.
    """

    kind: Literal["map"] = "map"
    longitude_deg: Degrees
    latitude_deg: Annotated[StrictFloat, Field(ge=-89.0, le=89.0)]
    crs: Annotated[str, Field(min_length=1, max_length=500), FOR_PEOPLE] = "EPSG:4326"


class DrawingGeoreference(Georeference):
    """The place of a site in a drawing whose place on the Earth nobody said.

    Attributes:
        x_m: The site's lower left corner along the drawing's x axis, in metres.
        y_m: The same along y.
        metres_per_unit: Length of the drawing's unit: 0.001 for millimetres.
    """

    kind: Literal["drawing"] = "drawing"
    x_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    y_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    metres_per_unit: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0


AnyGeoreference = Annotated[MapGeoreference | DrawingGeoreference, Field(discriminator="kind")]


def buildings_of(structures: Iterable[AnyStructure]) -> dict[str, list[AnyStructure]]:
    """Return structures by the building that they are parts of, in their order."""
    buildings: dict[str, list[AnyStructure]] = {}
    for each in structures:
        buildings.setdefault(each.building_name, []).append(each)
    return buildings
