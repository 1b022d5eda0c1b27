"""The references of each problem's score: the best rule and the best known layout."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from blast_env.documents import checked_as, parse_json
from blast_env.evaluation.engines import Engine
from blast_env.geometry import Layout

Share = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


@dataclass(frozen=True)
class ReferenceLayout:
    """A layout with the shares of the load that remain.

    Attributes:
        method: Name of the method that found it.
        layout: Its cells or pieces.
        shares: Judged share of the load without a barrier that remains, by the side of the cells
            (`cell_key`).
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    method: str
    layout: Layout
    shares: dict[str, Share] = field(default_factory=dict)


@dataclass(frozen=True)
class ScoreReference:
    """The stored references of a problem.

    Attributes:
        digest: Digest of the problem's definition.
        engine: The engine that judged the shares, with its version: `gas 8`.
        rules: Share of the load that remains with each rule, with cells of 0.5 m, by name.
        rule: The best of the rules: score 0.
        best: The best known layout: score 1.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    digest: str
    engine: str
    rules: dict[str, Share]
    rule: ReferenceLayout
    best: ReferenceLayout


def engine_key(engine: Engine) -> str:
    """Return an engine's name and version for `ScoreReference.engine`: another has other loads."""
    return engine.version.partition(" (")[0]


def cell_key(cell_m: float) -> str:
    """Return the key of `ReferenceLayout.shares` for a side of the cells in m."""
    return f"{cell_m:g}"


@cache
def stored_references() -> Mapping[str, ScoreReference]:
    """Return the bundled references by the names of the problems."""
    text = files("blast_env.benchmark").joinpath("data/references.json").read_text("utf-8")
    return MappingProxyType(checked_as(dict[str, ScoreReference], parse_json(text)))
