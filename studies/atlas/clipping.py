"""What cells clip off peaks, from the same walls in the open on two sizes of cells.

Peaks go to those of endlessly small cells with a power of the side of the cells. So each pair of
runs gives what the coarse cells clip. Its logarithm is fitted by a quadratic of the logarithm of
the distance and of the cosine of the angle of incidence.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from studies.atlas.samples import Bays, Group, curves_at, samples_edges, walls_in_the_open
from studies.atlas.scenes import MODULES

_EXPONENT: Final = 0.8
"""Power of the side of the cells with which reflected peaks converge (gas dynamics' own checks)."""


@dataclass(frozen=True, eq=False)
class Clipping:
    """What cells clip off peaks.

    Attributes:
        coarse: Coefficients of the logarithm of what 12 cells per m/kg^(1/3) take off.
    """

    coarse: FloatArray

    @classmethod
    def of(cls, coarse: Iterable[Group], fine: Iterable[Group]) -> "Clipping":
        """Return the clipping by the groups that ran on both sizes of cells."""
        on_coarse = {_key(group): group for group in coarse}
        terms, clipped = [], []
        for group in fine:
            both = [on_coarse[_key(group)], group]
            (wide, wide_pa), (_, sharp_pa) = (_peaks(own) for own in both)
            endless = sharp_pa + (sharp_pa - wide_pa) / (2.0**_EXPONENT - 1.0)
            numbers, chosen = samples_edges(wide)
            terms.append(_terms(np.exp(numbers[chosen, 1]), numbers[chosen, 2]))
            clipped.append(np.log(endless / wide_pa)[chosen])
        found = np.linalg.lstsq(np.concatenate(terms), np.concatenate(clipped), rcond=None)
        return cls(np.asarray(found[0]))

    def sharpening(self, cells: float, distance: FloatArray, cosine: FloatArray) -> FloatArray:
        """Return the factor on peaks that makes them those of endlessly small cells.

        Args:
            cells: Cells per m/kg^(1/3).
            distance: Scaled distances, m/kg^(1/3).
            cosine: Cosines of the angles of incidence; 0 at least counts.
        """
        clipped = np.maximum(_terms(distance, cosine) @ self.coarse, 0.0)
        return np.asarray(np.exp(clipped * (MODULES / cells) ** _EXPONENT))


def _key(group: Group) -> tuple[str, int]:
    return group["family"], group["group"]


def _peaks(group: Group) -> tuple[Bays, FloatArray]:
    (bays,) = walls_in_the_open([group])
    return bays, curves_at(bays, True)[:, 1] * np.exp(bays.log_change[:, 1])


def _terms(distance: FloatArray, cosine: FloatArray) -> FloatArray:
    far, slant = np.log(distance), np.maximum(cosine, 0.0)
    return np.column_stack([np.ones(len(far)), far, far**2, slant, slant**2, far * slant])
