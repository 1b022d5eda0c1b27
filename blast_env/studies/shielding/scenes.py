"""The scenes of the shielding study, as ordinary scenarios."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import ceil, hypot
from typing import Any, TypeVar

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import EndReason
from blast_env.physics.engines import find_engine
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import preset
from blast_env.runner import run_all
from blast_env.scenario import Scenario
from blast_env.simulation import BlastResult, simulate
from blast_env.units import MODULE_SIDE_M

_WALL_BEYOND_M = 3.0  # how far the radial wall goes on beyond the longest path


@dataclass(frozen=True)
class BlockGeometry:
    """A square block in plan, a charge on the axis of one face, and gauges round it.

    The defaults are the block of published street-junction experiments, at full size: there the
    scale was 1:5, with a side of 2.3 m and the charge 1.15 m before the face.

    Attributes:
        side_modules: Modules along each side of the block.
        stand_off_m: From the charge's centre to the front face.
        margin_m: Open ground between the scene and the site's borders, on all sides. What gets to
            a border is gone, and the flow behind the block ends the sooner, the nearer they are.
        tnt_kg: TNT-equivalent mass of the charge.
    """

    side_modules: int = 23
    stand_off_m: float = 5.75
    margin_m: float = 25.0
    tnt_kg: float = 100.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            BlastEnvError: If the block is too small for near and far gauges, or a length is not
                positive.
        """
        if self.side_modules < 3:
            raise BlastEnvError(f"side_modules is {self.side_modules}, must be at least 3")
        for name in ("stand_off_m", "margin_m", "tnt_kg"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise BlastEnvError(f"{name} is {value:g}, must be above 0 and finite")

    @property
    def side_m(self) -> float:
        """Side of the block."""
        return self.side_modules * MODULE_SIDE_M

    @property
    def corner_path_m(self) -> float:
        """Path from the charge's centre to a front corner."""
        return hypot(self.stand_off_m, self.side_m / 2.0)

    @cached_property
    def from_edge_m(self) -> FloatArray:
        """Distance of each module's middle from the first edge of its face (side_modules,)."""
        return MODULE_SIDE_M * (np.arange(self.side_modules, dtype=np.float64) + 0.5)

    @cached_property
    def side_path_m(self) -> FloatArray:
        """Path to each gauge of a side, from the front corner on (side_modules,)."""
        return self.corner_path_m + self.from_edge_m

    @cached_property
    def back_path_m(self) -> FloatArray:
        """Path to the gauges of half the back, from a back corner to the middle (gauges,)."""
        half = ceil(self.side_modules / 2)
        return self.corner_path_m + self.side_m + self.from_edge_m[:half]

    @cached_property
    def gauge_path_m(self) -> FloatArray:
        """Path to each gauge, those of a side first (gauges,)."""
        return np.concatenate((self.side_path_m, self.back_path_m))

    @property
    def wall_modules(self) -> int:
        """Length of the radial wall, which begins at the stand-off."""
        length_m = float(self.back_path_m[-1]) + _WALL_BEYOND_M - self.stand_off_m
        return ceil(length_m / MODULE_SIDE_M)

    @cached_property
    def wall_path_m(self) -> FloatArray:
        """Distance of each module of the radial wall from the charge (wall_modules,)."""
        index = np.arange(self.wall_modules, dtype=np.float64)
        return self.stand_off_m + MODULE_SIDE_M * (index + 0.5)


def block_scenario(geometry: BlockGeometry, parameters: SimulationParameters) -> Scenario:
    """Return the block with the charge before the middle of one face.

    Raises:
        ScenarioError: If the charge does not fit in, or parameters do not fit each other.
    """
    side = geometry.side_modules
    return structure_scenario("shielding_block", geometry, parameters, side, side)


def wall_scenario(geometry: BlockGeometry, parameters: SimulationParameters) -> Scenario:
    """Return the open field with a wall, one module thick, whose near end points at the charge.

    Its faces are parallel to the flow: what loads them is the free field's side-on load.

    Raises:
        ScenarioError: As `block_scenario`.
    """
    return structure_scenario(
        "shielding_free_field", geometry, parameters, 1, geometry.wall_modules
    )


def facade_scenario(
    distance_m: float, geometry: BlockGeometry, parameters: SimulationParameters
) -> Scenario:
    """Return a wall across the flow, as wide to either side as the charge is away.

    Args:
        distance_m: From the charge's centre to the wall.
        geometry: Its margin and charge are used.
        parameters: Parameters of the blast model.

    Raises:
        ScenarioError: As `block_scenario`.
    """
    rows = 2 * ceil(distance_m / MODULE_SIDE_M)
    at_distance = replace(geometry, stand_off_m=distance_m)
    return structure_scenario("shielding_facade", at_distance, parameters, rows, 2)


def structure_scenario(
    name: str, geometry: BlockGeometry, parameters: SimulationParameters, rows: int, columns: int
) -> Scenario:
    """Return a structure at the stand-off from the charge, margins all round."""
    margin_m, height_m, width_m = geometry.margin_m, rows * MODULE_SIDE_M, columns * MODULE_SIDE_M
    structure: dict[str, Any] = {
        "kind": "ModularObstacle",
        "name": "structure",
        "corner_m": (margin_m + geometry.stand_off_m, margin_m),
        "rows": rows,
        "columns": columns,
        "protected": True,
    }
    document: dict[str, Any] = {
        "schema_version": 1,
        "name": name,
        "site": {
            "width_m": margin_m + geometry.stand_off_m + width_m + margin_m,
            "height_m": margin_m + height_m + margin_m,
        },
        "charge": [
            {
                "kind": "point",
                "position_m": (margin_m, margin_m + height_m / 2.0),
                "tnt_kg": float(geometry.tnt_kg),
            }
        ],
        "structures": [structure],
        # All parameters are overridden, so that the preset does not matter.
        "simulation": {"preset": "ballistic", "overrides": parameters.model_dump()},
    }
    return Scenario.from_document(document, name)


Reading = TypeVar("Reading")


@dataclass(frozen=True)
class StudySettings:
    """Parameters, seeds and scenes of a study.

    Attributes:
        simulation: Parameters of the blast model, or the name of a preset.
        seeds: Seeds; every scene gets all of them.
        engine: Name of the engine.
        time_limit_s: Simulated time of every blast, instead of the parameters' own: behind a block
            loads build up for long.
        geometry: The block, the charge and the open ground around.
    """

    simulation: SimulationParameters | str
    seeds: tuple[int, ...] = tuple(range(16))
    engine: str = "event"
    time_limit_s: float = 4.0
    geometry: BlockGeometry = field(default_factory=BlockGeometry)

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: If seeds are repeated, negative or missing, or the time limit is out of
                bounds.
            UnknownNameError: If there is no such preset or engine.
        """
        if not self.seeds or len(set(self.seeds)) < len(self.seeds) or min(self.seeds) < 0:
            raise BlastEnvError(f"seeds: {self.seeds} must be at least one, none twice or below 0")
        if not 0.0 < self.time_limit_s <= 60.0:
            raise BlastEnvError(
                f"time_limit_s is {self.time_limit_s:g}, must be above 0 and at most 60"
            )
        find_engine(self.engine)
        if isinstance(self.simulation, str):
            preset(self.simulation)

    @property
    def parameters(self) -> SimulationParameters:
        """The parameters of the blast model."""
        return preset(self.simulation) if isinstance(self.simulation, str) else self.simulation

    @property
    def scene_parameters(self) -> SimulationParameters:
        """The parameters with the study's time limit."""
        return with_overrides(self.parameters, {"stepping": {"time_limit_s": self.time_limit_s}})

    def run_blasts(
        self,
        scenes: Sequence[Scenario],
        read: Callable[[BlastResult], Reading],
        processes: int = 1,
        progress: Callable[[float], None] | None = None,
    ) -> list[list[Reading]]:
        """Run every scene with every seed.

        Args:
            scenes: The scenes.
            read: Takes from each result what is needed, in the worker process.
            processes: Worker processes.
            progress: Called with the share of the blasts that is done.

        Returns:
            For each scene what was read, in the order of the seeds.

        Raises:
            BlastEnvError: If a blast ended at its limit of collisions.
        """
        jobs = [(scene, seed) for seed in self.seeds for scene in scenes]
        readings = run_all(partial(_run_one, self.engine, read), jobs, processes, progress)
        return [readings[number :: len(scenes)] for number in range(len(scenes))]


def _run_one(
    engine: str, read: Callable[[BlastResult], Reading], job: tuple[Scenario, int]
) -> Reading:
    """Run one blast, in a worker process."""
    scenario, seed = job
    result = simulate(scenario, seed=seed, engine=engine)
    if result.end_reason is EndReason.EVENT_LIMIT:
        limit = scenario.parameters.stepping.most_collisions
        raise BlastEnvError(
            f"{scenario.name}, seed {seed}: the blast ended at {result.time_s:.3g} s, at its limit "
            f"of {limit:,} collisions (stepping.most_collisions): its loads are not complete"
        )
    return read(result)
