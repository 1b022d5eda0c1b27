"""Features of the cells of the build zone and of the site, as inputs of the policy.

Lengths are in squares of the planes, unless stated otherwise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import torch
from torch import Tensor

from blast_env.envs.planes import GridObservation

_LEAST_WAY: Final = 1e-3
"""Least length of a path along an axis, in squares, against division by 0."""


class Spread(NamedTuple):
    """Mean position of a plane's values, in squares, and their covariance (batch,)."""

    x: Tensor
    y: Tensor
    xx: Tensor
    xy: Tensor
    yy: Tensor

    @classmethod
    def of(cls, plane: Tensor) -> "Spread":
        """Return mean and covariance of a plane (batch, rows, columns)."""
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
        """Return the half width of a uniform distribution from its variance."""
        return (3.0 * variance.clamp(min=0.0)).sqrt()

    def half_width(self, along_x: Tensor, along_y: Tensor) -> Tensor:
        """Return the half width along directions, in squares (batch, directions)."""
        variance = (
            self.xx[:, None] * along_x.square()
            + 2.0 * self.xy[:, None] * along_x * along_y
            + self.yy[:, None] * along_y.square()
        )
        return self.half_extent(variance)


class LinesOfSight(NamedTuple):
    """Lines from places of the charge to the centre of the protected structures.

    All attributes are (batch, places), lengths in squares.

    Attributes:
        x: Start of the line.
        y: Start of the line.
        along_x: Horizontal component of its unit vector.
        along_y: Vertical component of its unit vector.
        distance: Its length, at least 1.
        left: Tangent of the angle from the line to the left edge of the structures.
        right: Tangent of the angle to the right edge, which is negative to the right of the line.
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

        Several structures count as one rectangle with the same mean and variances.
        """
        towards_x, towards_y = target.x[:, None] - x, target.y[:, None] - y
        distance = torch.hypot(towards_x, towards_y).clamp(min=1.0)
        along_x, along_y = towards_x / distance, towards_y / distance
        tangents = _corner_tangents(x, y, along_x, along_y, target)
        left, right = tangents.amax(dim=0), tangents.amin(dim=0)
        return cls(x, y, along_x, along_y, distance, left, right)

    def coordinates(self, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        """Return the coordinates of points along each line and aside of it, in squares.

        Args:
            x: Abscissas of the points, in squares (batch, points).
            y: Ordinates of the points, in squares (batch, points).

        Returns:
            Two tensors (batch, places, points); aside is positive to the left of the line.
        """
        from_x, from_y = x[:, None] - self.x[..., None], y[:, None] - self.y[..., None]
        along_x, along_y = self.along_x[..., None], self.along_y[..., None]
        return from_x * along_x + from_y * along_y, from_y * along_x - from_x * along_y


def stands_before(
    lines: LinesOfSight, along: Tensor, x: Tensor, y: Tensor, target: Spread
) -> Tensor:
    """Return the mask, 0 or 1, of the points before the structures, neither in nor behind them.

    Args:
        lines: Lines from each place of the charge (batch, places).
        along: Coordinates of the points along each line, in squares (batch, places, points).
        x: Abscissas of the points, in squares (batch, points).
        y: Ordinates of the points, in squares (batch, points).
        target: The structures.

    Returns:
        (batch, places, points); 0 also for points on the other side of the charge.
    """
    enter_x, leave_x = _slab(lines.x, x, target.x, target.half_extent(target.xx))
    enter_y, leave_y = _slab(lines.y, y, target.y, target.half_extent(target.yy))
    enter, leave = torch.maximum(enter_x, enter_y), torch.minimum(leave_x, leave_y)
    is_met = (enter < leave) & (leave > 0.0) & (enter < 1.0)
    return ((along > 0.0) & ~is_met).float()


def likely_places(likely: Tensor, places: int) -> tuple[Tensor, Tensor]:
    """Return places that represent equal parts of a distribution.

    Args:
        likely: Relative probability of the charge per square (batch, rows, columns).
        places: Number of places; 1 gives the mean.

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
    """Return the shares of the paths to the points at which they enter and leave a slab."""
    way = end[:, None] - start[..., None]
    way = torch.where(way.abs() < _LEAST_WAY, _LEAST_WAY, way)
    one = ((middle - half)[:, None] - start)[..., None] / way
    other = ((middle + half)[:, None] - start)[..., None] / way
    return torch.minimum(one, other), torch.maximum(one, other)


def _corner_tangents(
    x: Tensor, y: Tensor, along_x: Tensor, along_y: Tensor, target: Spread
) -> Tensor:
    """Return the tangents of the angles to the corners of a rectangle (corners, batch, places)."""
    half_x, half_y = target.half_extent(target.xx), target.half_extent(target.yy)
    tangents = []
    for side_x, side_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        from_x = (target.x + side_x * half_x)[:, None] - x
        from_y = (target.y + side_y * half_y)[:, None] - y
        along = (from_x * along_x + from_y * along_y).clamp(min=1.0)
        tangents.append((from_y * along_x - from_x * along_y) / along)
    return torch.stack(tangents)


BEARINGS: Final = 96
"""Number of bearings from each place of the charge."""

MOST_OFFSET: Final = 4.0
"""Extent of the bearings to either side of the facade's centre, in half widths of the facade."""

_MOST_DEPTH: Final = 3.0


class Bearings(NamedTuple):
    """Bearings of the cells and the structures from each place of the charge.

    More of a blast reaches a facade under a wider angle, so shares of the facade are weighted by
    that angle.

    Attributes:
        first: First bearing of each cell (batch, places, cells).
        last: Bearing after the last one of each cell (batch, places, cells).
        before: Mask of the cells before the structures, 0 or 1 (batch, places, cells).
        of_facade: Share of the facade on each bearing (batch, places, BEARINGS).
        offset: Angular offset of a cell from the facade's centre, in half widths of the facade;
            mean over the places (batch, cells).
        offset_size: Mean magnitude of the offset over the places (batch, cells).
        cut: Share of the facade that a module on a cell hides (batch, cells).
    """

    first: Tensor
    last: Tensor
    before: Tensor
    of_facade: Tensor
    offset: Tensor
    offset_size: Tensor
    cut: Tensor

    @classmethod
    def of(cls, lines: LinesOfSight, along: Tensor, aside: Tensor, before: Tensor) -> "Bearings":
        """Return the bearings of cells.

        A module hides the bearings between its two outermost corners, in whole steps of `2 *
        MOST_OFFSET / BEARINGS` half widths of the facade. Only modules before the structures hide
        anything.

        Args:
            lines: Lines from each place of the charge (batch, places).
            along: Coordinates of the cells along each line, in squares (batch, places, cells).
            aside: Coordinates aside of it, in squares (batch, places, cells).
            before: Mask of the cells before the structures, 0 or 1 (batch, places, cells).
        """
        half_facade = (lines.left - lines.right).clamp(min=1e-3)[..., None] / 2.0
        middle = (lines.left + lines.right)[..., None] / 2.0
        half_module = 0.5 * (lines.along_x.abs() + lines.along_y.abs())[..., None]
        nearest = along.clamp(min=1.0)
        offset = (aside / nearest - middle) / half_facade
        half = half_module / nearest / half_facade
        first, last = _edge(offset - half), _edge(offset + half)
        last = torch.maximum(last, (first + 1).clamp(max=BEARINGS))
        weight = half_facade / half_facade.sum(dim=1, keepdim=True)
        centres = (torch.arange(BEARINGS, device=along.device) + 0.5) / BEARINGS * 2.0 - 1.0
        of_facade = centres.abs().mul(MOST_OFFSET).le(1.0).float()
        of_facade = (of_facade / of_facade.sum()) * weight
        return cls(
            first=first,
            last=last,
            before=before,
            of_facade=of_facade,
            offset=offset.clamp(-MOST_OFFSET, MOST_OFFSET).mean(dim=1),
            offset_size=offset.abs().clamp(max=MOST_OFFSET).mean(dim=1),
            cut=(_sums(of_facade, first, last) * before).sum(dim=1),
        )


class Occlusion(NamedTuple):
    """Occlusion of the bearings by modules; means over the places of the charge.

    Attributes:
        open_cut: Share of the facade that a module on a cell would newly hide (batch, cells).
        covered: Share of a cell's bearings on which a module stands (batch, cells).
        depth: Number of modules on a bearing of a cell, at most 3, divided by 3 (batch, cells).
        hidden: Share of the places with a module on a bearing (batch, BEARINGS).
        open_facade: Share of the facade that is not hidden yet (batch,).
    """

    open_cut: Tensor
    covered: Tensor
    depth: Tensor
    hidden: Tensor
    open_facade: Tensor

    @classmethod
    def of(cls, bearings: Bearings, barrier: Tensor) -> "Occlusion":
        """Return the occlusion by a barrier, and by one more module on each cell.

        Args:
            bearings: Bearings of the cells.
            barrier: Mask of the cells with a module, 0 or 1 (batch, cells).
        """
        first, last, before = bearings.first, bearings.last, bearings.before
        depth = _depth(first, last, barrier[:, None] * before)
        covered = depth.gt(0.0).float()
        open_facade = bearings.of_facade * (1.0 - covered)
        wide = (last - first).clamp(min=1).float()
        modules = _sums(depth.clamp(max=_MOST_DEPTH), first, last) / wide
        return cls(
            open_cut=(_sums(open_facade, first, last) * before).sum(dim=1),
            covered=(_sums(covered, first, last) / wide).mean(dim=1),
            depth=modules.mean(dim=1) / _MOST_DEPTH,
            hidden=covered.mean(dim=1),
            open_facade=open_facade.sum(dim=(1, 2)),
        )


def _edge(offset: Tensor) -> Tensor:
    """Return the nearest boundary between two bearings, from 0 to BEARINGS."""
    share = (offset / MOST_OFFSET + 1.0) / 2.0
    return (share * BEARINGS).round().clamp(0, BEARINGS).long()


def _depth(first: Tensor, last: Tensor, modules: Tensor) -> Tensor:
    """Return the number of modules on each bearing (batch, places, BEARINGS)."""
    steps = torch.zeros(*first.shape[:2], BEARINGS + 1, device=first.device)
    steps.scatter_add_(2, first, modules).scatter_add_(2, last, -modules)
    return steps.cumsum(dim=2)[..., :BEARINGS]


def _sums(values: Tensor, first: Tensor, last: Tensor) -> Tensor:
    """Return the sum of values (batch, places, BEARINGS) over the bearings of each cell."""
    up_to = torch.nn.functional.pad(values.cumsum(dim=2), (1, 0))
    return up_to.gather(2, last) - up_to.gather(2, first)


SHARES: Final = ("stock_share", "stock", "budget_share")
"""Channels with the same value everywhere."""

STATIC: Final = ("protected", "cost", "charge")
"""Channels from which `ZoneGeometry` is computed."""


class StaticCellFeatures(NamedTuple):
    """Features of each cell that do not depend on the layout, (batch, cells) each.

    Attributes:
        along: Distance along the line of sight, over 10 m.
        remaining: Remaining distance to the structures, over 10 m.
        along_share: `along` as a share of the length of the line.
        aside: Distance aside of the line, positive to the left, over 10 m.
        aside_size: Magnitude of `aside`.
        offset: See `Bearings`.
        offset_size: See `Bearings`.
        cut: Share of the facade that a module hides, times 10.
    """

    along: Tensor
    remaining: Tensor
    along_share: Tensor
    aside: Tensor
    aside_size: Tensor
    offset: Tensor
    offset_size: Tensor
    cut: Tensor


class ChangingCellFeatures(NamedTuple):
    """Further features of each cell for the present layout, (batch, cells) each.

    Attributes:
        open_cut: Share of the facade that a module would newly hide, times 10.
        covered: See `Occlusion`.
        depth: See `Occlusion`.
        cost: Cost of a module, from 0 to 1.
        free: Whether a module may be placed, 0 or 1.
    """

    open_cut: Tensor
    covered: Tensor
    depth: Tensor
    cost: Tensor
    free: Tensor


CELL_FEATURES: Final = (*StaticCellFeatures._fields, *ChangingCellFeatures._fields)
"""Names of the features of a cell, in their order."""


class SiteFeatures(NamedTuple):
    """Features of charge and structures, of the order of 1, (batch, 1) each.

    Attributes:
        distance: Distance from the mean place of the charge to that of the structures, over 20 m.
        half_facade: Half width of the structures across the line of sight, over 10 m.
        half_depth: Half depth of the structures along it, over 10 m.
        charge_half_length: Half extent of the charge's places along it, over 10 m.
        charge_half_width: Half extent of the charge's places across it, over 10 m.
        charge: Largest value of the charge's plane.
    """

    distance: Tensor
    half_facade: Tensor
    half_depth: Tensor
    charge_half_length: Tensor
    charge_half_width: Tensor
    charge: Tensor


SITE_FEATURES: Final = (
    *SiteFeatures._fields,
    "open_facade",
    *SHARES,
    *(f"hidden_{bearing}" for bearing in range(BEARINGS)),
)
"""Names of the features of the site, in their order."""


@dataclass(frozen=True, eq=False)
class Planes:
    """The planes of an observation by the names of their channels.

    Attributes:
        values: Values from 0 to 1 (batch, channels, height, width).
        channels: Their names, including those of `GridObservation`, in any order.
    """

    values: Tensor
    channels: tuple[str, ...] = GridObservation.channels

    def __getitem__(self, name: str) -> Tensor:
        """Return a plane (batch, height, width)."""
        return self.values[:, self.channels.index(name)]

    def of(self, names: Sequence[str]) -> Tensor:
        """Return several planes (batch, names, height, width)."""
        return self.values[:, [self.channels.index(name) for name in names]]


_LEVELS: Final = 255.0
"""Inverse of the step of planes' values: as whole numbers their sums are exact."""

_LENGTH: Final = 20.0
"""Divisor of lengths, in squares (10 m), so that they are of the order of 1."""

_SHARE_GAIN: Final = 10.0
"""Factor on the share of a facade that a module hides, so that it is of the order of 1."""


class ZoneView(NamedTuple):
    """Features of the cells of the build zone and of the site.

    Attributes:
        cells: Features of each cell (batch, rows, columns, features), named in `CELL_FEATURES`.
        barrier: Mask of the cells with a module, 0 or 1 (batch, rows, columns).
        free: Mask of the cells where a module may be placed, 0 or 1 (batch, rows, columns).
        site: Features of the site (batch, features), named in `SITE_FEATURES`.
    """

    cells: Tensor
    barrier: Tensor
    free: Tensor
    site: Tensor


class ZoneGeometry(NamedTuple):
    """Features that do not depend on the layout.

    Attributes:
        row: First row of the build zone in the planes (batch,).
        column: First column of the build zone in the planes (batch,).
        rows: Rows of the zone.
        columns: Columns of the zone.
        bearings: Bearings of the cells.
        cells: Features of each cell (batch, cells, features), those of `StaticCellFeatures`.
        cost: Cost of a module, from 0 to 1 (batch, cells).
        site: Features of the site (batch, features), those of `SiteFeatures`.
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
    def of(cls, planes: Planes, rows: int, columns: int, places: int = 1) -> "ZoneGeometry":
        """Return the geometry of the build zone along the lines of sight.

        The features of a cell rotate with the site: its coordinates along and aside of the line of
        sight, in lengths and relative to the line's length and to the facade, and the share of the
        facade that a module hides there. A policy therefore generalises to other places of the
        charge and to rotated sites. For a hidden charge they are means over `places`.

        Args:
            planes: Planes of the observation.
            rows: Rows of the build zone.
            columns: Columns of the build zone.
            places: Number of places that represent the charge; 1 takes the mean.
        """
        # Only cells of the build zone have a cost.
        row, column = (planes["cost"].amax(dim=dim).gt(0).int().argmax(dim=1) for dim in (2, 1))
        cost = _crop(planes["cost"], row, column, rows, columns)
        # The plane shows the square root of the charge's relative probability in a square.
        likely = (planes["charge"] * _LEVELS).round().square()
        target = Spread.of((planes["protected"] * _LEVELS).round())
        lines = LinesOfSight.between(*likely_places(likely, places), target)
        x = (column[:, None, None] + torch.arange(columns, device=row.device) + 0.5).float()
        y = (row[:, None, None] + torch.arange(rows, device=row.device)[:, None] + 0.5).float()
        shape = (len(row), rows, columns)
        x, y = x.expand(shape).flatten(1), y.expand(shape).flatten(1)
        along, aside = lines.coordinates(x, y)
        bearings = Bearings.of(lines, along, aside, stands_before(lines, along, x, y, target))
        distance = lines.distance[..., None]
        cells = StaticCellFeatures(
            along=along.mean(dim=1) / _LENGTH,
            remaining=(distance - along).mean(dim=1) / _LENGTH,
            along_share=(along / distance).mean(dim=1),
            aside=aside.mean(dim=1) / _LENGTH,
            aside_size=aside.abs().mean(dim=1) / _LENGTH,
            offset=bearings.offset,
            offset_size=bearings.offset_size,
            cut=bearings.cut * _SHARE_GAIN,
        )
        return cls(
            row=row,
            column=column,
            rows=rows,
            columns=columns,
            bearings=bearings,
            cells=torch.stack(cells, dim=-1),
            cost=cost.flatten(1),
            site=torch.cat(_measures(planes, likely, target), dim=1),
        )

    def crop(self, plane: Tensor) -> Tensor:
        """Return the build zone's part of a plane, from 0 to 1 (batch, rows, columns)."""
        return _crop(plane, self.row, self.column, self.rows, self.columns)

    def view(self, planes: Planes) -> ZoneView:
        """Return the features of the present layout.

        Static features of a cell are complemented by the share of the facade that a module would
        newly hide there, and by the modules on its bearings.

        Args:
            planes: Planes of the observation of these sites.
        """
        barrier, free = (self.crop(planes[name]) for name in ("barrier", "free"))
        seen = Occlusion.of(self.bearings, barrier.flatten(1))
        changing = ChangingCellFeatures(
            open_cut=seen.open_cut * _SHARE_GAIN,
            covered=seen.covered,
            depth=seen.depth,
            cost=self.cost,
            free=free.flatten(1),
        )
        cells = torch.cat((self.cells, torch.stack(changing, dim=-1)), dim=-1)
        shares = planes.of(SHARES)[:, :, 0, 0]
        site = (self.site, seen.open_facade[:, None], shares, seen.hidden)
        return ZoneView(cells.view(*barrier.shape, -1), barrier, free, torch.cat(site, dim=1))


def _measures(planes: Planes, likely: Tensor, target: Spread) -> SiteFeatures:
    """Return the features of charge and structures."""
    charge = Spread.of(likely)
    line = LinesOfSight.between(charge.x[:, None], charge.y[:, None], target)
    along_x, along_y = line.along_x, line.along_y
    return SiteFeatures(
        distance=line.distance / (2.0 * _LENGTH),
        half_facade=target.half_width(-along_y, along_x).clamp(min=1.0) / _LENGTH,
        half_depth=target.half_width(along_x, along_y) / _LENGTH,
        charge_half_length=charge.half_width(along_x, along_y) / _LENGTH,
        charge_half_width=charge.half_width(-along_y, along_x) / _LENGTH,
        charge=planes["charge"].amax(dim=(1, 2))[:, None],
    )


def _crop(plane: Tensor, row: Tensor, column: Tensor, rows: int, columns: int) -> Tensor:
    """Return a rectangle of a plane (batch, rows, columns)."""
    batch = torch.arange(len(plane), device=plane.device)[:, None, None]
    row_of = row[:, None] + torch.arange(rows, device=plane.device)
    column_of = column[:, None] + torch.arange(columns, device=plane.device)
    row_of = row_of.clamp(max=plane.shape[1] - 1)
    column_of = column_of.clamp(max=plane.shape[2] - 1)
    return plane[batch, row_of[:, :, None], column_of[:, None, :]]
