"""One film of several blasts side by side, all at the same time and with the same colours."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.rendering.film import FilmPlan, largest_load, paint_at, plan_film
from blast_env.rendering.film_files import Mp4File
from blast_env.rendering.frames import Frame, FramePainter
from blast_env.rendering.style import PAGE
from blast_env.simulation import Blast, BlastResult

_SUFFIX: Final = ".mp4"
_SHARE_OF_FIRST_RUNS: Final = 0.2  # of the progress


@dataclass(frozen=True, eq=False)
class FilmPanel:
    """One blast of the film.

    Attributes:
        blast: The blast.
        title: Heading of its part of the frame.
    """

    blast: Blast
    title: str

    @property
    def subtitle(self) -> str:
        """The line under the heading: short, because half a frame is narrow."""
        charge = self.blast.scene.charge
        x_m, y_m = charge.position_m
        return f"{charge.tnt_kg:g} kg TNT at ({x_m:.1f} m, {y_m:.1f} m), seed {self.blast.seed}"


def write_side_by_side(
    panels: Sequence[FilmPanel],
    path: str | Path,
    frames_per_s: float = 25.0,
    slow_motion: float | None = None,
    width_px: int = 1600,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[BlastResult, ...]:
    """Write a film of blasts side by side; return what happened in each.

    All show the same moment, and a colour means the same load in all. The film ends when that of
    the blast which takes longest would end; see `plan_film`. Every blast is run twice: first to
    learn its loads, then to draw it.

    Args:
        panels: The blasts, from left to right; at least two.
        path: The film, `.mp4`.
        frames_per_s: Frames in a second of the film.
        slow_motion: Seconds of the film for a second of the blast; see `plan_film`.
        width_px: Width of the film; every panel gets the same part, made even.
        progress: Called from time to time with the share of the work that is done.

    Raises:
        BlastEnvError: If there are fewer than two panels, the suffix is another one, an argument
            is out of bounds or the file cannot be written; nothing is left behind then.
    """
    if len(panels) < 2:
        raise BlastEnvError(f"panels: there are {len(panels)}, must be at least 2")
    if Path(path).suffix.lower() != _SUFFIX:
        raise BlastEnvError(f"{path}: suffix is {Path(path).suffix!r}, must be {_SUFFIX!r}")
    with write_atomically(path) as temporary:
        results = tuple(_first_runs(panels, progress))
        plan = _common_plan(results, frames_per_s, slow_motion)
        painters = _painters(panels, results, width_px // len(panels))
        title = " | ".join(panel.title for panel in panels)
        comment = f"{plan.real_time_factor}; {'; '.join(panel.subtitle for panel in panels)}"
        with Mp4File(temporary, plan.frames_per_s, title, comment) as film:
            for number, frame in enumerate(_frames(panels, painters, plan), start=1):
                film.append(frame)
                drawn = number / plan.frame_count
                progress(_SHARE_OF_FIRST_RUNS + (1.0 - _SHARE_OF_FIRST_RUNS) * drawn)
    return results


def _first_runs(
    panels: Sequence[FilmPanel], progress: Callable[[float], None]
) -> Iterator[BlastResult]:
    for number, panel in enumerate(panels, start=1):
        yield panel.blast.run()
        progress(_SHARE_OF_FIRST_RUNS * number / len(panels))


def _common_plan(
    results: Sequence[BlastResult], frames_per_s: float, slow_motion: float | None
) -> FilmPlan:
    """Return the plan of the blast that takes longest."""
    plans = (plan_film(result, frames_per_s, slow_motion) for result in results)
    return max(plans, key=lambda plan: plan.end_s)


def _painters(
    panels: Sequence[FilmPanel], results: Sequence[BlastResult], width_px: int
) -> list[FramePainter]:
    """Return a painter a panel, all with the colours of the largest load on what is protected."""
    largest = max((largest_load(result) or 0.0 for result in results), default=0.0)
    return [
        FramePainter(
            panel.blast.scene,
            title=panel.title,
            subtitle=panel.subtitle,
            width_px=width_px - width_px % 2,
            full_impulse=largest or None,
            build_zone=panel.blast.scenario.build_zone,
        )
        for panel in panels
    ]


def _frames(
    panels: Sequence[FilmPanel], painters: Sequence[FramePainter], plan: FilmPlan
) -> Iterator[Frame]:
    runs = [panel.blast.start() for panel in panels]
    height_px = max(painter.size_px[1] for painter in painters)
    for number in range(plan.frame_count):
        time_s = plan.time_s(number)
        frames = (
            paint_at(run, painter, time_s, plan.real_time_factor)
            for run, painter in zip(runs, painters, strict=True)
        )
        yield np.concatenate([_made_higher(frame, height_px) for frame in frames], axis=1)


def _made_higher(frame: Frame, height_px: int) -> Frame:
    """Return a frame with empty page below; legends need not have as many lines."""
    below = np.full((height_px - frame.shape[0], frame.shape[1], 3), PAGE, dtype=np.uint8)
    return np.concatenate([frame, below])
