"""Round structures: columns, silos, tanks; in a file a centre and a diameter.

    [[structures]]
    kind = "round"
    name = "column"
    centre_m = [12.0, 8.0]
    diameter_m = 2.0

In a scenario each is a building of rectangles of modules: the modules with centres in the circle.
So engines, placement, pictures and exports need no circles.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat, ValidationError

from blast_env.arrays import IntArray
from blast_env.geometry import stacked_runs
from blast_env.scenario.problems import Problem, problems_from, unknown_key
from blast_env.scenario.sections import Name, PointM, Section
from blast_env.units import MODULE_SIDE_M

KIND: Final = "round"

_MOST_NAME: Final = 36  # of the 40 characters of a name; parts add a number
_OF_RECTANGLES: Final = ("corner_m", "rows", "columns", "side_modules")
_INDEX: Final = re.compile(r"\bstructures\[(\d+)\]")


def _check_name(name: str) -> str:
    if len(name) > _MOST_NAME:
        raise ValueError(f"must have at most {_MOST_NAME} characters: its parts have more")
    return name


class RoundSection(Section):
    """The keys of a round structure; further keys are those of every structure.

    Attributes:
        name: Name of the building, and of its rectangle if there is only one.
        centre_m: Its centre.
        diameter_m: Its diameter, which is rounded to whole modules.
    """

    kind: Literal["round"]
    name: Annotated[Name, AfterValidator(_check_name)]
    centre_m: PointM
    diameter_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=100.0)]

    @property
    def width_m(self) -> float:
        """Its diameter rounded to whole modules, m."""
        return MODULE_SIDE_M * max(1, round(self.diameter_m / MODULE_SIDE_M))

    def parts(self, others: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return its rectangles as tables of a file, with the weight of one structure in total.

        Args:
            others: Its further keys.
        """
        rectangles, walls = disc(round(self.width_m / MODULE_SIDE_M))
        corner_m = [round(each - 0.5 * self.width_m, 9) for each in self.centre_m]
        parts = []
        for number, (row, column, rows, columns) in enumerate(rectangles.tolist(), start=1):
            place = (corner_m[0] + column * MODULE_SIDE_M, corner_m[1] + row * MODULE_SIDE_M)
            part = {
                **others,
                "kind": "ModularObstacle",
                "name": self.name,
                "corner_m": place,
                "rows": rows,
                "columns": columns,
            }
            if len(rectangles) > 1:
                part["name"] = f"{self.name}_{number}"
                part.setdefault("building", self.name)
                weight = part.get("weight", 1.0)
                if part.get("protected") is True and isinstance(weight, float):
                    part["weight"] = weight * walls[number - 1] / sum(walls)
            parts.append(part)
        return parts


def disc(side: int) -> tuple[IntArray, list[int]]:
    """Return a disc as rectangles of modules (n, 4), and the number of exposed sides of each.

    Args:
        side: Its diameter in modules.
    """
    along = np.arange(side) + 0.5 - 0.5 * side
    filled = np.hypot(along[:, np.newaxis], along) <= 0.5 * side
    rectangles = stacked_runs(filled)
    around = np.pad(filled, 1)
    open_sides = sum(
        (around[1:-1, 1:-1] & ~np.roll(around, step, axis)[1:-1, 1:-1]).astype(np.int64)
        for axis in (0, 1)
        for step in (-1, 1)
    )
    walls = [
        int(open_sides[row : row + rows, column : column + columns].sum())
        for row, column, rows, columns in rectangles.tolist()
    ]
    return rectangles, walls


@dataclass(frozen=True)
class WithoutRound:
    """A parsed scenario file with rectangles in place of round structures.

    Attributes:
        document: The file.
        problems: Problems of round structures, which are left unchanged in `document`.
        origin: Index in the file of each structure, or of the structure of which it is a part.
        unsound: Indices of the structures with these problems.
    """

    document: Mapping[str, Any]
    problems: tuple[Problem, ...] = ()
    origin: tuple[int, ...] | None = None
    unsound: frozenset[int] = field(default_factory=frozenset)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> "WithoutRound":
        """Return a file with its round structures replaced."""
        listed = document.get("structures")
        if not isinstance(listed, list | tuple) or not any(map(_is_round, listed)):
            return cls(document)
        structures: list[Any] = []
        origin: list[int] = []
        problems: list[Problem] = []
        names: dict[str, list[str]] = {}
        taken = [each.get("name") for each in listed if isinstance(each, Mapping)]
        for index, table in enumerate(listed):
            parts: list[Any] = [table]
            wrong: tuple[Problem, ...] = ()
            if _is_round(table):
                parts, wrong = _parts_of(table, index)
                name = str(table.get("name"))
                if taken.count(name) > 1:
                    key = f"structures[{index}].name"
                    wrong = (*wrong, Problem(key, f"is {name!r}, which another structure has"))
                names[name] = [str(part.get("name")) for part in parts]
            structures += parts
            origin += [index] * len(parts)
            problems += wrong
        unsound = frozenset(index for index, each in enumerate(structures) if _is_round(each))
        changed = {**document, "structures": structures}
        if isinstance(zone := document.get("build_zone"), Mapping):
            changed["build_zone"] = _with_parts_named(zone, names)
        return cls(changed, tuple(problems), tuple(origin), unsound)

    def as_written(self, problems: tuple[Problem, ...]) -> tuple[Problem, ...]:
        """Return problems with the keys of the file, those of round structures first."""
        if self.origin is None:
            return problems
        own = [
            Problem(*(_INDEX.sub(self._written, text) for text in (problem.key, problem.message)))
            for problem in problems
            if not self._is_of_unsound(problem)
        ]
        return tuple(dict.fromkeys((*self.problems, *own)))

    def _is_of_unsound(self, problem: Problem) -> bool:
        match = _INDEX.match(problem.key)
        return match is not None and int(match[1]) in self.unsound

    def _written(self, match: re.Match[str]) -> str:
        origin = self.origin or ()
        index = int(match[1])
        return f"structures[{origin[index] if index < len(origin) else index}]"


def _is_round(table: Any) -> bool:
    return isinstance(table, Mapping) and str(table.get("kind")).lower() == KIND


def _parts_of(
    table: Mapping[str, Any], index: int
) -> tuple[list[Mapping[str, Any]], tuple[Problem, ...]]:
    """Return the rectangles of a round structure, or the structure itself and its problems."""
    where = ("structures", index)
    own = {key: value for key, value in table.items() if key in RoundSection.model_fields}
    problems = tuple(
        unknown_key((*where, key), RoundSection.model_fields)
        for key in _OF_RECTANGLES
        if key in table
    )
    try:
        section = RoundSection.model_validate(own)
    except ValidationError as error:
        return [table], (*problems, *problems_from(error, RoundSection, where))
    x_m, y_m = section.centre_m
    if min(x_m, y_m) < 0.5 * section.width_m:
        message = (
            f"is ({x_m:g}, {y_m:g}), must be at least {0.5 * section.width_m:g} from the left and"
            " the lower border of the site"
        )
        problems = (*problems, Problem(f"structures[{index}].centre_m", message))
    others = {key: value for key, value in table.items() if key not in own}
    return ([table], problems) if problems else (list(section.parts(others)), ())


def _with_parts_named(zone: Mapping[str, Any], names: Mapping[str, list[str]]) -> dict[str, Any]:
    """Return a build zone with the rectangles of round structures named in its measures."""
    changed = dict(zone)
    for key in ("removable", "hardening"):
        if isinstance(measures := zone.get(key), list | tuple):
            changed[key] = [_measure_with(each, names) for each in measures]
    return changed


def _measure_with(measure: Any, names: Mapping[str, list[str]]) -> Any:
    named = measure.get("structures") if isinstance(measure, Mapping) else None
    if not isinstance(named, list | tuple):
        return measure
    parts = [part for name in named for part in names.get(str(name), [name])]
    return {**measure, "structures": parts}
