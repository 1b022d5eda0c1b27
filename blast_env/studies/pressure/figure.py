"""The pressure on a facade over time, beside Kingery and Bulmash's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blast_env.calibration.references import Friedlander
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.studies.pressure.pulses import PressureHistory
from blast_env.units import MS_PER_S

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
