"""Fits the time step to the speeds, so that nothing tunnels and slow phases cost little."""

from itertools import combinations_with_replacement
from typing import Any, Final

import numpy as np
import pymunk
from numpy.typing import NDArray

from blast_env.physics.particles import CollisionType
from blast_env.physics.pymunk_contacts import ContactReader, StepContacts
from blast_env.physics.pymunk_space import PymunkSpace

_TOO_FAST: Final = 2.0
"""Speeds above the one that the step was made for, up to which the step is kept.

The step is at most half a radius and half a half module, so twice the speed still leaves the
centre of a ball in the outer half of a module that it hits.
"""
_SLOW: Final = 0.5
"""Below this share of the speed that the step was made for, the step is doubled."""


class StepGuard:
    """Halves the time step when a ball gets too fast for it, doubles it when all are slow.

    Speeds change by contacts only, so the contacts of each step give an upper bound of every
    ball's speed; the true speeds are read only when a bound is too high.

    Chipmunk carries the impulse of a lasting contact over to the next step in the ratio of the
    time steps, and a contact that has bounced already would get a second push. When the step
    changes, lasting contacts are therefore left out of one step, which makes Chipmunk forget that
    impulse; they start anew in the step after.

    Attributes:
        time_step_s: The time step to make next.
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
        """The speed that the present time step is made for."""
        return self._step_length_units / self.time_step_s

    def watch(self, contacts: StepContacts, mass: NDArray[np.float64], kick: float) -> None:
        """Take note of the contacts of a step.

        Args:
            contacts: The contacts.
            mass: Masses of all balls (n,).
            kick: Base impulse that every new pair got as well.
        """
        if self._steps_to_reset:
            self._go_on_resetting()
        if not len(contacts.ball_pairs):
            return
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
        """Whether this contact is to be left out of the present step."""
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
