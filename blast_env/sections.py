"""The base of all parts of a scenario file: lengths, names, points, rectangles, the site.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground, which is flat.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    StrictFloat,
    model_serializer,
)

from blast_env.geometry import Rectangle
from blast_env.hashing import HashMark
from blast_env.units import MODULE_SIDE_M
from blast_env.values import plain_text

Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(ge=1e-3, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]

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

    reason: Annotated[Reason, HashMark.NEVER]
