"""The peak to compare with a limit: cells clip peaks, and clipping must not keep a limit.

On a face in sight of the charge, the larger of the peak on its cells and Kingery and Bulmash's
reflected peak counts: that at normal incidence or at the angle of the face, whichever is larger,
for the height of the charge (`blast_env.curves.over_ground`). On other faces, the peak on the cells
is multiplied by the possible clipping (`peak_factor`), up to the curve, since an obstacle adds
nothing to the wave in the open. If the cells alone exceed the curve, as between walls, it is no
bound.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pandas as pd

from blast_env.curves import Ways, in_the_open, normally_reflected
from blast_env.response.facade import peak_factor
from blast_env.site.blast_site import BlastSite, in_sight


class PeakSource(StrEnum):
    """The sources of a peak, in the words of a report."""

    GAS = "gas"
    CURVE = "Kingery-Bulmash reflected"
    EXTRAPOLATED = "gas, extrapolated from the cells"


@dataclass(frozen=True)
class PeakWeight:
    """The peak on a building to compare with limits."""

    pa: float
    source: PeakSource


def counted_peak(site: BlastSite, cell_m: float, faces: pd.DataFrame) -> PeakWeight:
    """Return the largest of the counted peaks on faces of cells, of `GasResult.on_walls`."""
    charge = site.charge
    points_m = faces[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)
    outward = np.zeros((len(faces), 3))
    outward[:, :2] = faces[["outward_x", "outward_y"]]
    seen = in_sight(site, points_m, outward)
    _, tnt_kg, height_m = charge
    ways = Ways.between((*charge.position_m, height_m), points_m, outward, seen)
    gas_pa = faces["peak_pa"].to_numpy(dtype=np.float64)
    curve_pa = normally_reflected("overpressure", ways.away_m, tnt_kg, height_m)
    curve_pa = np.maximum(curve_pa, in_the_open("overpressure", ways, tnt_kg, height_m))
    grown_pa = peak_factor(cell_m, charge.tnt_kg) * gas_pa
    bounded = gas_pa <= curve_pa
    hidden_pa = np.where(bounded, np.minimum(grown_pa, curve_pa), grown_pa)
    counted_pa = np.where(seen, np.maximum(gas_pa, curve_pa), hidden_pa)
    which = int(counted_pa.argmax())
    source = PeakSource.GAS if seen[which] else PeakSource.EXTRAPOLATED
    if bounded[which] and counted_pa[which] == curve_pa[which]:
        source = PeakSource.CURVE
    return PeakWeight(float(counted_pa[which]), source)
