"""What the studies of shielding and of reflection have in common: how blasts are run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import joblib

from blast_env.calibration.shielding_scenes import BlockGeometry
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import EndReason, find_engine
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import preset
from blast_env.scenario import Scenario
from blast_env.simulation import BlastResult, simulate

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
        numbers = [(scene, seed) for seed in self.seeds for scene in range(len(scenes))]
        jobs = (
            joblib.delayed(_run_one)((scene, seed), scenes[scene], self.engine, read)
            for scene, seed in numbers
        )
        parallel = joblib.Parallel(n_jobs=processes, return_as="generator_unordered")
        readings: dict[tuple[int, int], Reading] = {}
        for number, reading in parallel(jobs):
            readings[number] = reading
            if progress is not None:
                progress(len(readings) / len(numbers))
        return [[readings[scene, seed] for seed in self.seeds] for scene in range(len(scenes))]


def _run_one(
    number: tuple[int, int],
    scenario: Scenario,
    engine: str,
    read: Callable[[BlastResult], Reading],
) -> tuple[tuple[int, int], Reading]:
    """Run one blast, in a worker process."""
    _, seed = number
    result = simulate(scenario, seed=seed, engine=engine)
    if result.end_reason is EndReason.EVENT_LIMIT:
        limit = scenario.parameters.stepping.most_collisions
        raise BlastEnvError(
            f"{scenario.name}, seed {seed}: the blast ended at {result.time_s:.3g} s, at its limit "
            f"of {limit:,} collisions (stepping.most_collisions): its loads are not complete"
        )
    return number, read(result)
