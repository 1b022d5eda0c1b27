"""Table of simply supported glass plates under large deflection, by von Karman's equations.

`python -m studies.plates` solves them, and makes the table. Each row is a plate of one aspect ratio
at one deflection, dimensionless: load q b^4 / (E h^4), deflection w / h, stress sigma b^2 / (E h^2)
with the short side b, the thickness h, Young's modulus E and the pressure q. The risk integral is
Beason & Morgan's, over both faces:

    R = mean((c sigma ab / (E h^2))^m) over the plate, sigma the larger principal stress, tension
    c = [2 / pi * integral of (cos^2 t + n sin^2 t)^m dt]^(1/m), n the ratio of principal stresses

(Beason & Morgan, Glass failure prediction model, J. Struct. Eng. 110 (1984) 197; ln R is the stress
distribution factor J of ASTM E1300).
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray

WEIBULL_M: Final = 7.0
"""Surface flaw parameter m of weathered window glass (ASTM E1300)."""

ASPECT_RATIOS: Final = (1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0)
"""Long over short side of the plates of the table."""

DEFLECTIONS: Final = np.geomspace(0.02, 30.0, 48)
"""Deflections w / h of the table, for each plate."""

TABLE: Final = "glass_plates.csv"
"""File of the table."""


@dataclass(frozen=True, eq=False)
class PlateCurve:
    """Load, risk and shape of a plate of one aspect ratio over its deflection.

    Attributes:
        deflection: w / h of the centre, ascending (points,).
        load: q b^4 / (E h^4) (points,).
        risk: R (points,).
        load_mass_factor: mean(phi^2) / mean(phi) of the shape (points,).
    """

    deflection: FloatArray
    load: FloatArray
    risk: FloatArray
    load_mass_factor: FloatArray


@cache
def plate_curve(aspect_ratio: float) -> PlateCurve:
    """Return the curve of a plate, interpolated between those of the table.

    Args:
        aspect_ratio: Long over short side, from 1 to 5.
    """
    ratios, values = _table()
    columns = np.array(
        [
            [np.interp(aspect_ratio, ratios, values[:, point, column]) for column in range(3)]
            for point in range(values.shape[1])
        ]
    )
    return PlateCurve(
        deflection=DEFLECTIONS,
        load=np.exp(columns[:, 0]),
        risk=np.exp(columns[:, 1]),
        load_mass_factor=columns[:, 2],
    )


@cache
def _table() -> tuple[FloatArray, FloatArray]:
    """Return aspect ratios, and per ratio and deflection: ln load, ln risk, K_LM, mean(phi)."""
    text = files("blast_env.response").joinpath("data", TABLE).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    rows = np.array([[float(word) for word in line.split(",")] for line in lines[1:]])
    values = rows[:, 2:].reshape(len(ASPECT_RATIOS), len(DEFLECTIONS), 4)
    values = np.concatenate([np.log(values[..., :2]), values[..., 2:]], axis=-1)
    return np.array(ASPECT_RATIOS), values
