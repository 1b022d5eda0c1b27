"""Whether charges of 20, 100 and 1000 kg TNT obey Hopkinson-Cranz scaling, for docs/validity.md.

The same scaled distances for every mass. Impulses per metre of facade, divided by the cube root of
the mass, should then be the same. The law of the 100 kg calibration, used with the scaling, and a
law of each mass's own are held against Kingery-Bulmash. Draws both as a figure.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import pandas as pd
import typer

from blast_env import load_scenario
from blast_env.calibration import fit_metrics, fit_power_law, kingery_bulmash, load_calibration
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.files import write_atomically
from blast_env.rendering.figures import save_figure
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.scenario import Scenario
from blast_env.studies.calibration.study import FreeFieldStudy, summarise
from blast_env.units import PA_PER_PSI

with render_extra():
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

MASSES_KG = (20.0, 100.0, 1000.0)
_LOOKS: Final = (("#0072B2", "o"), ("#000000", "D"), ("#D55E00", "^"))
_Z_TICKS: Final = (2, 3, 4, 5, 6, 8)
COLUMNS = ("tnt_kg", "distance_m", "scaled_distance", "i_sim", "ci95", "arrival_s")


def main(
    calibration: str = "collisional_kb",
    engine: str = "event",
    seeds: Annotated[int, typer.Option(min=2)] = 16,
    first_seed: int = 1000,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    out: Path = Path("out/hopkinson_cranz"),
    figure: Path = Path("docs/pictures/hopkinson_cranz.png"),
) -> None:
    """Print the scaled impulses and the errors of both laws, write and draw them."""
    with user_errors():
        out.mkdir(parents=True, exist_ok=True)
        table = scaled_impulses(
            calibration, engine, range(first_seed, first_seed + seeds), processes, out
        )
        with write_atomically(out / f"{calibration}.{engine}.csv") as temporary:
            table.to_csv(temporary, index=False)
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


def scaled_impulses(
    calibration: str,
    engine: str,
    seeds: range,
    processes: int,
    store: Path,
    progress: Callable[[float], None] | None = None,
) -> pd.DataFrame:
    """Return one row a mass and distance.

    `i_sim_scaled` is the impulse on the calibration's facade over the cube root of the mass in
    units of the calibration's; `scaled_psi_s` what the calibration makes of it.
    """
    stored = load_calibration(calibration, engine)
    tables = []
    for tnt_kg in MASSES_KG:
        scale = (tnt_kg / stored.tnt_kg) ** (1.0 / 3.0)
        scenario = free_field(tnt_kg, stored.preset)
        distances_m = tuple(round(scale * distance_m, 2) for distance_m in stored.distances_m)
        study = FreeFieldStudy(scenario, distances_m, tuple(seeds), engine)
        with progress_bar(f"{tnt_kg:g} kg") as show:
            runs = study.run(
                processes, store / f"{tnt_kg:g}kg.{engine}.runs.jsonl", progress or show
            )
        own = summarise(runs, stored.simulated)
        own.insert(0, "tnt_kg", tnt_kg)
        own["scaled_distance"] = own.distance_m / tnt_kg ** (1.0 / 3.0)
        own["i_sim_scaled"] = own.i_sim / scale
        pa_s = kingery_bulmash("reflected_impulse", own.distance_m.to_numpy(), tnt_kg)
        own["reference_psi_s"] = np.asarray(pa_s) / PA_PER_PSI
        law = stored.scaling_law
        own["scaled_psi_s"] = scale * law(own.i_sim_scaled.to_numpy())
        tables.append(own)
    wanted = [*COLUMNS, "i_sim_scaled", "reference_psi_s", "scaled_psi_s"]
    return pd.concat(tables)[wanted].reset_index(drop=True)


def scaling_figure(table: pd.DataFrame, subtitle: str) -> Figure:
    """Return the scaled impulses over Z, and the errors of the 100 kg law on all masses.

    Args:
        table: Of `scaled_impulses`.
        subtitle: What was run.
    """
    figure = Figure(figsize=(12.0, 5.4), layout="constrained")
    impulse, error = figure.subplots(1, 2)
    for (tnt_kg, own), (colour, marker) in zip(table.groupby("tnt_kg"), _LOOKS, strict=False):
        half_width = own.ci95 * own.i_sim_scaled / own.i_sim
        look = {"color": colour, "marker": marker, "label": f"{tnt_kg:g} kg TNT"}
        impulse.errorbar(own.scaled_distance, own.i_sim_scaled, half_width, capsize=3, **look)
        percent = 100.0 * (own.scaled_psi_s / own.reference_psi_s - 1.0)
        error.plot(own.scaled_distance, percent, **look)
    error.axhline(0.0, color="#000000", lw=1.0)
    impulse.set(yscale="log", title="The same curve, if charges scale (95 % intervals)")
    impulse.set_ylabel("simulated impulse / (W / 100 kg)$^{1/3}$ (simulation units)")
    error.set(title="Law of 100 kg, scaled, against Kingery and Bulmash")
    error.set_ylabel("error of the reflected impulse (%)")
    for axes in (impulse, error):
        axes.set_xscale("log")
        axes.set_xlabel("Z = R / W$^{1/3}$ (m/kg$^{1/3}$)")
        axes.xaxis.set_major_locator(FixedLocator(_Z_TICKS))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(color="#E3E6EA")
        axes.legend()
    write_heading(figure, "Hopkinson-Cranz scaling in the model", subtitle)
    return figure


def free_field(tnt_kg: float, preset: str) -> Scenario:
    """Return the free field with another charge."""
    document = load_scenario("free_field").model_dump()
    (source,) = document["charge"]
    source["tnt_kg"] = tnt_kg
    scenario = Scenario.from_document(document, f"free_field with {tnt_kg:g} kg TNT")
    return scenario.with_simulation(preset)


if __name__ == "__main__":
    typer.run(main)
