"""The probability of a level of protection over the mass of the charge."""

from collections.abc import Mapping, Sequence

from blast_env.plots.style import render_extra

with render_extra():
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter


def capacity_figure(
    curves: Mapping[str, Sequence[tuple[float, float]]], level: str, tnt_kg: float, title: str
) -> Figure:
    """Return a picture of the probability of a level over the mass of the charge.

    Args:
        curves: Masses, kg, and probabilities, by the name of the layout.
        level: The level.
        tnt_kg: The mass in the scenario.
        title: Title of the picture.
    """
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    styles = zip(curves.items(), ("#666666", "#0072B2"), ("o--", "s-"), strict=False)
    for (name, points), colour, style in styles:
        axes.plot(*zip(*points, strict=True), style, color=colour, markersize=4.0, label=name)
    axes.axvline(tnt_kg, color="black", linestyle=":", linewidth=1.2)
    axes.text(tnt_kg, 1.03, " charge of the scenario", fontsize=8, va="bottom")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("mass of the charge (kg TNT)")
    axes.set_ylabel(f"probability of level {level!r}")
    axes.set_title(title, fontsize=11, pad=18)
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return figure
