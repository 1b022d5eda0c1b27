"""Hopkinson-Cranz scaling of charges of 20, 100 and 1000 kg TNT in the particle model.

All masses have the same scaled distances. The law of a calibration made with one mass, used with
the scaling, and a law fitted to each mass are compared with Kingery and Bulmash. This is the basis
for the range of masses of `collisional_kb`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import pandas as pd
import typer

from blast_env.calibration import fit_metrics, fit_power_law, kingery_bulmash, load_calibration
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.evaluation.free_field import FreeFieldStudy, free_field, summarise
from blast_env.files import make_folder
from blast_env.runner import share_of
from blast_env.tables import markdown_table, write_csv
from blast_env.units import PA_PER_PSI

MASSES_KG: Final = (20.0, 100.0, 1000.0)
HEADERS: Final = (
    "charge (kg)",
    "distances (m)",
    "scaled law: MAPE",
    "integral error",
    "largest error",
    "law of its own: B",
    "MAPE",
)


def scaled_impulses(
    calibration: str,
    engine: str,
    seeds: range,
    processes: int,
    store: Path,
    progress: Callable[[float], None] | None = None,
) -> pd.DataFrame:
    """Run the blasts; return one row per mass and distance.

    Args:
        calibration: Name of the calibration.
        engine: Name of its engine.
        seeds: Seeds at every distance.
        processes: Worker processes.
        store: Folder of the finished blasts.
        progress: Called with the finished share.

    Returns:
        `tnt_kg`, `distance_m`, `i_sim`, `reference_psi_s` (Kingery and Bulmash, reflected) and
        `scaled_psi_s`, the calibrated impulse with Hopkinson-Cranz scaling of the mass.
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
        own = summarise(runs, stored.simulated)[["distance_m", "i_sim"]]
        own.insert(0, "tnt_kg", tnt_kg)
        pa_s = kingery_bulmash("reflected_impulse", own.distance_m.to_numpy(), tnt_kg)
        own["reference_psi_s"] = np.asarray(pa_s) / PA_PER_PSI
        own["scaled_psi_s"] = scale * stored.scaling_law(own.i_sim.to_numpy() / scale)
        tables.append(own)
    return pd.concat(tables).reset_index(drop=True)


def law_rows(table: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return one row per mass: errors of the scaled law and of a fitted law; see `HEADERS`."""
    rows: list[tuple[str, ...]] = []
    for tnt_kg, own in table.groupby("tnt_kg"):
        i_sim, reference = own.i_sim.to_numpy(), own.reference_psi_s.to_numpy()
        law = fit_power_law(i_sim, reference)
        fitted = fit_metrics(own.distance_m, law(i_sim), reference)
        scaled = fit_metrics(own.distance_m, own.scaled_psi_s, reference)
        largest = float((own.scaled_psi_s / own.reference_psi_s - 1.0).abs().max())
        rows.append(
            (
                f"{tnt_kg:g}",
                f"{own.distance_m.min():.3g} to {own.distance_m.max():.3g}",
                f"{scaled.mape_percent:.1f} %",
                f"{scaled.integral_error_percent:.1f} %",
                f"{100.0 * largest:.1f} %",
                f"{law.B:.3f}",
                f"{fitted.mape_percent:.1f} %",
            )
        )
    return rows


def main(
    calibration: str = "collisional_kb",
    engine: str = "event",
    seeds: Annotated[int, typer.Option(min=2)] = 16,
    first_seed: int = 1000,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/hopkinson_cranz"),
) -> None:
    """Print and write the errors of Hopkinson-Cranz scaling for each mass."""
    with user_errors(), running_on(cluster):
        make_folder(out)
        numbers = range(first_seed, first_seed + seeds)
        with progress_bar("blasts") as progress:
            table = scaled_impulses(calibration, engine, numbers, processes, out, progress)
        path = write_csv(table, out / f"{calibration}.{engine}.csv")
    print_line(markdown_table(HEADERS, law_rows(table)))
    print_line(f"wrote {path}")


if __name__ == "__main__":
    typer.run(main)
