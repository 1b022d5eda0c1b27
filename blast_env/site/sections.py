"""The parts of a scenario: common types, the site, gauges, simulation, georeference.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground, which is flat.
"""

import re
from collections.abc import Mapping
from functools import cached_property
from itertools import chain
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    StrictFloat,
    StrictInt,
    ValidationError,
    model_serializer,
)

from blast_env.errors import type_word
from blast_env.geometry import Rectangle
from blast_env.site.parameters import PRESETS, SimulationParameters, preset, with_overrides
from blast_env.site.problems import (
    Problem,
    ScenarioError,
    problems_from,
    unknown_key,
    unknown_name,
)
from blast_env.units import MODULE_SIDE_M
from blast_env.values import plain_text

Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(ge=1e-3, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]

Height = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0)]
"""Height of a structure or barrier, m: at least a module's side."""

Count = Annotated[StrictInt, Field(ge=1, le=1000)]

MOST_MODULES: Final = 250_000
"""Most modules of a scene: 250 m x 250 m of buildings, which add 2 s to a blast."""

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


class Ground(Section):
    """A rectangle of the site."""

    corner_m: PointM
    size_m: SizeM

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle."""
        return Rectangle.from_corner(self.corner_m, self.size_m)


class Area(Ground):
    """A rectangle of the site under a special condition, with the reason."""

    reason: Reason


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
