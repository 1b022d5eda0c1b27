"""Reflected peaks on a facade by the size of the cells, against Kingery and Bulmash."""

from dataclasses import dataclass
from time import process_time
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.curves import Quantity, kingery_bulmash
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas.settings import FACE_NAMES
from blast_env.site import Scenario

FACADES: Final = ((100.0, 12.5), (20.0, 10.0), (100.0, 20.0))
"""Charges in kg on the ground, and their distances from the facade in m."""

ENGINES: Final = (
    GasEngine(),
    GasEngine(cell_m=0.25),
    GasEngine(cells="fine"),
    GasEngine(cells="fine", cell_m=0.125),
    GasEngine(cells="fine", cell_m=0.1),
)

_BEFORE_M: Final = 5.0  # ground behind the charge
_WIDTH_M: Final = 20.0
_HEIGHT_M: Final = 9.0
_NEAR_M: Final = 0.6  # half the width of the patch opposite the charge, and half its height


@dataclass(frozen=True)
class FacadeLoad:
    """The load on the patch of a facade opposite a charge, over Kingery and Bulmash's.

    Attributes:
        peak: Reflected peak overpressure.
        impulse: Reflected impulse.
        cpu_s: Processor time of the blast.
    """

    peak: float
    impulse: float
    cpu_s: float


def facade(charge_kg: float, distance_m: float) -> Scenario:
    """Return the site of a charge on the ground before a facade of 20 x 9 m."""
    width_m = _WIDTH_M + 10.0
    document = {
        "schema_version": 2,
        "name": "facade",
        "site": {"width_m": width_m, "height_m": distance_m + 10.0, "air_height_m": 15.0},
        "charge": [{"kind": "point", "position_m": (width_m / 2, _BEFORE_M), "tnt_kg": charge_kg}],
        "structures": [
            {
                "kind": "ModularObstacle",
                "name": "building",
                "corner_m": ((width_m - _WIDTH_M) / 2, _BEFORE_M + distance_m),
                "rows": 8,
                "columns": int(2 * _WIDTH_M),
                "protected": True,
                "height_m": _HEIGHT_M,
            }
        ],
    }
    return Scenario.from_document(document, "facade")


def facade_load(charge_kg: float, distance_m: float, engine: GasEngine) -> FacadeLoad:
    """Run a blast before a facade; return the load on the patch of 1.2 m opposite the charge."""
    began_s = process_time()
    run = GasBlast(facade(charge_kg, distance_m), engine=engine).run().run
    cpu_s = process_time() - began_s
    table = run.table
    x_m, _, z_m = table.centre_m.T
    beside_m = np.abs(x_m - run.site.charge.position_m[0])
    own = (table.structure == 0) & (table.face == FACE_NAMES.index("south"))
    patch = own & (beside_m < _NEAR_M) & (z_m < 2.0 * _NEAR_M)

    def over_curve(loads: FloatArray, of: Quantity) -> float:
        return float(loads[patch].mean()) / kingery_bulmash(of, distance_m, charge_kg)

    return FacadeLoad(
        over_curve(run.loads.peak_pa, "reflected_overpressure"),
        over_curve(run.loads.impulse_pa_s, "reflected_impulse"),
        cpu_s,
    )
