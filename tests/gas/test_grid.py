"""Grids and arguments that make no sense are refused, with the value and the bound."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import LoadTable, Snapshots
from blast_env.gas.solver import Burning, GasSolver, Settling

WRONG: Any = "wall"
AIR = np.zeros((4, 3, 2), dtype=bool)
GRID = GasGrid(0.5, AIR, origin_m=(1.0, 2.0, 0.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GasGrid(0.0, AIR), "cell_m is 0.0, but must be above 0"),
        (lambda: GasGrid(float("nan"), AIR), "cell_m is nan"),
        (lambda: GasGrid(0.5, AIR[0]), "must be of three dimensions"),
        (lambda: GasGrid(0.5, AIR.astype(int)), "and bool"),
        (lambda: GasGrid(0.5, AIR[:0]), "no cells at all"),
        (lambda: GasGrid(0.5, AIR, x_low=WRONG), "x_low is 'wall', but must be one of"),
        (lambda: GasGrid(0.5, AIR, origin_m=WRONG[:2]), "three finite lengths"),
        (lambda: GRID.cell_at((3.1, 2.0, 0.0)), "x = 3.1 m is outside the grid, 1.0 to 3.0 m"),
        (lambda: GasSolver(GRID, precision=WRONG), "precision is 'wall'"),
        (lambda: GasSolver(GRID, threads=0), "threads is 0, but must be at least 1"),
        (lambda: GasSolver(GRID, courant=0.6), "courant is 0.6, but must be above 0"),
        (lambda: GasSolver(GRID, pressure_pa=0.0), "0.0 Pa"),
        (lambda: GasSolver(GRID, burning=Burning(1.0, 1.0)), "needs with_fuel=True"),
        (lambda: GasSolver(GRID, settling=Settling(0.1, 1.0)), "hottest is 1.0, but must be above"),
        (
            lambda: GasSolver(GRID).set_state(density_kg_m3=1.0, pressure_pa=-1.0),
            "pressure_pa falls to -1.0",
        ),
        (lambda: LoadTable(1, 0.0, is_mean=True), "arrival_pa is 0.0"),
        (lambda: Snapshots(GRID, 3, 0, []), "axis is 3"),
        (lambda: Snapshots(GRID, 2, 2, []), "layer is 2, but must be 0 to 1"),
    ],
)
def test_errors_carry_the_value(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        make()


def test_places_in_the_grid() -> None:
    assert GRID.shape == (4, 3, 2)
    assert GRID.centres_m(0).tolist() == [1.25, 1.75, 2.25, 2.75]
    assert GRID.cell_at((1.0, 2.6, 0.9)) == (0, 1, 1)
    assert GRID.cell_at((3.0, 3.5, 1.0)) == (3, 2, 1)
