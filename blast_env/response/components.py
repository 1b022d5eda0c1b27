"""Components of facades: a catalogue of common ones, and those of a scenario.

A component fills a bay: windows, wall panels, or both side by side. The catalogue is
`data/components.toml`; every entry gives the source of its properties. A scenario may define
further components with the same keys, by section properties if none of the kinds fits.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib.resources import files
from typing import Annotated, Final, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StrictFloat,
    TypeAdapter,
    ValidationError,
)

from blast_env.bays import Bay
from blast_env.errors import BlastEnvError
from blast_env.response.wall_sections import Masonry, ReinforcedConcrete, Sheeting, Supports
from blast_env.sections import HashMark
from blast_env.values import plain_text

PaneSide = Annotated[StrictFloat, Field(ge=0.05, le=20.0)]
_Text = Annotated[str, Field(min_length=1, max_length=300), AfterValidator(plain_text)]


def _none_or_pane(thickness_mm: float) -> float:
    if thickness_mm != 0.0 and not thickness_mm >= 1.0:
        raise ValueError("must be 0 or at least 1")
    return thickness_mm


class _Component(BaseModel):
    """Base of components.

    Attributes:
        title: Title for display.
        source: Source of its properties.
        cost_m2: Cost of installing it in place of another one, per m2; `None` if it is not
            available as a replacement.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    title: Annotated[_Text, HashMark.NEVER]
    source: Annotated[_Text, HashMark.NEVER]
    cost_m2: Annotated[StrictFloat, Field(ge=0.0, le=1e9)] | None = None


LEAST_INTERLAYER_MM: Final = 1.52
"""Thickness of PVB below which laminated panes failed early in arena tests."""


_ASSUMED_INTERLAYERS: Final = ((16_000.0, 0.15), (4_000.0, 0.1))
"""Tension, N/m, and tearing share of PVB and film in the catalogue."""


class GlassKind(StrEnum):
    """Heat treatment of glass."""

    ANNEALED = "annealed"
    HEAT_STRENGTHENED = "heat_strengthened"
    FULLY_TEMPERED = "fully_tempered"

    @property
    def type_factor(self) -> float:
        """Load resistance over that of annealed glass (ASTM E1300, table 1)."""
        return {"annealed": 1.0, "heat_strengthened": 2.0, "fully_tempered": 4.0}[self.value]


class Interlayer(BaseModel):
    """Interlayer of laminated glass, which retains the fragments.

    The default values are an assumption of this project, without a published table: PVB of 1.52 mm
    as a membrane with the tension of its cohesion, which tears at a share of the short side.

    Attributes:
        material: Whether it lies between plies, or is a film on the pane.
        tension_n_m: Tension of the broken pane in its plane, N/m.
        tear_share: Deflection at which it tears or leaves the frame, over the short side.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    material: Literal["pvb", "film"] = "pvb"
    thickness_mm: Annotated[StrictFloat, Field(ge=0.1, le=20.0)] = LEAST_INTERLAYER_MM
    tension_n_m: Annotated[StrictFloat, Field(ge=1.0, le=1e9)] = 16_000.0
    tear_share: Annotated[StrictFloat, Field(ge=0.001, le=1.0)] = 0.15

    @property
    def is_assumed(self) -> bool:
        """Whether tension and tearing are assumptions of this project."""
        return (self.tension_n_m, self.tear_share) in _ASSUMED_INTERLAYERS


class Glazing(_Component):
    """Windows: as many equal panes as fit into the bay, at least one.

    Attributes:
        thickness_mm: Minimum thickness of the glass by its standard; of laminated glass, the sum
            of all plies.
        glass: Heat treatment.
        interlayer: Interlayer or film that retains the fragments; `None` without one.
        outer_thickness_mm: Thickness of the outer pane of double glazing; 0 for single.
        sill_m: Height of the lower edge above the floor.
    """

    kind: Literal["glazing"] = "glazing"
    width_m: PaneSide
    height_m: PaneSide
    thickness_mm: Annotated[StrictFloat, Field(ge=1.0, le=100.0)]
    glass: GlassKind = GlassKind.ANNEALED
    interlayer: Interlayer | None = None
    outer_thickness_mm: Annotated[StrictFloat, Field(le=100.0), AfterValidator(_none_or_pane)] = 0.0
    sill_m: Annotated[StrictFloat, Field(ge=0.0, le=10.0)] = 0.9


class Wall(_Component):
    """A wall panel that spans from floor to floor.

    Attributes:
        span_m: Its span; the height of the storey by default.
    """

    kind: Literal["wall"] = "wall"
    section: Annotated[ReinforcedConcrete | Masonry | Sheeting, Field(discriminator="kind")]
    supports: Supports = Supports.SIMPLE
    span_m: Annotated[StrictFloat, Field(ge=0.1, le=50.0)] | None = None


Component = Annotated[Glazing | Wall, Field(discriminator="kind")]
"""A component of a facade."""

_READ: Final[TypeAdapter[dict[str, Glazing | Wall]]] = TypeAdapter(dict[str, Component])


@cache
def catalogue() -> dict[str, Glazing | Wall]:
    """Return the components of the package, by name.

    Raises:
        BlastEnvError: If the file is invalid.
    """
    # Read once, and checked as the components of a scenario are.
    text = files("blast_env.response").joinpath("data", "components.toml").read_text("utf-8")
    try:
        return _READ.validate_python(tomllib.loads(text))
    except ValidationError as error:
        raise BlastEnvError(f"components.toml: {error}") from None


@dataclass(frozen=True)
class FacadeBay:
    """A bay with its components.

    Attributes:
        glazing: Its windows; `None` without.
        wall: Its wall panel; `None` without.
    """

    bay: Bay
    glazing: Glazing | None = None
    wall: Wall | None = None

    def __post_init__(self) -> None:
        """Check that the window fits.

        Raises:
            BlastEnvError: If the bay is empty, or a pane is larger than its bay.
        """
        if self.glazing is None and self.wall is None:
            raise BlastEnvError(f"bay {self.bay.name}: it has neither windows nor a wall")
        if self.glazing is None:
            return
        top_m = self.glazing.sill_m + self.glazing.height_m
        if self.glazing.width_m > self.bay.width_m + 1e-9 or top_m > self.bay.height_m + 1e-9:
            raise BlastEnvError(
                f"bay {self.bay.name}: a pane of {self.glazing.width_m:g} x"
                f" {self.glazing.height_m:g} m over a sill of {self.glazing.sill_m:g} m must fit"
                f" into {self.bay.width_m:g} x {self.bay.height_m:g} m"
            )

    @property
    def panes(self) -> int:
        """Number of panes: as many as fit side by side."""
        if self.glazing is None:
            return 0
        return max(1, int(self.bay.width_m / self.glazing.width_m + 1e-9))

    @property
    def glazed_m2(self) -> float:
        """Area of its panes."""
        if self.glazing is None:
            return 0.0
        return self.panes * (self.glazing.width_m * self.glazing.height_m)


@dataclass(frozen=True)
class Alternatives:
    """A bay with its possible components.

    Attributes:
        glazing: Possible windows, by the name of their component.
        wall: Possible wall panels, by the name of their component.
    """

    name: str
    structure: str
    glazing: Mapping[str, FacadeBay]
    wall: Mapping[str, FacadeBay]
