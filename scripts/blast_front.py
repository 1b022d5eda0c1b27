"""How fast the blast front runs in the event engine, against the laws of strong blasts.

Prints a Markdown table of exponents and of simulated over predicted radii, and draws a figure. See
`scripts.front_measurement` for the laws; the front is where the air is densest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.rendering.figures import save_figure
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import count_of, render_extra
from scripts.front_measurement import (
    SEDOV_GAS,
    FrontCase,
    FrontTrace,
    elastic_front,
    inelastic_front,
    sedov_constant,
)

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter


@dataclass(frozen=True)
class Study:
    """One law on trial.

    Attributes:
        title: Of the panel.
        case: The blast.
        radii_spacings: Radii by the law, spacings, at which to look.
        fitted_from: Radius by the law from which on it should hold: the swept air then weighs
            much more than the charge.
        exponent: Of the time in the law.
        law: Formula of the law.
        measure: Runs the case.
    """

    title: str
    case: FrontCase
    radii_spacings: tuple[float, ...]
    fitted_from: float
    exponent: str
    law: str
    measure: Callable[[FrontCase, Sequence[float], int], FrontTrace]

    def traces(self, seeds: int) -> list[FrontTrace]:
        """Return the fronts of so many seeds."""
        return [self.measure(self.case, self.radii_spacings, seed) for seed in range(seeds)]


def _radii(first: float, last: float, count: int) -> tuple[float, ...]:
    return tuple(np.geomspace(first, last, count).tolist())


STUDIES: Final = (
    Study(
        "elastic",
        FrontCase(restitution=1.0, side_spacings=500),
        _radii(25.0, 220.0, 14),
        50.0,
        "1/2",
        "$(E t^2 / 0.3519 \\rho)^{1/4}$",
        elastic_front,
    ),
    Study(
        "restitution 0.3",
        FrontCase(restitution=0.3, side_spacings=180, ball_count=100),
        _radii(18.0, 75.0, 12),
        20.0,
        "1/3",
        "$(3 P t / \\pi \\rho)^{1/3}$",
        inelastic_front,
    ),
)


def main(
    seeds: Annotated[int, typer.Option(min=1)] = 3,
    out: Path = Path("out/blast_front.png"),
) -> None:
    """Run the blasts, print the table, draw the figure."""
    with user_errors():
        out.parent.mkdir(parents=True, exist_ok=True)
        found = []
        with progress_bar("blasts") as progress:
            for number, study in enumerate(STUDIES):
                found.append(study.traces(seeds))
                progress((number + 1) / len(STUDIES))
        print_table(found)
        save_figure(front_figure(found), out)
        print_line(f"figure: {out}")


def print_table(found: Sequence[Sequence[FrontTrace]]) -> None:
    """Print what was found for each of `STUDIES`: mean over the seeds, in the fitted range."""
    print_line("| balls | air balls | R / spacing | exponent | law | R / law | densest |")
    print_line("|---" * 7 + "|")
    for study, traces in zip(STUDIES, found, strict=True):
        late = [trace.from_radius(study.fitted_from) for trace in traces]
        exponents, ratios = ([getattr(t, name) for t in late] for name in ("exponent", "ratio"))
        densest = np.mean([trace.compression[-1] for trace in traces])
        print_line(
            f"| {study.title} | {study.case.side_spacings**2:,} "
            f"| {study.fitted_from:g} to {study.radii_spacings[-1]:g} "
            f"| {np.mean(exponents):.3f} +- {np.std(exponents):.3f} | {study.exponent} "
            f"| {np.mean(ratios):.3f} +- {np.std(ratios):.3f} | {densest:.2f} |"
        )
    packing = STUDIES[0].case.packing_fraction
    larger = (SEDOV_GAS / sedov_constant(packing)) ** 0.25
    print_line(
        f"A packing fraction of {packing:g} alone would put the elastic front at {larger:.3f}; "
        "its width, which is that of a few free paths, pulls the densest place inwards."
    )


def front_figure(found: Sequence[Sequence[FrontTrace]]) -> Figure:
    """Return a figure of the fronts of each of `STUDIES`: the radii, and how far off the law."""
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    panels = figure.subplots(2, len(STUDIES), height_ratios=(2, 1), sharex="col")
    for column, (study, traces) in enumerate(zip(STUDIES, found, strict=True)):
        _draw_radii(panels[0, column], study, traces)
        _draw_ratios(panels[1, column], study, traces)
    balls = ", ".join(f"{study.case.side_spacings**2:,} ({study.title})" for study in STUDIES)
    write_heading(
        figure,
        "The blast front in cold air of hard discs, event engine",
        f"where the air is densest; balls of the air: {balls}; grey: within 5 %; blue: fitted",
    )
    return figure


def _draw_radii(axes: Axes, study: Study, traces: Sequence[FrontTrace]) -> None:
    time_s, law = traces[0].time_s, np.mean([trace.law for trace in traces], axis=0)
    axes.plot(time_s, law, color="#D55E00", lw=1.6, label=f"law: {study.law}")
    for number, trace in enumerate(traces):
        label = f"simulated, {count_of('seed', len(traces))}" if number == 0 else None
        axes.plot(time_s, trace.radius, "o", ms=4.0, color="#0072B2", alpha=0.6, label=label)
    late = [trace.from_radius(study.fitted_from).exponent for trace in traces]
    axes.set_title(f"{study.title}: $R \\propto t^{{{np.mean(late):.3f}}}$, law {study.exponent}")
    axes.set_yscale("log")
    ticks = [
        r for r in (10, 20, 30, 50, 70, 100, 150, 200, 300) if law[0] * 0.7 < r < law[-1] * 1.3
    ]
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("radius of the front (spacings of the air)")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")


def _draw_ratios(axes: Axes, study: Study, traces: Sequence[FrontTrace]) -> None:
    time_s = traces[0].time_s
    for trace in traces:
        axes.plot(time_s, trace.radius / trace.law, "o", ms=4.0, color="#0072B2", alpha=0.6)
    axes.axhspan(0.95, 1.05, color="#000000", alpha=0.07, lw=0)
    axes.axhline(1.0, color="#D55E00", lw=1.6)
    fitted = time_s[np.asarray(study.radii_spacings) >= study.fitted_from]
    axes.axvspan(fitted[0] * 0.96, fitted[-1] * 1.04, color="#0072B2", alpha=0.06, lw=0)
    axes.set_xscale("log")
    axes.set_ylim(0.8, 1.2)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("simulated / law")
    axes.grid(alpha=0.3)


if __name__ == "__main__":
    typer.run(main)
