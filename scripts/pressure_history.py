"""How far the simulated pressure on a facade is from Kingery and Bulmash's.

The impulse is calibrated, so the pressures are scaled to it; arrival, peak and duration are then
what the model says by itself. Prints a Markdown table and draws a figure.
"""

from pathlib import Path
from typing import Annotated

import joblib
import typer

from blast_env import load_scenario, simulate
from blast_env.calibration import Friedlander, kingery_bulmash
from blast_env.calibration.model import load_calibration
from blast_env.cli.output import print_line, user_errors
from blast_env.rendering.figures import save_figure
from blast_env.simulation import BlastResult
from blast_env.studies.pressure.figure import PressureCase, pressure_figure
from blast_env.studies.pressure.pulses import facade_history
from blast_env.units import MS_PER_S

CALIBRATION = "ballistic_kb_100kg"
BIN_S = 0.0005
PA_PER_KPA = 1000.0


def main(
    distances: Annotated[str, typer.Option(help="m, separated by commas.")] = "10,20,40",
    seeds: int = 16,
    first_seed: int = 2000,
    processes: int = 2,
    out: Path = Path("out/pressure_history.png"),
) -> None:
    """Run blasts, print the table, draw the figure."""
    with user_errors():
        out.parent.mkdir(parents=True, exist_ok=True)
        wanted = range(first_seed, first_seed + seeds)
        cases = [pressure_case(float(d), wanted, processes) for d in distances.split(",")]
        save_figure(
            pressure_figure(
                cases,
                f"100 kg TNT; simulated with preset ballistic, {seeds} seeds, bins of "
                f"{MS_PER_S * BIN_S:g} ms, scaled to the calibrated impulse",
            ),
            out,
        )
    print_line("| R (m) | | arrival (ms) | peak (kPa) | positive duration (ms) | impulse (Pa s) |")
    print_line("|---|---|---|---|---|---|")
    for case in cases:
        for who, wave in (("simulated", case.fitted), ("Kingery-Bulmash", case.reference)):
            print_line(
                f"| {case.distance_m:g} | {who} | {MS_PER_S * wave.arrival_s:.1f} | "
                f"{wave.peak / PA_PER_KPA:.0f} | {MS_PER_S * wave.positive_duration_s:.1f} | "
                f"{_impulse(case, who):.0f} |"
            )
    print_line(f"wrote {out}")


def pressure_case(distance_m: float, seeds: range, processes: int) -> PressureCase:
    """Return the simulated history and the reference at a distance."""
    scenario = load_scenario("free_field").at_stand_off(distance_m)
    jobs = (joblib.delayed(simulate)(scenario, seed=seed) for seed in seeds)
    results: list[BlastResult] = joblib.Parallel(n_jobs=processes)(jobs)
    calibration = load_calibration(CALIBRATION)
    impulse_sim = sum(result.impulse_sim("building") for result in results) / len(results)
    raw = facade_history(results, "building", "left", BIN_S)
    width_m = calibration.facade_width_m
    charge_kg = results[0].blast.scene.charge.tnt_kg
    wanted = calibration.convert(impulse_sim, width_m, distance_m, charge_kg)
    history = facade_history(results, "building", "left", BIN_S, scale=wanted.pa_s / raw.impulse)
    return PressureCase(
        distance_m, history, history.friedlander(), reference_wave(distance_m, charge_kg)
    )


def reference_wave(distance_m: float, charge_kg: float) -> Friedlander:
    """Return Kingery and Bulmash's reflected pressure as a Friedlander waveform."""
    peak, duration_s, impulse, arrival_s = (
        kingery_bulmash(quantity, distance_m, charge_kg)
        for quantity in (
            "reflected_overpressure",
            "positive_duration",
            "reflected_impulse",
            "arrival_time",
        )
    )
    return Friedlander.from_impulse(peak, duration_s, impulse, arrival_s)


def _impulse(case: PressureCase, who: str) -> float:
    return case.history.impulse if who == "simulated" else case.reference.impulse()


if __name__ == "__main__":
    typer.run(main)
