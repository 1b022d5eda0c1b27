"""A terrace is a step in the ground: nothing is lost there, and who is far from it is not told."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env.gas import FaceLoads, GasRun, GasSettings
from blast_env.layout import build_site
from tests import builders
from tests.builders import block, point
from tests.gas.flows import all_faces, blast, check_nothing_is_lost, face_loads, recorder
from tests.test_terraces import WALL, terraced

NEAR = GasSettings(border_m=0.0)
"""Open borders 2 m beside the site."""


def test_a_closed_box_with_a_step_loses_nothing() -> None:
    """Mass and energy stay; all its walls, the terrace's too, take up the change of momentum."""
    open_box = GasRun(NEAR, build_site(terraced(), WALL)).grid.solid
    box = np.pad(open_box, 1, constant_values=True)
    solver = blast(box, (9, 17, 3), loaded=all_faces, looking=face_loads, precision="double")
    check_nothing_is_lost(solver)
    load, faces = recorder(solver, FaceLoads), solver.faces
    impulse = load.net_impulse_pa_s
    area_m2 = solver.grid.cell_m**2
    pushed = [
        -area_m2 * float((impulse * faces.side)[faces.axis == axis].sum()) for axis in range(3)
    ]
    scale = area_m2 * float(load.impulse_pa_s.sum())
    momentum = np.array(solver.totals().momentum_kg_m_s)
    assert np.array(pushed) / scale == pytest.approx(-momentum / scale, abs=1e-12)


def loads_on(
    building: dict[str, Any],
    charge_m: tuple[float, float, float],
    *terraces: dict[str, Any],
    until_s: float,
    air_m: float = 7.0,
) -> NDArray[np.float64]:
    """Return impulse and peak on each face of a building (2, n), of 5 kg on a site 30 m long."""
    x_m, y_m, height_m = charge_m
    source = point(x_m, y_m, 5.0, height_m=height_m)
    grounds = (terrace | {"carries": True} for terrace in terraces)
    scenario = builders.site("step", (30.0, 16.0, air_m), source, building, *grounds)
    site = build_site(scenario)
    run = GasRun(GasSettings(border_m=0.0, until=until_s), site)
    run.advance(np.inf)
    own = run.table.structure == 0
    order = np.lexsort((*run.table.centre_m[own].T, run.table.face[own]))
    loads = run.loads.impulse_pa_s, run.loads.peak_pa
    return np.stack([load[own][order] for load in loads])


def test_a_far_terrace_is_felt_by_nothing_that_counts() -> None:
    """Its edge is 18 m from the charge, and 12 m behind the hut; its echo comes in the suction."""
    hut = block("hut", 8.0, 7.0, 4, 4, height_m=2.5, protected=True)
    terrace = block("terrace", 22.0, 0.0, 32, 16, height_m=1.0)
    flat, stepped = (
        loads_on(hut, (4.0, 8.0, 0.0), *terraces, until_s=0.1) for terraces in ((), (terrace,))
    )
    assert np.array_equal(flat, stepped)
    assert flat[0].mean() > 150.0  # Pa s: the blast has passed


def test_on_a_terrace_far_from_its_edge_it_is_as_on_the_ground() -> None:
    """Charge, hall and air a metre higher; an edge that is near shows by then."""
    high_m, until_s = 1.0, 0.02

    def hall(base_m: float) -> dict[str, Any]:
        ends = {"base_m": base_m, "height_m": base_m + 2.5}
        return block("hall", 15.0, 6.0, 8, 6, protected=True, **ends)

    flat = loads_on(hall(0.0), (12.0, 8.0, 1.5), until_s=until_s)
    wide, narrow = (
        loads_on(
            hall(high_m),
            (12.0, 8.0, 1.5 + high_m),
            block("terrace", left_m, 0.0, 32, round(2.0 * (right_m - left_m)), height_m=high_m),
            until_s=until_s,
            air_m=7.0 + high_m,
        )
        for left_m, right_m in ((0.0, 30.0), (11.0, 18.0))
    )
    assert flat[0].mean() > 150.0
    assert wide == pytest.approx(flat, rel=1e-5)
    assert narrow != pytest.approx(flat, rel=0.01)
