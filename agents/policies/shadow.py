"""How much of the sight of the protected structures modules take away, bearing by bearing."""

from typing import Final, NamedTuple

import torch
from torch import Tensor

from agents.policies.sight import LinesOfSight

BEARINGS: Final = 96
"""Bearings that are told apart from each place of the charge."""
MOST_SHADE: Final = 4.0
"""They reach so many half widths of the facade to either side of its middle."""

_MOST_DEPTH: Final = 3.0


class Bearings(NamedTuple):
    """On which bearings the cells and the structures are seen from each place of the charge.

    From a place that sees the facade under a wider angle, more of a blast meets it: shares of the
    facade are weighted by that.

    Attributes:
        first: The first bearing of each cell (batch, places, cells).
        last: The one after its last, likewise.
        before: Which cells lie before the structures, 0 or 1, likewise.
        of_facade: Share of the facade on each bearing (batch, places, BEARINGS).
        shade: How far from the facade's middle a cell is seen from the charge, in half widths of
            the facade; mean over the places (batch, cells).
        shade_size: The same without its sign, place by place (batch, cells).
        cut: Share of the facade that a module on a cell hides (batch, cells).
    """

    first: Tensor
    last: Tensor
    before: Tensor
    of_facade: Tensor
    shade: Tensor
    shade_size: Tensor
    cut: Tensor

    @classmethod
    def of(cls, lines: LinesOfSight, along: Tensor, aside: Tensor, before: Tensor) -> "Bearings":
        """Find them.

        A module hides the bearings between its two outermost corners, in whole steps of `2 *
        MOST_SHADE / BEARINGS` half widths of the facade. What does not stand before the structures
        hides nothing.

        Args:
            lines: From each place of the charge (batch, places).
            along: How far the cells are along each line, in squares (batch, places, cells).
            aside: How far they are aside of it, likewise.
            before: Which of them lie before the structures, 0 or 1, likewise.
        """
        half_facade = (lines.left - lines.right).clamp(min=1e-3)[..., None] / 2.0
        middle = (lines.left + lines.right)[..., None] / 2.0
        half_module = 0.5 * (lines.along_x.abs() + lines.along_y.abs())[..., None]
        nearest = along.clamp(min=1.0)
        shade = (aside / nearest - middle) / half_facade
        half = half_module / nearest / half_facade
        first, last = _edge(shade - half), _edge(shade + half)
        last = torch.maximum(last, (first + 1).clamp(max=BEARINGS))
        weight = half_facade / half_facade.sum(dim=1, keepdim=True)
        centres = (torch.arange(BEARINGS, device=along.device) + 0.5) / BEARINGS * 2.0 - 1.0
        of_facade = centres.abs().mul(MOST_SHADE).le(1.0).float()
        of_facade = (of_facade / of_facade.sum()) * weight
        return cls(
            first=first,
            last=last,
            before=before,
            of_facade=of_facade,
            shade=shade.clamp(-MOST_SHADE, MOST_SHADE).mean(dim=1),
            shade_size=shade.abs().clamp(max=MOST_SHADE).mean(dim=1),
            cut=(_sums(of_facade, first, last) * before).sum(dim=1),
        )


class Shadow(NamedTuple):
    """What modules do to the bearings; means over the places of the charge.

    Attributes:
        open_cut: Share of the facade that a module on a cell would hide and that nothing hides
            yet (batch, cells).
        covered: Share of a cell's bearings on which a module stands (batch, cells).
        depth: How many modules stand on a bearing of a cell, at most 3, divided by 3
            (batch, cells).
        hidden: Share of the places from which a module stands on a bearing (batch, BEARINGS).
        open_facade: Share of the facade that nothing hides yet (batch,).
    """

    open_cut: Tensor
    covered: Tensor
    depth: Tensor
    hidden: Tensor
    open_facade: Tensor

    @classmethod
    def of(cls, bearings: Bearings, barrier: Tensor) -> "Shadow":
        """Return what the modules of a barrier hide, and what one more on each cell would.

        Args:
            bearings: Of the cells.
            barrier: Which cells hold a module, 0 or 1 (batch, cells).
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


def _edge(shade: Tensor) -> Tensor:
    """Return the boundary between two bearings that is nearest, from 0 to BEARINGS."""
    share = (shade / MOST_SHADE + 1.0) / 2.0
    return (share * BEARINGS).round().clamp(0, BEARINGS).long()


def _depth(first: Tensor, last: Tensor, modules: Tensor) -> Tensor:
    """Return how many modules stand on each bearing (batch, places, BEARINGS)."""
    steps = torch.zeros(*first.shape[:2], BEARINGS + 1, device=first.device)
    steps.scatter_add_(2, first, modules).scatter_add_(2, last, -modules)
    return steps.cumsum(dim=2)[..., :BEARINGS]


def _sums(values: Tensor, first: Tensor, last: Tensor) -> Tensor:
    """Return the sum of values (batch, places, BEARINGS) over the bearings of each cell."""
    up_to = torch.nn.functional.pad(values.cumsum(dim=2), (1, 0))
    return up_to.gather(2, last) - up_to.gather(2, first)
