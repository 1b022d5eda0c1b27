"""Nothing gets out of a closed ring of modules, however hard the balls inside press on it."""

import pytest

from blast_env.evaluation.engines import simulate
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M
from tests.builders import block, point, site


def ring(cavity_modules: int, shift_m: float) -> Scenario:
    """Return a charge in a square cavity with walls all around it, and a target outside.

    Args:
        cavity_modules: Side of the cavity.
        shift_m: By which the upper wall is moved along itself, off the lattice of the others.
    """
    side, corner = cavity_modules + 2, 6.0
    near, far = corner + MODULE_SIDE_M, corner + (side - 1) * MODULE_SIDE_M
    target_m = corner + side * MODULE_SIDE_M + 1.5
    walls: list[tuple[str, float, float, int, int]] = [
        ("lower", corner, corner, 1, side),
        ("upper", corner - shift_m, far, 1, side + (shift_m > 0.0)),
        ("left", corner, near, cavity_modules, 1),
        ("right", far, near, cavity_modules, 1),
        ("target", target_m, corner, side, 2),
    ]
    structures = [block(*wall, protected=wall[0] == "target") for wall in walls]
    middle_m = corner + side * MODULE_SIDE_M / 2.0
    size_m = (target_m + 4.0, 2.0 * corner + side * MODULE_SIDE_M)
    model = {"preset": "ballistic", "overrides": {"stepping": {"time_limit_s": 0.25}}}
    return site("ring", size_m, point(middle_m, middle_m), *structures, simulation=model)


@pytest.mark.parametrize("engine", ["pymunk", "event"])
@pytest.mark.parametrize(("cavity_modules", "shift_m"), [(4, 0.0), (5, 0.25)])
def test_a_closed_ring_is_closed_and_borne_alike_by_its_walls(
    engine: str, cavity_modules: int, shift_m: float
) -> None:
    """On pymunk, balls got between the modules of one wall, in the corners of the ring."""
    result = simulate(ring(cavity_modules, shift_m), seed=0, engine=engine)
    loads = [result.impulse_sim(name) for name in ("lower", "upper", "left", "right")]
    assert 1000.0 < max(loads) < 1.1 * min(loads)
    assert result.impulse_sim("target") == 0.0
    assert set(result.collisions["structure"]) == {"lower", "upper", "left", "right"}
