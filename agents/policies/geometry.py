"""Where the cells of the build zone lie between charge and building, read off the planes."""

from typing import Final, NamedTuple

import torch
from torch import Tensor

from blast_env.envs.grid_observation import GridObservation

CHANNELS: Final = GridObservation.channels
PROTECTED, CHARGE, COST, BARRIER, FREE = (
    CHANNELS.index(name) for name in ("protected", "charge", "cost", "barrier", "free")
)
SHARES: Final = tuple(CHANNELS.index(name) for name in ("stock_share", "stock", "budget_share"))

CELL_FEATURES: Final = 10
BEARINGS: Final = 48
SITE_FEATURES: Final = 6 + len(SHARES) + BEARINGS

_LEVELS: Final = 255.0
_LENGTH: Final = 20.0
"""Lengths are divided by so many squares, 10 m, to be of the order of 1."""
_MOST_SHADE: Final = 3.0
"""Bearings are told apart up to so many times the half width of the facade on either side."""


class ZoneView(NamedTuple):
    """What a policy knows of the cells of the build zone, and of the site as a whole.

    Attributes:
        cells: Features of each cell (batch, rows, columns, CELL_FEATURES).
        barrier: Which cells hold a module, 0 or 1 (batch, rows, columns).
        free: Which may take one, 0 or 1 (batch, rows, columns).
        site: Features of the whole (batch, SITE_FEATURES).
    """

    cells: Tensor
    barrier: Tensor
    free: Tensor
    site: Tensor


def zone_view(planes: Tensor, rows: int, columns: int) -> ZoneView:
    """Return the build zone as seen along the line of sight from charge to protected structures.

    The features of a cell turn with the site: how far it is along the line of sight and aside of
    it, in metres and as shares of the whole way and of the facade, and whether a module stands on
    its bearing already. So what is learnt at one place of the charge holds at the others, and on
    a turned site. Where the charge is hidden, the line begins in the middle of its places.

    Args:
        planes: A `"grid"` observation, from 0 to 255 (batch, channels, height, width).
        rows: Rows of the build zone.
        columns: Its columns.
    """
    row, column = _corner(planes[:, COST])
    cost, barrier, free = (
        _crop(planes[:, channel], row, column, rows, columns).float() / _LEVELS
        for channel in (COST, BARRIER, FREE)
    )
    sight = _LineOfSight.of(planes)
    x = column[:, None] + torch.arange(columns, device=planes.device) + 0.5
    y = row[:, None] + torch.arange(rows, device=planes.device) + 0.5
    along, aside = sight.coordinates(x[:, None, :], y[:, :, None])
    distance, facade = sight.distance[:, None, None], sight.facade[:, None, None]
    shade = (aside / along.clamp(min=1.0) * distance / facade).clamp(-_MOST_SHADE, _MOST_SHADE)
    bearing = ((shade / _MOST_SHADE + 1.0) / 2.0 * (BEARINGS - 1)).round().long().flatten(1)
    covered = _covered_bearings(bearing, barrier)
    cells = torch.stack(
        (
            along / _LENGTH,
            (distance - along) / _LENGTH,
            along / distance,
            aside / _LENGTH,
            aside.abs() / _LENGTH,
            shade,
            shade.abs(),
            covered.gather(1, bearing).reshape(barrier.shape),
            cost,
            free,
        ),
        dim=-1,
    )
    shares = planes[:, SHARES, 0, 0].float() / _LEVELS
    return ZoneView(cells, barrier, free, torch.cat((sight.measures, shares, covered), dim=1))


class _Cloud(NamedTuple):
    """Mean place of a plane's values, in squares, and how far they spread about it (batch,)."""

    x: Tensor
    y: Tensor
    xx: Tensor
    xy: Tensor
    yy: Tensor

    @classmethod
    def of(cls, plane: Tensor) -> "_Cloud":
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

    def half_width(self, along_x: Tensor, along_y: Tensor) -> Tensor:
        """Return half the width of an even spread in a direction, in squares (batch,)."""
        variance = (
            self.xx * along_x.square()
            + 2.0 * self.xy * along_x * along_y
            + self.yy * along_y.square()
        )
        return (3.0 * variance.clamp(min=0.0)).sqrt()


class _LineOfSight(NamedTuple):
    """The line from the middle of the charge to that of the protected structures.

    Attributes:
        x: Where it begins, in squares (batch,).
        y: Likewise.
        along_x: Its direction, of length 1 (batch,).
        along_y: Likewise.
        distance: Its length in squares (batch,).
        facade: Half the width of the structures across it, in squares (batch,).
        measures: What there is to say of it, each of the order of 1 (batch, 6).
    """

    x: Tensor
    y: Tensor
    along_x: Tensor
    along_y: Tensor
    distance: Tensor
    facade: Tensor
    measures: Tensor

    @classmethod
    def of(cls, planes: Tensor) -> "_LineOfSight":
        """Find it in an observation (batch, channels, height, width)."""
        levels = planes[:, CHARGE].float()
        # The plane shows the root of how likely the charge is in a square.
        charge, target = _Cloud.of(levels.square()), _Cloud.of(planes[:, PROTECTED].float())
        towards_x, towards_y = target.x - charge.x, target.y - charge.y
        distance = torch.hypot(towards_x, towards_y).clamp(min=1.0)
        along_x, along_y = towards_x / distance, towards_y / distance
        facade = target.half_width(-along_y, along_x).clamp(min=1.0)
        measures = torch.stack(
            (
                distance / (2.0 * _LENGTH),
                facade / _LENGTH,
                target.half_width(along_x, along_y) / _LENGTH,
                charge.half_width(along_x, along_y) / _LENGTH,
                charge.half_width(-along_y, along_x) / _LENGTH,
                levels.amax(dim=(1, 2)) / _LEVELS,
            ),
            dim=1,
        )
        return cls(charge.x, charge.y, along_x, along_y, distance, facade, measures)

    def coordinates(self, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        """Return how far places are along the line and aside of it, in squares.

        Args:
            x: In squares (batch, 1, columns).
            y: Likewise (batch, rows, 1).

        Returns:
            Two tensors (batch, rows, columns); to the left of the line is positive.
        """
        from_x, from_y = x - self.x[:, None, None], y - self.y[:, None, None]
        along_x, along_y = self.along_x[:, None, None], self.along_y[:, None, None]
        return from_x * along_x + from_y * along_y, from_y * along_x - from_x * along_y


def _covered_bearings(bearing: Tensor, barrier: Tensor) -> Tensor:
    """Return on which bearings a module stands, 0 or 1 (batch, BEARINGS)."""
    covered = torch.zeros(len(bearing), BEARINGS, device=bearing.device)
    return covered.scatter_add_(1, bearing, barrier.flatten(1)).clamp_(max=1.0)


def _corner(cost: Tensor) -> tuple[Tensor, Tensor]:
    """Return the first row and column of the build zone (batch,): only there cells have a cost."""
    inside_y, inside_x = cost.amax(dim=2).gt(0), cost.amax(dim=1).gt(0)
    return inside_y.int().argmax(dim=1), inside_x.int().argmax(dim=1)


def _crop(plane: Tensor, row: Tensor, column: Tensor, rows: int, columns: int) -> Tensor:
    """Return a rectangle of a plane (batch, rows, columns)."""
    batch = torch.arange(len(plane), device=plane.device)[:, None, None]
    row_of = row[:, None] + torch.arange(rows, device=plane.device)
    column_of = column[:, None] + torch.arange(columns, device=plane.device)
    row_of, column_of = (
        row_of.clamp(max=plane.shape[1] - 1),
        column_of.clamp(max=plane.shape[2] - 1),
    )
    return plane[batch, row_of[:, :, None], column_of[:, None, :]]
