"""The tables and figures of docs/studies/particles.md: what of the particle model is right."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from statistics import fmean, stdev
from typing import Annotated, Final

import numpy as np
import pandas as pd
import typer

from blast_env.calibration import fit_metrics, fit_power_law
from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder
from blast_env.fitting.free_field import free_field
from blast_env.physics.parameters import with_overrides
from blast_env.physics.presets import preset as find_preset
from blast_env.physics.presets import with_resolution
from blast_env.rendering.figures import save_figure
from blast_env.runner import run_all
from blast_env.scenario import Scenario
from blast_env.simulation import simulate
from blast_env.studies.shielding.reflection import (
    ReflectionStudy,
    near_field,
    reference_near_field,
)
from blast_env.tables import markdown_table, write_csv
from blast_env.units import MODULE_SIDE_M, MS_PER_S
from studies.particles import mach_stem as stem
from studies.particles.pressure.figure import BIN_S, PA_PER_KPA, pressure_case, pressure_figure
from studies.particles.scaling import scaled_impulses, scaling_figure

FACADES_MODULES: Final = (20, 40, 80)
"""The calibrations' reference facade, twice and four times it."""
THERMAL_SHARES: Final = (0.0, 0.25, 0.5, 0.75, 0.9)
NEAR_FIELD_M: Final = (10.0, 25.0)

Processes = Annotated[int, typer.Option(min=1)]
Seeds = Annotated[int, typer.Option(min=2)]
app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def scaling(
    calibration: str = "collisional_kb",
    engine: str = "event",
    seeds: Seeds = 16,
    first_seed: int = 1000,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/hopkinson_cranz"),
    figure: Path = Path("docs/pictures/hopkinson_cranz.png"),
) -> None:
    """Print, write and draw whether charges obey Hopkinson-Cranz scaling."""
    with user_errors(), running_on(cluster):
        make_folder(out)
        numbers = range(first_seed, first_seed + seeds)
        with progress_bar("blasts") as progress:
            table = scaled_impulses(calibration, engine, numbers, processes, out, progress)
        write_csv(table, out / f"{calibration}.{engine}.csv")
        subtitle = f"calibration {calibration}, engine {engine}, {seeds} seeds at each distance"
        save_figure(scaling_figure(table, subtitle), figure)
        print_line(table.round(4).to_string(index=False))
        for tnt_kg, own in table.groupby("tnt_kg"):
            reference = own.reference_psi_s.to_numpy()
            law = fit_power_law(own.i_sim.to_numpy(), reference)
            fitted = fit_metrics(own.distance_m, law(own.i_sim.to_numpy()), reference)
            scaled = fit_metrics(own.distance_m, own.scaled_psi_s, reference)
            print_line(
                f"{tnt_kg:g} kg: law of its own B = {law.B:.3f}, MAPE {fitted.mape_percent:.1f} %; "
                f"law of 100 kg, scaled: MAPE {scaled.mape_percent:.1f} %, integral error "
                f"{scaled.integral_error_percent:.1f} %"
            )


@app.command()
def facade_width(
    distance_m: float = 40.0,
    seeds: Seeds = 16,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Print the scaled impulse on the reference facade, on twice and on four times it."""
    with user_errors(), running_on(cluster):
        for side_modules in FACADES_MODULES:
            scenario = free_field(side_modules=side_modules).at_stand_off(distance_m)
            scaled = run_all(partial(_psi_s, scenario), range(seeds), processes)
            width_m, error = side_modules * MODULE_SIDE_M, stdev(scaled) / seeds**0.5
            print_line(f"{width_m:3g} m: {fmean(scaled):.4f} +- {error:.4f} psi s")


def _psi_s(scenario: Scenario, seed: int) -> float:
    return simulate(scenario, seed=seed).impulse("building").psi_s


@app.command()
def pressure(
    distances: Annotated[str, typer.Option(help="m, separated by commas.")] = "10,20,40",
    seeds: int = 16,
    first_seed: int = 2000,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/pressure_history.png"),
) -> None:
    """Print and draw how far the pressure on a facade is from Kingery and Bulmash's.

    The impulse is calibrated, so the pressures are scaled to it; arrival, peak and duration are
    then what the model says by itself.
    """
    with user_errors(), running_on(cluster):
        make_folder(out.parent)
        wanted = range(first_seed, first_seed + seeds)
        cases = [pressure_case(float(d), wanted, processes) for d in distances.split(",")]
        subtitle = (
            f"100 kg TNT; simulated with preset ballistic, {seeds} seeds, bins of "
            f"{MS_PER_S * BIN_S:g} ms, scaled to the calibrated impulse"
        )
        save_figure(pressure_figure(cases, subtitle), out)
    rows = [
        (
            f"{case.distance_m:g}",
            who,
            f"{MS_PER_S * wave.arrival_s:.1f}",
            f"{wave.peak / PA_PER_KPA:.0f}",
            f"{MS_PER_S * wave.positive_duration_s:.1f}",
            f"{impulse:.0f}",
        )
        for case in cases
        for who, wave, impulse in (
            ("simulated", case.fitted, case.history.impulse),
            ("Kingery-Bulmash", case.reference, case.reference.impulse()),
        )
    ]
    columns = ("arrival (ms)", "peak (kPa)", "positive duration (ms)", "impulse (Pa s)")
    print_line(markdown_table(("R (m)", "", *columns), rows))
    print_line(f"wrote {out}")


@app.command()
def mach_stem(
    preset: Annotated[
        str | None, typer.Option(help="Without it: dense air without losses.")
    ] = None,
    resolution: Annotated[float, typer.Option(help="How much finer the balls are.")] = 2.0,
    stand_off: Annotated[float, typer.Option(help="m")] = 6.0,
    first_ms: float = 6.0,
    last_ms: float = 14.0,
    times: Annotated[int, typer.Option(min=4)] = 17,
    seeds: Seeds = 40,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/mach_stem.png"),
) -> None:
    """Print and draw whether reflection at a long wall turns into a Mach stem, and where."""
    with user_errors(), running_on(cluster):
        parameters = stem.dense_elastic_air() if preset is None else find_preset(preset)
        if parameters.air.spacing_units == 0.0:
            raise BlastEnvError(f"preset {preset!r} has no air: there is no density to look at")
        make_folder(out.parent)
        scenario = stem.wall_scenario(stand_off, with_resolution(parameters, resolution))
        times_s = (np.linspace(first_ms, last_ms, times) / MS_PER_S).tolist()
        halves = [
            stem.mean_density(scenario, range(half, seeds, 2), times_s, processes)
            for half in range(2)
        ]
        fields = [
            stem.DensityField(a.time_s, a.stand_off_m, (a.density + b.density) / 2.0)
            for a, b in zip(*halves, strict=True)
        ]
        name = "dense air without losses" if preset is None else f"preset {preset}"
        subtitle = f"{name}, resolution {resolution:g}, {seeds} seeds, stand-off {stand_off:g} m"
        angle_deg, *each_deg = (stem.transition_deg(of) for of in (fields, *halves))
        save_figure(stem.mach_stem_figure(fields, angle_deg, subtitle), out)
    headers = ("time (ms)", "angle of incidence (deg)", "height of the stem (m)")
    print_line(markdown_table(headers, map(_stem_row, fields)))
    if np.isnan(angle_deg):
        print_line("no stem can be told")
    else:
        each = " and ".join(f"{angle:.1f}" for angle in each_deg)
        print_line(f"a stem begins at {angle_deg:.1f} degrees; either half of the seeds: {each}")
    print_line(f"wrote {out}")


def _stem_row(field: stem.DensityField) -> tuple[str, ...]:
    found = (field.incidence_deg, field.stem_height_m)
    cells = ("-" if np.isnan(field.incidence_deg) else f"{each:.1f}" for each in found)
    return f"{MS_PER_S * field.time_s:.1f}", *cells


@app.command()
def thermal_share(
    preset: str = "collisional",
    resolutions: Annotated[str, typer.Option(help="Finer balls beside it.")] = "2,3",
    seeds: Seeds = 16,
    first_seed: int = 1000,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/thermal_share.csv"),
) -> None:
    """Print and write what the random part of the charge's initial velocity does.

    The preset with several thermal shares, and finer balls beside it: reflected impulse over
    distance, side-on load over path length, their ratio; last Kingery and Bulmash's.
    """
    with user_errors(), running_on(cluster):
        make_folder(out.parent)
        base = find_preset(preset)
        shares = [{"explosive": {"thermal_share": share}} for share in THERMAL_SHARES]
        cases = [with_overrides(base, overrides) for overrides in shares]
        cases += [with_resolution(base, float(each)) for each in resolutions.split(",")]
        numbers = tuple(range(first_seed, first_seed + seeds))
        found = []
        for parameters in cases:
            study = ReflectionStudy(parameters, numbers, time_limit_s=1.0, distances_m=NEAR_FIELD_M)
            with progress_bar(f"thermal share {parameters.explosive.thermal_share:g}") as progress:
                found.append(near_field(study.run(processes, progress)))
        found.append(reference_near_field(NEAR_FIELD_M))
        table = pd.DataFrame([asdict(each) for each in found])
        write_csv(table, out)
        print_line(table.round(3).to_string(index=False))
        print_line("last row: Kingery and Bulmash, hemispherical, reflected and incident impulse")


if __name__ == "__main__":
    app()
