"""The free-field study: blasts at many distances with many seeds, resumable."""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtrit

from blast_env.calibration.model import SimulatedQuantity
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import find_engine
from blast_env.scenario import Scenario
from blast_env.simulation import simulate

RUN_COLUMNS = ("distance_m", "seed", "impulse_sim", "transferred_impulse_sim", "first_hit_s")


@dataclass(frozen=True)
class FreeFieldRun:
    """One blast of a study.

    Attributes:
        key: Hash of scenario and charge, seed, engine and its version; tells runs apart.
        distance_m: From the charge's centre to the facade.
        seed: Seed of the blast.
        impulse_sim: Sum of m |v| over the hits on the structure, simulation units.
        transferred_impulse_sim: Momentum really transferred to it, simulation units.
        first_hit_s: Time of the first hit; None where nothing hit it.
    """

    key: str
    distance_m: float
    seed: int
    impulse_sim: float
    transferred_impulse_sim: float
    first_hit_s: float | None


@dataclass(frozen=True)
class FreeFieldStudy:
    """Blasts on one structure in the open at several distances.

    Attributes:
        scenario: A scenario with one point charge and one structure, such as `free_field`.
        distances_m: Distances from the charge's centre to the facade, ascending.
        seeds: Seeds; every distance gets all of them.
        engine: Name of the engine.
    """

    scenario: Scenario
    distances_m: tuple[float, ...]
    seeds: tuple[int, ...]
    engine: str = "pymunk"

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: If distances are not ascending, or seeds are repeated or missing.
        """
        for before, after in zip(self.distances_m, self.distances_m[1:], strict=False):
            if not before < after:
                raise BlastEnvError(
                    f"distances: {after:g} m follows {before:g} m, must be ascending, none twice"
                )
        if not self.distances_m:
            raise BlastEnvError("distances: there are none, must be at least one")
        if not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise BlastEnvError(f"seeds: {self.seeds} must be at least one, none twice")

    def run(
        self,
        processes: int = 1,
        store: Path | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> pd.DataFrame:
        """Run all blasts that the store does not hold yet.

        Args:
            processes: Worker processes.
            store: File of finished runs, one JSON object a line; each run is added as it ends,
                so that an interrupted study goes on where it was. A last line that was cut short
                is run again.
            progress: Called with the share of the blasts that is done.

        Returns:
            One row a blast, by distance and seed; the columns are `RUN_COLUMNS`.

        Raises:
            BlastEnvError: If the store is not one, or cannot be written.
        """
        finished = {} if store is None else read_store(store)
        wanted = {
            self._key(scenario, seed): (scenario, distance_m, seed)
            for distance_m in self.distances_m
            for scenario in (self.scenario.at_stand_off(distance_m),)
            for seed in self.seeds
        }
        missing = [key for key in wanted if key not in finished]
        jobs = (joblib.delayed(_run_one)(key, *wanted[key], self.engine) for key in missing)
        parallel = joblib.Parallel(n_jobs=processes, return_as="generator_unordered")
        for done, run in enumerate(parallel(jobs), start=1):
            finished[run.key] = run
            if store is not None:
                append_to_store(store, run)
            if progress is not None:
                progress(1.0 - (len(missing) - done) / len(wanted))
        rows = [asdict(finished[key]) for key in wanted]
        table = pd.DataFrame(rows)[list(RUN_COLUMNS)]
        return table.sort_values(["distance_m", "seed"], ignore_index=True)

    def _key(self, scenario: Scenario, seed: int) -> str:
        version = find_engine(self.engine).version
        return f"{scenario.content_hash} {seed} {self.engine} {version}"


def impulse_by_seed(
    runs: pd.DataFrame, simulated: SimulatedQuantity = "impulse"
) -> NDArray[np.float64]:
    """Return the impulses, simulation units (seeds, distances), from the table of a study."""
    pivot = runs.pivot_table(index="seed", columns="distance_m", values=f"{simulated}_sim")
    return pivot.to_numpy(dtype=np.float64)


def summarise(runs: pd.DataFrame, simulated: SimulatedQuantity = "impulse") -> pd.DataFrame:
    """Return mean and 95 % confidence interval at each distance.

    Args:
        runs: The table of a study.
        simulated: Which sum over the collisions `i_sim` is.

    Returns:
        One row a distance: `distance_m`, `seeds`, `i_sim`, its half-width `ci95` (Student's t),
        the standard deviation `sd` between seeds, `transferred_sim` and `arrival_s`.
    """
    groups = runs.groupby("distance_m")
    table = pd.DataFrame(
        {
            "seeds": groups.size(),
            "i_sim": groups[f"{simulated}_sim"].mean(),
            "sd": groups[f"{simulated}_sim"].std(ddof=1),
            "transferred_sim": groups.transferred_impulse_sim.mean(),
            "arrival_s": groups.first_hit_s.mean(),
        }
    )
    # Student's t; scipy.stats has it too, but takes a third of a second to import.
    t = stdtrit(np.maximum(table.seeds - 1, 1), 0.975)
    table.insert(2, "ci95", t * table.sd / np.sqrt(table.seeds))
    return table.reset_index()


def read_store(path: Path) -> dict[str, FreeFieldRun]:
    """Return the runs in a store by their keys; none if there is no such file.

    Raises:
        BlastEnvError: If a line other than an unfinished last one is not a run.
    """
    if not path.exists():
        return {}
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise BlastEnvError(f"{path}: cannot be read: {error}") from error
    runs: dict[str, FreeFieldRun] = {}
    for number, line in enumerate(lines[:-1], start=1):
        try:
            run = FreeFieldRun(**json.loads(line))
        except (TypeError, ValueError) as error:
            raise BlastEnvError(
                f"{path}: line {number} is not a run of a study: {error}"
            ) from error
        runs[run.key] = run
    return runs


def append_to_store(path: Path, run: FreeFieldRun) -> None:
    """Add a run to a store, after cutting off a last line that was left unfinished.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    line = json.dumps(asdict(run)) + "\n"
    try:
        with path.open("ab+") as file:
            _cut_unfinished_line(file)
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise BlastEnvError(f"{path}: cannot be written: {error.strerror or error}") from error


def _cut_unfinished_line(file: Any) -> None:
    size = file.seek(0, os.SEEK_END)
    if size == 0:
        return
    file.seek(size - 1)
    if file.read(1) == b"\n":
        return
    file.seek(0)
    file.truncate(file.read().rfind(b"\n") + 1)


def _run_one(
    key: str, scenario: Scenario, distance_m: float, seed: int, engine: str
) -> FreeFieldRun:
    """Run one blast, in a worker process."""
    result = simulate(scenario, seed=seed, engine=engine)
    (structure,) = result.obstacles
    return FreeFieldRun(
        key=key,
        distance_m=distance_m,
        seed=seed,
        impulse_sim=structure.impulse,
        transferred_impulse_sim=structure.transferred_impulse,
        first_hit_s=structure.first_hit_s,
    )
