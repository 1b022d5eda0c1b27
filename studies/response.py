"""The tables of docs/engineers/response.md: `python -m studies.response`."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from blast_env.cli.output import print_line
from blast_env.response.glass import Pane, glazing_responses
from blast_env.response.sdof import Resistance, System, responses
from blast_env.tables import markdown_table

E1300: Final = (
    (4.57, 2.0, 2.0, 1.048),
    (4.57, 1.6, 1.0, 2.064),
    (4.57, 1.0, 0.8, 3.678),
    (5.56, 1.2, 1.0, 3.426),
    (5.56, 1.6, 1.0, 2.476),
    (5.56, 2.2, 1.4, 1.602),
    (7.42, 2.0, 2.0, 1.943),
    (7.42, 1.0, 0.6, 9.786),
    (7.42, 2.2, 1.0, 2.596),
)
"""Least thickness (mm), sides (m), non-factored load (kPa): read by others from E1300's charts."""

_STIFFNESS_PA_M: Final = 1e6
_STATIC_PA: Final = 1e3

Row = tuple[str, ...]


def non_factored_loads() -> Iterator[Row]:
    """Yield a row a pane: E1300's load, ours, and their ratio."""
    for thickness_mm, long_m, short_m, load_kpa in E1300:
        own_kpa = 1e-3 * Pane(long_m, short_m, 1e-3 * thickness_mm).load_resistance_pa()
        pane = f"{thickness_mm:g} mm, {long_m:g} x {short_m:g} m"
        yield pane, f"{load_kpa:.2f}", f"{own_kpa:.2f}", f"{own_kpa / load_kpa:.3f}"


def load_factors() -> Iterator[Row]:
    """Yield a row a duration: dynamic load factor of a triangle, in closed form and integrated."""
    system = System(100.0, 1.0, Resistance.elastic_plastic(_STIFFNESS_PA_M, 1e12))
    period = system.period_s
    for share in (0.1, 0.25, 0.5, 1.0, 2.0, 5.0):
        td, w = share * period, 2.0 * np.pi / period
        t = np.linspace(0.0, td + period, 200_001)
        loaded = 1.0 - np.cos(w * t) + np.sin(w * t) / (w * td) - t / td
        free = (np.sin(w * t) - np.sin(w * (t - td))) / (w * td) - np.cos(w * t)
        closed = float(np.where(t <= td, loaded, free).max())
        found = responses([system], np.array([0.0, td]), np.array([[_STATIC_PA, 0.0]]))
        own = float(found.peak_m[0]) * _STIFFNESS_PA_M / _STATIC_PA
        yield f"{share:g}", f"{closed:.3f}", f"{own:.3f}"


def halved_peaks(impulse_pa_s: float = 60.0) -> Iterator[Row]:
    """Yield a row a pane: what half the peak with the same impulse does to breakage."""
    for thickness_mm in (3.78, 5.56, 9.02):
        pane = Pane(1.2, 1.5, 1e-3 * thickness_mm)
        shares = []
        for peak_pa in (8e3, 4e3):
            end_s = 2.0 * impulse_pa_s / peak_pa
            history = np.array([[peak_pa, 0.0, 0.0]])
            found = glazing_responses([pane], np.array([0.0, end_s, 2.0 * end_s]), history)
            shares.append(f"{100.0 * float(found.break_probability[0]):.1f} %")
        yield f"{thickness_mm:g} mm, 1.2 x 1.5 m", *shares


def main() -> None:
    """Print the tables."""
    loads = ("annealed pane, least thickness", "E1300, kPa", "here, kPa", "ratio")
    print_line(markdown_table(loads, non_factored_loads()))
    factors = ("duration over period", "closed form", "here")
    print_line("\n" + markdown_table(factors, load_factors()))
    peaks = ("annealed pane, 60 Pa s", "break, 8 kPa", "break, 4 kPa")
    print_line("\n" + markdown_table(peaks, halved_peaks()))


if __name__ == "__main__":
    main()
