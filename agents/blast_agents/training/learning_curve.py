"""The learning curve of a run as a figure."""

from pathlib import Path
from typing import Final

import numpy as np

from blast_agents.surrogate.engine import is_surrogate
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.recorder import Progress
from blast_agents.training.run_folder import RunConfiguration
from blast_env.rendering.figures import save_figure
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import number_on_axis, render_extra

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, PercentFormatter

# Okabe and Ito's colours, which people with any colour vision can tell apart.
_TRAINING: Final = "#56B4E9"
_HELD_OUT: Final = "#D55E00"
_BEST: Final = "#000000"


def learning_curve(progress: Progress, configuration: RunConfiguration) -> Figure:
    """Return the reduction in training and on held-out threats over the blasts, or guesses, spent.

    Args:
        progress: The tables of the run.
        configuration: Of the run.
    """
    settings, counters = configuration.settings, progress.counters
    spent = "guesses" if is_surrogate(settings.engine) else "blasts"
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    axes = figure.add_subplot()
    _draw(axes, progress)
    axes.set_xlabel(f"{spent} spent on training")
    figure.legend(loc="outside lower center", ncols=2)  # where it hides nothing
    write_heading(
        figure,
        f"{ALGORITHM_NAMES[settings.algorithm]} on {Path(settings.scenario).stem}, "
        f"{settings.threat} threat",
        f"seed {settings.seed}, {counters.steps:,} steps, {counters.episodes:,} episodes, "
        f"{counters.blasts:,} {spent} with engine {settings.engine}, {counters.seconds:,.0f} s; "
        f"{settings.evaluation_cases} held-out threats",
    )
    return figure


def save_learning_curve(progress: Progress, configuration: RunConfiguration, path: Path) -> Path:
    """Save the figure.

    Returns:
        The path.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    return save_figure(learning_curve(progress, configuration), path)


def _draw(axes: Axes, progress: Progress) -> None:
    rollouts, evaluations = progress.rollouts, progress.evaluations
    axes.plot(
        [row.blasts for row in rollouts],
        [row.reduction for row in rollouts],
        color=_TRAINING,
        label="training: layouts drawn from the policy",
    )
    if evaluations:
        blasts = [row.blasts for row in evaluations]
        value = np.array([row.reduction for row in evaluations])
        low = value - [row.low for row in evaluations]
        high = np.array([row.high for row in evaluations]) - value
        axes.errorbar(
            blasts,
            value,
            yerr=np.maximum([low, high], 0.0),
            color=_HELD_OUT,
            marker="o",
            markersize=4,
            capsize=3,
            label="held-out threats: proposed layouts, 95 % interval",
        )
        best = int(np.argmax(value))
        axes.plot(
            blasts[best],
            value[best],
            color=_BEST,
            marker="o",
            markersize=12,
            fillstyle="none",
            ls="",
            label=f"best weights: {100.0 * value[best]:.1f} %",
        )
    axes.set_ylabel("reduction of the load that counts")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.xaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.3)
