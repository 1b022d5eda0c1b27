"""The pressure on a facade over time, beside Kingery and Bulmash's."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from blast_env.calibration.model import load_calibration
from blast_env.calibration.references import Friedlander, kingery_bulmash
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.runner import run_all
from blast_env.scenario import Scenario, load_scenario
from blast_env.simulation import BlastResult, simulate
from blast_env.units import MS_PER_S
from studies.particles.pressure.pulses import PressureHistory, facade_history

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CALIBRATION = "ballistic_kb_100kg"

BIN_S = 0.0005

PA_PER_KPA = 1000.0


@dataclass(frozen=True, eq=False)
class PressureCase:
    """A distance with what the simulator and what the reference say there.

    Attributes:
        distance_m: From the charge to the facade.
        history: The simulated history, in Pa.
        fitted: Friedlander waveform fitted to it.
        reference: Kingery and Bulmash's waveform, reflected.
    """

    distance_m: float
    history: PressureHistory
    fitted: Friedlander
    reference: Friedlander


def pressure_figure(cases: Sequence[PressureCase], subtitle: str) -> Figure:
    """Return one panel a distance: simulated bins, their fit, and the reference."""
    figure = Figure(figsize=(6.0 * len(cases), 5.4), layout="constrained")
    panels = figure.subplots(1, len(cases), squeeze=False)[0]
    for axes, case in zip(panels, cases, strict=True):
        _draw(axes, case)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    write_heading(figure, "Reflected pressure on the facade", subtitle)
    return figure


def _draw(axes: Axes, case: PressureCase) -> None:
    history, reference = case.history, case.reference
    edges_ms = MS_PER_S * history.edges_s
    axes.stairs(
        history.pressure / PA_PER_KPA,
        edges_ms,
        fill=True,
        color="#0072B2",
        alpha=0.35,
        label=f"simulated, mean of {len(history.pressure_by_seed)} seeds",
    )
    end_s = max(
        history.arrival_s + 2.5 * history.positive_duration_s,
        reference.arrival_s + 1.3 * reference.positive_duration_s,
    )
    time_s = np.linspace(0.0, end_s, 2000)
    for wave, colour, line, label in (
        (case.fitted, "#0072B2", "-", "Friedlander fit of the simulated"),
        (reference, "#D55E00", "--", "Kingery-Bulmash, hemispherical"),
    ):
        axes.plot(
            MS_PER_S * time_s, _positive_kpa(wave, time_s), color=colour, ls=line, label=label
        )
    axes.set_xlim(0.0, MS_PER_S * end_s)
    axes.set_title(f"{case.distance_m:g} m")
    axes.set_xlabel("time since the detonation (ms)")
    axes.set_ylabel("overpressure (kPa)")
    axes.grid(alpha=0.3)


def _positive_kpa(wave: Friedlander, time_s: np.ndarray) -> np.ndarray:
    """Return the positive phase, kPa; NaN outside it, so that nothing is drawn there."""
    since_s = time_s - wave.arrival_s
    inside = (since_s >= 0.0) & (since_s <= wave.positive_duration_s)
    return np.where(inside, wave.pressure(time_s) / PA_PER_KPA, np.nan)


def pressure_case(distance_m: float, seeds: range, processes: int) -> PressureCase:
    """Return the simulated history and the reference at a distance."""
    scenario = load_scenario("free_field").at_stand_off(distance_m)
    results = run_all(partial(_blast, scenario), seeds, processes)
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


def _blast(scenario: Scenario, seed: int) -> BlastResult:
    return simulate(scenario, seed=seed)


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
