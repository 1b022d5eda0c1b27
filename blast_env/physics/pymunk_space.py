"""A scene as a pymunk space, ready to be stepped."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import pymunk
from numpy.typing import NDArray

from blast_env.physics.parameters import BallParameters, SimulationParameters
from blast_env.physics.particles import Balls, CollisionType
from blast_env.physics.structure import Border, ModularObstacle, ModularPart
from blast_env.physics.surface import wall_surface
from blast_env.scene import Scene
from blast_env.units import MODULE_SIDE_UNITS

CHARGE_GROUP: Final = 1
"""Shapes of one group do not collide with each other: the balls of a charge."""

_BORDER_THICKNESS_UNITS: Final = 4.0
_HASH_CELLS: Final = 5000


class BallShape(pymunk.Circle):
    """A ball's circle that knows the ball's index in the scene."""

    index: int


class ModuleShape(pymunk.Poly):
    """A module's square that knows its index and the corners where the wall goes on."""

    index: int
    x: float
    y: float
    covered_corners: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class PymunkSpace:
    """A space and the objects in it.

    Attributes:
        space: The space.
        ball_bodies: Bodies of the scene's balls, in their order.
        ball_shapes: Shapes of the scene's balls, in their order.
        parts: The modules of all obstacles, in order.
        module_bodies: Bodies by module index; modules that no ball can reach have none.
        border_body: The body of the border lines.
        time_step_s: The time step that suits the parameters.
        longest_step_s: The longest time step that the parameters allow.
        fastest_units_per_s: The speed that the time step was made for.
        module_friction: Friction of the modules.
    """

    space: pymunk.Space
    ball_bodies: list[pymunk.Body]
    ball_shapes: list[BallShape]
    parts: list[ModularPart]
    module_bodies: dict[int, pymunk.Body]
    border_body: pymunk.Body
    time_step_s: float
    longest_step_s: float
    fastest_units_per_s: float
    module_friction: float

    def expose(self, standing: NDArray[np.int64]) -> list[int]:
        """Bring the modules up to date with which of them stand.

        Args:
            standing: Indices of the modules that stand.

        Returns:
            The indices of the modules that are new in the space.
        """
        centres = np.array([(part.x, part.y) for part in self.parts]).reshape(-1, 2)[standing]
        surface = wall_surface(centres)
        kept = set(standing.tolist())
        for index in [index for index in self.module_bodies if index not in kept]:
            body = self.module_bodies.pop(index)
            self.space.remove(body, *body.shapes)
        added = []
        for index, exposed, corners in zip(
            standing.tolist(),
            surface.exposed.tolist(),
            surface.covered_corners.tolist(),
            strict=True,
        ):
            if not exposed:
                continue
            if index not in self.module_bodies:
                self._add_module(index)
                added.append(index)
            (shape,) = self.module_bodies[index].shapes
            assert isinstance(shape, ModuleShape)
            shape.covered_corners = tuple(corners)
        return added

    def _add_module(self, index: int) -> None:
        part = self.parts[index]
        body = pymunk.Body(body_type=pymunk.Body.STATIC)
        body.position = part.x, part.y
        half = MODULE_SIDE_UNITS / 2.0
        shape = ModuleShape(body, [(-half, -half), (half, -half), (half, half), (-half, half)])
        shape.index, shape.x, shape.y = index, part.x, part.y
        shape.friction = self.module_friction
        shape.collision_type = CollisionType.ModularPart
        self.space.add(body, shape)
        self.module_bodies[index] = body


def build_space(scene: Scene, obstacles: tuple[ModularObstacle, ...]) -> PymunkSpace:
    """Put a scene into a new space.

    Always a new one: a space that was emptied and filled again does not repeat a run to the last
    bit.

    Args:
        scene: The scene.
        obstacles: The scene's obstacles, which will hold the hits.
    """
    parameters = scene.parameters
    fastest = expected_fastest_units_per_s(scene.balls, parameters)
    longest_step_s = parameters.stepping.longest_step_s
    space = pymunk.Space()
    space.iterations = parameters.stepping.solver_iterations
    # An arbiter that did not touch in this step is dropped at once, so that the arbiters of a
    # step are its contacts.
    space.collision_persistence = 1
    space.use_spatial_hash(_hash_cell(scene.balls, parameters), _HASH_CELLS)
    built = PymunkSpace(
        space=space,
        ball_bodies=[],
        ball_shapes=[],
        parts=[part for obstacle in obstacles for part in obstacle.parts],
        module_bodies={},
        border_body=_add_border(space, scene),
        time_step_s=min(step_length_units(scene.balls, parameters) / fastest, longest_step_s),
        longest_step_s=longest_step_s,
        fastest_units_per_s=fastest,
        module_friction=parameters.contact.module_friction,
    )
    built.expose(np.arange(len(built.parts)))
    _add_balls(built, scene)
    return built


def expected_fastest_units_per_s(balls: Balls, parameters: SimulationParameters) -> float:
    """Return the speed of the ball that should be the fastest one of the blast.

    An explosive ball at the start, or an air ball that such a one has hit head-on, plus the base
    impulse.
    """
    fastest = float(np.hypot(*balls.velocity.T).max())
    if (balls.kind == CollisionType.AirBall).any():
        charge_mass, air_mass = float(balls.mass.max()), parameters.air.mass
        restitution = parameters.explosive.elasticity * parameters.air.elasticity
        fastest *= max(1.0, (1.0 + restitution) * charge_mass / (charge_mass + air_mass))
    return fastest + parameters.contact.base_impulse / float(balls.mass.min())


def step_length_units(balls: Balls, parameters: SimulationParameters) -> float:
    """Return how far the fastest ball may go in one step.

    `step_radii` times the smallest radius, where half a module counts as a radius too, so that
    the centre of a ball stays in the outer half of a module that it hits.
    """
    smallest = min(float(balls.radius.min()), MODULE_SIDE_UNITS / 2.0)
    return parameters.stepping.step_radii * smallest


def _hash_cell(balls: Balls, parameters: SimulationParameters) -> float:
    """Return the cell of the spatial hash: some ball diameters, or the spacing of the air."""
    return max(4.0 * float(balls.radius.max()), parameters.air.spacing_units, MODULE_SIDE_UNITS)


def _add_border(space: pymunk.Space, scene: Scene) -> pymunk.Body:
    """Add the four lines, thick outwards, so that their inner face is the border."""
    body = pymunk.Body(body_type=pymunk.Body.STATIC)
    space.add(body)
    outer = Border(scene.site.grown(_BORDER_THICKNESS_UNITS))
    for start, end in outer.lines():
        line = pymunk.Segment(body, start, end, _BORDER_THICKNESS_UNITS)
        line.collision_type = CollisionType.Border
        space.add(line)
    return body


def _add_balls(built: PymunkSpace, scene: Scene) -> None:
    balls, parameters = scene.balls, scene.parameters
    kinds: dict[int, BallParameters] = {
        CollisionType.ExplosionBall: parameters.explosive,
        CollisionType.AirBall: parameters.air,
    }
    apart = pymunk.ShapeFilter(group=CHARGE_GROUP)
    no_filter = pymunk.ShapeFilter()
    within_charge = parameters.explosive.collide_within_charge
    for index, (kind, position, velocity, mass, radius) in enumerate(
        zip(
            balls.kind.tolist(),
            balls.position.tolist(),
            balls.velocity.tolist(),
            balls.mass.tolist(),
            balls.radius.tolist(),
            strict=True,
        )
    ):
        of_kind = kinds[kind]
        body = pymunk.Body(mass, of_kind.inertia_factor * mass * radius**2)
        body.position = position
        body.velocity = velocity
        shape = BallShape(body, radius)
        shape.index = index
        shape.elasticity = of_kind.elasticity
        shape.friction = of_kind.friction
        shape.collision_type = kind
        is_charge = kind == CollisionType.ExplosionBall
        shape.filter = apart if is_charge and not within_charge else no_filter
        built.ball_bodies.append(body)
        built.ball_shapes.append(shape)
    built.space.add(*built.ball_bodies, *built.ball_shapes)
