"""Nothing gets out of a closed ring of modules, however hard the balls inside press on it."""

import pytest

from blast_env.evaluation.engines import simulate
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M
from tests.builders import block, point, site


def ring(cavity_modules: int, thickness: int, shift_m: float = 0.0) -> Scenario:
    """Return a charge in a square cavity with walls all around it, and a target outside.

    Args:
        cavity_modules: Side of the cavity.
        thickness: Of the walls, modules.
        shift_m: By which the upper wall is moved along itself, off the lattice of the others.
    """
    side, corner = cavity_modules + 2 * thickness, 6.0
    far = corner + (side - thickness) * MODULE_SIDE_M
    near = corner + thickness * MODULE_SIDE_M
    target_m = corner + side * MODULE_SIDE_M + 1.5
    walls: list[tuple[str, float, float, int, int]] = [
        ("lower", corner, corner, thickness, side),
        ("upper", corner - shift_m, far, thickness, side + (shift_m > 0.0)),
        ("left", corner, near, cavity_modules, thickness),
        ("right", far, near, cavity_modules, thickness),
        ("target", target_m, corner, side, 2),
    ]
    structures = [block(*wall, protected=wall[0] == "target") for wall in walls]
    middle_m = corner + side * MODULE_SIDE_M / 2.0
    size_m = (target_m + 4.0, 2.0 * corner + side * MODULE_SIDE_M)
    model = {"preset": "ballistic", "overrides": {"stepping": {"time_limit_s": 0.25}}}
    return site("ring", size_m, point(middle_m, middle_m), *structures, simulation=model)


@pytest.mark.parametrize("engine", ["pymunk", "event"])
@pytest.mark.parametrize(
    ("cavity_modules", "thickness", "shift_m", "seed"), [(4, 1, 0.0, 0), (5, 1, 0.25, 0)]
)
def test_a_closed_ring_is_closed(
    engine: str, cavity_modules: int, thickness: int, shift_m: float, seed: int
) -> None:
    """On pymunk, balls got between the modules of one wall, in the corners of the ring."""
    result = simulate(ring(cavity_modules, thickness, shift_m), seed=seed, engine=engine)
    assert result.impulse_sim("left") > 1000.0
    assert result.impulse_sim("target") == 0.0
    assert set(result.collisions["structure"]) == {"lower", "upper", "left", "right"}


def test_the_walls_of_a_ring_bear_alike() -> None:
    """Whatever holds the balls back loads no wall more than another, and no module for nothing."""
    result = simulate(ring(4, 1), seed=0, engine="pymunk")
    loads = [result.impulse_sim(name) for name in ("lower", "upper", "left", "right")]
    assert max(loads) < 1.1 * min(loads)
    hits = result.modules.groupby("structure")["hits"].agg(["min", "sum"]).to_dict("index")
    assert hits["left"]["min"] > 0
    assert hits["target"]["sum"] == 0
