"""A free-field study from the command line: its three laws, and a stored calibration."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from blast_env.atomic import write_atomically
from blast_env.calibration.calibrate import (
    CalibrationReport,
    LawName,
    Reference,
    kingery_bulmash_reference,
    paper_reference,
)
from blast_env.calibration.calibrate import (
    calibrate as fit_laws,
)
from blast_env.calibration.metrics import shape_rms_percent
from blast_env.calibration.model import Calibration, SimulatedQuantity
from blast_env.calibration.references import paper_table
from blast_env.calibration.stored import save_calibration
from blast_env.calibration.study import FreeFieldStudy
from blast_env.cli.output import make_table, print_line, progress_bar, result_console
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import find_engine
from blast_env.scenario import Scenario, load_scenario

ReferenceName = Literal["paper_ufc", "reflected_impulse", "incident_impulse"]
Burst = Literal["hemispherical", "spherical"]


@dataclass(frozen=True)
class FreeFieldOptions:
    """What the command was called with; see `blast-env calibrate --help`.

    Attributes:
        name: Name of the calibration and of its files.
        reference: What to calibrate against.
        distances: Distances, m, separated by commas.
        seeds: Seeds at every distance.
        scenario: A scenario with one point charge and one structure.
        preset: Parameters, instead of the scenario's.
        engine: Name of the engine.
        tnt_kg: Mass of the charge, instead of the scenario's.
        tnt_range: Masses "LOW,HIGH" for which the calibration is to hold by scaling.
        law: The law to store.
        simulated: Which sum over the collisions to convert.
        burst: For Kingery-Bulmash.
        processes: Worker processes.
        out: Folder for all files.
    """

    name: str
    reference: ReferenceName
    distances: str
    seeds: tuple[int, ...]
    scenario: str
    preset: str | None
    engine: str
    tnt_kg: float | None
    tnt_range: str | None
    law: LawName
    simulated: SimulatedQuantity
    burst: Burst
    processes: int
    out: Path

    @property
    def stem(self) -> str:
        """Path of all files without their suffix."""
        return str(self.out / f"{self.name}.{self.engine}")


def calibrate_free_field(options: FreeFieldOptions) -> None:
    """Run the study, write its files and print its tables.

    Raises:
        BlastEnvError: If an option is wrong.
    """
    distances_m = _parse_numbers("--distances", options.distances)
    tnt_range_kg = _parse_range(options.tnt_range)
    options.out.mkdir(parents=True, exist_ok=True)
    engine = find_engine(options.engine).name
    study = FreeFieldStudy(_scenario(options), distances_m, options.seeds, engine)
    reference = _reference(options.reference, study, options.burst)
    with progress_bar(f"{len(options.seeds) * len(distances_m)} blasts") as progress:
        runs = study.run(options.processes, Path(f"{options.stem}.runs.jsonl"), progress)
    report = fit_laws(study, runs, reference, options.simulated)
    stored = report.calibration(options.name, options.law)
    stored = stored.model_copy(update={"tnt_range_kg": tnt_range_kg})
    _write(report, stored, options.stem)
    _print(report, stored)
    for suffix in (".json", ".csv", ".png", ".runs.jsonl"):
        print_line(f"wrote {options.stem}{suffix}")


def _scenario(options: FreeFieldOptions) -> Scenario:
    scenario = load_scenario(options.scenario)
    if options.preset is not None:
        scenario = scenario.with_simulation(options.preset)
    if options.tnt_kg is None:
        return scenario
    document = scenario.model_dump()
    for source in document["charge"]:
        source["tnt_kg"] = options.tnt_kg
    return Scenario.from_document(document, f"{options.scenario} with --tnt-kg")


def _parse_numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise BlastEnvError(
            f"{option} is {text!r}, must be numbers separated by commas, e.g. 8,10,15"
        ) from None


def _parse_range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    numbers = _parse_numbers("--tnt-range", text)
    if len(numbers) != 2 or not 0.0 < numbers[0] <= numbers[1]:
        raise BlastEnvError(f"--tnt-range is {text!r}, must be LOW,HIGH in kg, e.g. 20,1000")
    return numbers[0], numbers[1]


def _reference(name: ReferenceName, study: FreeFieldStudy, burst: Burst) -> Reference:
    if name == "paper_ufc":
        return paper_reference(study.distances_m)
    charge_kg = study.scenario.charge[0].tnt_kg
    return kingery_bulmash_reference(study.distances_m, charge_kg, name, burst)


def _write(report: CalibrationReport, stored: Calibration, stem: str) -> None:
    from blast_env.rendering.calibration_figure import calibration_figure
    from blast_env.rendering.figures import save_figure

    save_calibration(stored, Path(f"{stem}.json"))
    with write_atomically(Path(f"{stem}.csv")) as temporary:
        report.table().to_csv(temporary, index=False)
    save_figure(calibration_figure(report, stored.name), Path(f"{stem}.png"))


def _print(report: CalibrationReport, stored: Calibration) -> None:
    table = make_table(
        f"{stored.name}: {len(stored.seeds)} seeds at each distance, reference "
        f"{stored.reference.source}, {stored.reference.quantity.replace('_', ' ')}",
        ("R (m)", "i_sim", "95 % +-", "reference (psi s)", *report.laws, "error of stored law"),
        text_columns=0,
    )
    for row in report.table().to_dict("records"):
        table.add_row(
            f"{row['distance_m']:g}",
            f"{row['i_sim']:,.0f}",
            f"{row['ci95']:,.0f}",
            f"{row['reference_psi_s']:.4f}",
            *(f"{row[f'{name}_psi_s']:.4f}" for name in report.laws),
            f"{row[f'{stored.law}_error_percent']:+.1f} %",
        )
    result_console().print(table)
    for name, metrics in report.metrics.items():
        coefficients = ", ".join(
            f"{k} = {v:.5g}" for k, v in report.laws[name].coefficients.items()
        )
        print_line(
            f"{name}: {coefficients}; MAPE {metrics.mape_percent:.2f} %, RMSE {metrics.rmse:.4f} "
            f"psi s, integral error {metrics.integral_error_percent:.2f} %"
        )
    intervals = ", ".join(
        f"{k} {low:.4g} to {high:.4g}" for k, (low, high) in stored.coefficient_intervals.items()
    )
    print_line(
        f"stored: {stored.law}; 95 % intervals over seeds: {intervals}; leave-one-distance-out "
        f"MAPE {stored.metrics.leave_one_out_mape_percent:.2f} %"
    )
    if stored.reference.source == "paper UFC column":
        own = paper_table().set_index("r_m").i_sim.loc[list(stored.distances_m)].to_numpy()
        rms = shape_rms_percent(stored.i_sim, own)
        print_line(f"against the paper's own i_sim: {rms:.1f} % rms after one common factor")
