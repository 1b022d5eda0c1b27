"""The stock list of real barriers that comes with the package; scenarios take them by name."""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Annotated, Final

from pydantic import Field, StrictBool, StrictFloat

from blast_env.scenario.sections import Count, Height, Section

Mass = Annotated[StrictFloat, Field(gt=0.0, le=1e6)]
BaseWidth = Annotated[StrictFloat, Field(gt=0.0, le=20.0)]
Friction = Annotated[StrictFloat, Field(ge=0.0, le=2.0)]
Anchorage = Annotated[StrictFloat, Field(ge=0.0, le=1e9)]

_FILE: Final = "barriers.toml"


class StockBarrier(Section):
    """A barrier of the stock list: an item of a catalogue without how many there are.

    Attributes:
        description: What it is.
        length_modules: Modules along its length.
        thickness_modules: Modules across its length.
        height_m: Height above the ground.
        cost: Relative cost of a piece: 1 is about a metre of concrete road barrier.
        rotatable: Whether it may be turned by a right angle.
        stops_vehicles: Whether no vehicle gets past it.
        mass_kg: Mass of a piece; that of a block of concrete where it is not known.
        base_width_m: Width of its base; its thickness where it is not known.
        anchorage_n: Horizontal force that the anchors of a piece hold.
        source: Where the dimensions come from, in words.
    """

    description: Annotated[str, Field(max_length=200)]
    length_modules: Count
    thickness_modules: Count
    height_m: Height
    cost: Annotated[StrictFloat, Field(gt=0.0)]
    rotatable: StrictBool
    stops_vehicles: StrictBool
    mass_kg: Mass | None = None
    base_width_m: BaseWidth | None = None
    anchorage_n: Anchorage | None = None
    source: str


@cache
def stock_barriers() -> Mapping[str, StockBarrier]:
    """Return the barriers of the stock list by name."""
    text = files(__package__).joinpath(_FILE).read_text(encoding="utf-8")
    listed = tomllib.loads(text)
    barriers = {name: StockBarrier.model_validate(each) for name, each in listed.items()}
    return MappingProxyType(barriers)
