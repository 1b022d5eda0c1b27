"""The plate solver: thin-plate limit, E1300's deflections, and the table of the package."""

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.response.plate_table import plate_curve
from studies.plates import POISSON_RATIO, Plate, curve_values


def test_small_deflections_are_those_of_thin_plates() -> None:
    """Timoshenko & Woinowsky-Krieger, table 8: 0.00406 q b^4 / D in the middle of a square."""
    (state,) = Plate(1.0).states(np.array([0.01]))
    factor = 12.0 * (1.0 - POISSON_RATIO**2)
    assert state.deflection / state.load == pytest.approx(0.00406 * factor, rel=2e-3)


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
def test_deflections_are_those_of_e1300(ratio: float) -> None:
    """Its appendix gives ln(w / h) as a square of ln ln(q (ab)^2 / (E h^4)): a fit of its own."""
    load = np.array([20.0, 100.0, 500.0])
    states = Plate(ratio).states(np.concatenate([np.geomspace(0.1, 15.0, 12), load]))[-3:]
    r = ratio ** np.arange(4)
    r0 = r @ [0.553, -3.83, 1.11, -0.0969]
    r1 = r @ [-2.29, 5.83, -2.17, 0.2067]
    r2 = r @ [1.485, -1.908, 0.815, -0.0822]
    x = np.log(np.log(load * ratio**2))
    expected = np.exp(r0 + r1 * x + r2 * x**2)
    assert [state.deflection for state in states] == pytest.approx(expected, rel=0.05)


def test_plates_stiffen_as_they_bend() -> None:
    states = Plate(1.5).states(np.geomspace(0.1, 500.0, 20))
    compliance = [state.deflection / state.load for state in states]
    assert np.all(np.diff(compliance) < 0.0)


def test_stresses_grow_slower_than_loads_and_their_weights_are_the_plate() -> None:
    first, last = Plate(1.0).states(np.array([1.0, 50.0]))
    assert 1.0 < last.largest_stress / first.largest_stress < 50.0
    assert last.weights.sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_the_table_is_what_the_equations_give() -> None:
    """The shipped file against the solver, for one of its aspect ratios."""
    values = curve_values(1.5)
    curve = plate_curve(1.5)
    assert curve.load == pytest.approx(values[:, 0], rel=1e-3)
    assert curve.risk == pytest.approx(values[:, 1], rel=1e-2)
    assert curve.load_mass_factor == pytest.approx(values[:, 2], rel=1e-3)


@pytest.mark.parametrize("ratio", [0.9, 5.1, float("nan")])
def test_aspect_ratios_out_of_bounds(ratio: float) -> None:
    with pytest.raises(BlastEnvError, match=r"aspect ratio is .*, must be from 1 to 5"):
        Plate(ratio)
