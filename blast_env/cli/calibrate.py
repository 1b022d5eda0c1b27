"""`blast-env calibrate`: a free-field study, its three laws, and a stored calibration."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from blast_env.cli.command import FOLDER, option
from blast_env.cli.options import ClusterOptions, ProcessOptions, running_on
from blast_env.cli.output import (
    ResultTable,
    print_line,
    print_written,
    progress_bar,
    result_console,
    save_pictures,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import CALIBRATED_ENGINES, find_engine
from blast_env.files import make_folder
from blast_env.particles.calibration.laws import LawName, shape_rms_percent
from blast_env.particles.calibration.model import (
    Calibration,
    SimulatedQuantity,
    save_calibration,
)
from blast_env.particles.calibration.references import paper_table
from blast_env.site import Scenario, load_scenario
from blast_env.tables import write_csv
from blast_env.values import plain_number

if TYPE_CHECKING:  # takes a third of a second to import
    from blast_env.evaluation.free_field import CalibrationReport, FreeFieldStudy, Reference

ReferenceName = Literal["paper_ufc", "reflected_impulse", "incident_impulse"]
Burst = Literal["hemispherical", "spherical"]


@dataclass(frozen=True, kw_only=True)
class CalibrateCommand(ProcessOptions, ClusterOptions):
    """Run blasts at many distances, fit the three laws, and store one as a calibration.

    Finished blasts are stored in NAME.ENGINE.runs.sqlite: after an interruption, the same command
    resumes from there.
    """

    name: str = option(..., "Name of the calibration and of its files.")
    reference: ReferenceName = option(
        ...,
        "paper_ufc, or Kingery-Bulmash: reflected_ or incident_impulse.",
        metavar="REFERENCE",
    )
    distances: str = option(
        "15,30,45,60,75,90,105,120", "Distances from charge to facade, m, separated by commas."
    )
    seeds: int = option(16, "Blasts at each distance.", min=2)
    first_seed: int = option(1000, "First seed.", min=0)
    scenario: str = option("free_field", "A scenario with one point charge and one structure.")
    preset: str | None = option(None, "Parameters of this name.")
    engine: str = option("pymunk", f"{' or '.join(CALIBRATED_ENGINES)}.")
    law: LawName = option(
        "power", "The law to store: proportional, linear or power.", metavar="LAW"
    )
    simulated: SimulatedQuantity = option(
        "impulse",
        "Convert impulse (m|v|), or transferred_impulse (momentum really transferred).",
        metavar="QUANTITY",
    )
    burst: Burst = option(
        "hemispherical", "For Kingery-Bulmash: hemispherical or spherical.", metavar="BURST"
    )
    tnt_kg: float | None = option(
        None, "Mass of the charge, kg TNT, instead of the scenario's.", metavar="KG"
    )
    tnt_range: str | None = option(
        None, "LOW,HIGH: masses, kg, for which the law shall hold by scaling."
    )
    out: Path = option(Path("out/calibration"), "Folder for all files.", writes=FOLDER)

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C."""
        return "the same command resumes after the finished blasts"

    @property
    def stem(self) -> str:
        """Path of all files without their suffix."""
        return str(self.out / f"{self.name}.{self.engine}")

    def __call__(self) -> None:
        """Run the study, write its files and print its tables."""
        # Here, because pandas and SciPy take a third of a second to import.
        from blast_env.evaluation.free_field import FreeFieldStudy
        from blast_env.evaluation.free_field import calibrate as fit_laws

        distances_m = _parse_numbers("--distances", self.distances)
        tnt_range_kg = _parse_range(self.tnt_range)
        make_folder(self.out)
        engine = find_engine(self.engine)
        seeds = tuple(range(self.first_seed, self.first_seed + self.seeds))
        study = FreeFieldStudy(self._scenario(), distances_m, seeds, engine.name)
        reference = _reference(self.reference, study, self.burst)
        kept = Path(f"{self.stem}.runs.sqlite")
        count = len(seeds) * len(distances_m)
        with running_on(self.cluster), progress_bar(f"{count} blasts") as progress:
            runs = study.run(self.processes, kept, progress)
        report = fit_laws(study, runs, reference, self.simulated)
        stored = report.calibration(self.name, self.law)
        stored = stored.model_copy(update={"tnt_range_kg": tnt_range_kg})
        written = _write(report, stored, self.stem)
        print_line(engine.describe([study.scenario]))
        _print(report, stored)
        print_written([*written, kept])

    def _scenario(self) -> Scenario:
        scenario = load_scenario(self.scenario)
        if self.preset is not None:
            scenario = scenario.with_simulation(self.preset)
        if self.tnt_kg is None:
            return scenario
        document = scenario.model_dump()
        for source in document["charge"]:
            source["tnt_kg"] = self.tnt_kg
        return Scenario.from_document(document, f"{self.scenario} with --tnt-kg")


def _parse_numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(plain_number(option, part) for part in text.split(","))
    except BlastEnvError:
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


def _reference(name: ReferenceName, study: "FreeFieldStudy", burst: Burst) -> "Reference":
    from blast_env.evaluation.free_field import kingery_bulmash_reference, paper_reference

    if name == "paper_ufc":
        return paper_reference(study.distances_m)
    charge_kg = study.scenario.charge[0].tnt_kg
    return kingery_bulmash_reference(study.distances_m, charge_kg, name, burst)


def _write(report: "CalibrationReport", stored: Calibration, stem: str) -> list[Path]:
    record, picture = Path(f"{stem}.json"), Path(f"{stem}.png")
    save_calibration(stored, record)
    table = write_csv(report.table(), f"{stem}.csv")
    return [record, table, *save_pictures(lambda: _save_figure(report, stored, picture))]


def _save_figure(report: "CalibrationReport", stored: Calibration, path: Path) -> list[Path]:
    # Here, because pictures need the extra `render`.
    from blast_env.plots.calibration_figures import calibration_figure
    from blast_env.plots.figures import save_figure

    return [save_figure(calibration_figure(report, stored.name), path)]


def _print(report: "CalibrationReport", stored: Calibration) -> None:
    table = ResultTable(
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
