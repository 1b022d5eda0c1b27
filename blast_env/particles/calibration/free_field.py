"""The free-field study: blasts at many distances with many seeds, resumable."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter
from scipy.special import stdtrit

from blast_env.curves import kingery_bulmash
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.particles.calibration.fits import (
    Fit,
    FitMetrics,
    bootstrap_coefficients,
    fit_linear,
    fit_metrics,
    fit_power_law,
    fit_proportional,
    leave_one_out,
)
from blast_env.particles.calibration.model import (
    Calibration,
    LawName,
    MetricsSection,
    ReferenceSection,
    ScalingLaw,
    SimulatedQuantity,
)
from blast_env.particles.calibration.paper_table import paper_ufc_column
from blast_env.particles.event import VERSION as EVENT_VERSION
from blast_env.particles.pymunk import VERSION as PYMUNK_VERSION
from blast_env.particles.run import BlastRun, Scene, build_scene
from blast_env.provenance import package_version
from blast_env.runner import as_completed
from blast_env.site import Scenario, load_scenario
from blast_env.site.parameters import parameters_digest
from blast_env.store import Store
from blast_env.units import MODULE_SIDE_M, PA_PER_PSI, UNITS_PER_M

_VERSIONS: Final = MappingProxyType({"pymunk": PYMUNK_VERSION, "event": EVENT_VERSION})

RUN_COLUMNS = ("distance_m", "seed", "impulse_sim", "transferred_impulse_sim", "first_hit_s")
Amount = Annotated[float, Field(ge=0.0)]


@dataclass(frozen=True)
class FreeFieldRun:
    """One blast of a study.

    Attributes:
        key: Identity of the run: hash of the scenario with the charge, seed, engine and its
            version.
        distance_m: Distance from the charge's centre to the facade.
        seed: Seed of the blast.
        impulse_sim: Sum of m |v| over the hits on the structure, simulation units.
        transferred_impulse_sim: Momentum actually transferred to it, simulation units.
        first_hit_s: Time of the first hit; `None` without a hit.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    key: str
    distance_m: Annotated[float, Field(gt=0.0)]
    seed: Annotated[int, Field(ge=0)]
    impulse_sim: Amount
    transferred_impulse_sim: Amount
    first_hit_s: Amount | None


_RUN: Final = TypeAdapter(FreeFieldRun)


@dataclass(frozen=True)
class FreeFieldStudy:
    """Blasts on one structure in the open at several distances.

    Attributes:
        scenario: A scenario with one point charge and one structure, such as `free_field`.
        distances_m: Distances from the charge's centre to the facade, ascending.
        seeds: Seeds at every distance.
        engine: Name of the engine.
    """

    scenario: Scenario
    distances_m: tuple[float, ...]
    seeds: tuple[int, ...]
    engine: str = "pymunk"

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: If distances do not ascend or are missing, or seeds are repeated or
                missing, or there is no particle engine of that name.
        """
        for before, after in zip(self.distances_m, self.distances_m[1:], strict=False):
            if not before < after:
                raise BlastEnvError(
                    f"distances: {after:g} m follows {before:g} m, must be ascending, none twice"
                )
        if self.engine not in _VERSIONS:
            raise UnknownNameError("engine", self.engine, _VERSIONS)
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
        """Run all blasts that are missing in the store.

        Args:
            processes: Worker processes.
            store: File of finished runs, a `Store`; each run is added as it ends, so that an
                interrupted study continues from there.
            progress: Called with the finished share of the blasts.

        Returns:
            One row per blast, by distance and seed; the columns are `RUN_COLUMNS`.

        Raises:
            BlastEnvError: If the store is damaged or cannot be written.
        """
        # The key has all that a run depends on, so that no other one is taken for it.
        wanted = {
            f"{scenario.content_hash} {seed} {self.engine} {_VERSIONS[self.engine]}": (
                scenario,
                distance_m,
                seed,
            )
            for distance_m in self.distances_m
            for scenario in (self.scenario.at_stand_off(distance_m),)
            for seed in self.seeds
        }
        kept = Store(store) if store is not None else None
        found = {key: kept.read(key, _RUN.validate_json) for key in wanted} if kept else {}
        finished = {key: run for key, run in found.items() if run is not None}
        missing = [key for key in wanted if key not in finished]
        jobs = [(key, *wanted[key], self.engine) for key in missing]
        for done, (_, run) in enumerate(as_completed(_run_one, jobs, processes), start=1):
            finished[run.key] = run
            if kept is not None:
                kept.put(run.key, _RUN.dump_json(run))
            if progress is not None:
                progress(1.0 - (len(missing) - done) / len(wanted))
        rows = [asdict(finished[key]) for key in wanted]
        table = pd.DataFrame(rows)[list(RUN_COLUMNS)]
        return table.sort_values(["distance_m", "seed"], ignore_index=True)


def free_field(tnt_kg: float | None = None, side_modules: int | None = None) -> Scenario:
    """Return `free_field` with another charge, or a facade of another width.

    The strip behind the structure keeps its width.
    """
    document = load_scenario("free_field").model_dump()
    (source,), (structure,) = document["charge"], document["structures"]
    if tnt_kg is not None:
        source["tnt_kg"] = tnt_kg
    if side_modules is not None:
        lower_m = (document["site"]["height_m"] - side_modules * MODULE_SIDE_M) / 2.0
        document["site"]["width_m"] += (side_modules - structure["side_modules"]) * MODULE_SIDE_M
        structure["corner_m"] = (structure["corner_m"][0], lower_m)
        structure["side_modules"] = side_modules
    return Scenario.from_document(document, "free_field with changes")


def impulse_by_seed(
    runs: pd.DataFrame, simulated: SimulatedQuantity = "impulse"
) -> NDArray[np.float64]:
    """Return the impulses of a study's table, simulation units (seeds, distances)."""
    pivot = runs.pivot_table(index="seed", columns="distance_m", values=f"{simulated}_sim")
    return pivot.to_numpy(dtype=np.float64)


def summarise(runs: pd.DataFrame, simulated: SimulatedQuantity = "impulse") -> pd.DataFrame:
    """Return mean and 95 % confidence interval at each distance.

    Args:
        runs: The table of a study.
        simulated: The sum over the collisions for `i_sim`.

    Returns:
        One row per distance: `distance_m`, `seeds`, `i_sim`, its half-width `ci95` (Student's t),
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
    # Student's t; scipy.stats also has it, but takes a third of a second to import.
    t = stdtrit(np.maximum(table.seeds - 1, 1), 0.975)
    table.insert(2, "ci95", t * table.sd / np.sqrt(table.seeds))
    return table.reset_index()


def _started(engine: str, scene: Scene) -> BlastRun:
    """Return a run at time 0; only the engine in use is imported, as both load compiled code."""
    if engine == "pymunk":
        from blast_env.particles.pymunk.engine import PymunkRun

        return PymunkRun(scene)
    from blast_env.particles.event.engine import EventRun

    return EventRun(scene)


def _run_one(job: tuple[str, Scenario, float, int, str]) -> FreeFieldRun:
    """Run one blast, in a worker process."""
    key, scenario, distance_m, seed, engine = job
    run = _started(engine, build_scene(scenario, (), seed))
    while run.end_reason is None:
        run.advance(np.inf)
    (structure,) = run.obstacles
    return FreeFieldRun(
        key=key,
        distance_m=distance_m,
        seed=seed,
        impulse_sim=structure.impulse,
        transferred_impulse_sim=structure.transferred_impulse,
        first_hit_s=structure.first_hit_s,
    )


FITS: Final[Mapping[str, Fit]] = MappingProxyType(
    {"proportional": fit_proportional, "linear": fit_linear, "power": fit_power_law}
)

ImpulseQuantity = Literal["incident_impulse", "reflected_impulse"]


@dataclass(frozen=True)
class Reference:
    """Reference of a calibration.

    Attributes:
        section: Description for the calibration file.
        impulse_psi_s: Its impulse at each distance (n,), psi*s.
    """

    section: ReferenceSection
    impulse_psi_s: np.ndarray


def paper_reference(distances_m: tuple[float, ...]) -> Reference:
    """Return the paper's UFC column.

    Raises:
        BlastEnvError: If a distance is not among the paper's eight.
    """
    column = paper_ufc_column()
    for distance_m in distances_m:
        if distance_m not in column.index:
            known = ", ".join(f"{known_m:g}" for known_m in column.index)
            raise BlastEnvError(
                f"the paper's UFC column has no value at {distance_m:g} m, must be one of {known}"
            )
    section = ReferenceSection(source="paper UFC column", quantity="impulse")
    return Reference(section, column.loc[list(distances_m)].to_numpy(dtype=np.float64))


def kingery_bulmash_reference(
    distances_m: tuple[float, ...],
    charge_kg: float,
    quantity: ImpulseQuantity = "reflected_impulse",
) -> Reference:
    """Return Kingery and Bulmash's impulse of a hemispherical burst.

    Raises:
        BlastEnvError: If a distance is outside the range of the curves.
    """
    impulse_pa_s = kingery_bulmash(quantity, np.array(distances_m), charge_kg)
    section = ReferenceSection(
        source="Kingery-Bulmash", quantity=quantity, burst="hemispherical", charge_kg=charge_kg
    )
    return Reference(section, impulse_pa_s / PA_PER_PSI)


@dataclass(frozen=True, eq=False)
class CalibrationReport:
    """A study with its three fits.

    Attributes:
        study: The study.
        runs: One row per blast.
        summary: One row per distance; see `summarise`.
        reference: The reference of the fits.
        laws: The three laws by name.
        metrics: Agreement of each law with the reference, by name.
        simulated: The sum over the collisions that they convert.
    """

    study: FreeFieldStudy
    runs: pd.DataFrame
    summary: pd.DataFrame
    reference: Reference
    laws: Mapping[str, ScalingLaw]
    metrics: Mapping[str, FitMetrics]
    simulated: SimulatedQuantity = "impulse"

    def table(self) -> pd.DataFrame:
        """Return the summary with the reference and the laws in psi*s, and their errors in %."""
        table = self.summary.assign(reference_psi_s=self.reference.impulse_psi_s)
        for name, law in self.laws.items():
            scaled = law(table.i_sim.to_numpy())
            table[f"{name}_psi_s"] = scaled
            table[f"{name}_error_percent"] = 100.0 * (scaled / table.reference_psi_s - 1.0)
        return table

    def calibration(self, name: str, law: LawName = "power") -> Calibration:
        """Return the calibration of one of the laws."""
        study, by_seed = self.study, impulse_by_seed(self.runs, self.simulated)
        reference = self.reference.impulse_psi_s
        # Two kinds of doubt: from distance to distance, by leaving each out, and from seed to seed,
        # by drawing seeds with replacement.
        left_out = leave_one_out(
            study.distances_m, self.summary.i_sim.to_numpy(), reference, FITS[law]
        )
        intervals = bootstrap_coefficients(by_seed, reference, FITS[law])
        (structure,) = study.scenario.structures
        (source,) = study.scenario.charge
        return Calibration(
            name=name,
            law=law,
            coefficients=self.laws[law].coefficients,
            coefficient_intervals={key: (i.low, i.high) for key, i in intervals.items()},
            reference=self.reference.section,
            preset=study.scenario.simulation.preset,
            parameters_digest=parameters_digest(study.scenario.parameters, study.engine),
            engine=study.engine,
            engine_version=_VERSIONS[study.engine],
            blast_env_version=package_version(),
            facade_width_m=structure.rectangle_m.top - structure.rectangle_m.bottom,
            ball_radius_m=study.scenario.parameters.air.radius_units / UNITS_PER_M,
            simulated=self.simulated,
            tnt_kg=source.tnt_kg,
            distances_m=study.distances_m,
            seeds=study.seeds,
            i_sim=tuple(self.summary.i_sim),
            i_sim_ci95=tuple(self.summary.ci95),
            i_reference_psi_s=tuple(reference.tolist()),
            metrics=MetricsSection(
                **asdict(self.metrics[law]),
                leave_one_out_mape_percent=left_out.metrics.mape_percent,
            ),
        )


def calibrate(
    study: FreeFieldStudy,
    runs: pd.DataFrame,
    reference: Reference,
    simulated: SimulatedQuantity = "impulse",
) -> CalibrationReport:
    """Fit the three laws to the runs of a study.

    Args:
        simulated: The sum over the collisions to convert.

    Raises:
        BlastEnvError: If the runs cannot be fitted, e.g. because nothing arrived at a distance.
    """
    summary = summarise(runs, simulated)
    i_sim = summary.i_sim.to_numpy(dtype=np.float64)
    laws = {name: fit(i_sim, reference.impulse_psi_s) for name, fit in FITS.items()}
    metrics = {
        name: fit_metrics(study.distances_m, law(i_sim), reference.impulse_psi_s)
        for name, law in laws.items()
    }
    return CalibrationReport(study, runs, summary, reference, laws, metrics, simulated)
