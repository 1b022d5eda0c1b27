"""A run of the particle model, from its scene to its collisions.

The scene is the site of a blast with its balls and their parameters. The main result of a run is
the record of the collisions with modules (paper, section 2.8).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.geometry import TOLERANCE_M, Element, Rectangle, distance_to_rectangle
from blast_env.layout.build_site import build_site, random_streams
from blast_env.particles.objects import (
    Balls,
    ModularObstacle,
    air_lattice,
    explosion_fan,
    in_units,
    obstacle_of,
)
from blast_env.problems import Problem, ScenarioError
from blast_env.results import EndReason
from blast_env.site import AnyCharge, PointSource, Scenario
from blast_env.site.blast_site import BlastSite, Charge
from blast_env.site.parameters import SimulationParameters, for_charge
from blast_env.site.structures import StructureOutline
from blast_env.site.zone import distance_m
from blast_env.units import UNITS_PER_M


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(BlastSite):
    """The initial state of one blast by particles; the balls are in simulation units.

    Attributes:
        balls: All balls; air first, then the charge.
        parameters: Parameters of the blast model for this charge.
    """

    balls: Balls
    parameters: SimulationParameters

    @cached_property
    def site(self) -> Rectangle:
        """The simulated area, units."""
        return self.site_m.scaled(UNITS_PER_M)

    @cached_property
    def charge_centre(self) -> tuple[float, float]:
        """Centre of the charge, units."""
        return in_units(self.charge.position_m)

    @cached_property
    def impulse_quantum(self) -> float:
        """The power of two, simulation units, of which every recorded impulse is a multiple.

        It is about 2^-36 of the largest initial momentum, which is negligible. Sums of recorded
        impulses, up to 2^17 such momenta, are then exact in any order and partition: the rewards
        of an episode add up to the impulse of the blast.
        """
        momentum = self.balls.mass * np.hypot(*self.balls.velocity.T)
        return float(2.0 ** (np.ceil(np.log2(momentum.max())) - 36))

    @property
    def largest_exact_impulse(self) -> float:
        """Bound below which sums of recorded impulses are exact, simulation units."""
        return self.impulse_quantum * 2.0**53

    def round_impulse(self, impulse: float) -> float:
        """Return an impulse rounded to a multiple of the quantum."""
        return round(impulse / self.impulse_quantum) * self.impulse_quantum

    def obstacles(self) -> tuple[ModularObstacle, ...]:
        """Return new obstacles without hits, in the order of `structures`."""
        return tuple(map(obstacle_of, self.structures))


def build_scene(
    scenario: Scenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    charge: AnyCharge | None = None,
) -> Scene:
    """Return the scene of one blast by particles, which is two-dimensional.

    Args:
        layout: (row, column) of the build-zone cells with a barrier module, or pieces.
        seed: Seed of the charge (if the scenario has several), the fan's phase and the air's
            jitter. None of them depends on the barrier.
        charge: The charge, instead of one drawn from the scenario.

    Raises:
        LayoutError: If the layout does not fit the build zone, or the charge.
        ScenarioError: If the charge is not clear of a structure or the border, or is over a roof:
            without heights it would be inside the structure; or a structure begins above the
            ground, or is a terrace.
        BlastEnvError: If the mass of the charge is out of bounds of the parameters.
        ValueError: If the seed is negative.
    """
    base = build_site(scenario, layout, seed, charge, with_zone=False)
    if any(structure.base_m or structure.carries for structure in scenario.structures):
        scenario.check_for_particles()
    _check_not_over_a_roof(scenario, base.charge)
    try:
        parameters = for_charge(scenario.parameters, base.charge.tnt_kg)
    except BlastEnvError as error:
        message = f"{scenario.name}: charge: {error}; engine 'gas' takes this charge"
        raise BlastEnvError(message) from error
    # Separate streams for charge, fan and air: a barrier or another fan leaves the air as it is.
    _, fan_rng, air_rng = random_streams(seed)
    centre = in_units(base.charge.position_m)
    air = air_lattice(
        parameters.air,
        base.site_m.scaled(UNITS_PER_M),
        _solid_rectangles(base.structures),
        centre,
        parameters.explosive.offset_units + parameters.explosive.radius_units,
        air_rng,
    )
    fan = explosion_fan(parameters.explosive, centre, fan_rng)
    return Scene(
        site_m=base.site_m,
        charge=base.charge,
        balls=Balls.concatenate((air, fan)),
        structures=base.structures,
        gauges=base.gauges,
        air_height_m=base.air_height_m,
        parameters=parameters,
    )


def _check_not_over_a_roof(scenario: Scenario, charge: Charge) -> None:
    """Refuse a raised charge that is inside a structure in plan."""
    if charge.height_m == 0.0:
        return
    x_m, y_m = charge.position_m
    place = PointSource.at(charge)
    for structure in scenario.structures:
        # In plan a charge on a roof lies inside the building.
        away_m = min(distance_m(place, box) for box in structure.boxes_m)
        if away_m < scenario.charge_radius_m - TOLERANCE_M:
            message = (
                f"is at ({x_m:g}, {y_m:g}) m, {charge.height_m:g} m high, over {structure.name!r}"
                f" of {structure.height_m:g} m: the particle engines know no heights and would put"
                " it inside, must be clear of it in plan, or the engine one with heights"
            )
            raise ScenarioError(scenario.name, [Problem("charge", message)])


def _solid_rectangles(structures: Sequence[StructureOutline]) -> list[Rectangle]:
    """Return rectangles that cover the modules, in simulation units."""
    rectangles: list[Rectangle] = []
    for outline in structures:
        if not outline.is_barrier:
            rectangles.extend(box.scaled(UNITS_PER_M) for box in outline.boxes_m)
        else:
            rectangles.extend(part.rectangle for part in obstacle_of(outline).parts)
    return rectangles


COLLISION_DTYPE = np.dtype(
    [
        ("time_s", np.float64),
        ("kind", np.uint8),  # CollisionType of the ball
        ("ball", np.int64),  # index into the scene's balls
        ("module", np.int64),  # index into the scene's modules
        ("mass", np.float64),  # before the collision
        ("vx", np.float64),  # velocity before the collision, units per second
        ("vy", np.float64),
        ("normal_x", np.float64),  # unit vector out of the module
        ("normal_y", np.float64),
        ("impulse", np.float64),  # m |v| before the collision, see `Scene.impulse_quantum`
        ("transferred_impulse", np.float64),  # along the normal, as given by the solver
        ("earlier_collisions", np.int64),  # of this ball, with anything
        ("first_contact", np.bool_),  # of this module
    ]
)

CollisionArray = NDArray[np.void]


class CollisionLog:
    """Collisions in the order of time."""

    def __init__(self) -> None:
        self._arrays: list[CollisionArray] = []
        self._rows: list[tuple[float, ...]] = []  # after those of the arrays

    def __len__(self) -> int:
        return sum(map(len, self._arrays)) + len(self._rows)

    def extend(self, collisions: CollisionArray) -> None:
        """Add an array of `COLLISION_DTYPE`."""
        self._gather_rows()
        self._arrays.append(collisions)

    def append(
        self,
        *,
        time_s: float,
        kind: int,
        ball: int,
        module: int,
        mass: float,
        velocity: tuple[float, float],
        normal: tuple[float, float],
        impulse: float,
        transferred_impulse: float,
        earlier_collisions: int,
        first_contact: bool,
    ) -> None:
        """Add a collision; the arguments are the fields of `COLLISION_DTYPE`."""
        who = (time_s, kind, ball, module, mass)
        what = (*velocity, *normal, impulse, transferred_impulse)
        self._rows.append((*who, *what, earlier_collisions, first_contact))

    def to_array(self, start: int = 0) -> CollisionArray:
        """Return the collisions from `start` on as an array of `COLLISION_DTYPE`."""
        self._gather_rows()
        if len(self._arrays) != 1:
            empty = np.empty(0, dtype=COLLISION_DTYPE)
            self._arrays = [np.concatenate([empty, *self._arrays])]
        return self._arrays[0][start:].copy()

    def _gather_rows(self) -> None:
        if self._rows:
            self._arrays.append(np.array(self._rows, dtype=COLLISION_DTYPE))
            self._rows = []


def _floats(collisions: CollisionArray, column: str) -> NDArray[np.float64]:
    values: NDArray[np.float64] = collisions[column]
    return values


def incidence_angle_rad(collisions: CollisionArray) -> NDArray[np.float64]:
    """Return the angle of incidence (n,): 0 is head-on, pi/2 grazing.

    It is the angle between the reversed velocity before the collision and the module's normal.
    """
    columns = ("vx", "vy", "normal_x", "normal_y")
    vx, vy, normal_x, normal_y = (_floats(collisions, name) for name in columns)
    towards = -(vx * normal_x + vy * normal_y)
    across = np.abs(vx * normal_y - vy * normal_x)
    angle: NDArray[np.float64] = np.arctan2(across, towards)
    return angle


@dataclass(frozen=True, eq=False)
class BallStates:
    """The remaining balls, in simulation units.

    Attributes:
        index: Index into the scene's balls (n,), ascending.
        kind: `CollisionType` (n,).
        position: Centres (n, 2).
        velocity: Velocities (n, 2).
        mass: Masses (n,).
        radius: Radii (n,).
    """

    index: NDArray[np.int64]
    kind: NDArray[np.uint8]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    mass: NDArray[np.float64]
    radius: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.index)

    @property
    def speed(self) -> NDArray[np.float64]:
        """Speeds (n,)."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])


def can_reach(balls: BallStates, scene: Scene, within_s: float) -> bool:
    """Return whether any moving ball can still act on a structure in the remaining time.

    Directions are ignored, since a collision may change them, and speeds are doubled, because a
    ball at rest leaves a collision with at most twice the speed of the ball that hits it.

    Args:
        scene: The scene; its barrier does not count as a structure.
    """
    # A bound that is cheap and never wrong: straight distance to the nearest structure against the
    # farthest way that is left.
    distance = np.full(len(balls), np.inf)
    for outline in scene.structures:
        for box in () if outline.is_barrier else outline.boxes_m:
            to_this = distance_to_rectangle(balls.position, box.scaled(UNITS_PER_M))
            distance = np.minimum(distance, to_this)
    reach = 2.0 * balls.speed * within_s
    return bool(((reach > 0.0) & (distance - balls.radius <= reach)).any())


class BlastRun(Protocol):
    """One blast in progress.

    Attributes:
        scene: The initial state.
        obstacles: The structures with their current hits.
        log: The collisions with modules up to now.
        time_s: Simulated time.
        steps: Number of steps of the engine.
        end_reason: Reason for the end of the run; `None` before it.
    """

    scene: Scene
    obstacles: tuple[ModularObstacle, ...]
    log: CollisionLog
    time_s: float
    steps: int
    end_reason: EndReason | None

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`, or the run has ended.

        The division of a run into calls does not change its results.
        """

    def balls(self) -> BallStates:
        """Return the remaining balls."""
