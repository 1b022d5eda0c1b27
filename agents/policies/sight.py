"""Lines of sight from where the charge may be to the protected structures, read off the planes."""

from typing import Final, NamedTuple

import torch
from torch import Tensor

_LEAST_WAY: Final = 1e-3
"""A way along an axis that is shorter, in squares, counts as so long: nothing is divided by 0."""


class Spread(NamedTuple):
    """Mean place of a plane's values, in squares, and how far they spread about it (batch,)."""

    x: Tensor
    y: Tensor
    xx: Tensor
    xy: Tensor
    yy: Tensor

    @classmethod
    def of(cls, plane: Tensor) -> "Spread":
        """Measure a plane (batch, rows, columns)."""
        over_y, over_x = plane.sum(dim=2), plane.sum(dim=1)
        total = over_x.sum(dim=1).clamp(min=1e-6)
        y_of = torch.arange(plane.shape[1], dtype=plane.dtype, device=plane.device) + 0.5
        x_of = torch.arange(plane.shape[2], dtype=plane.dtype, device=plane.device) + 0.5
        x, y = over_x @ x_of / total, over_y @ y_of / total
        xx = over_x @ x_of.square() / total - x.square()
        yy = over_y @ y_of.square() / total - y.square()
        xy = (plane @ x_of) @ y_of / total - x * y
        return cls(x, y, xx, xy, yy)

    @staticmethod
    def half_extent(variance: Tensor) -> Tensor:
        """Return half the width of an even spread from its variance."""
        return (3.0 * variance.clamp(min=0.0)).sqrt()

    def half_width(self, along_x: Tensor, along_y: Tensor) -> Tensor:
        """Return half the width of an even spread in directions, in squares (batch, directions)."""
        variance = (
            self.xx[:, None] * along_x.square()
            + 2.0 * self.xy[:, None] * along_x * along_y
            + self.yy[:, None] * along_y.square()
        )
        return self.half_extent(variance)


class LinesOfSight(NamedTuple):
    """A line from each of some places of the charge to the middle of the protected structures.

    All attributes are (batch, places), lengths in squares.

    Attributes:
        x: Where it begins.
        y: Likewise.
        along_x: Its direction, of length 1.
        along_y: Likewise.
        distance: Its length, at least 1.
        left: How far aside of the line they reach to the left, over how far along it: the tangent
            of the angle at which they are seen.
        right: Likewise to the right, where it is negative.
    """

    x: Tensor
    y: Tensor
    along_x: Tensor
    along_y: Tensor
    distance: Tensor
    left: Tensor
    right: Tensor

    @classmethod
    def between(cls, x: Tensor, y: Tensor, target: Spread) -> "LinesOfSight":
        """Return the lines from places (batch, places) to the structures.

        Several structures count as one rectangle that is spread as far as they are.
        """
        towards_x, towards_y = target.x[:, None] - x, target.y[:, None] - y
        distance = torch.hypot(towards_x, towards_y).clamp(min=1.0)
        along_x, along_y = towards_x / distance, towards_y / distance
        tangents = _corner_tangents(x, y, along_x, along_y, target)
        left, right = tangents.amax(dim=0), tangents.amin(dim=0)
        return cls(x, y, along_x, along_y, distance, left, right)

    def coordinates(self, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        """Return how far points are along each line and aside of it, in squares.

        Args:
            x: In squares (batch, points).
            y: Likewise.

        Returns:
            Two tensors (batch, places, points); to the left of the line is positive.
        """
        from_x, from_y = x[:, None] - self.x[..., None], y[:, None] - self.y[..., None]
        along_x, along_y = self.along_x[..., None], self.along_y[..., None]
        return from_x * along_x + from_y * along_y, from_y * along_x - from_x * along_y


def stands_before(
    lines: LinesOfSight, along: Tensor, x: Tensor, y: Tensor, target: Spread
) -> Tensor:
    """Return which points lie before the structures, neither in nor behind them, 0 or 1.

    Args:
        lines: From each place of the charge (batch, places).
        along: How far the points are along each line, in squares (batch, places, points).
        x: Of the points, in squares (batch, points).
        y: Likewise.
        target: The structures.

    Returns:
        (batch, places, points); 0 also for what lies on the other side of the charge.
    """
    enter_x, leave_x = _slab(lines.x, x, target.x, target.half_extent(target.xx))
    enter_y, leave_y = _slab(lines.y, y, target.y, target.half_extent(target.yy))
    enter, leave = torch.maximum(enter_x, enter_y), torch.minimum(leave_x, leave_y)
    is_met = (enter < leave) & (leave > 0.0) & (enter < 1.0)
    return ((along > 0.0) & ~is_met).float()


def likely_places(likely: Tensor, places: int) -> tuple[Tensor, Tensor]:
    """Return places that stand for a distribution, each for as large a part of it.

    Args:
        likely: How likely the charge is in a square (batch, rows, columns).
        places: How many; 1 gives the mean.

    Returns:
        x and y in squares (batch, places).
    """
    if places == 1:
        middle = Spread.of(likely)
        return middle.x[:, None], middle.y[:, None]
    columns = likely.shape[2]
    up_to = likely.flatten(1).cumsum(dim=1)
    parts = (torch.arange(places, dtype=up_to.dtype, device=up_to.device) + 0.5) / places
    wanted = parts * up_to[:, -1:]
    square = torch.searchsorted(up_to, wanted).clamp(max=up_to.shape[1] - 1)
    return square % columns + 0.5, square.div(columns, rounding_mode="floor") + 0.5


def _slab(start: Tensor, end: Tensor, middle: Tensor, half: Tensor) -> tuple[Tensor, Tensor]:
    """Return the shares of the ways to the points at which they enter and leave a slab."""
    way = end[:, None] - start[..., None]
    way = torch.where(way.abs() < _LEAST_WAY, _LEAST_WAY, way)
    one = ((middle - half)[:, None] - start)[..., None] / way
    other = ((middle + half)[:, None] - start)[..., None] / way
    return torch.minimum(one, other), torch.maximum(one, other)


def _corner_tangents(
    x: Tensor, y: Tensor, along_x: Tensor, along_y: Tensor, target: Spread
) -> Tensor:
    """Return where the corners of a rectangle are seen (corners, batch, places)."""
    half_x, half_y = target.half_extent(target.xx), target.half_extent(target.yy)
    tangents = []
    for side_x, side_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        from_x = (target.x + side_x * half_x)[:, None] - x
        from_y = (target.y + side_y * half_y)[:, None] - y
        along = (from_x * along_x + from_y * along_y).clamp(min=1.0)
        tangents.append((from_y * along_x - from_x * along_y) / along)
    return torch.stack(tangents)
