"""A scene that is mirrored or turned gives the same blast, mirrored or turned, to the last bit."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from blast_env.evaluation.engines.particles import PymunkEngine
from blast_env.geometry import Rectangle
from blast_env.site.balls import Balls, air_lattice, explosion_fan
from blast_env.site.scene import Scene
from blast_env.site.structure import ModularObstacle
from blast_env.units import MODULE_SIDE_UNITS
from tests.particles.scenes import finished, parameters, scene, wall

SITE = Rectangle(-60.0, -60.0, 60.0, 60.0)
"""Centred on the origin: there, and only there, mirroring rounds nothing."""


@dataclass(frozen=True)
class Turn:
    """A symmetry of the square: a matrix of -1, 0 and 1."""

    name: str
    matrix: tuple[tuple[int, int], tuple[int, int]]

    def points(self, points: np.ndarray) -> np.ndarray:
        """Return the images of points (n, 2), with -0.0 replaced by 0.0."""
        turned: np.ndarray = points @ np.array(self.matrix, dtype=np.float64).T + 0.0
        return turned


TURNS = [  # all other symmetries of the square are made of these two
    Turn("left and right swapped", ((-1, 0), (0, 1))),
    Turn("a quarter turn", ((0, -1), (1, 0))),
]


def blast(turn: Turn | None, air: dict[str, object], contact: dict[str, object]) -> Scene:
    """A charge and air in front of a structure with a notch, all of it turned."""
    of_parameters = parameters(
        air={"mass": 0.2, "elasticity": 0.97, "spacing_units": 4.1, **air},
        explosive={"ball_count": 360, "elasticity": 0.97},
        contact=contact,
        stepping={"time_limit_s": 0.15},
    )
    rng = np.random.default_rng(5)
    corner, rows, columns = (20.0, -9.0), 10, 4
    cells = tuple((r, c) for r in range(rows) for c in range(columns) if (r, c) != (3, 0))
    rectangle = wall(corner, rows, columns).build().rectangle
    lattice = air_lattice(of_parameters.air, SITE, [rectangle], (-7.3, 1.7), 2.0, rng)
    fan = explosion_fan(of_parameters.explosive, (-7.3, 1.7), rng)
    of_balls = Balls.concatenate((lattice, fan))
    if turn is not None:
        of_balls = replace(
            of_balls,
            position=turn.points(of_balls.position),
            velocity=turn.points(of_balls.velocity),
        )
    # Single modules: a grid would number them in an order of its own.
    parts = wall(corner, rows, columns, cells=cells).build().parts
    centres = np.array([(part.x, part.y) for part in parts])
    corners = (centres if turn is None else turn.points(centres)) - MODULE_SIDE_UNITS / 2.0
    modules = [
        wall(tuple(corner), 1, 1, f"module {number}")
        for number, corner in enumerate(corners.tolist())
    ]
    return replace(scene(of_balls, modules, of_parameters), site_m=SITE.scaled(0.25))


def loads(obstacles: tuple[ModularObstacle, ...]) -> list[tuple[int, float, float]]:
    return [(o.hits, o.impulse, o.transferred_impulse) for o in obstacles]


@pytest.mark.parametrize("contact", [{}, {"base_impulse": 3.0, "module_restitution": 0.9}])
@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.name)
def test_a_turned_blast_is_the_same_blast(turn: Turn, contact: dict[str, object]) -> None:
    plain, turned = (finished(blast(t, {}, contact)) for t in (None, turn))
    assert plain.steps == turned.steps > 5000
    assert plain.obstacles[0].hits + plain.obstacles[5].hits > 0
    assert loads(plain.obstacles) == loads(turned.obstacles)
    before, after = plain.balls(), turned.balls()
    assert (before.index == after.index).all()
    assert (turn.points(before.position) == after.position + 0.0).all()
    assert (turn.points(before.velocity) == after.velocity + 0.0).all()


def test_a_mirrored_blast_loads_modules_alike_in_steps() -> None:
    air: dict[str, object] = {"spacing_units": 8.0}
    plain, mirrored = (finished(blast(t, air, {}), PymunkEngine()) for t in (None, TURNS[0]))
    assert plain.obstacles[0].hits + plain.obstacles[5].hits > 0
    assert [o.impulse for o in plain.obstacles] == [o.impulse for o in mirrored.obstacles]


@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.name)
def test_ties_do_not_break_the_symmetry(turn: Turn) -> None:
    """On a bare lattice balls meet several others at exactly the same time, all over the site."""
    air: dict[str, object] = {"jitter": 0.0, "lattice_offset": "centred", "spacing_units": 4.0}
    plain, turned = (finished(blast(t, air, {})) for t in (None, turn))
    assert plain.steps == turned.steps > 5000
    assert loads(plain.obstacles) == loads(turned.obstacles)
