"""Where the cells of the build zone lie between charge and building, read off the planes."""

from typing import Final, NamedTuple

import torch
from torch import Tensor

from agents.policies.shadow import BEARINGS, Bearings, Shadow
from agents.policies.sight import LinesOfSight, Spread, likely_places, stands_before
from blast_env.envs.grid_observation import GridObservation

CHANNELS: Final = GridObservation.channels
PROTECTED, CHARGE, COST, BARRIER, FREE = (
    CHANNELS.index(name) for name in ("protected", "charge", "cost", "barrier", "free")
)
SHARES: Final = tuple(CHANNELS.index(name) for name in ("stock_share", "stock", "budget_share"))

STATIC: Final = tuple(CHANNELS.index(name) for name in ("protected", "cost", "charge"))
"""The planes of which `ZoneGeometry` is made."""

CELL_FEATURES: Final = 13
SITE_FEATURES: Final = 7 + len(SHARES) + BEARINGS

_LEVELS: Final = 255.0
_LENGTH: Final = 20.0
"""Lengths are divided by so many squares, 10 m, to be of the order of 1."""
_SHARE_GAIN: Final = 10.0
"""A module hides some tenth of a facade; times this it is of the order of 1."""


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


class ZoneGeometry(NamedTuple):
    """What stays the same while modules are placed.

    Attributes:
        row: First row of the build zone in the planes (batch,).
        column: First column (batch,).
        rows: Rows of the zone.
        columns: Its columns.
        bearings: On which bearings the cells are seen.
        cells: Features of each cell (batch, cells, 8).
        cost: Cost of a module, from 0 to 1 (batch, cells).
        site: Features of the whole (batch, 6).
    """

    row: Tensor
    column: Tensor
    rows: int
    columns: int
    bearings: Bearings
    cells: Tensor
    cost: Tensor
    site: Tensor

    @classmethod
    def of(cls, planes: Tensor, rows: int, columns: int, places: int = 1) -> "ZoneGeometry":
        """Read the build zone off as seen along the lines of sight from charge to structures.

        The features of a cell turn with the site: how far it is along the line of sight and aside
        of it, in metres and as shares of the whole way and of the facade, and how much of the
        facade a module hides there. So what is learnt at one place of the charge holds at the
        others, and on a turned site. Where the charge is hidden, they are means over places that
        it may be at.

        Args:
            planes: A `"grid"` observation, from 0 to 255 (batch, channels, height, width).
            rows: Rows of the build zone.
            columns: Its columns.
            places: Places that stand for where the charge may be; 1 takes the middle.
        """
        row, column = _corner(planes[:, COST])
        cost = _crop(planes[:, COST], row, column, rows, columns).float() / _LEVELS
        # The plane shows the root of how likely the charge is in a square.
        likely = planes[:, CHARGE].float().square()
        target = Spread.of(planes[:, PROTECTED].float())
        lines = LinesOfSight.between(*likely_places(likely, places), target)
        x = (column[:, None, None] + torch.arange(columns, device=planes.device) + 0.5).float()
        y = (row[:, None, None] + torch.arange(rows, device=planes.device)[:, None] + 0.5).float()
        shape = (len(planes), rows, columns)
        x, y = x.expand(shape).flatten(1), y.expand(shape).flatten(1)
        along, aside = lines.coordinates(x, y)
        bearings = Bearings.of(lines, along, aside, stands_before(lines, along, x, y, target))
        distance = lines.distance[..., None]
        cells = (
            along.mean(dim=1) / _LENGTH,
            (distance - along).mean(dim=1) / _LENGTH,
            (along / distance).mean(dim=1),
            aside.mean(dim=1) / _LENGTH,
            aside.abs().mean(dim=1) / _LENGTH,
            bearings.shade,
            bearings.shade_size,
            bearings.cut * _SHARE_GAIN,
        )
        return cls(
            row=row,
            column=column,
            rows=rows,
            columns=columns,
            bearings=bearings,
            cells=torch.stack(cells, dim=-1),
            cost=cost.flatten(1),
            site=_measures(planes, likely, target),
        )

    def view(self, planes: Tensor) -> ZoneView:
        """Return what the policy sees now.

        For each cell there is more to say once modules stand: how much of the facade a module
        would hide there that nothing hides yet, and what stands on its bearing already.

        Args:
            planes: The observation of these sites (batch, channels, height, width).
        """
        barrier, free = (
            _crop(planes[:, channel], self.row, self.column, self.rows, self.columns).float()
            / _LEVELS
            for channel in (BARRIER, FREE)
        )
        seen = Shadow.of(self.bearings, barrier.flatten(1))
        shaded = (seen.open_cut * _SHARE_GAIN, seen.covered, seen.depth, self.cost, free.flatten(1))
        cells = torch.cat((self.cells, torch.stack(shaded, dim=-1)), dim=-1)
        shares = planes[:, SHARES, 0, 0].float() / _LEVELS
        site = (self.site, seen.open_facade[:, None], shares, seen.hidden)
        return ZoneView(cells.view(*barrier.shape, -1), barrier, free, torch.cat(site, dim=1))


def _measures(planes: Tensor, likely: Tensor, target: Spread) -> Tensor:
    """Return what there is to say of charge and structures, of the order of 1 (batch, 6)."""
    charge = Spread.of(likely)
    line = LinesOfSight.between(charge.x[:, None], charge.y[:, None], target)
    along_x, along_y = line.along_x, line.along_y
    return torch.cat(
        (
            line.distance / (2.0 * _LENGTH),
            target.half_width(-along_y, along_x).clamp(min=1.0) / _LENGTH,
            target.half_width(along_x, along_y) / _LENGTH,
            charge.half_width(along_x, along_y) / _LENGTH,
            charge.half_width(-along_y, along_x) / _LENGTH,
            planes[:, CHARGE].float().amax(dim=(1, 2))[:, None] / _LEVELS,
        ),
        dim=1,
    )


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
