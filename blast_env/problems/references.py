"""What each problem is scored between: the best rule, and the best layout that is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from blast_env.documents import checked_as, parse_json
from blast_env.geometry import Layout

Share = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


@dataclass(frozen=True)
class KnownLayout:
    """A layout, and what it leaves of the load.

    Attributes:
        method: What found it.
        layout: Its cells or pieces.
        shares: What the judge finds left of the load without a barrier, by the side of the cells in
            m, as a text.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    method: str
    layout: Layout
    shares: dict[str, Share] = field(default_factory=dict)


@dataclass(frozen=True)
class ScoreReference:
    """What is stored with a problem.

    Attributes:
        digest: Of what the problem says.
        rules: What each rule leaves of the load, with cells of 0.5 m, by name.
        rule: The best of the rules: score 0.
        best: The best layout known: score 1.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    digest: str
    rules: dict[str, Share]
    rule: KnownLayout
    best: KnownLayout


def cell_key(cell_m: float) -> str:
    """Return the side of cells as `KnownLayout.shares` has it."""
    return f"{cell_m:g}"


@cache
def stored_references() -> Mapping[str, ScoreReference]:
    """Return the references that come with the package, by the names of the problems."""
    text = files("blast_env.problems").joinpath("data/references.json").read_text("utf-8")
    return MappingProxyType(checked_as(dict[str, ScoreReference], parse_json(text)))
