"""The sections of a scenario but the build zone: site, charge, structures, gauges, simulation.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground, which is flat.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self

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
    model_validator,
)

from blast_env.errors import type_word
from blast_env.geometry import Cell, Rectangle
from blast_env.response.components import PaneSide
from blast_env.response.facade import BAY_M, STOREY_M, Bay
from blast_env.site.blast_site import WALLS, Charge, WallName
from blast_env.site.parameters import PRESETS, SimulationParameters, preset, with_overrides
from blast_env.site.presets import CHARGE_PRESETS, TNT_EQUIVALENTS, tnt_equivalent_kg
from blast_env.site.problems import (
    Problem,
    ScenarioError,
    problems_from,
    unknown_key,
    unknown_name,
)
from blast_env.units import MODULE_SIDE_M
from blast_env.values import plain_text

if TYPE_CHECKING:  # shapely takes a tenth of a second to import
    from blast_env.site.footprint import Footprint

Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(ge=1e-3, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]

Height = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0)]
"""Height of a structure or barrier, m: at least a module's side."""

Count = Annotated[StrictInt, Field(ge=1, le=1000)]

MOST_MODULES: Final = 250_000
"""Most modules of a scene: 250 m x 250 m of buildings, which add 2 s to a blast."""

VehicleMass = Annotated[StrictFloat, Field(ge=50.0, le=200_000.0)]
"""Mass of a vehicle, kg."""

Speed = Annotated[StrictFloat, Field(ge=1.0, le=300.0)]
"""Speed of a vehicle, km/h."""


FOR_PEOPLE: Final = AfterValidator(plain_text)
"""Annotation of texts for readers."""

Reason = Annotated[str, Field(min_length=1, max_length=200), FOR_PEOPLE]


def _check_name(name: str) -> str:
    """Refuse a name that is unsuitable for file names and column headings."""
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", name) is None:
        raise ValueError("must be 1 to 40 letters, digits, '_' or '-', the first one a letter")
    return name


Name = Annotated[str, AfterValidator(_check_name)]


class Section(BaseModel):
    """Base of all parts of a scenario: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, without the cached properties of the original."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied


class SparseSection(Section):
    """Base of sections that are saved without the missing values of some keys."""

    sparse: ClassVar[frozenset[str]]
    """The keys."""

    @model_serializer(mode="wrap")
    def _without_missing(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        dump: dict[str, Any] = handler(self)
        return {key: dump[key] for key in dump if dump[key] is not None or key not in self.sparse}


class Site(Section):
    """The simulated area, with open borders.

    Attributes:
        width_m: Its extent along x.
        height_m: Its extent along y.
        air_height_m: Height of the simulated air; the default of `Scenario.air_height_m` unless
            given.
    """

    width_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
    height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
    air_height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)] | None = None

    @property
    def rectangle_m(self) -> Rectangle:
        """The whole site."""
        return Rectangle(0.0, 0.0, self.width_m, self.height_m)


class ChargeSource(Section):
    """Base of the sources of a charge.

    Attributes:
        threat: Its name for readers, as `car`; no result depends on it. A preset of
            `blast_env.site.presets` gives the mass, if `tnt_kg` is missing.
        tnt_kg: TNT-equivalent mass of a charge from this source; a document may have `mass_kg` and
            `explosive` instead.
        weight: Probability of this source, relative to the others.
        height_m: Height of the charge's centre above the ground; at 0 it lies on the ground.
    """

    threat: Name | None = None
    tnt_kg: Annotated[StrictFloat, Field(ge=0.01, le=100_000.0)]
    weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] = 1.0
    height_m: Coordinate = 0.0

    @model_validator(mode="before")
    @classmethod
    def _with_mass(cls, given: Any) -> Any:
        """Add the mass of a preset, or that equivalent to another explosive."""
        if not isinstance(given, Mapping) or "tnt_kg" in given:
            return given
        rest = {key: value for key, value in given.items() if key not in ("mass_kg", "explosive")}
        preset_kg, _ = CHARGE_PRESETS.get(str(given.get("threat")), (None, ""))
        mass_kg, explosive = given.get("mass_kg"), given.get("explosive")
        if mass_kg is None or explosive is None:
            return given if preset_kg is None else {**given, "tnt_kg": preset_kg}
        if not isinstance(mass_kg, int | float) or explosive not in TNT_EQUIVALENTS:
            known = ", ".join(TNT_EQUIVALENTS)
            raise ValueError(f"must have a mass_kg in kg and an explosive of {known}")
        return {**rest, "tnt_kg": tnt_equivalent_kg(float(mass_kg), explosive)}


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
    """A charge uniformly distributed on a segment: a vehicle on a road."""

    kind: Literal["segment"]
    start_m: PointM
    end_m: PointM

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the segment."""
        return self.start_m, self.end_m

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines of the charge's places."""
        return (self.segment_m,)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the segment."""
        share = rng.random()
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


class Ground(Section):
    """A rectangle of the site."""

    corner_m: PointM
    size_m: SizeM

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle."""
        return Rectangle.from_corner(self.corner_m, self.size_m)


class RectangleSource(ChargeSource, Ground):
    """A charge uniformly distributed in a rectangle: a parking area."""

    kind: Literal["rectangle"]

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the rectangle."""
        x_share, y_share = rng.random(2)
        return (
            self.corner_m[0] + float(x_share) * self.size_m[0],
            self.corner_m[1] + float(y_share) * self.size_m[1],
        )


class Area(Ground):
    """A rectangle of the site under a special condition, with the reason."""

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
        """The segment as a rectangle of width 0."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))

    @property
    def length_m(self) -> float:
        """Length of a segment along a side of the site."""
        left, bottom, right, top = self.bounds_m
        return max(right - left, top - bottom)

    def side(self, site: Site) -> WallName | None:
        """Return the side of the site on which the segment lies; `None` if on none."""
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
"""Side of slow ground, m; a smaller one could lie between the places of the speed search."""


class SlowArea(Area):
    """Ground that limits a vehicle's speed, with the reason: a speed table, a chicane.

    Attributes:
        speed_km_h: Largest speed on it.
    """

    size_m: tuple[_SlowSize, _SlowSize]
    speed_km_h: Speed


class Motion(Section):
    """The motion of a vehicle, which decides its impact speed on barriers.

    Attributes:
        mass_kg: Its mass, with the load.
        max_speed_km_h: Its largest speed.
        acceleration_m_s2: Its acceleration at any speed.
        entry_speed_km_h: Its speed at entry to the site; the largest unless given.
        grip: Coefficient of friction between tyres and ground, which limits speed in turns.
        slow: Ground that limits its speed.
    """

    mass_kg: VehicleMass
    max_speed_km_h: Speed
    acceleration_m_s2: Annotated[StrictFloat, Field(ge=0.1, le=20.0)]
    entry_speed_km_h: Annotated[StrictFloat, Field(ge=0.0, le=300.0)] | None = None
    grip: Annotated[StrictFloat, Field(ge=0.1, le=2.0)] = 1.0
    slow: Annotated[tuple[SlowArea, ...], Field(max_length=100)] = ()

    @property
    def entry_km_h(self) -> float:
        """Its speed at entry to the site, at most the largest."""
        entry = self.max_speed_km_h if self.entry_speed_km_h is None else self.entry_speed_km_h
        return min(entry, self.max_speed_km_h)


class VehicleSource(ChargeSource, SparseSection):
    """A charge in a vehicle, which goes off at one of the worst places within its reach.

    The reach depends on the layout: see `blast_env.site.vehicles`.

    Attributes:
        entries: Its entries to the site.
        width_m: Its width, and the side of its square on the ground.
        drivable: The ground on which it can drive; the whole site unless given.
        keep_outs: Ground that is closed to it nevertheless, with reasons.
        places: Number of worst places; successive charges go off at successive ones.
        apart_m: Least distance between two of them; the width unless given.
        motion: Its motion; without one, barriers that stop vehicles stop it at any speed.
    """

    sparse: ClassVar = frozenset({"motion"})

    kind: Literal["vehicle"]
    entries: Annotated[tuple[Entry, ...], Field(min_length=1, max_length=100)]
    width_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=100.0)]
    drivable: Annotated[tuple[Ground, ...], Field(max_length=100)] = ()
    keep_outs: Annotated[tuple[Area, ...], Field(max_length=100)] = ()
    places: Annotated[StrictInt, Field(ge=1, le=100)] = 4
    apart_m: Length | None = None
    motion: Motion | None = None

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines of its entries."""
        return tuple((entry.start_m, entry.end_m) for entry in self.entries)

    @property
    def least_apart_m(self) -> float:
        """Least distance between two of the places."""
        return self.width_m if self.apart_m is None else self.apart_m


PlaceSource = PointSource | SegmentSource | RectangleSource
"""A source with places that do not depend on the layout."""

AnySource = Annotated[PlaceSource | VehicleSource, Field(discriminator="kind")]


def _check_faces(faces: tuple[WallName, ...]) -> tuple[WallName, ...]:
    """Refuse a repeated wall, and return the walls in the order of `WALLS`."""
    for wall in WALLS:
        if faces.count(wall) > 1:
            raise ValueError(f"must name each wall at most once, not {wall!r} twice")
    return tuple(wall for wall in WALLS if wall in faces)


Walls = Annotated[tuple[WallName, ...], Field(min_length=1, max_length=4)]

Storeys = Annotated[
    tuple[Annotated[StrictInt, Field(ge=1, le=200)], ...], Field(min_length=1, max_length=200)
]


class FacadePart(Section):
    """Bays with other components than the rest of the facade.

    Attributes:
        walls: Their walls; all unless given.
        storeys: Their storeys, from 1; all unless given.
        glazing: Name of the component of their windows; that of the facade unless given.
        wall: Name of the component of their wall panels; that of the facade unless given.
    """

    walls: Walls = WALLS
    storeys: Storeys | None = None
    glazing: Name | None = None
    wall: Name | None = None

    def covers(self, bay: Bay) -> bool:
        """Return whether a bay belongs to them."""
        return bay.wall in self.walls and (self.storeys is None or bay.storey in self.storeys)


class FacadeSection(Section):
    """The components of a structure's walls.

    Attributes:
        storey_m: Height of a storey; the ground floor has the remaining height of the building.
        storeys: Number of storeys of equal height, in the place of `storey_m`.
        bay_m: Width of a bay; bays of a wall are made equally wide.
        glazing: Name of the component of its windows; none unless given.
        pane_width_m: Width of their panes; by default that of the component.
        pane_height_m: Height of their panes; by default that of the component.
        wall: Name of the component of its walls; none unless given.
        parts: Bays with other components; the last one that covers a bay counts.
    """

    storey_m: Annotated[StrictFloat, Field(ge=2.0, le=20.0)] = STOREY_M
    storeys: Annotated[StrictInt, Field(ge=1, le=200)] | None = None
    bay_m: Annotated[StrictFloat, Field(ge=0.5, le=50.0)] = BAY_M
    glazing: Name | None = None
    pane_width_m: PaneSide | None = None
    pane_height_m: PaneSide | None = None
    wall: Name | None = None
    parts: Annotated[tuple[FacadePart, ...], Field(max_length=100)] = ()

    def of_side(self, side: WallName) -> FacadePart:
        """Return the part that is all bays of a side; an empty one if there is none."""
        own = (each for each in self.parts if each.walls == (side,) and each.storeys is None)
        return next(own, FacadePart(walls=(side,)))

    def with_side(self, side: WallName, **names: str | None) -> Self:
        """Return the facade with other components in all bays of a side.

        Args:
            side: The side.
            names: Names of components by `glazing` or `wall`; `None`: that of the facade.
        """
        before = self.of_side(side)
        own = before.model_copy(update=names)
        parts = [each for each in self.parts if each != before]
        parts += [own] if own.glazing or own.wall else []
        return self.model_copy(update={"parts": tuple(parts)})

    def names(self) -> Iterator[tuple[str, str]]:
        """Yield the key and the name of each component."""
        for key in ("glazing", "wall"):
            if (name := getattr(self, key)) is not None:
                yield key, name
            for index, part in enumerate(self.parts):
                if (name := getattr(part, key)) is not None:
                    yield f"parts[{index}].{key}", name


PASSAGE_M: Final = 2.0
"""Least height of a structure's underside at which vehicles pass below."""


class StructureSection(Section):
    """Base of the structures.

    Attributes:
        name: Name in tables and pictures; `barrier` is taken by the modules of a layout.
        protected: Whether the load on it counts.
        weight: Weight of its load among the protected structures.
        peak_weight: Weight of its peak overpressure, if the objective counts peaks; `weight` unless
            given.
        module_capacity: Impulse, simulation units, at which a module is removed; modules never fail
            unless given.
        height_m: Height of its top above the ground; the height of the air unless given.
        base_m: Height of its underside: above 0 it is a canopy, or a storey over a passage. For gas
            dynamics only.
        carries: Whether it is a terrace: solid from the ground, and barriers may stand on its top.
            For gas dynamics only.
        faces: The walls whose load counts; a wall is named by the side that it faces.
        building: Name of its building, if that has several structures, for tables; no result
            depends on it.
        title: Its name for readers, as on the map, for pictures and tables; no result depends on
            it.
        facade: The components of its walls; no load depends on it.
    """

    name: Name
    protected: StrictBool = False
    weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] = 1.0
    peak_weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] | None = None
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
    title: Annotated[str, Field(max_length=100), FOR_PEOPLE] = ""
    facade: FacadeSection | None = None

    @property
    def lets_through(self) -> bool:
        """Whether people and vehicles pass below it: its base is at least `PASSAGE_M` high."""
        return self.base_m >= PASSAGE_M

    @property
    def building_name(self) -> str:
        """Name of its building; the name of the structure if it has none."""
        return self.building or self.name

    @property
    def counted_peak_weight(self) -> float:
        """Weight of its peak: `peak_weight`, or `weight` unless given."""
        return self.weight if self.peak_weight is None else self.peak_weight

    @property
    def footprint(self) -> "Footprint | None":
        """Its polygon; `None` for a rectangle of modules."""
        return None

    @property
    def cells(self) -> tuple[Cell, ...] | None:
        """Rows and columns of its modules, row by row; `None` for all of its grid."""
        return None


class ModularObstacleSection(StructureSection):
    """A `ModularObstacle`: a rectangle of rows x columns modules."""

    kind: Literal["ModularObstacle"]
    corner_m: PointM
    rows: Count
    columns: Count

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return self.rows * self.columns

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """The footprint, as for every structure in rectangles of modules."""
        return (self.rectangle_m,)

    @property
    def rectangle_m(self) -> Rectangle:
        """The footprint."""
        size = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size)


class ConcreteSquareSection(StructureSection):
    """A `ConcreteSquare`: a square of modules."""

    kind: Literal["ConcreteSquare"]
    corner_m: PointM
    side_modules: Count

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return self.rows * self.columns

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """The footprint, as for every structure in rectangles of modules."""
        return (self.rectangle_m,)

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


Corners = Annotated[tuple[PointM, ...], Field(min_length=3, max_length=5000)]
"""Corners of a closed line."""


class PolygonSection(StructureSection):
    """A building with a polygon in plan, in modules whose centres it covers.

    Attributes:
        outline_m: Corners of its outline, in either order.
        courtyards_m: Corners of each of its courtyards.
    """

    kind: Literal["polygon"]
    outline_m: Corners
    courtyards_m: Annotated[tuple[Corners, ...], Field(max_length=100)] = ()

    @model_validator(mode="after")
    def _check_rings(self) -> Self:
        """Refuse outlines that cross themselves, and those without a module or with too many."""
        from blast_env.site.footprint import footprint_problem

        problem = footprint_problem(self.outline_m, self.courtyards_m)
        if not problem and self.footprint.area_m2 > MOST_MODULES * MODULE_SIDE_M**2:
            most_m2 = MOST_MODULES * MODULE_SIDE_M**2
            problem = f"encloses {self.footprint.area_m2:,.0f} m2, must be at most {most_m2:,.0f}"
        if not problem and not self.footprint.cells:
            problem = (
                f"encloses {self.footprint.area_m2:.3g} m2 and the centre of no module, must cover"
                f" the centre of a square of the grid of {MODULE_SIDE_M:g} m"
            )
        if problem:
            raise ScenarioError(self.name, [Problem("outline_m", problem)])
        return self

    @property
    def footprint(self) -> "Footprint":
        """Its polygon."""
        from blast_env.site.footprint import footprint_of

        return footprint_of(self.outline_m, self.courtyards_m)

    @property
    def corner_m(self) -> PointM:
        """Lower left corner of the grid of its modules."""
        return self.footprint.corner_m

    @property
    def rows(self) -> int:
        """Rows of the grid of its modules."""
        return self.footprint.shape[0]

    @property
    def columns(self) -> int:
        """Columns of the grid of its modules."""
        return self.footprint.shape[1]

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return len(self.footprint.cells)

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Rows and columns of its modules, row by row."""
        return self.footprint.cells

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """Its modules in few rectangles."""
        return self.footprint.boxes_m

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle around its modules."""
        return Rectangle.around(self.boxes_m)


AnyStructure = Annotated[
    ModularObstacleSection | ConcreteSquareSection | PolygonSection, Field(discriminator="kind")
]


class GaugeSection(Section):
    """A gauge of overpressure in the air.

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


PresetName = Annotated[str, AfterValidator(_check_preset)]
"""Name of a preset of the particle model."""


def _check_overrides(overrides: dict[str, Any]) -> dict[str, Any]:
    """Refuse overrides of unknown parameters, and values out of bounds."""
    groups = (_group_problems(group, values) for group, values in overrides.items())
    problems = tuple(chain.from_iterable(groups))
    if problems:
        raise ScenarioError("overrides", problems)
    return overrides


def _group_problems(group: str, values: object) -> tuple[Problem, ...]:
    """Return the problems of the overrides of one group of parameters."""
    field = SimulationParameters.model_fields.get(group)
    if field is None:
        return (unknown_key((group,), SimulationParameters.model_fields),)
    model = field.annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise TypeError(f"SimulationParameters.{group} is not a group of parameters")
    if not isinstance(values, Mapping):
        return (Problem(group, f"is {type_word(values)}, must be a table"),)
    try:
        # A group's values are independent and have defaults, so the overrides can be checked
        # alone, and every problem concerns a given key.
        model.model_validate(values, strict=True)
    except ValidationError as error:
        return problems_from(error, model, (group,))
    return ()


class SimulationSection(Section):
    """The particle model's parameters: a preset by name, with overrides.

    Attributes:
        preset: A name in `blast_env.site.parameters.PRESETS`.
        overrides: Nested like `SimulationParameters`: `{"air": {"spacing_units": 3.0}}`.
    """

    preset: PresetName = "ballistic"
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
        crs: Coordinate reference system of layouts exported to the map, as pyproj reads it:
            `EPSG:4326` (longitude, latitude), `EPSG:25832`.
    """

    kind: Literal["map"] = "map"
    longitude_deg: Degrees
    latitude_deg: Annotated[StrictFloat, Field(ge=-89.0, le=89.0)]
    crs: Annotated[str, Field(min_length=1, max_length=500), FOR_PEOPLE] = "EPSG:4326"


class DrawingGeoreference(Georeference):
    """The place of a site in a drawing without a place on the Earth.

    Attributes:
        x_m: The site's lower left corner along the drawing's x axis, in metres.
        y_m: The same along y.
        metres_per_unit: Length of the drawing's unit: 0.001 for millimetres.
    """

    kind: Literal["drawing"] = "drawing"
    x_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    y_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    metres_per_unit: Annotated[StrictFloat, Field(ge=1e-12, le=1e6)] = 1.0


AnyGeoreference = Annotated[MapGeoreference | DrawingGeoreference, Field(discriminator="kind")]


def buildings_of(structures: Iterable[AnyStructure]) -> dict[str, list[AnyStructure]]:
    """Return structures by the names of their buildings, in order."""
    buildings: dict[str, list[AnyStructure]] = {}
    for each in structures:
        buildings.setdefault(each.building_name, []).append(each)
    return buildings
