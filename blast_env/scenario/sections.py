"""The sections of a scenario: site, charge, structures; `build_zone` and `simulation` are others.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site.
"""

import re
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
)

from blast_env.geometry import Rectangle
from blast_env.units import MODULE_SIDE_M

Coordinate = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
Length = Annotated[StrictFloat, Field(gt=0.0, le=2000.0)]
PointM = tuple[Coordinate, Coordinate]
SizeM = tuple[Length, Length]
Cell = tuple[int, int]
"""(row, column) of a build-zone cell, from 0; rows count upwards, columns to the right."""
Count = Annotated[StrictInt, Field(ge=1, le=1000)]


def _check_name(name: str) -> str:
    """Refuse a name that could not be a part of a file name or of a column heading."""
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", name) is None:
        raise ValueError("must be 1 to 40 letters, digits, '_' or '-', the first one a letter")
    return name


Name = Annotated[str, AfterValidator(_check_name)]


class Charge(NamedTuple):
    """One charge: where it is and its TNT-equivalent mass."""

    position_m: tuple[float, float]
    tnt_kg: float


class Section(BaseModel):
    """Base of all parts of a scenario: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Site(Section):
    """The simulated area; what leaves it is gone."""

    width_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
    height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]

    @property
    def rectangle_m(self) -> Rectangle:
        """The whole site."""
        return Rectangle(0.0, 0.0, self.width_m, self.height_m)


class ChargeSource(Section):
    """Base of the places that a charge may come from.

    Attributes:
        tnt_kg: TNT-equivalent mass of a charge from this source.
        weight: How likely this source is, relative to the others.
    """

    tnt_kg: Annotated[StrictFloat, Field(ge=0.01, le=100_000.0)]
    weight: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0


class PointSource(ChargeSource):
    """A charge at a fixed point."""

    kind: Literal["point"] = "point"
    position_m: PointM

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the diagonal that the source spans."""
        return self.position_m, self.position_m

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


AnySource = Annotated[PointSource | SegmentSource | RectangleSource, Field(discriminator="kind")]


class StructureSection(Section):
    """Base of the structures.

    Attributes:
        name: Name in tables and pictures; `barrier` is taken by the modules of a layout.
        corner_m: Lower left corner.
        protected: Whether the load on it counts.
        weight: How much its load counts among the protected structures.
        module_capacity: Impulse, simulation units, that a module bears before it is removed;
            without it modules never fail.
    """

    name: Name
    corner_m: PointM
    protected: StrictBool = False
    weight: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0
    module_capacity: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None


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
