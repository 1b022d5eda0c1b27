"""Evaluations on held-out threats during a training, their file, and the learning curve."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from io import BytesIO
from math import inf, isnan
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import (
    RunConfiguration,
    RunFolder,
    TrainingSettings,
    refusing,
)
from blast_agents.training.weights import check_zip
from blast_env.documents import checked_as, parse_csv, parse_json, read_text
from blast_env.errors import BlastEnvError, value_text
from blast_env.files import read_regular, write_atomically
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import number_on_axis, render_extra

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, PercentFormatter

_MOST_BYTES: Final = 100_000_000

_WINDOW: Final = 100
"""Most episodes of a point of the learning curve, as of the means of stable-baselines3."""


@dataclass(frozen=True)
class EvaluationRow:
    """An evaluation on held-out threats; the first three as by stable-baselines3's `EvalCallback`.

    Attributes:
        timesteps: Steps of training.
        results: Reductions of the cases.
        ep_lengths: Modules or pieces of their layouts.
        reduction: Reduction over the cases.
        low: Lower end of its 95 % interval.
        high: Upper end of its 95 % interval.
        episodes: Episodes of training.
        blasts: Blasts of training, without those of the evaluations.
        seconds: Duration of the training, in s.
        judging: `TrainingSettings.judging` as JSON; empty if the file does not say.
    """

    timesteps: int
    results: tuple[float, ...]
    ep_lengths: tuple[int, ...]
    reduction: float
    low: float
    high: float
    episodes: int
    blasts: int
    seconds: float
    judging: str = ""


_NAMES: Final = tuple(field.name for field in fields(EvaluationRow))
_ROWS: Final = TypeAdapter(list[EvaluationRow])


def best_of(rows: Sequence[EvaluationRow]) -> EvaluationRow | None:
    """Return the evaluation with the largest reduction, the first of equal ones.

    A reduction that is no number, where a layout hides a building, is less than any other.
    """
    return max(rows, key=lambda row: -inf if isnan(row.reduction) else row.reduction, default=None)


def write_evaluations(path: Path, rows: Sequence[EvaluationRow]) -> None:
    """Write evaluations as `evaluations.npz`, an array for each attribute.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    buffer = BytesIO()
    columns = {name: np.array([getattr(row, name) for row in rows]) for name in _NAMES}
    np.savez(buffer, **columns)  # type: ignore[arg-type]
    with write_atomically(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())


def read_evaluations(path: Path) -> list[EvaluationRow]:
    """Return the evaluations of a run, none before the first.

    Raises:
        BlastEnvError: If the file is damaged.
    """
    if not path.exists():
        return []
    try:
        content = BytesIO(read_regular(path, _MOST_BYTES))
        check_zip(content)
        with np.load(content) as arrays:
            count = len(arrays[_NAMES[0]])
            unsaid = {"judging": np.array([""] * count)}
            columns = [{**unsaid, **arrays}[name].tolist() for name in _NAMES]
        rows = [dict(zip(_NAMES, row, strict=True)) for row in zip(*columns, strict=True)]
        return _ROWS.validate_python(rows)
    # NumPy reports a faulty file by exceptions of many types.
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise BlastEnvError(f"{path}: is damaged: {reason}") from error


def check_judging(
    rows: Sequence[EvaluationRow], settings: TrainingSettings, cases: int, place: Path
) -> None:
    """Refuse settings by which further evaluations would not compare with those of a run.

    Args:
        rows: The evaluations of the run.
        settings: Its settings now.
        cases: Number of cases of an evaluation.
        place: The run folder, for the error.

    Raises:
        BlastEnvError: If one differs, which the message names, or the evaluations are damaged.
    """
    said = next((row.judging for row in rows if row.judging), "")
    with refusing(place):
        before = checked_as(dict[str, Any], parse_json(said or "{}"))
    now = settings.judging | {"number of results": cases}
    if rows:
        before["number of results"] = len(rows[-1].results)
    for name, value in before.items():
        if now.get(name) != value:
            raise BlastEnvError(
                f"{place}: {name} is {value_text(now.get(name))}, must be {value_text(value)} as in"
                " the evaluations of the run, of which one has the best weights; train --start-from"
                f" {place} begins another run with them"
            )


@dataclass(frozen=True)
class EpisodeRow:
    """An episode of training, by the names of stable-baselines3's `Monitor`.

    Attributes:
        r: Reward.
        l: Steps.
        t: Time since the start, in s.
        reduction: Reduction of the load.
    """

    r: float
    l: int  # noqa: E741
    t: float
    reduction: float


def read_episodes(monitor: Path) -> list[EpisodeRow]:
    """Return the episodes of a table of `Monitor`, without a last line that a kill has cut.

    Raises:
        BlastEnvError: If it is missing or damaged.
    """
    with refusing(monitor):
        text = read_text(monitor, _MOST_BYTES)
        table = text[text.find("\n") + 1 : text.rfind("\n") + 1]
        return [*parse_csv(table, EpisodeRow)]


def _training_curve(
    monitor: Path, start: int, rows: Sequence[EvaluationRow]
) -> tuple[list[float], list[float]]:
    """Return blasts and mean reductions of the episodes of a table, in windows of many.

    The blasts are interpolated between the evaluations, by the steps.
    """
    episodes = read_episodes(monitor)
    steps = start + np.cumsum([episode.l for episode in episodes])
    known = np.maximum.accumulate([0, *(row.timesteps for row in rows)])
    spent = np.interp(steps, known, [0, *(row.blasts for row in rows)])
    reduction = np.array([episode.reduction for episode in episodes])
    window = max(min(len(episodes) // 10, _WINDOW), 1)
    parts = [slice(first, first + window) for first in range(0, len(episodes), window)]
    return [spent[part].mean() for part in parts], [reduction[part].mean() for part in parts]


# Okabe and Ito's colours, which are distinguishable with any colour vision.
_TRAINING: Final = "#56B4E9"
_HELD_OUT: Final = "#D55E00"
_BEST: Final = "#000000"


def learning_curve(
    folder: RunFolder, configuration: RunConfiguration, rows: Sequence[EvaluationRow]
) -> Figure:
    """Return the figure of the reduction in training and on held-out threats over the blasts.

    Args:
        folder: The run folder.
        configuration: Configuration of the run.
        rows: The evaluations, at least one.

    Raises:
        BlastEnvError: If a table of episodes is damaged.
    """
    settings, last = configuration.settings, rows[-1]
    spent = "guesses" if settings.guesses else "blasts"
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    axes = figure.add_subplot()
    for number, (start, path) in enumerate(folder.monitors.items()):
        axes.plot(
            *_training_curve(path, start, rows),
            color=_TRAINING,
            label="_" * bool(number) + "training: layouts drawn from the policy",
        )
    _draw_held_out(axes, rows)
    axes.set_xlabel(f"{spent} spent on training")
    figure.legend(loc="outside lower center", ncols=2)  # where it hides nothing
    write_heading(
        figure,
        f"{ALGORITHM_NAMES[settings.algorithm]} on {Path(settings.scenario).stem}, "
        f"{settings.threat} threat",
        f"seed {settings.seed}, {last.timesteps:,} steps, {last.episodes:,} episodes, "
        f"{last.blasts:,} {spent} with engine {settings.engine}, {last.seconds:,.0f} s; "
        f"{len(last.results)} threats of evaluations",
    )
    return figure


def _draw_held_out(axes: Axes, rows: Sequence[EvaluationRow]) -> None:
    blasts = [row.blasts for row in rows]
    value = np.array([row.reduction for row in rows])
    low = value - [row.low for row in rows]
    high = np.array([row.high for row in rows]) - value
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
    best = best_of(rows)
    assert best is not None
    axes.plot(
        best.blasts,
        best.reduction,
        color=_BEST,
        marker="o",
        markersize=12,
        fillstyle="none",
        ls="",
        label=f"best weights: {100.0 * best.reduction:.1f} %",
    )
    axes.set_ylabel("reduction of the load that counts")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.xaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.3)
