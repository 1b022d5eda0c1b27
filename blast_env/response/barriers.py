"""Barriers as rigid bodies that stand, slide, rock or overturn under a blast.

A piece of mass M, height H and base width B stands on the ground. The pressures on its two sides
exert a force F(t) at half its height. It tips about the far edge of its base, whose way from its
centre is a = (B cos theta - H sin theta) / 2 across and b = (H cos theta + B sin theta) / 2 down.
While the edge holds,

    (I + M (a^2 + b^2)) theta'' = F H / 2 cos theta - M g a,    I = M (H^2 + B^2) / 12

and it holds as long as its friction f = F - M (b theta'' + a theta'^2) stays within mu N, with
N = M (g + a theta'' - b theta'^2). Else it slides, and friction limits the moment:

    I theta'' = N (mu b - a) - F B / 2 sin theta
    M x'' = F - mu N - M (b theta'' + a theta'^2)

So a piece that slides rocks only if mu is above B / H, however large the force is. It overturns
when its centre passes the edge. An anchored piece does not move if the force stays within its
anchors' capacity; otherwise it is treated as unanchored throughout.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.response.sdof import check_histories

CONCRETE_KG_M3: Final = 2400.0
"""Density of a piece, unless its mass is given."""

FRICTION: Final = 0.5
"""Coefficient of friction of a piece on the ground, unless given: an assumption."""

_STEP_S: Final = 1e-4
_AFTER_S: Final = 3.0


class Stability(StrEnum):
    """Outcome of a blast for a piece."""

    STANDS = "stands"
    SLIDES = "slides"
    ROCKS = "rocks"
    OVERTURNS = "overturns"


@dataclass(frozen=True)
class RigidPiece:
    """A barrier piece on the ground, per metre of its length.

    Attributes:
        base_m: Width of its base.
        friction: Coefficient of friction with the ground.
        anchor_n_m: Horizontal capacity of its anchors, N per metre; 0 without anchors.
    """

    height_m: float
    base_m: float
    mass_kg_m: float
    friction: float = FRICTION
    anchor_n_m: float = 0.0

    @classmethod
    def of_block(
        cls,
        length_m: float,
        thickness_m: float,
        height_m: float,
        mass_kg: float | None = None,
        base_width_m: float | None = None,
        friction: float | None = None,
        anchorage_n: float = 0.0,
    ) -> "RigidPiece":
        """Return a piece of a given size, by default a solid block of concrete.

        Args:
            length_m: Length, perpendicular to the force.
            thickness_m: Thickness, parallel to the force.
            mass_kg: Mass of the whole piece; that of solid concrete by default.
            base_width_m: Width of its base; its thickness by default.
            friction: Coefficient of friction with the ground; `FRICTION` by default.
            anchorage_n: Horizontal capacity of all its anchors together.
        """
        # Everything per metre of length: rocking and sliding across the length do not depend on it.
        block_kg = CONCRETE_KG_M3 * length_m * thickness_m * height_m
        return cls(
            height_m,
            thickness_m if base_width_m is None else base_width_m,
            (block_kg if mass_kg is None else mass_kg) / length_m,
            FRICTION if friction is None else friction,
            anchorage_n / length_m,
        )

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            BlastEnvError: If one is out of bounds.
        """
        # A piece without height, base or mass has no motion to compute.
        for name in ("height_m", "base_m", "mass_kg_m"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise BlastEnvError(f"piece: {name} is {value}, must be above 0")
        for name in ("friction", "anchor_n_m"):
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise BlastEnvError(f"piece: {name} is {value}, must be at least 0")


@dataclass(frozen=True, eq=False)
class PieceResponses:
    """Responses of pieces to a blast.

    Attributes:
        slide_m: Largest sliding displacement, m (pieces,).
        tilt: Largest tilt over the tilt of overturning (pieces,); 1 and more have overturned.
        overturn_s: Time of overturning; infinite if they do not overturn (pieces,).
        held: Whether the anchors held (pieces,).
    """

    slide_m: FloatArray
    tilt: FloatArray
    overturn_s: FloatArray
    held: FloatArray

    @property
    def stability(self) -> list[Stability]:
        """Worst outcome of each piece; tilts up to 0.05 and slides up to 10 mm are neglected."""
        return [
            Stability.OVERTURNS
            if tilt >= 1.0
            else Stability.ROCKS
            if tilt > 0.05
            else Stability.SLIDES
            if slide > 0.01
            else Stability.STANDS
            for slide, tilt in zip(self.slide_m.tolist(), self.tilt.tolist(), strict=True)
        ]


def piece_responses(
    pieces: Sequence[RigidPiece], time_s: FloatArray, pressure_pa: FloatArray
) -> PieceResponses:
    """Return the response of each piece to the difference of the pressures on its sides.

    Args:
        time_s: Times of the histories, ascending (times,).
        pressure_pa: Mean pressure on one side less that on the other (pieces, times).

    Raises:
        BlastEnvError: If there is not one history per piece.
    """
    check_histories(len(pieces), time_s, pressure_pa)
    from blast_env.response.kernels import move_piece

    rows = np.zeros((len(pieces), 4))
    # A piece that rocks may overturn after the load: the motion goes on for three seconds.
    steps = int(np.ceil((float(time_s[-1] - time_s[0]) + _AFTER_S) / _STEP_S))
    begin_s = float(time_s[0])
    at_s = begin_s + _STEP_S * np.arange(steps + 1)
    for index, piece in enumerate(pieces):
        force = piece.height_m * np.interp(at_s, time_s, pressure_pa[index], left=0.0, right=0.0)
        # Anchors hold the whole force or, once they fail, nothing: no energy is taken.
        held = bool(piece.anchor_n_m > 0.0 and np.abs(force).max() <= piece.anchor_n_m)
        if held:
            rows[index] = 0.0, 0.0, np.inf, 1.0
            continue
        size = piece.mass_kg_m, piece.height_m, piece.base_m
        slide_m, tilt, overturn_s = move_piece(force, *size, piece.friction, _STEP_S)
        rows[index] = slide_m, tilt, begin_s + overturn_s, 0.0
    return PieceResponses(*rows.T)
