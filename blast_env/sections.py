"""Parts that scenario files are made of: lengths, names, points, the site; and their hashes.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground, which is flat.
"""

import json
import re
from collections.abc import Collection, Mapping
from enum import Enum
from functools import cached_property
from hashlib import sha256
from math import ceil
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    StrictFloat,
    StrictInt,
    model_serializer,
)

from blast_env.geometry import Rectangle
from blast_env.units import MODULE_SIDE_M
from blast_env.values import plain_text


class HashMark(Enum):
    """Mark of a field in its annotation; fields without one count in all hashes."""

    NEVER = "no result depends on it"
    IF_SET = "left out where it has its default value"
    IF_RESPONSE = "counts where the objective is the response of facades"
    OF_PLACES = "counts for the meaning of a layout: shape and place of a structure"
    NOT_OF_PLACES = "does not count for the meaning of a layout"


def fields_with(model: type[BaseModel], mark: HashMark) -> set[str]:
    """Return the names of the fields of a model with a mark."""
    return {name for name, field in model.model_fields.items() if mark in field.metadata}


def hashed_content(section: BaseModel, *left_out: HashMark) -> dict[str, Any]:
    """Return the content of a section that counts in a hash, as plain JSON values.

    Args:
        section: The section, with its subsections.
        left_out: Marks of fields that do not count, beside `NEVER` and defaults of `IF_SET`.
    """
    return _counted(section, section.model_dump(mode="json"), {HashMark.NEVER, *left_out})


def digest_of(content: Mapping[str, Any]) -> str:
    """Return SHA-256 of plain JSON values; the order of keys and the sign of 0 do not count."""
    text = json.dumps(_without_negative_zero(content), sort_keys=True, allow_nan=False)
    return sha256(text.encode()).hexdigest()


def _counted(section: BaseModel, dump: Any, left_out: Collection[HashMark]) -> dict[str, Any]:
    """Return the entries of a dump that count; sparse sections have no entry for some fields."""
    counted = {}
    for name, field in type(section).model_fields.items():
        # A default that is left out keeps the hashes of scenarios older than the field.
        marks, value = field.metadata, getattr(section, name)
        is_default = value == field.get_default(call_default_factory=True)
        is_out = any(mark in marks for mark in left_out)
        if name in dump and not is_out and not (HashMark.IF_SET in marks and is_default):
            counted[name] = _of_value(value, dump[name], left_out)
    return counted


def _of_value(value: Any, dump: Any, left_out: Collection[HashMark]) -> Any:
    if isinstance(value, BaseModel):
        return _counted(value, dump, left_out)
    if isinstance(value, Mapping):
        return {key: _of_value(value[key], dump[key], left_out) for key in value}
    if isinstance(value, tuple):
        return [_of_value(*pair, left_out) for pair in zip(value, dump, strict=True)]
    return dump


def _without_negative_zero(value: Any) -> Any:
    """Return nested values with every -0.0 replaced by 0.0, which is the same place on a site."""
    if isinstance(value, dict):
        return {key: _without_negative_zero(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_negative_zero(item) for item in value]
    return value + 0.0 if isinstance(value, float) else value


Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(ge=1e-3, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]

Count = Annotated[StrictInt, Field(ge=1, le=1000)]

MOST_MODULES: Final = 250_000
"""Most modules of a scene: 250 m x 250 m of buildings, which add 2 s to a blast."""

Height = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0)]
"""Height of a structure or barrier, m: at least a module's side."""

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

    @cached_property
    def rectangle_m(self) -> Rectangle:
        """The whole site."""
        return Rectangle(0.0, 0.0, self.width_m, self.height_m)

    @cached_property
    def squares(self) -> tuple[int, int]:
        """Number of rows and of columns of squares of 0.5 m that cover the site."""
        return ceil(self.height_m / MODULE_SIDE_M - 1e-9), ceil(self.width_m / MODULE_SIDE_M - 1e-9)


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

    reason: Annotated[Reason, HashMark.NEVER]


class GaugeSection(Section):
    """A gauge of overpressure in the air.

    Attributes:
        name: Name in tables and pictures.
        position_m: X, y, and height above the ground.
    """

    name: Name
    position_m: tuple[Coordinate, Coordinate, Coordinate]


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
