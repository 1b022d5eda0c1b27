"""Large deflection of a simply supported glass plate by von Karman's equations.

    python -m studies.plates    # recomputes the table of the package, in some 10 s

All quantities are dimensionless, so that one table serves all panes. With the short side b, the
thickness h, Young's modulus E and the pressure q

    load        q b^4 / (E h^4)
    deflection  w / h
    stress      sigma b^2 / (E h^2)

The edges carry no moment, do not deflect, and slip freely in the plane of the plate, like a pane in
gaskets and as ASTM E1300 assumes:

    D lap^2 w = q + h L(w, F)          lap^2 F = -(E / 2) L(w, w)
    L(u, v)   = u_xx v_yy - 2 u_xy v_xy + u_yy v_xx
    w = w_nn = 0 and F = F_n = 0 along the edge

(Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, chapter 13). The solution uses
Galerkin's method with cosines for w and clamped polynomials for F, and Newton's method in small
steps of load.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.legendre import leggauss

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.response import plate_table
from blast_env.response.plate_table import ASPECT_RATIOS, DEFLECTIONS, TABLE, WEIBULL_M

POISSON_RATIO: Final = 0.22
"""Poisson's ratio of soda-lime glass, as in ASTM E1300."""

_LOADS: Final = np.geomspace(0.1, 80_000.0, 90)
_COSINES: Final = 9
_POLYNOMIALS: Final = 9
_POINTS: Final = 32
_TOLERANCE: Final = 1e-10
_MOST_ITERATIONS: Final = 40


@dataclass(frozen=True, eq=False)
class PlateState:
    """A plate under one load.

    Attributes:
        load: q b^4 / (E h^4).
        deflection: Deflection of the centre, w / h.
        volume: Mean deflection over the plate, w / h.
        shape_square: Mean of the squared shape (w / w_centre)^2, for the mass factor.
        principal: Principal stresses sigma b^2 / (E h^2) at the points of a quarter, larger first
            (2 faces, points, points, 2); the face away from the load first.
        weights: Share of the plate's area for each point (points, points); they sum to 1.
    """

    load: float
    deflection: float
    volume: float
    shape_square: float
    principal: FloatArray
    weights: FloatArray


@dataclass(frozen=True)
class Plate:
    """A rectangular plate of unit short side.

    Attributes:
        aspect_ratio: Long over short side, from 1 to 5.
    """

    aspect_ratio: float

    def __post_init__(self) -> None:
        """Check the ratio.

        Raises:
            BlastEnvError: If it is out of bounds.
        """
        if not 1.0 <= self.aspect_ratio <= 5.0:
            raise BlastEnvError(f"aspect ratio is {self.aspect_ratio}, must be from 1 to 5")

    def states(self, loads: FloatArray) -> list[PlateState]:
        """Return the plate under each load.

        Args:
            loads: Ascending, each positive, q b^4 / (E h^4) (loads,).

        Raises:
            BlastEnvError: If Newton's method does not converge.
        """
        coefficients = np.zeros(_COSINES * _COSINES)
        states = []
        for load in loads.tolist():
            coefficients = self._solved(coefficients, load)
            states.append(self._state(coefficients, load))
        return states

    @cached_property
    def _half(self) -> tuple[float, float]:
        return self.aspect_ratio / 2.0, 0.5

    @cached_property
    def _points(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points and weights on (0, 1)."""
        points, weights = leggauss(_POINTS)
        return 0.5 * (points + 1.0), 0.5 * weights

    @cached_property
    def _bending(self) -> tuple[FloatArray, ...]:
        """Basis of w, its xx, yy and xy derivatives (functions, points of a quarter)."""
        along = [_cosines(self._points[0], half) for half in self._half]
        return _products(along)

    @cached_property
    def _membrane(self) -> tuple[FloatArray, ...]:
        """Basis of F, its xx, yy and xy derivatives (functions, points of a quarter)."""
        along = [_clamped(self._points[0], half) for half in self._half]
        return _products(along)

    @cached_property
    def _weights(self) -> FloatArray:
        """Quadrature weights of a quarter (points,); they sum to its area."""
        weights = np.outer(self._points[1], self._points[1]).ravel()
        return weights * self._half[0] * self._half[1]

    @cached_property
    def _stiffness(self) -> FloatArray:
        """Bending stiffness with D / (E h^3) (functions, functions)."""
        _, w_xx, w_yy, _ = self._bending
        laplacian = w_xx + w_yy  # the other terms vanish at these edges
        return (laplacian * self._weights) @ laplacian.T / (12.0 * (1.0 - POISSON_RATIO**2))

    @cached_property
    def _compliance(self) -> FloatArray:
        """Inverse of the membrane's matrix (functions, functions)."""
        _, f_xx, f_yy, _ = self._membrane
        laplacian = f_xx + f_yy
        return np.asarray(np.linalg.inv((laplacian * self._weights) @ laplacian.T), np.float64)

    def _solved(self, coefficients: FloatArray, load: float) -> FloatArray:
        """Return the coefficients of w under a load, starting from those under a smaller load."""
        pushed = load * (self._bending[0] @ self._weights)
        for _ in range(_MOST_ITERATIONS):
            residual, tangent = self._residual(coefficients, pushed)
            step = np.asarray(np.linalg.solve(tangent, -residual), np.float64)
            coefficients = coefficients + step
            if np.abs(step).max() <= _TOLERANCE * max(1.0, float(np.abs(coefficients).max())):
                return coefficients
        raise BlastEnvError(
            f"plate of aspect ratio {self.aspect_ratio:g} under a load of {load:g}: no convergence "
            f"in {_MOST_ITERATIONS} iterations, must be given in smaller steps of load"
        )

    def _residual(
        self, coefficients: FloatArray, pushed: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the residual of the equation of w, and its derivative."""
        w = [coefficients @ segment for segment in self._bending[1:]]
        stress_function = self._stress_function(coefficients)
        f = [stress_function @ segment for segment in self._membrane[1:]]
        basis = self._bending[0]
        residual = self._stiffness @ coefficients - pushed
        residual -= basis @ (self._weights * _bracket(w, f))
        changed = _bracket(self._bending[1:], f)  # variation of w with F fixed
        with_w = _bracket(self._bending[1:], w)
        moved = -self._compliance @ ((self._membrane[0] * self._weights) @ with_w.T)
        by_membrane = moved.T @ _bracket(self._membrane[1:], w)
        tangent = self._stiffness - (basis * self._weights) @ (changed + by_membrane).T
        return residual, tangent

    def _stress_function(self, coefficients: FloatArray) -> FloatArray:
        w = [coefficients @ segment for segment in self._bending[1:]]
        source: FloatArray = self._membrane[0] @ (self._weights * _bracket(w, w))
        return -0.5 * self._compliance @ source

    def _state(self, coefficients: FloatArray, load: float) -> PlateState:
        w, w_xx, w_yy, w_xy = (coefficients @ segment for segment in self._bending)
        stress_function = self._stress_function(coefficients)
        _, f_xx, f_yy, f_xy = (stress_function @ segment for segment in self._membrane)
        factor = -0.5 / (1.0 - POISSON_RATIO**2)
        bent = np.array(
            [
                factor * (w_xx + POISSON_RATIO * w_yy),
                factor * (w_yy + POISSON_RATIO * w_xx),
                factor * (1.0 - POISSON_RATIO) * w_xy,
            ]
        )
        stretched = np.array([f_yy, f_xx, -f_xy])
        faces = np.array([stretched + bent, stretched - bent])
        shares = self._weights / self._weights.sum()
        centre = float(coefficients.sum())  # every cosine is 1 there
        shape = (_POINTS, _POINTS)
        return PlateState(
            load=load,
            deflection=centre,
            volume=float(shares @ w),
            shape_square=float(shares @ (w / centre) ** 2),
            principal=_principal(faces).reshape(2, *shape, 2),
            weights=shares.reshape(shape),
        )


def _cosines(points: FloatArray, half: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return cos((2 i - 1) pi s / 2) at s = x / half, and its first and second derivative in x."""
    waves = np.arange(1.0, 2.0 * _COSINES, 2.0)[:, None] * np.pi / 2.0
    angle = waves * points
    return np.cos(angle), -waves / half * np.sin(angle), -((waves / half) ** 2) * np.cos(angle)


def _clamped(points: FloatArray, half: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (1 - s^2)^2 T_2i(s) at s = x / half, and its first and second derivative in x."""
    edge = chebyshev.poly2cheb([1.0, 0.0, -2.0, 0.0, 1.0])
    found: tuple[list[FloatArray], ...] = ([], [], [])
    for index in range(_POLYNOMIALS):
        own = chebyshev.chebmul(edge, [0.0] * (2 * index) + [1.0])
        for order, rows in enumerate(found):
            derived = chebyshev.chebval(points, chebyshev.chebder(own, order))
            rows.append(np.asarray(derived, np.float64) / half**order)
    value, first, second = (np.array(rows) for rows in found)
    return value, first, second


def _products(along: list[tuple[FloatArray, FloatArray, FloatArray]]) -> tuple[FloatArray, ...]:
    """Return the products of functions of x and y: value, xx, yy, xy (functions, points)."""
    x, y = along
    pairs = ((0, 0), (2, 0), (0, 2), (1, 1))
    return tuple(
        np.einsum("ip,jq->ijpq", x[i], y[j]).reshape(len(x[0]) * len(y[0]), -1) for i, j in pairs
    )


def _bracket(u: "tuple[FloatArray, ...] | list[FloatArray]", v: list[FloatArray]) -> FloatArray:
    """Return L(u, v) = u_xx v_yy - 2 u_xy v_xy + u_yy v_xx."""
    result: FloatArray = u[0] * v[1] - 2.0 * u[2] * v[2] + u[1] * v[0]
    return result


def _principal(stress: FloatArray) -> FloatArray:
    """Return the principal values of (faces, 3, points) in plane stress (faces, points, 2)."""
    mean = 0.5 * (stress[:, 0] + stress[:, 1])
    radius = np.hypot(0.5 * (stress[:, 0] - stress[:, 1]), stress[:, 2])
    return np.stack([mean + radius, mean - radius], axis=-1)


def curve_values(aspect_ratio: float) -> FloatArray:
    """Return load, risk, K_LM and mean(phi) over the table's deflections (deflections, 4).

    Solves von Karman's equations, in half a second.
    """
    states = Plate(aspect_ratio).states(_LOADS)
    found = np.array([_values(state, aspect_ratio) for state in states])
    at = np.log(DEFLECTIONS)
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
        "# von Karman plates, edges held and free to slip: studies.plates",
        "aspect_ratio,deflection,load,risk,load_mass_factor,load_factor",
    ]
    for ratio in ASPECT_RATIOS:
        for deflection, row in zip(DEFLECTIONS, curve_values(ratio), strict=True):
            lines.append(",".join(f"{value:.6g}" for value in (ratio, deflection, *row)))
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the table of the package."""
    with write_atomically(Path(plate_table.__file__).parent / "data" / TABLE) as temporary:
        temporary.write_text(table_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
