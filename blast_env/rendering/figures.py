"""Figures of a blast: loads, their history, and the paper's Figures 1 and 2."""

from pathlib import Path

import numpy as np

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.physics.parameters import SimulationParameters
from blast_env.physics.particles import FloatArray, explosion_fan
from blast_env.rendering.extra import render_extra
from blast_env.rendering.heat_map import heat_map
from blast_env.rendering.history import impulse_over_time
from blast_env.rendering.scheme import model_scheme
from blast_env.rendering.style import EXPLOSIVE, INK, QUIET_INK, unit_interval
from blast_env.units import UNITS_PER_M

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "FIGURE_SUFFIXES",
    "heat_map",
    "impulse_over_time",
    "initial_velocities",
    "model_scheme",
    "save_figure",
]

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""The kinds of files that a figure can be saved as."""

_DOTS_PER_IN = 150
_MOST_ARROWS = 36
_MOST_NAMED_ANGLES = 16


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Save a figure, as the kind of file that the suffix names.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is none of `FIGURE_SUFFIXES` or the file cannot be written;
            nothing is left behind then.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in FIGURE_SUFFIXES:
        raise BlastEnvError(
            f"{path}: cannot save a figure with the suffix {path.suffix!r}, "
            f"must be one of {', '.join(FIGURE_SUFFIXES)}"
        )
    with write_atomically(path) as temporary:
        figure.savefig(temporary, format=suffix[1:], dpi=_DOTS_PER_IN)
    return path


def initial_velocities(parameters: SimulationParameters, count: int = 12) -> Figure:
    """Return the velocities with which a fan of balls starts, the paper's Figure 2.

    Args:
        parameters: The parameters of the blast model.
        count: How many balls the fan has, 1 to 36; the charge itself has more.

    Raises:
        BlastEnvError: If the count is out of bounds.
    """
    if not 1 <= count <= _MOST_ARROWS:
        raise BlastEnvError(f"count is {count}, must be 1 to {_MOST_ARROWS}")
    explosive = parameters.explosive
    fan = explosion_fan(
        explosive.model_copy(update={"ball_count": count, "fan_phase": "fixed"}),
        (0.0, 0.0),
        np.random.default_rng(0),
    )
    speed_m_per_s = explosive.speed_units_per_s / UNITS_PER_M
    figure = Figure(figsize=(7.0, 7.4), layout="constrained")
    axes = figure.subplots()
    _draw_arrows(axes, fan.velocity / UNITS_PER_M, speed_m_per_s)
    reach = 1.45 * speed_m_per_s
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set(xlabel="velocity in x (m/s)", ylabel="velocity in y (m/s)")
    axes.set_title(
        f"Initial velocities of {count} explosive balls", fontsize=13, fontweight="bold", pad=24
    )
    axes.text(
        0.5,
        1.015,
        f"$v_0$ = {explosive.speed_units_per_s:g} units/s = {speed_m_per_s:g} m/s at the angles "
        rf"$\theta_i = 2\pi i/{count}$; a charge has {explosive.ball_count} balls",
        transform=axes.transAxes,
        ha="center",
        va="bottom",
        color=unit_interval(QUIET_INK),
    )
    return figure


def _draw_arrows(axes: Axes, velocity: FloatArray, speed: float) -> None:
    """Draw every velocity from the centre, with its index and angle at the tip."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(
        speed * np.cos(angle),
        speed * np.sin(angle),
        color=unit_interval(QUIET_INK),
        linewidth=0.8,
        linestyle=":",
    )
    tails = 0.12 * velocity
    axes.quiver(
        *tails.T,
        *(velocity - tails).T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.006,
        color=unit_interval(INK),
        zorder=2,
    )
    axes.scatter(
        tails[:, 0], tails[:, 1], s=45, color=unit_interval(EXPLOSIVE), edgecolor="white", zorder=3
    )
    named = len(velocity) <= _MOST_NAMED_ANGLES
    for index, (x, y) in enumerate(velocity, start=1):
        degrees = 360.0 * index / len(velocity)
        sideways = x / speed
        axes.text(
            1.05 * x,
            1.07 * y,
            rf"$\theta_{{{index}}}$ = {degrees:.4g}°" if named else f"{degrees:.4g}°",
            ha="center" if abs(sideways) < 0.1 else "left" if sideways > 0.0 else "right",
            va="center",
            fontsize=10,
        )
