"""`blast-env calibrate`: a free-field study, its three laws, and a stored calibration."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import typer

from blast_env.answers.calibrate import calibration_answer
from blast_env.answers.terminal import print_line
from blast_env.cli.command import writes
from blast_env.cli.options import ClusterAddress, ProcessesOption, TntOption, numbers, running_on
from blast_env.cli.output import print_outcome, progress_bar, resumable, save_pictures
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import CALIBRATED_ENGINES, PAPER_ENGINES, find_engine
from blast_env.files import make_folder
from blast_env.particles.calibration.model import (
    Calibration,
    LawName,
    SimulatedQuantity,
    save_calibration,
)
from blast_env.site import Scenario, load_scenario
from blast_env.tables import write_csv
from blast_env.values import plain_number

if TYPE_CHECKING:  # takes a third of a second to import
    from matplotlib.figure import Figure

    from blast_env.particles.calibration.free_field import (
        CalibrationReport,
        FreeFieldStudy,
        Reference,
    )

ReferenceName = Literal["paper_ufc", "reflected_impulse", "incident_impulse"]
_ENGINES: Final = f"{' or '.join(CALIBRATED_ENGINES)}."


def calibrate(
    name: str = typer.Option(help="Name of the calibration and of its files."),
    reference: ReferenceName = typer.Option(
        help="paper_ufc, or Kingery-Bulmash: reflected_ or incident_impulse.", metavar="REFERENCE"
    ),
    distances: str = typer.Option(
        "15,30,45,60,75,90,105,120",
        help="Distances from charge to facade, m, separated by commas.",
    ),
    seeds: int = typer.Option(16, help="Blasts at each distance.", min=2),
    first_seed: int = typer.Option(1000, help="First seed.", min=0),
    scenario: str = typer.Option(
        "free_field", help="A scenario with one point charge and one structure."
    ),
    preset: str | None = typer.Option(None, help="Parameters of this name."),
    engine: str = typer.Option(PAPER_ENGINES["calibrate"], help=_ENGINES),
    law: LawName = typer.Option(
        "power", help="The law to store: proportional, linear or power.", metavar="LAW"
    ),
    simulated: SimulatedQuantity = typer.Option(
        "impulse",
        help="Convert impulse (m|v|), or transferred_impulse (momentum really transferred).",
        metavar="QUANTITY",
    ),
    tnt_kg: TntOption = None,
    tnt_range: str | None = typer.Option(
        None, help="LOW,HIGH: masses, kg, for which the law shall hold by scaling."
    ),
    out: Path = writes("Folder for all files", default=Path("out/calibration")),
    processes: ProcessesOption = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Run blasts at many distances, fit the three laws, and store one as a calibration.

    Finished blasts are stored in NAME.ENGINE.runs.sqlite: after an interruption, the same command
    resumes from there.
    """
    # Here, because pandas and SciPy take a third of a second to import.
    from blast_env.particles.calibration.free_field import FreeFieldStudy
    from blast_env.particles.calibration.free_field import calibrate as fit_laws

    distances_m = _parse_numbers("--distances", distances)
    tnt_range_kg = _parse_range(tnt_range)
    make_folder(out)
    used = find_engine(engine)
    site = _site(scenario, preset, tnt_kg)
    drawn = tuple(range(first_seed, first_seed + seeds))
    study = FreeFieldStudy(site, distances_m, drawn, used.name)
    compared = _reference(reference, study)
    stem = str(out / f"{name}.{engine}")
    kept = Path(f"{stem}.runs.sqlite")
    label = f"{seeds * len(distances_m)} blasts"
    resume = "the same command resumes after the finished blasts"
    with resumable(resume), running_on(cluster), progress_bar(label) as progress:
        runs = study.run(processes, kept, progress)
    report = fit_laws(study, runs, compared, simulated)
    stored = report.calibration(name, law).model_copy(update={"tnt_range_kg": tnt_range_kg})
    written = _write(report, stored, stem)
    print_line(used.describe([study.scenario]))
    print_outcome(calibration_answer(report, stored), [*written, kept])


def _site(name: str, preset: str | None, tnt_kg: float | None) -> Scenario:
    """Return the scenario with the parameters and the mass of the command line."""
    site = load_scenario(name).with_simulation(preset)
    if tnt_kg is None:
        return site
    document = site.model_dump()
    for source in document["charge"]:
        source["tnt_kg"] = tnt_kg
    return Scenario.from_document(document, f"{name} with --tnt-kg")


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
    low, high = numbers("--tnt-range", text, "LOW,HIGH")
    if not 0.0 < low <= high:
        raise BlastEnvError(f"--tnt-range is {text!r}, must be LOW,HIGH in kg, e.g. 20,1000")
    return low, high


def _reference(name: ReferenceName, study: "FreeFieldStudy") -> "Reference":
    from blast_env.particles.calibration.free_field import (
        kingery_bulmash_reference,
        paper_reference,
    )

    if name == "paper_ufc":
        return paper_reference(study.distances_m)
    charge_kg = study.scenario.charge[0].tnt_kg
    return kingery_bulmash_reference(study.distances_m, charge_kg, name)


def _write(report: "CalibrationReport", stored: Calibration, stem: str) -> list[Path]:
    record, picture = Path(f"{stem}.json"), Path(f"{stem}.png")
    save_calibration(stored, record)
    table = write_csv(report.table(), f"{stem}.csv")
    return [record, table, *save_pictures((picture, partial(_figure, report, stored)))]


def _figure(report: "CalibrationReport", stored: Calibration) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.plots.calibration_figures import calibration_figure

    return calibration_figure(report, stored.name)
