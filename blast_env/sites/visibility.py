"""Visibility: the lines along which a charge sees the protected structures, and who cuts them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Element, Rectangle
from blast_env.scenario import (
    AnyScenario,
    AnySource,
    PointSource,
    RectangleSource,
    Scenario,
    find_scenario,
)
from blast_env.scenario.sections import PointM
from blast_env.units import MODULE_SIDE_M

DIRECTIONS: Final = 360
"""Lines that leave each place."""


TARGETS: Final = 3
"""Heights on a facade that lines go to, where it has a height: the middles of thirds."""


PLACES: Final = 9
"""Places along a segment or an entry, or in a rectangle, 3 x 3."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """The lines of sight from where a charge may be to the protected structures.

    From places spread evenly over every source, lines leave in directions spread evenly, as the
    balls of a charge do. Those that would meet a protected structure count, each by the weights
    of its source and of the structure. Where the structure has a height, each of them stands for
    several, which rise from the charge to the middle of its lower, middle and upper third: a low
    wall cuts them near the charge, and the lower ones alone near the structure.

    Attributes:
        weight: Weight of each line that no other structure stops (lines,).
        cut: Which lines an endlessly high module on each cell of the build zone would cut
            (lines, rows, columns).
        height_m: How high each line is over each cell (lines, rows, columns).
        open_share: Share, by weight, of the lines that no other structure stops.
    """

    weight: FloatArray
    cut: BoolArray
    height_m: FloatArray
    open_share: float

    @classmethod
    def of(cls, scenario: AnyScenario) -> "Visibility":
        """Return the lines of sight of a scenario.

        Args:
            scenario: The scenario, or its bundled name or path.

        Raises:
            BlastEnvError: If it has no build zone.
        """
        scenario = find_scenario(scenario)
        origin, direction, source_weight = _all_lines(scenario)
        protected_m, other_m = np.full((2, len(origin)), np.inf)
        weight, target_m = np.zeros((2, len(origin)))
        for structure in scenario.structures:
            entry_m = _entry_m(origin, direction, structure.rectangle_m)
            if structure.protected:
                nearer = entry_m < protected_m
                weight[nearer] = (structure.weight * source_weight)[nearer]
                target_m[nearer] = structure.height_m or 0.0
                protected_m = np.minimum(protected_m, entry_m)
            else:
                other_m = np.minimum(other_m, entry_m)
        free = (weight > 0.0) & (protected_m < other_m)
        open_share = float(weight[free].sum() / max(weight.sum(), 1e-300))
        cut, along_share = _cut(scenario, origin[free], direction[free], protected_m[free])
        if not target_m.any():
            return cls(weight[free], cut, np.zeros(cut.shape), open_share)
        shares = (np.arange(TARGETS) + 0.5) / TARGETS
        ends_m = (shares[:, np.newaxis] * target_m[free]).ravel()  # third by third
        return cls(
            np.tile(weight[free] / TARGETS, TARGETS),
            np.tile(cut, (TARGETS, 1, 1)),
            ends_m[:, np.newaxis, np.newaxis] * np.tile(along_share, (TARGETS, 1, 1)),
            open_share,
        )

    def cut_by(self, height_m: float | None) -> BoolArray:
        """Return which lines a module of a height would cut on each cell (lines, rows, columns).

        Args:
            height_m: The height; `None` is as high as the air.
        """
        return self.cut if height_m is None else self.cut & (self.height_m < height_m)

    def cut_share(
        self, cells: Sequence[Element], heights_m: Sequence[float | None] | None = None
    ) -> float:
        """Return the share of the lines, by weight, that modules cut.

        Args:
            cells: (row, column) of the cells that hold a module (`Placement.cells`).
            heights_m: Height of each module; all are as high as the air unless given.
        """
        if not cells or not len(self.weight):
            return 0.0
        rows, columns = zip(*(each[:2] for each in cells), strict=True)
        cut = self.cut[:, rows, columns]
        if heights_m is not None:
            tall = np.array([np.inf if each is None else each for each in heights_m])
            cut = cut & (self.height_m[:, rows, columns] < tall)
        share = float(self.weight @ cut.any(axis=1) / self.weight.sum())
        return min(share, 1.0)  # rounding


def _all_lines(scenario: Scenario) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return origins (lines, 2), directions (lines, 2) and weights of sources (lines,)."""
    places = [(place, source.weight) for source in scenario.charge for place in _places(source)]
    origin = np.repeat(np.array([place for place, _ in places]), DIRECTIONS, axis=0)
    weight = np.repeat(np.array([weight for _, weight in places]), DIRECTIONS)
    return origin, np.tile(np.array(_directions()), (len(places), 1)), weight


@cache
def _directions() -> tuple[tuple[float, float], ...]:
    """Return the directions, none of them along an axis.

    Rounded, so that the last bit of sines, which differs between machines, decides nothing.
    """
    angles = (2.0 * pi * (index + 0.5) / DIRECTIONS for index in range(DIRECTIONS))
    return tuple((round(cos(angle), 9), round(sin(angle), 9)) for angle in angles)


def _places(source: AnySource) -> list[PointM]:
    """Return the places of a source, each in the middle of as large a part of it.

    Those of a vehicle are along its entries: where it gets to is for the layout to decide.
    """
    if isinstance(source, PointSource):
        return [source.position_m]
    if not isinstance(source, RectangleSource):
        return [place for ends_m in source.lines_m for place in _places_along(*ends_m)]
    side = round(PLACES**0.5)
    shares = [(index + 0.5) / side for index in range(side)]
    (left, bottom), (width, height) = source.corner_m, source.size_m
    return [(left + across * width, bottom + up * height) for up in shares for across in shares]


def _places_along(start_m: PointM, end_m: PointM) -> list[PointM]:
    (x0, y0), (x1, y1) = start_m, end_m
    shares = [(index + 0.5) / PLACES for index in range(PLACES)]
    return [(x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in shares]


def _entry_m(origin: FloatArray, direction: FloatArray, rectangle: Rectangle) -> FloatArray:
    """Return how far along each line it enters a rectangle (lines,); infinite if it misses."""
    low = (np.array([rectangle.left, rectangle.bottom]) - origin) / direction
    high = (np.array([rectangle.right, rectangle.top]) - origin) / direction
    enter = np.minimum(low, high).max(axis=1)
    leave = np.maximum(low, high).min(axis=1)
    return np.where((enter < leave) & (leave > 0.0), enter, np.inf)


def _cut(
    scenario: Scenario, origin: FloatArray, direction: FloatArray, length_m: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return which lines a module on each cell would cut, and how far along each line that is.

    Both (lines, rows, columns); the latter as a share of the line's length, 0 to 1.
    """
    x, y = scenario.zone.centres_m
    to_x = x[0] - origin[:, :1]  # (lines, columns)
    to_y = y[:, 0] - origin[:, 1:]  # (lines, rows)
    along_x, along_y = direction[:, :1], direction[:, 1:]
    along = (to_y * along_y)[:, :, np.newaxis] + (to_x * along_x)[:, np.newaxis, :]
    beside = (to_y * along_x)[:, :, np.newaxis] - (to_x * along_y)[:, np.newaxis, :]
    half_width = MODULE_SIDE_M / 2.0 * np.abs(direction).sum(axis=1)
    cut: BoolArray = (
        (np.abs(beside) < half_width[:, np.newaxis, np.newaxis])
        & (along > 0.0)
        & (along < length_m[:, np.newaxis, np.newaxis])
    )
    share: FloatArray = np.clip(along / length_m[:, np.newaxis, np.newaxis], 0.0, 1.0)
    return cut, share
