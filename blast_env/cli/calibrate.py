"""`blast-env calibrate`: a free-field study, its three laws, and a stored calibration."""

from pathlib import Path
from typing import Annotated, Literal

import typer

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
from blast_env.calibration.references import paper_table
from blast_env.calibration.stored import Calibration, save_calibration
from blast_env.calibration.study import FreeFieldStudy
from blast_env.cli.output import make_table, print_line, progress_bar, result_console, user_errors
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import find_engine
from blast_env.scenario import load_scenario

PAPER_DISTANCES = "15,30,45,60,75,90,105,120"
ReferenceName = Literal["paper_ufc", "reflected_impulse", "incident_impulse"]


def calibrate(
    name: Annotated[str, typer.Option(help="Name of the calibration and of its files.")],
    reference: Annotated[ReferenceName, typer.Option(help="What to calibrate against.")],
    distances: Annotated[
        str, typer.Option(help="Distances from charge to facade, m, separated by commas.")
    ] = PAPER_DISTANCES,
    seeds: Annotated[int, typer.Option(min=2, help="Blasts at each distance.")] = 16,
    first_seed: Annotated[int, typer.Option(min=0, help="The seeds count from here.")] = 1000,
    scenario: Annotated[
        str, typer.Option(help="A scenario with one point charge and one structure.")
    ] = "free_field",
    preset: Annotated[str | None, typer.Option(help="Parameters of this name.")] = None,
    engine: Annotated[str, typer.Option(help="pymunk or event.")] = "pymunk",
    law: Annotated[LawName, typer.Option(help="The law to store.")] = "power",
    burst: Annotated[
        Literal["hemispherical", "spherical"], typer.Option(help="For Kingery-Bulmash.")
    ] = "hemispherical",
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for all files.")] = Path("out/calibration"),
) -> None:
    """Run blasts at many distances, fit the three laws, and store one as a calibration.

    Finished blasts are kept in NAME.ENGINE.runs.jsonl: after an interruption, the same command goes on
    from there.
    """
    with user_errors():
        out.mkdir(parents=True, exist_ok=True)
        chosen = load_scenario(scenario)
        if preset is not None:
            chosen = chosen.with_simulation(preset)
        distances_m = _parse_distances(distances)
        numbers = tuple(range(first_seed, first_seed + seeds))
        study = FreeFieldStudy(chosen, distances_m, numbers, find_engine(engine).name)
        to_match = _reference(reference, study, burst)
        with progress_bar(f"{seeds * len(distances_m)} blasts") as progress:
            runs = study.run(processes, out / f"{name}.{engine}.runs.jsonl", progress)
        report = fit_laws(study, runs, to_match)
        stored = report.calibration(name, law)
        _write(report, stored, out)
        _print(report, stored)
        for suffix in (".json", ".csv", ".png", ".runs.jsonl"):
            print_line(f"wrote {out / name}.{engine}{suffix}")


def _parse_distances(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise BlastEnvError(
            f"--distances is {text!r}, must be numbers separated by commas, e.g. 8,10,15"
        ) from None


def _reference(
    name: ReferenceName, study: FreeFieldStudy, burst: Literal["hemispherical", "spherical"]
) -> Reference:
    if name == "paper_ufc":
        return paper_reference(study.distances_m)
    charge_kg = study.scenario.charge[0].tnt_kg
    return kingery_bulmash_reference(study.distances_m, charge_kg, name, burst)


def _write(report: CalibrationReport, stored: Calibration, out: Path) -> None:
    from blast_env.rendering.calibration_figure import calibration_figure
    from blast_env.rendering.figures import save_figure

    stem = f"{stored.name}.{stored.engine}"
    save_calibration(stored, out / f"{stem}.json")
    with write_atomically(out / f"{stem}.csv") as temporary:
        report.table().to_csv(temporary, index=False)
    save_figure(calibration_figure(report, stored.name), out / f"{stem}.png")


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
