"""The balls of the model: a fan of explosive balls and a lattice of air balls (section 2.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.geometry import Rectangle, distance_to_rectangle
from blast_env.site.parameters import AirParameters, BallParameters, ExplosiveParameters

_ROUNDING: Final = 1e-9  # of distances, units


class CollisionType(IntEnum):
    """The paper's four kinds of objects (section 2.4), with its names."""

    ExplosionBall = 1
    AirBall = 2
    ModularPart = 3
    Border = 4


@dataclass(frozen=True, eq=False)
class Balls:
    """Any number of balls, in simulation units.

    Attributes:
        kind: `CollisionType` of each ball, uint8 (n,).
        position: Centres (n, 2).
        velocity: Velocities, units per second (n, 2).
        mass: Masses (n,).
        radius: Radii (n,).
    """

    kind: NDArray[np.uint8]
    position: FloatArray
    velocity: FloatArray
    mass: FloatArray
    radius: FloatArray

    def __len__(self) -> int:
        return len(self.kind)

    @classmethod
    def of_one_kind(
        cls,
        kind: CollisionType,
        parameters: BallParameters,
        position: FloatArray,
        velocity: FloatArray,
    ) -> "Balls":
        """Return balls of one kind, all with the mass and radius of `parameters`."""
        count = len(position)
        return cls(
            kind=np.full(count, kind, dtype=np.uint8),
            position=position,
            velocity=velocity,
            mass=np.full(count, parameters.mass),
            radius=np.full(count, parameters.radius_units),
        )

    @classmethod
    def concatenate(cls, groups: Sequence["Balls"]) -> "Balls":
        """Return the balls of all groups, in their order."""
        return cls(
            kind=np.concatenate([group.kind for group in groups]),
            position=np.concatenate([group.position for group in groups]),
            velocity=np.concatenate([group.velocity for group in groups]),
            mass=np.concatenate([group.mass for group in groups]),
            radius=np.concatenate([group.radius for group in groups]),
        )


def explosion_fan(
    parameters: ExplosiveParameters,
    centre: tuple[float, float],
    rng: np.random.Generator,
) -> Balls:
    """Return the charge: N `ExplosionBall`s at the angles 2 pi i / N (section 2.3).

    With a thermal share, the velocities have a normally distributed part besides the radial one;
    the mean kinetic energy is the same.

    Args:
        centre: The charge's centre, units.
        rng: Generator for the phase of the fan and the random part of the velocities.
    """
    # Drawn in any case: the velocities after it do not depend on the option.
    drawn = rng.random()
    phase = drawn if parameters.fan_phase == "random" else 0.0
    index = np.arange(1, parameters.ball_count + 1)
    angle = 2.0 * np.pi * (index + phase) / parameters.ball_count
    direction = np.column_stack((np.cos(angle), np.sin(angle)))
    share = parameters.thermal_share
    # Energies add up: (1 - share) of the kinetic energy is radial, share / 2 goes to each axis.
    random_part = np.sqrt(share / 2.0) * rng.normal(size=direction.shape)
    return Balls.of_one_kind(
        CollisionType.ExplosionBall,
        parameters,
        position=np.asarray(centre) + parameters.offset_units * direction,
        velocity=parameters.speed_units_per_s * (np.sqrt(1.0 - share) * direction + random_part),
    )


def air_lattice(
    parameters: AirParameters,
    site: Rectangle,
    obstacles: Sequence[Rectangle],
    charge_centre: tuple[float, float],
    charge_radius: float,
    rng: np.random.Generator,
) -> Balls:
    """Return the air: `AirBall`s at rest on a square lattice that fills the site.

    A ball that would touch an obstacle, the charge or the border is left out.

    Args:
        site: The simulated area, units.
        obstacles: Rectangles without air, units.
        charge_centre: The charge's centre, units.
        charge_radius: Radius of the charge's disc, units.
        rng: Generator for the offset of the lattice and the jitter.
    """
    if parameters.spacing_units == 0.0:
        empty = np.empty((0, 2))
        return Balls.of_one_kind(CollisionType.AirBall, parameters, empty, empty)
    spacing, radius = parameters.spacing_units, parameters.radius_units
    # Always drawn, so that a centred lattice does not shift the random stream of the jitter.
    drawn_x, drawn_y = rng.random(2)
    if parameters.lattice_offset == "centred":
        drawn_x = _centring_share(site.right - site.left, spacing)
        drawn_y = _centring_share(site.top - site.bottom, spacing)
    x = np.arange(site.left + drawn_x * spacing, site.right, spacing)
    y = np.arange(site.bottom + drawn_y * spacing, site.top, spacing)
    position = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # Half of the free gap at most, so that neighbours never overlap.
    reach = parameters.jitter * max(0.0, spacing / 2.0 - radius)
    position = position + rng.uniform(-reach, reach, size=position.shape)

    # (1) Clear of the border and the charge, all at once; (2) clear of obstacles, each on the part
    # of the lattice around it: the cost goes with the area of obstacles, not with their number
    # times the air.
    inner = site.grown(-radius)
    free = (
        (position[:, 0] > inner.left)
        & (position[:, 0] < inner.right)
        & (position[:, 1] > inner.bottom)
        & (position[:, 1] < inner.top)
        & (np.hypot(*(position - charge_centre).T) > charge_radius + radius)
    )
    places, is_free = position.reshape(len(y), len(x), 2), free.reshape(len(y), len(x))
    near = radius + reach + _ROUNDING
    for obstacle in obstacles:
        around = obstacle.grown(near)
        rows = slice(*np.searchsorted(y, (around.bottom, around.top)))
        columns = slice(*np.searchsorted(x, (around.left, around.right)))
        distance = distance_to_rectangle(places[rows, columns].reshape(-1, 2), obstacle)
        is_free[rows, columns] &= (distance > radius).reshape(is_free[rows, columns].shape)
    position = position[free]
    return Balls.of_one_kind(CollisionType.AirBall, parameters, position, np.zeros_like(position))


def _centring_share(length: float, spacing: float) -> float:
    """Return the offset, in spacings, that leaves equal margins at both borders."""
    margin = (length - (length // spacing - 1) * spacing) / 2.0
    return margin / spacing
