"""Precomputed table of glass plates, made with `plate`.

    python -m blast_env.response.plate_table    # recomputes the table, in some 10 s

Each row is a plate of one aspect ratio at one deflection, dimensionless as in `plate`. The risk
integral is Beason & Morgan's, over both faces:

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
from numpy.polynomial.legendre import leggauss

from blast_env.arrays import FloatArray
from blast_env.response.plate import Plate, PlateState

WEIBULL_M: Final = 7.0
"""Surface flaw parameter m of weathered window glass (ASTM E1300)."""

_ASPECT_RATIOS: Final = (1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0)
_DEFLECTIONS: Final = np.geomspace(0.02, 30.0, 48)
_LOADS: Final = np.geomspace(0.1, 80_000.0, 90)
_NAME: Final = "glass_plates.csv"


@dataclass(frozen=True, eq=False)
class PlateCurve:
    """Load, risk and shape of a plate of one aspect ratio over its deflection.

    Attributes:
        deflection: w / h of the centre, ascending (points,).
        load: q b^4 / (E h^4) (points,).
        risk: R (points,).
        load_mass_factor: mean(phi^2) / mean(phi) of the shape (points,).
        load_factor: mean(phi) of the shape (points,).
    """

    deflection: FloatArray
    load: FloatArray
    risk: FloatArray
    load_mass_factor: FloatArray
    load_factor: FloatArray


@cache
def plate_curve(aspect_ratio: float) -> PlateCurve:
    """Return the curve of a plate, interpolated between those of the table.

    Args:
        aspect_ratio: Long over short side, from 1 to 5.
    """
    ratios, values = _table()
    columns = np.array(
        [
            [np.interp(aspect_ratio, ratios, values[:, point, column]) for column in range(4)]
            for point in range(values.shape[1])
        ]
    )
    return PlateCurve(
        deflection=_DEFLECTIONS,
        load=np.exp(columns[:, 0]),
        risk=np.exp(columns[:, 1]),
        load_mass_factor=columns[:, 2],
        load_factor=columns[:, 3],
    )


@cache
def _table() -> tuple[FloatArray, FloatArray]:
    """Return aspect ratios, and per ratio and deflection: ln load, ln risk, K_LM, mean(phi)."""
    text = files("blast_env.response").joinpath("data", _NAME).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    rows = np.array([[float(each) for each in line.split(",")] for line in lines[1:]])
    values = rows[:, 2:].reshape(len(_ASPECT_RATIOS), len(_DEFLECTIONS), 4)
    values = np.concatenate([np.log(values[..., :2]), values[..., 2:]], axis=-1)
    return np.array(_ASPECT_RATIOS), values


def curve_values(aspect_ratio: float) -> FloatArray:
    """Return load, risk, K_LM and mean(phi) over the table's deflections (deflections, 4).

    Solves von Karman's equations, in half a second.
    """
    states = Plate(aspect_ratio).states(_LOADS)
    found = np.array([_values(state, aspect_ratio) for state in states])
    at = np.log(_DEFLECTIONS)
    known = np.log([state.deflection for state in states])
    logs = [np.interp(at, known, np.log(found[:, column])) for column in (0, 1)]
    shapes = [np.interp(at, known, found[:, column]) for column in (2, 3)]
    return np.column_stack([*np.exp(logs), *shapes])


def _values(state: PlateState, aspect_ratio: float) -> tuple[float, ...]:
    shape = state.volume / state.deflection
    return state.load, _risk(state, aspect_ratio), state.shape_square / shape, shape


def _risk(state: PlateState, aspect_ratio: float) -> float:
    larger, smaller = state.principal[..., 0], state.principal[..., 1]
    tension = np.maximum(larger, 0.0) * aspect_ratio  # from b^2 to ab
    ratio = np.divide(smaller, larger, out=np.zeros_like(larger), where=larger > 0.0)
    total = (_biaxial_power(ratio) * tension**WEIBULL_M * state.weights).sum()
    return float(total)


def _biaxial_power(ratio: FloatArray) -> FloatArray:
    """Return c^m for ratios of smaller over larger principal stress, at most 1."""
    points, weights = leggauss(24)
    negative = np.where(ratio < 0.0, -ratio, 1.0)
    limit = np.where(ratio >= 0.0, np.pi / 2.0, np.arctan(np.sqrt(1.0 / negative)))
    angle = 0.5 * (points + 1.0) * limit[..., None]
    normal = np.cos(angle) ** 2 + ratio[..., None] * np.sin(angle) ** 2
    result: FloatArray = 2.0 / np.pi * limit * ((normal**WEIBULL_M) @ (0.5 * weights))
    return result


def table_text() -> str:
    """Return the table as text, with a comment on its origin."""
    lines = [
        "# von Karman plates, edges held and free to slip: blast_env.response.plate_table",
        "aspect_ratio,deflection,load,risk,load_mass_factor,load_factor",
    ]
    for ratio in _ASPECT_RATIOS:
        for deflection, row in zip(_DEFLECTIONS, curve_values(ratio), strict=True):
            lines.append(",".join(f"{each:.6g}" for each in (ratio, deflection, *row)))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    from pathlib import Path

    Path(__file__).with_name("data").joinpath(_NAME).write_text(table_text(), encoding="utf-8")
