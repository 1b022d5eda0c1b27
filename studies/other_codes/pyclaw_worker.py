"""Run one scene with PyClaw, in an interpreter with clawpack and without this project.

`python pyclaw_worker.py IN.npz OUT.npz`: IN holds `state` (4, nx, ny) of density, momenta and
energy in units of still air, `air` (nx, ny), `cell_m`, `gauges` (n, 2) and `until`; OUT holds
`times` (steps,), `overpressure` (steps, n) over still air's pressure, and `cpu_s`.
"""

import sys
from time import process_time
from typing import Any

import numpy as np
from clawpack import pyclaw, riemann
from numpy.typing import NDArray

GAMMA = 1.4


def _run(
    state: NDArray[Any], air: NDArray[Any], cell_m: float, gauges: NDArray[Any], until: float
) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Return times, overpressures in the gauges after each step, and CPU s."""
    solver = pyclaw.ClawSolver2D(riemann.euler_hlle_with_walls_2D)
    solver.dimensional_split = True
    solver.limiters = pyclaw.limiters.tvd.vanleer
    solver.cfl_desired, solver.cfl_max = 0.45, 0.5
    solver.dt_initial = 0.01 * cell_m
    for bounds in (solver.bc_lower, solver.bc_upper, solver.aux_bc_lower, solver.aux_bc_upper):
        bounds[0] = bounds[1] = pyclaw.BC.extrap
    axes = [
        pyclaw.Dimension(0.0, n * cell_m, n, name=name)
        for n, name in zip(air.shape, "xy", strict=True)
    ]
    domain = pyclaw.Domain(axes)
    field = pyclaw.State(domain, 4, 1)
    field.problem_data["gamma"] = GAMMA
    field.q[:], field.aux[0] = state, air
    solution = pyclaw.Solution(field, domain)
    solver.setup(solution)
    # PyClaw also advances the state inside the walls, which would become unphysical; reset it.
    solid = ~air
    still = np.array([1.0, 0.0, 0.0, 1.0 / (GAMMA - 1.0)])

    def empty_walls(_: object, now: Any) -> None:
        now.q[:, solid] = still[:, None]

    solver.before_step = empty_walls
    times, overpressures, begin = [], [], process_time()
    while solution.t < until:
        solver.evolve_to_time(solution)
        if not solver.accept_step:
            continue
        density, x, y, energy = solution.q[:, gauges[:, 0], gauges[:, 1]]
        times.append(solution.t)
        pressure = (GAMMA - 1.0) * (energy - 0.5 * (x * x + y * y) / density)
        overpressures.append(pressure - 1.0)
    return np.array(times), np.array(overpressures), process_time() - begin


if __name__ == "__main__":
    given = np.load(sys.argv[1])
    times, overpressure, cpu_s = _run(
        given["state"], given["air"], float(given["cell_m"]), given["gauges"], float(given["until"])
    )
    np.savez(sys.argv[2], times=times, overpressure=overpressure, cpu_s=cpu_s)
