"""Reading balls and contacts out of a pymunk space in batches."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import pymunk.batch
from numpy.typing import NDArray

from blast_env.physics.pymunk_space import PymunkSpace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
        ball_impulse: Impulse along the normal that the pair exchanged in this step (k,).
        module_pairs: A ball and a module that touch each other (q, 2).
        module_impulse: Impulse along the normal that the module gave in this step (q,).
        leaving: Balls that touch the border, twice where they touch two lines (p,).
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
        """Learn the bodies' ids; needed again when a module got a body."""
        built = self._built
        modules = sorted(built.module_bodies)
        bodies = [*built.ball_bodies, *(built.module_bodies[m] for m in modules), built.border_body]
        index = np.array(
            [*range(self._ball_count), *(self._ball_count + m for m in modules), self._border]
        )
        ids = np.array([body.id for body in bodies], dtype=np.uint64)
        order = np.argsort(ids)
        self._sorted_ids, self._index_of_sorted = ids[order], index[order]

    def read_balls(self) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the scene's balls (n, 2); NaN where one is gone."""
        buffer = self._body_buffer
        buffer.clear()
        pymunk.batch.get_space_bodies(self._built.space, _BODY_FIELDS, buffer)
        index = self._index_of(np.frombuffer(buffer.int_buf(), dtype=np.uint64))
        state = np.full((self._border + 1, 4), np.nan)
        state[index] = np.frombuffer(buffer.float_buf()).reshape(-1, 4)
        return state[: self._ball_count, :2], state[: self._ball_count, 2:]

    def read_contacts(self) -> StepContacts:
        """Return the contacts of the step that was just made."""
        buffer = self._contact_buffer
        buffer.clear()
        pymunk.batch.get_space_arbiters(self._built.space, _CONTACT_FIELDS, buffer)
        integers = np.frombuffer(buffer.int_buf(), dtype=np.uint64).reshape(-1, 4)
        if not len(integers):
            return _NO_CONTACTS
        floats = np.frombuffer(buffer.float_buf()).reshape(-1, 4)
        pair = self._index_of(integers[:, :2])
        pair.sort(axis=1)
        # pymunk's order depends on memory addresses; ours must not. A rejected contact has no
        # contact points.
        order = np.argsort(pair[:, 0] * (self._border + 1) + pair[:, 1], kind="stable")
        order = order[integers[order, 3] > 0]
        pair, floats = pair[order], floats[order]
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
