"""Walls as a whole: from which side a ball came, though pymunk sees the modules one by one.

A module alone pushes a ball out through its nearest face. Of a wall that may be a joint, or the
far side: balls got between the modules of a closed ring, and through, in its corners above all.
"""

from typing import Final, NamedTuple

from blast_env.physics.pymunk.space import ModuleShape
from blast_env.units import MODULE_SIDE_UNITS

HALF: Final = MODULE_SIDE_UNITS / 2.0

OUTWARD: Final = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))
"""Normals of a module's faces, in the order of `WallSurface.free_faces`."""

Place = tuple[float, float]


class Contact(NamedTuple):
    """How a module meets a ball.

    Attributes:
        holds: Whether it does; else another module of the wall does.
        faces: The faces that the ball may leave through, indices of `OUTWARD`, the best one first,
            where that is not for pymunk to say; else none.
    """

    holds: bool
    faces: tuple[int, ...] = ()


_PYMUNK_DECIDES: Final = Contact(True)
_ANOTHER_MODULE: Final = Contact(False)


class WallSides:
    """Remembers where balls that are inside a wall were before they got there.

    For balls with their centre outside all walls it changes nothing.
    """

    def __init__(self) -> None:
        self._last: dict[int, Place] = {}
        self._now: dict[int, Place] = {}

    def begin_step(self) -> None:
        """Forget the balls that were not inside a wall in the step before."""
        self._last, self._now = self._now, {}

    def meet(self, ball: int, module: ModuleShape, centre: Place, before: Place) -> Contact:
        """Return how a module meets a ball that pymunk finds in contact with it.

        Args:
            ball: Index of the ball.
            module: The module.
            centre: Where the centre of the ball is, from that of the module, units.
            before: Where it was one step before, likewise.
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
    """Return how far a place is above a face, units; negative below it.

    Args:
        face: An index of `OUTWARD`.
        place: From the centre of the module, units.
    """
    return OUTWARD[face][0] * place[0] + OUTWARD[face][1] * place[1] - HALF


def _faces_to(module: ModuleShape, place: Place) -> tuple[int, ...]:
    """Return the faces that look to a place outside the wall, the highest first.

    Of those where the wall ends, if there is one; else one where it goes on, towards the place.
    """
    heights = [height_above(face, place) for face in range(4)]
    order = sorted(range(4), key=lambda face: -heights[face])
    free = tuple(face for face in order if module.free_faces[face] and heights[face] >= 0.0)
    return free or (order[0],)
