"""A scene as a pymunk space, its contacts, and the treatment of walls as a whole.

pymunk treats modules individually, and pushes a ball out of a module through the nearest face. In a
wall, that may be a joint or the far side: balls could pass between the modules of a closed ring,
mostly at its corners. `WallSides` therefore determines the side from which a ball came.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import pymunk
import pymunk.batch
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.particles.objects import (
    Balls,
    Border,
    CollisionType,
    ModularObstacle,
    ModularPart,
    wall_surface,
)
from blast_env.particles.run import Scene
from blast_env.site.parameters import BallParameters, SimulationParameters
from blast_env.units import MODULE_SIDE_UNITS

CHARGE_GROUP: Final = 1
"""Group of the charge's balls; shapes of one group do not collide with each other."""

_BORDER_THICKNESS_UNITS: Final = 4.0
_HASH_CELLS: Final = 5000


class BallShape(pymunk.Circle):
    """A ball's circle with the ball's index in the scene."""

    index: int


class ModuleShape(pymunk.Poly):
    """A module's square with its index, its centre, its free faces and its covered corners."""

    index: int
    x: float
    y: float
    free_faces: tuple[bool, ...]
    covered_corners: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class PymunkSpace:
    """A space and the objects in it.

    Attributes:
        space: The space.
        ball_bodies: Bodies of the scene's balls, in their order.
        ball_shapes: Shapes of the scene's balls, in their order.
        parts: The modules of all obstacles, in order.
        module_bodies: Bodies by module index; modules out of reach of all balls have none.
        border_body: The body of the border lines.
        time_step_s: The initial time step.
        longest_step_s: The longest time step by the parameters.
        fastest_units_per_s: The design speed of the time step.
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
        """Update the modules in the space to the exposed ones of the intact modules.

        Args:
            standing: Indices of the intact modules.

        Returns:
            The indices of the modules that are new in the space.
        """
        # 1. Modules that are gone, or no longer at the surface; 2. those that have come to it; 3.
        # the faces and corners of all, which have changed with their neighbours.
        centres = np.array([(part.x, part.y) for part in self.parts]).reshape(-1, 2)[standing]
        surface = wall_surface(centres)
        kept = set(standing.tolist())
        for index in [index for index in self.module_bodies if index not in kept]:
            body = self.module_bodies.pop(index)
            self.space.remove(body, *body.shapes)
        added = []
        for index, exposed, faces, corners in zip(
            standing.tolist(),
            surface.exposed.tolist(),
            surface.free_faces.tolist(),
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
            shape.free_faces, shape.covered_corners = tuple(faces), tuple(corners)
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
    """Return a new space with a scene.

    A reused space would not reproduce a run to the last bit.

    Args:
        obstacles: The scene's obstacles, which collect the hits.
    """
    parameters = scene.parameters
    fastest = expected_fastest_units_per_s(scene.balls, parameters)
    # The step is as long as the fastest ball needs for a share of the smallest radius.
    longest_step_s = parameters.stepping.longest_step_s
    space = pymunk.Space()
    space.iterations = parameters.stepping.solver_iterations
    # Arbiters without contact in a step are dropped at once, so that the arbiters of a step are
    # its contacts.
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
    """Return the expected largest speed of a ball in the blast.

    That of an explosive ball at the start, or of an air ball after a head-on collision with it,
    plus the effect of the base impulse.
    """
    fastest = float(np.hypot(*balls.velocity.T).max())
    if (balls.kind == CollisionType.AirBall).any():
        charge_mass, air_mass = float(balls.mass.max()), parameters.air.mass
        restitution = parameters.explosive.elasticity * parameters.air.elasticity
        fastest *= max(1.0, (1.0 + restitution) * charge_mass / (charge_mass + air_mass))
    return fastest + parameters.contact.base_impulse / float(balls.mass.min())


def step_length_units(balls: Balls, parameters: SimulationParameters) -> float:
    """Return the largest distance of the fastest ball in one step, units.

    `step_radii` times the smallest radius or half a module, if that is smaller, so that the centre
    of a ball stays in the outer half of a module that it hits.
    """
    smallest = min(float(balls.radius.min()), MODULE_SIDE_UNITS / 2.0)
    return parameters.stepping.step_radii * smallest


def _hash_cell(balls: Balls, parameters: SimulationParameters) -> float:
    """Return the cell of the broad phase: some ball diameters, or the spacing of the air."""
    return max(4.0 * float(balls.radius.max()), parameters.air.spacing_units, MODULE_SIDE_UNITS)


def _add_border(space: pymunk.Space, scene: Scene) -> pymunk.Body:
    """Add the four border lines, thickened outwards, so that their inner faces are the border."""
    body = pymunk.Body(body_type=pymunk.Body.STATIC)
    space.add(body)
    # Thick lines: a fast ball cannot pass one within a step.
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
        # The order of adding decides the order of solving, hence the last bits: the scene's order.
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


_BODY_FIELDS: Final = (
    pymunk.batch.BodyFields.BODY_ID
    | pymunk.batch.BodyFields.POSITION
    | pymunk.batch.BodyFields.VELOCITY
)

_CONTACT_FIELDS: Final = (
    pymunk.batch.ArbiterFields.BODY_A_ID
    | pymunk.batch.ArbiterFields.BODY_B_ID
    | pymunk.batch.ArbiterFields.IS_FIRST_CONTACT
    | pymunk.batch.ArbiterFields.CONTACT_COUNT
    | pymunk.batch.ArbiterFields.TOTAL_IMPULSE
    | pymunk.batch.ArbiterFields.NORMAL
)


@dataclass(frozen=True, eq=False)
class StepContacts:
    """The contacts of one step, sorted by the objects' indices.

    Attributes:
        ball_pairs: Balls that touch each other, the lower index first (k, 2).
        ball_first: Whether the contact is new in this step (k,).
        ball_impulse: Impulse along the normal between the pair in this step (k,).
        module_pairs: A ball and a module that touch each other (q, 2).
        module_impulse: Impulse along the normal by the module in this step (q,).
        leaving: Balls that touch the border, twice if they touch two lines (p,).
    """

    ball_pairs: IntArray
    ball_first: NDArray[np.bool_]
    ball_impulse: FloatArray
    module_pairs: IntArray
    module_impulse: FloatArray
    leaving: IntArray


_NO_CONTACTS: Final = StepContacts(
    ball_pairs=np.empty((0, 2), dtype=np.int64),
    ball_first=np.empty(0, dtype=np.bool_),
    ball_impulse=np.empty(0),
    module_pairs=np.empty((0, 2), dtype=np.int64),
    module_impulse=np.empty(0),
    leaving=np.empty(0, dtype=np.int64),
)


class ContactReader:
    """Translates pymunk's batches into indices of a scene's balls and modules."""

    def __init__(self, built: PymunkSpace) -> None:
        self._built = built
        self._ball_count = len(built.ball_bodies)
        self._border = self._ball_count + len(built.parts)
        self._body_buffer = pymunk.batch.Buffer()
        self._contact_buffer = pymunk.batch.Buffer()
        self._sorted_ids: NDArray[np.uint64]
        self._index_of_sorted: IntArray
        self.learn_bodies()

    def learn_bodies(self) -> None:
        """Read the bodies' ids; necessary again after a module was given a body."""
        built = self._built
        modules = sorted(built.module_bodies)
        bodies = [*built.ball_bodies, *(built.module_bodies[m] for m in modules), built.border_body]
        index = np.array(
            [*range(self._ball_count), *(self._ball_count + m for m in modules), self._border]
        )
        # pymunk counts bodies through the process: ids are translated to indices by a sorted table.
        ids = np.array([body.id for body in bodies], dtype=np.uint64)
        order = np.argsort(ids)
        self._sorted_ids, self._index_of_sorted = ids[order], index[order]

    def read_balls(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the scene's balls (n, 2); NaN for removed ones."""
        buffer = self._body_buffer
        buffer.clear()
        pymunk.batch.get_space_bodies(self._built.space, _BODY_FIELDS, buffer)
        index = self._index_of(np.frombuffer(buffer.int_buf(), dtype=np.uint64))
        state = np.full((self._border + 1, 4), np.nan)
        state[index] = np.frombuffer(buffer.float_buf()).reshape(-1, 4)
        return state[: self._ball_count, :2], state[: self._ball_count, 2:]

    def read_contacts(self) -> StepContacts:
        """Return the contacts of the last step."""
        buffer = self._contact_buffer
        buffer.clear()
        pymunk.batch.get_space_arbiters(self._built.space, _CONTACT_FIELDS, buffer)
        integers = np.frombuffer(buffer.int_buf(), dtype=np.uint64).reshape(-1, 4)
        if not len(integers):
            return _NO_CONTACTS
        floats = np.frombuffer(buffer.float_buf()).reshape(-1, 4)
        pair = self._index_of(integers[:, :2])
        pair.sort(axis=1)
        # pymunk's order depends on memory addresses, hence the sort. A rejected contact has no
        # contact points.
        order = np.argsort(pair[:, 0] * (self._border + 1) + pair[:, 1], kind="stable")
        order = order[integers[order, 3] > 0]
        pair, floats = pair[order], floats[order]
        # The part along the normal; friction has the rest.
        impulse = np.abs(floats[:, 0] * floats[:, 2] + floats[:, 1] * floats[:, 3])
        between_balls = pair[:, 1] < self._ball_count
        at_border = pair[:, 1] == self._border
        at_module = ~(between_balls | at_border)
        return StepContacts(
            ball_pairs=pair[between_balls],
            ball_first=integers[order, 2][between_balls] == 1,
            ball_impulse=impulse[between_balls],
            module_pairs=pair[at_module] - (0, self._ball_count),
            module_impulse=impulse[at_module],
            leaving=pair[at_border, 0],
        )

    def _index_of(self, ids: NDArray[np.uint64]) -> IntArray:
        return self._index_of_sorted[np.searchsorted(self._sorted_ids, ids)]


HALF: Final = MODULE_SIDE_UNITS / 2.0

OUTWARD: Final = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))
"""Normals of a module's faces, in the order of `WallSurface.free_faces`."""

Place = tuple[float, float]


class Contact(NamedTuple):
    """The contact of a module with a ball.

    Attributes:
        holds: Whether this module is in contact, rather than another one of the wall.
        faces: The faces through which the ball may leave, indices of `OUTWARD`, the best one
            first; empty if pymunk decides.
    """

    holds: bool
    faces: tuple[int, ...] = ()


_PYMUNK_DECIDES: Final = Contact(True)
_ANOTHER_MODULE: Final = Contact(False)


class WallSides:
    """Stores the positions of balls inside a wall before they entered it.

    It does not affect balls with their centre outside all walls.
    """

    def __init__(self) -> None:
        self._last: dict[int, Place] = {}
        self._now: dict[int, Place] = {}

    def begin_step(self) -> None:
        """Forget the balls that were not inside a wall in the step before."""
        self._last, self._now = self._now, {}

    def meet(self, ball: int, module: ModuleShape, centre: Place, before: Place) -> Contact:
        """Return the contact of a module with a ball that pymunk finds in contact with it.

        Args:
            ball: Index of the ball.
            centre: Centre of the ball relative to that of the module, units.
            before: The same one step before, units.
        """
        (x, y), (beside, above) = centre, (abs(centre[0]) - HALF, abs(centre[1]) - HALF)
        known = self._last.get(ball)
        if known is not None:
            before = known[0] - module.x, known[1] - module.y
        if beside <= 0.0 and above <= 0.0:
            return self._push_back(ball, module, before)
        if beside > 0.0 and above > 0.0:
            covered = module.covered_corners[(x > 0.0) + 2 * (y > 0.0)]
            return _ANOTHER_MODULE if covered else _PYMUNK_DECIDES
        if known is not None:
            came_by = _faces_to(module, before)[0]
            if height_above(came_by, centre) < -MODULE_SIDE_UNITS:  # it is beyond the far side
                return self._push_back(ball, module, before)
        face = int(x > 0.0) if beside > 0.0 else 2 + int(y > 0.0)
        return _PYMUNK_DECIDES if module.free_faces[face] else _ANOTHER_MODULE

    def _push_back(self, ball: int, module: ModuleShape, before: Place) -> Contact:
        self._now[ball] = before[0] + module.x, before[1] + module.y
        return Contact(True, _faces_to(module, before))


def height_above(face: int, place: Place) -> float:
    """Return the height of a place above a face, units; negative below it.

    Args:
        face: An index of `OUTWARD`.
        place: The place relative to the centre of the module, units.
    """
    return OUTWARD[face][0] * place[0] + OUTWARD[face][1] * place[1] - HALF


def _faces_to(module: ModuleShape, place: Place) -> tuple[int, ...]:
    """Return the free faces towards a place outside the wall, the largest height above first.

    Without such a face, return the covered face with the largest height.
    """
    heights = [height_above(face, place) for face in range(4)]
    order = sorted(range(4), key=lambda face: -heights[face])
    free = tuple(face for face in order if module.free_faces[face] and heights[face] >= 0.0)
    return free or (order[0],)
