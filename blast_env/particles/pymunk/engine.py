"""The reference engine: pymunk with time steps."""

from collections.abc import Callable, Iterable
from itertools import combinations_with_replacement
from math import hypot
from typing import Any, Final, NamedTuple

import numpy as np
import pymunk
from numpy.typing import NDArray

from blast_env.arrays import IntArray
from blast_env.particles.objects import CollisionType
from blast_env.particles.pymunk.space import (
    HALF,
    OUTWARD,
    BallShape,
    ContactReader,
    ModuleShape,
    PymunkSpace,
    StepContacts,
    WallSides,
    build_space,
    height_above,
)
from blast_env.particles.run import BallStates, CollisionLog, Scene, can_reach
from blast_env.results import EndReason

_TOO_FAST: Final = 2.0
"""Ratio of a speed to the design speed of the step up to which the step is kept.

The step is at most half a radius and half a half module, so that at twice the speed the centre of
a ball is still in the outer half of a module that it hits.
"""

_SLOW: Final = 0.5
"""Share of the design speed of the step below which the step is doubled."""


class StepGuard:
    """Halves the time step when a ball is too fast for it, doubles it when all are slow.

    Speeds change only by contacts, so that the contacts of each step give an upper bound of every
    ball's speed; the true speeds are read only if a bound is too high.

    Chipmunk transfers the impulse of a persistent contact to the next step in the ratio of the
    time steps, and a contact that has already bounced would receive a second impulse. When the step
    changes, persistent contacts are therefore left out of one step, which resets that impulse in
    Chipmunk; they start again in the following step.

    Attributes:
        time_step_s: The next time step.
    """

    def __init__(
        self, built: PymunkSpace, reader: ContactReader, speeds: NDArray[np.float64]
    ) -> None:
        self.time_step_s = built.time_step_s
        self._longest_step_s = built.longest_step_s
        self._step_length_units = built.time_step_s * built.fastest_units_per_s
        self._space = built.space
        self._reader = reader
        self._speed_bound = speeds.copy()
        self._steps_to_reset = 0

    @property
    def _design_units_per_s(self) -> float:
        """Design speed of the present time step."""
        return self._step_length_units / self.time_step_s

    def watch(self, contacts: StepContacts, mass: NDArray[np.float64], kick: float) -> None:
        """Update the bounds of speeds by the contacts of a step; halve the time step if needed.

        Args:
            mass: Masses of all balls (n,).
            kick: Base impulse on every new pair.
        """
        if self._steps_to_reset:
            self._go_on_resetting()
        if not len(contacts.ball_pairs):
            return
        # A bound on each speed that only grows: no velocities are read until a bound says so.
        impulse = contacts.ball_impulse + kick * contacts.ball_first
        balls = contacts.ball_pairs
        np.add.at(self._speed_bound, balls, impulse[:, None] / mass[balls])
        if self._speed_bound[balls].max() > _TOO_FAST * self._design_units_per_s:
            _, velocity = self._reader.read_balls()
            self._speed_bound = np.nan_to_num(np.hypot(velocity[:, 0], velocity[:, 1]))
            while self._speed_bound.max() > _TOO_FAST * self._design_units_per_s:
                self._change(0.5)

    def relax(self, fastest_units_per_s: float) -> None:
        """Double the time step if all balls are slow.

        Args:
            fastest_units_per_s: Speed of the fastest ball.
        """
        if (
            fastest_units_per_s < _SLOW * self._design_units_per_s
            and 2.0 * self.time_step_s <= self._longest_step_s
        ):
            self._change(2.0)

    def drops(self, arbiter: pymunk.Arbiter) -> bool:
        """Return whether a contact is left out of the present step."""
        return self._steps_to_reset == 2 and not arbiter.is_first_contact

    def _change(self, factor: float) -> None:
        self.time_step_s *= factor
        self._steps_to_reset = 2
        self._on_ball_contacts(self._before_ball_contact)

    def _go_on_resetting(self) -> None:
        self._steps_to_reset -= 1
        if self._steps_to_reset == 0:
            self._on_ball_contacts(pymunk.empty_callback)

    def _before_ball_contact(
        self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any
    ) -> None:
        arbiter.process_collision = not self.drops(arbiter)

    def _on_ball_contacts(self, callback: Any) -> None:
        kinds = (CollisionType.ExplosionBall, CollisionType.AirBall)
        for one, other in combinations_with_replacement(kinds, 2):
            self._space.on_collision(one, other, pre_solve=callback)


_STEPS_BETWEEN_CHECKS: Final = 32


class _Touch(NamedTuple):
    """A ball in contact with a module, before the contact is solved."""

    ball: int
    gap: float
    module: int
    is_lasting: bool
    velocity: pymunk.Vec2d
    outward_normal: pymunk.Vec2d


class PymunkRun:
    """One blast in a pymunk space; see `BlastRun` for the attributes.

    Contacts of balls with modules use a Python callback, which decides on their solution. All
    other contacts are read in one batch after each step.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.obstacles = scene.obstacles()
        self.log = CollisionLog()
        self.time_s = 0.0
        self.steps = 0
        self.end_reason: EndReason | None = None
        self._built = build_space(scene, self.obstacles)
        self._reader = ContactReader(self._built)
        self._guard = StepGuard(self._built, self._reader, np.hypot(*scene.balls.velocity.T))
        self._contact = scene.parameters.contact
        self._mass = scene.balls.mass.copy()
        self._radius = scene.balls.radius.copy()
        self._is_explosive = scene.balls.kind == CollisionType.ExplosionBall
        self._alive = np.ones(len(scene.balls), dtype=np.bool_)
        self._collisions = np.zeros(len(scene.balls), dtype=np.int64)
        self._next_check = 0
        self._touches: list[_Touch] = []
        self._sides = WallSides()
        self._stepped_s = 0.0
        self._touching: frozenset[int] = frozenset()  # balls on a module in the step before
        for kind in (CollisionType.ExplosionBall, CollisionType.AirBall):
            self._built.space.on_collision(
                kind, CollisionType.ModularPart, pre_solve=self._before_module_contact
            )

    def __reduce__(self) -> tuple[Callable[[Scene, float], "PymunkRun"], tuple[Scene, float]]:
        """Pickle the scene and the time: a space cannot be pickled, but runs are reproducible."""
        return _run_again, (self.scene, self.time_s if self.end_reason is None else np.inf)

    @property
    def time_step_s(self) -> float:
        """The next time step."""
        return self._guard.time_step_s

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`, or the run has ended."""
        limit_s = self.scene.parameters.stepping.time_limit_s
        while self.end_reason is None and self.time_s < until_s:
            if self.time_s >= limit_s:
                self.end_reason = EndReason.TIME_LIMIT
            elif self._is_out_of_reach(limit_s - self.time_s):
                self.end_reason = EndReason.OUT_OF_REACH
            else:
                self._step()

    def balls(self) -> BallStates:
        """Return the remaining balls."""
        position, velocity = self._reader.read_balls()
        index = np.flatnonzero(self._alive)
        return BallStates(
            index=index,
            kind=self.scene.balls.kind[index],
            position=position[index],
            velocity=velocity[index],
            mass=self._mass[index],
            radius=self._radius[index],
        )

    def _is_out_of_reach(self, within_s: float) -> bool:
        """Return whether no ball can reach a structure any more, checked only every few steps."""
        if self.steps < self._next_check:
            return False
        self._next_check = self.steps + _STEPS_BETWEEN_CHECKS
        balls = self.balls()
        self._guard.relax(float(balls.speed.max(initial=0.0)))
        return not can_reach(balls, self.scene, within_s)

    def _step(self) -> None:
        self._touches.clear()
        self._sides.begin_step()
        self._stepped_s = time_step_s = self._guard.time_step_s
        self._built.space.step(time_step_s)
        self.steps += 1
        self.time_s += time_step_s
        # (1) The space's step, in which the callback decides on contacts with modules; (2) the
        # bounds on speeds; (3) hits on modules; (4) the base impulse and shrinking of new pairs;
        # (5) the 30 % of explosive balls at modules; (6) balls at the border go.
        contacts = self._reader.read_contacts()
        self._guard.watch(contacts, self._mass, self._contact.base_impulse)
        new_touches = self._record_touches(contacts)
        self._after_ball_contacts(contacts.ball_pairs[contacts.ball_first])
        for ball in new_touches:
            if self._is_explosive[ball]:
                self._shrink(ball, self._contact.module_shrink)
        if len(contacts.leaving):
            self._remove(contacts.leaving.tolist())

    # ---- a ball on a module (section 2.4) ---------------------------------------------------

    def _before_module_contact(
        self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any
    ) -> None:
        """Decide on a ball's rebound before pymunk solves the contact."""
        ball, module = arbiter.shapes
        assert isinstance(ball, BallShape)
        assert isinstance(module, ModuleShape)
        body = self._built.ball_bodies[ball.index]
        x, y = body.position
        centre = x - module.x, y - module.y
        # Where the ball came from decides which face of a wall it met.
        moved = body.velocity * self._stepped_s
        before = centre[0] - moved.x, centre[1] - moved.y
        contact = self._sides.meet(ball.index, module, centre, before)
        if not contact.holds:
            arbiter.process_collision = False
            return
        if contact.faces:
            self._push_out(arbiter, contact.faces, centre)
        arbiter.process_collision = not self._guard.drops(arbiter)
        arbiter.restitution = self._contact.module_restitution
        beside, above = max(abs(centre[0]) - HALF, 0.0), max(abs(centre[1]) - HALF, 0.0)
        gap = hypot(beside, above) - float(self._radius[ball.index])
        self._touches.append(
            _Touch(
                ball.index,
                gap,
                module.index,
                ball.index in self._touching,
                body.velocity,
                -arbiter.normal,
            )
        )

    def _push_out(
        self, arbiter: pymunk.Arbiter, faces: tuple[int, ...], centre: tuple[float, float]
    ) -> None:
        """Push a ball out through the first of the faces, unless pymunk has chosen one of them."""
        normal = -arbiter.normal
        if any(normal == OUTWARD[face] for face in faces):
            return
        ball, _ = arbiter.shapes
        assert isinstance(ball, BallShape)
        outward, height = pymunk.Vec2d(*OUTWARD[faces[0]]), height_above(faces[0], centre)
        position = self._built.ball_bodies[ball.index].position
        radius = float(self._radius[ball.index])
        on_ball, on_face = position - outward * radius, position - outward * height
        point = pymunk.ContactPoint(on_ball, on_face, height - radius)
        arbiter.contact_point_set = pymunk.ContactPointSet(-outward, (point,))

    def _record_touches(self, contacts: StepContacts) -> list[int]:
        """Record the impulses of modules on balls in this step; return the balls in new contact."""
        if not self._touches:
            self._touching = frozenset()
            return []
        # Sorted by ball and gap: of two modules touched at once the nearest one counts (section
        # 2.8).
        nearest: dict[int, _Touch] = {}
        for touch in sorted(self._touches, key=lambda touch: touch[:3]):
            nearest.setdefault(touch.ball, touch)
        given: dict[int, float] = dict.fromkeys(nearest, 0.0)
        to_nearest: dict[int, float] = dict.fromkeys(nearest, 0.0)
        for (ball, module), impulse in zip(
            contacts.module_pairs.tolist(), contacts.module_impulse.tolist(), strict=True
        ):
            given[ball] += impulse
            if module == nearest[ball].module:
                to_nearest[ball] += impulse
        broken = False
        for ball, touch in nearest.items():
            if given[ball] > 0.0:
                broken |= self._record(touch, to_nearest[ball], given[ball])
        self._touching = frozenset(nearest)
        if broken:
            self._remove_destroyed()
        return [ball for ball, touch in nearest.items() if not touch.is_lasting]

    def _record(self, touch: _Touch, to_module: float, transferred: float) -> bool:
        """Record a collision; return whether it destroyed the module.

        A ball pressed against a module by others collides more often than the time step resolves.
        Each step in which the module exerts an impulse J on it counts as a collision at the normal
        speed J / ((1 + C_e) m), which for a single ball is the speed before the collision. Its
        tangential speed counts only at the beginning of the contact.
        """
        mass, normal = float(self._mass[touch.ball]), touch.outward_normal
        # The normal velocity before, from the impulse that the solver found: J = (1 + e) m v_n. The
        # tangential one is that at the touch, unless the ball rested there.
        velocity = normal * (-to_module / ((1.0 + self._contact.module_restitution) * mass))
        if not touch.is_lasting:
            velocity += touch.velocity - normal * touch.velocity.dot(normal)
        part = self._built.parts[touch.module]
        was_destroyed, first_contact = part.destroyed, part.hits == 0
        impulse = self.scene.round_impulse(mass * velocity.length)
        part.register(self.time_s, impulse, transferred)
        self.log.append(
            time_s=self.time_s,
            kind=int(self.scene.balls.kind[touch.ball]),
            ball=touch.ball,
            module=touch.module,
            mass=mass,
            velocity=velocity,
            normal=normal,
            impulse=impulse,
            transferred_impulse=transferred,
            earlier_collisions=int(self._collisions[touch.ball]),
            first_contact=first_contact,
        )
        self._collisions[touch.ball] += 1
        return part.destroyed and not was_destroyed

    def _remove_destroyed(self) -> None:
        """Remove destroyed modules from the space, and expose those behind them."""
        standing = [i for i, part in enumerate(self._built.parts) if not part.destroyed]
        self._built.expose(np.array(standing, dtype=np.int64))
        self._reader.learn_bodies()

    # ---- balls among themselves (section 2.4) -----------------------------------------------

    def _after_ball_contacts(self, new_pairs: IntArray) -> None:
        """Apply the rules for new contacts between balls."""
        if not len(new_pairs):
            return
        np.add.at(self._collisions, new_pairs, 1)
        if self._contact.base_impulse > 0.0:
            self._apply_base_impulse(new_pairs)
        explosive = self._is_explosive[new_pairs]
        with_air = explosive[:, 0] != explosive[:, 1]
        for ball in new_pairs[with_air][explosive[with_air]].tolist():
            self._shrink(ball, self._contact.air_shrink)

    def _apply_base_impulse(self, pairs: IntArray) -> None:
        """Apply I_b to both balls of each pair along the line of their centres, outwards."""
        impulse = self._contact.base_impulse
        for one, other in pairs.tolist():
            a, b = self._built.ball_bodies[one], self._built.ball_bodies[other]
            along = (b.position - a.position).normalized()
            a.velocity -= along * (impulse / a.mass)
            b.velocity += along * (impulse / b.mass)

    def _shrink(self, ball: int, factor: float) -> None:
        """Scale a ball's radius and mass; remove it if it becomes too small."""
        if not self._alive[ball] or factor == 1.0:
            return
        self._mass[ball] *= factor
        self._radius[ball] *= factor
        mass, radius = float(self._mass[ball]), float(self._radius[ball])
        if radius < self._contact.minimum_radius_units:
            self._remove([ball])
            return
        body = self._built.ball_bodies[ball]
        body.mass = mass
        body.moment = self.scene.parameters.explosive.inertia_factor * mass * radius**2
        self._built.ball_shapes[ball].unsafe_set_radius(radius)

    def _remove(self, balls: Iterable[int]) -> None:
        for ball in balls:
            if self._alive[ball]:
                self._alive[ball] = False
                self._built.space.remove(
                    self._built.ball_bodies[ball], self._built.ball_shapes[ball]
                )


def _run_again(scene: Scene, until_s: float) -> PymunkRun:
    """Return a run of a scene up to the time of another run of it."""
    run = PymunkRun(scene)
    run.advance(until_s)
    return run
