"""Whether charges of 20, 100 and 1000 kg TNT obey Hopkinson-Cranz scaling.

The same scaled distances for every mass. Impulses per metre of facade, divided by the cube root of
the mass, should then be the same. The law of the 100 kg calibration, used with the scaling, is held
against Kingery-Bulmash.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from blast_env.calibration import kingery_bulmash, load_calibration
from blast_env.fitting.free_field import FreeFieldStudy, free_field, summarise
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.runner import share_of
from blast_env.units import PA_PER_PSI

with render_extra():
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

MASSES_KG = (20.0, 100.0, 1000.0)
_LOOKS: Final = (("#0072B2", "o"), ("#000000", "D"), ("#D55E00", "^"))
_Z_TICKS: Final = (2, 3, 4, 5, 6, 8)
COLUMNS = ("tnt_kg", "distance_m", "scaled_distance", "i_sim", "ci95", "arrival_s")


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
    for number, tnt_kg in enumerate(MASSES_KG):
        scale = (tnt_kg / stored.tnt_kg) ** (1.0 / 3.0)
        scenario = free_field(tnt_kg=tnt_kg).with_simulation(stored.preset)
        distances_m = tuple(round(scale * distance_m, 2) for distance_m in stored.distances_m)
        study = FreeFieldStudy(scenario, distances_m, tuple(seeds), engine)
        path = store / f"{tnt_kg:g}kg.{engine}.runs.jsonl"
        runs = study.run(processes, path, share_of(progress, number, len(MASSES_KG)))
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
