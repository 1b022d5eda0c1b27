"""The grid error: Roache's grid convergence index of loads and reductions.

Final statements run on fine cells, and once more, for the worst charge, on cells twice as large.
The index of a number f of both runs is

    GCI = F |f_fine - f_coarse| / (r^p - 1)

with the ratio r of the sizes of the cells, the order p of the method and a factor of safety F
(Roache 1994, 1998). Roache takes F = 1.25 where three sizes show the order, and F = 3 where two
sizes leave it assumed. Here there are two sizes, so F = 3; docs/engineers/gas.md has the order
assumed, and measures how often the index covers the numbers on still smaller cells.

The index is absolute: that of a load is a load, that of a reduction a share. It bounds neither the
error of the model nor the spread of charges.
"""

from dataclasses import dataclass
from math import nan
from typing import Final, NamedTuple, Self

from blast_env.errors import BlastEnvError
from blast_env.evaluation.blasts import Blasts, NumberOf
from blast_env.evaluation.cases import LoadCase
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.record import BlastRecord
from blast_env.geometry import Layout
from blast_env.statistics import reductions

ORDER: Final = 2.0
"""Assumed order of convergence: that of the method in smooth flow."""

FACTOR: Final = 3.0
"""Factor of safety with two sizes of cells."""

RATIO: Final = 2.0
"""Ratio of the sizes of the cells of an engine and of its `Engine.coarser`."""


def convergence_index(
    fine: float,
    coarse: float,
    ratio: float = RATIO,
    order: float = ORDER,
    factor: float = FACTOR,
) -> float:
    """Return Roache's grid convergence index of a number on the fine cells, in its unit.

    `ratio` is the side of the coarse cells over that of the fine ones.

    Raises:
        BlastEnvError: If `ratio` is not above 1, or `order` or `factor` is not above 0.
    """
    for name, value, least in (("ratio", ratio, 1.0), ("order", order, 0.0), ("factor", factor, 0)):
        if not value > least:
            raise BlastEnvError(f"{name} is {value:g}, must be above {least:g}")
    return float(factor * abs(fine - coarse) / (ratio**order - 1.0))


@dataclass(frozen=True, eq=False)
class GridError:
    """The grid error of numbers of a layout under one charge.

    Attributes:
        threat: The charge.
        layout: The layout.
        fine: Records with the layout and without a barrier on the fine cells.
        coarse: The same on the coarse ones.
        coarser: The engine with the coarse cells.
        ratio: Side of the coarse cells over that of the fine ones.
    """

    threat: LoadCase
    layout: Layout
    fine: tuple[BlastRecord, BlastRecord]
    coarse: tuple[BlastRecord, BlastRecord]
    coarser: Engine
    ratio: float = RATIO

    @classmethod
    def of(
        cls, blasts: Blasts, name: str | None = None, number: int | None = None
    ) -> "GridError | None":
        """Return the error for a layout under a charge; `None` without coarser cells.

        It is for the layout in question unless that is named, and for the charge that governs of
        those with coarser cells, unless its number is given.
        """
        # 1. The charges with both sizes of cells.
        coarse, name = blasts.coarse, name or blasts.judged
        if coarse is None:
            return None
        numbers = [k for k, own in enumerate(blasts.threats) if own in coarse.threats]
        if not numbers or number not in (None, *numbers):
            return None
        # 2. Of these the one that governs, unless another is asked for.
        if number is None:
            number = numbers[blasts.under(numbers).worst(name)]
        # 3. Both sizes, each with the layout and without a barrier.
        threat = blasts.threats[number]
        fine_m, coarse_m = (part.engine.smallest_m for part in (blasts, coarse))
        return cls(
            threat,
            blasts.layouts[name],
            blasts.pairs(name)[number],
            coarse.pairs(name)[coarse.threats.index(threat)],
            coarse.engine,
            coarse_m / fine_m if fine_m else RATIO,
        )

    def of_reduction(self, number_of: NumberOf, unprotected_of: NumberOf | None = None) -> float:
        """Return the error of the reduction of a number, as an absolute share; NaN without one.

        `unprotected_of` selects the number without a barrier, if it is another.
        """
        fine, coarse = (
            reductions(number_of(protected), (unprotected_of or number_of)(unprotected)).item()
            for protected, unprotected in (self.fine, self.coarse)
        )
        return convergence_index(fine, coarse, self.ratio)

    def of_load(self, number_of: NumberOf) -> float:
        """Return the error of a number with the layout as a share of it; NaN of no load."""
        return self._share(0, number_of)

    def of_unprotected(self, number_of: NumberOf) -> float:
        """Return the error of a number without a barrier as a share of it; NaN of no load."""
        return self._share(1, number_of)

    def _share(self, side: int, number_of: NumberOf) -> float:
        # As a share of the load, which carries over to means over all charges.
        fine, coarse = number_of(self.fine[side]), number_of(self.coarse[side])
        return convergence_index(fine, coarse, self.ratio) / fine if fine > 0.0 else nan


class Effect(NamedTuple):
    """A number of a blast with a layout and without a barrier; errors are NaN with one size.

    Attributes:
        reduction: Share that is gone; NaN without a load.
        error: Grid error of `value`, in its unit.
        unprotected_error: That of `unprotected`.
        reduction_error: That of `reduction`, an absolute share.
    """

    value: float
    unprotected: float
    reduction: float
    error: float = nan
    unprotected_error: float = nan
    reduction_error: float = nan

    @classmethod
    def of(cls, blasts: Blasts, number_of: NumberOf, number: int) -> Self:
        """Return the effect of the layout in question under a threat, by its number."""
        pair = blasts.pairs(blasts.judged)[number]
        return cls.between(pair, number_of, GridError.of(blasts, number=number))

    @classmethod
    def between(
        cls,
        pair: tuple[BlastRecord, BlastRecord],
        number_of: NumberOf,
        error: GridError | None,
    ) -> Self:
        """Return the effect between the records with a layout and without a barrier."""
        value, unprotected = map(number_of, pair)
        gone = reductions(value, unprotected).item()
        if error is None:
            return cls(value, unprotected, gone)
        return cls(
            value,
            unprotected,
            gone,
            error.of_load(number_of) * value,
            error.of_unprotected(number_of) * unprotected,
            error.of_reduction(number_of),
        )


def impulse_of(record: BlastRecord) -> float:
    """Return the impulse on the protected structures, Pa s."""
    return record.loads.protected_impulse_pa_s
