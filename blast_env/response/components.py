"""Components of facades: a catalogue of common ones, and those of a scenario.

A component fills a bay: windows, wall panels, or both side by side. The catalogue is
`data/components.toml`; every entry gives the source of its properties. A scenario may define
further components with the same keys, by section properties if none of the kinds fits.
"""

import tomllib
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

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.hashing import HashMark
from blast_env.response.glass import GlassKind, Interlayer, Pane
from blast_env.response.walls import Masonry, Panel, ReinforcedConcrete, Sheeting, Supports
from blast_env.values import plain_text

_MM: Final = 1e-3
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


class Glazing(_Component):
    """Windows: as many equal panes as fit into the bay, at least one.

    Attributes:
        width_m: Width of a pane.
        height_m: Height of a pane.
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

    @property
    def pane(self) -> Pane:
        """One of its panes."""
        return Pane(
            self.width_m,
            self.height_m,
            self.thickness_mm * _MM,
            self.glass,
            self.interlayer,
            self.outer_thickness_mm * _MM,
            self.sill_m,
        )


class Wall(_Component):
    """A wall panel that spans from floor to floor.

    Attributes:
        section: Its section.
        supports: Its support by the floors.
        span_m: Its span; the height of the storey by default.
    """

    kind: Literal["wall"] = "wall"
    section: Annotated[ReinforcedConcrete | Masonry | Sheeting, Field(discriminator="kind")]
    supports: Supports = Supports.SIMPLE
    span_m: Annotated[StrictFloat, Field(ge=0.1, le=50.0)] | None = None

    def panel(self, storey_m: float) -> Panel:
        """Return its panel in a storey of a given height."""
        return Panel(self.section, storey_m if self.span_m is None else self.span_m, self.supports)


Component = Annotated[Glazing | Wall, Field(discriminator="kind")]
"""A component of a facade."""

_READ: Final[TypeAdapter[dict[str, Glazing | Wall]]] = TypeAdapter(dict[str, Component])


@cache
def catalogue() -> dict[str, Glazing | Wall]:
    """Return the components of the package, by name.

    Raises:
        BlastEnvError: If the file is invalid.
    """
    text = files("blast_env.response").joinpath("data", "components.toml").read_text("utf-8")
    try:
        return _READ.validate_python(tomllib.loads(text))
    except ValidationError as error:
        raise BlastEnvError(f"components.toml: {error}") from None


def find_component(name: str) -> Glazing | Wall:
    """Return a component of the catalogue by name.

    Raises:
        UnknownNameError: If there is none; the message suggests the nearest one.
    """
    known = catalogue()
    if name not in known:
        raise UnknownNameError("component", name, known)
    return known[name]
