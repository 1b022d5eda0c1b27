"""Films of blasts, alone and side by side."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.files import write_atomically
from blast_env.particles.run import BlastRun
from blast_env.plots.canvas import Frame
from blast_env.plots.film_files import (
    GIF_WIDTH_PX,
    FilmPlan,
    Footage,
    known_suffix,
    plan_gif,
    plan_until,
    save_frames,
)
from blast_env.plots.frames import ONE_SEED, FramePainter
from blast_env.plots.heat_map import LoadScale
from blast_env.plots.plan import PAGE
from blast_env.plots.style import barrier_text, charge_text, shown_until_s
from blast_env.runner import ProgressCallback, share_of
from blast_env.units import MS_PER_S

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasBlast
    from blast_env.gas.engine import Recorders
    from blast_env.plots.pressure_frames import VerticalSection

_TENTHS_OF_RUNS: Final = 4  # of the progress


def write_film(
    blast: "Blast | GasBlast",
    path: str | Path,
    *,
    beside: "Blast | GasBlast | None" = None,
    frames_per_s: float = 25.0,
    slow_motion: float | None = None,
    width_px: int | None = None,
    section: "VerticalSection | None" = None,
    recorders: "Recorders" = lambda _: (),
    progress: ProgressCallback = lambda _: None,
) -> tuple[Any, ...]:
    """Run a blast, or two side by side, and write a film.

    A film by particles shows the balls and the loads on modules. It ends a little after 99.9 % of
    the impulse on the protected structures has arrived (on all structures, if none is protected or
    hit), but at the latest at twice the arrival time of 95 %. A film of gas dynamics shows the
    overpressure in plan and in a section, to the end of the run. Two blasts are shown at the same
    moments and on one colour scale; the film has the length of the longer one.

    Args:
        blast: The blast, by either kind of engine.
        path: The film, `.mp4` or `.gif`. A GIF is at most 640 pixels wide and has at most 12.5
            frames per second, to limit its size.
        beside: Another blast by the same engine, shown to the left: without the barrier, or with
            another layout. By gas dynamics it has the same site and charge.
        frames_per_s: Frames per second of the film.
        slow_motion: Seconds of the film per second of the blast; by default the film lasts about
            10 s.
        width_px: Width of the film; by default 960, or 1600 with two blasts.
        section: The section of gas dynamics, by default through the charge and along the way to
            the protected structures.
        recorders: Further recorders of gas dynamics, as for `GasBlast.run`.
        progress: Called from time to time with the finished share of the work.

    Returns:
        The results of the blasts, from left to right.

    Raises:
        BlastEnvError: If the suffix is another one, an argument is out of bounds, site or charge
            of blasts of gas dynamics differ, or the file cannot be written; no file remains then,
            nor after Ctrl-C.
    """
    suffix = known_suffix(path)
    blasts: list[Any] = [blast] if beside is None else [beside, blast]
    width_px = width_px or (960 if beside is None else 1600)
    if suffix == ".gif":
        width_px = min(width_px, GIF_WIDTH_PX)
    with write_atomically(path) as temporary:
        running = share_of(progress, 0, 10, _TENTHS_OF_RUNS)
        if isinstance(blast, Blast):
            footage = _particle_footage(blasts, width_px, running)
        else:  # here, because Numba takes half a second to import
            from blast_env.plots.pressure_film import pressure_footage

            footage = pressure_footage(blasts, width_px, section, recorders, running)
        plan = plan_until(footage.end_s, frames_per_s, slow_motion)
        if suffix == ".gif":
            plan = plan_gif(plan)
        drawing = share_of(progress, _TENTHS_OF_RUNS, 10, 10 - _TENTHS_OF_RUNS)
        frames = _with_progress(footage.frames(plan), plan, drawing)
        comment = (
            f"{footage.words}, {plan.real_time_factor}, {plan.end_s * MS_PER_S:.4g} ms of "
            f"simulated time, scenario {blast.scenario.content_hash}"
        )
        save_frames(frames, temporary, suffix, plan, blast.scenario.name, comment)
    return footage.results


def _with_progress(
    frames: Iterable[Frame], plan: FilmPlan, progress: ProgressCallback
) -> Iterator[Frame]:
    """Yield frames, and report the share of the film so far."""
    for number, frame in enumerate(frames, start=1):
        yield frame
        progress(number / plan.frame_count)


def _particle_footage(
    blasts: Sequence[Blast], width_px: int, progress: ProgressCallback
) -> Footage:
    """Run blasts by particles for their loads and arrival times; frames run them again.

    Each blast gets an equal part of the width, rounded down to an even one.
    """
    count = len(blasts)
    results = tuple(
        blast.run(share_of(progress, number, count)) for number, blast in enumerate(blasts)
    )
    shown = dict.fromkeys(f"{blast.scenario.name}, seed {blast.seed}" for blast in blasts)
    return Footage(
        results,
        max(map(shown_until_s, results)),
        lambda plan: _frames(blasts, _painters(results, width_px // count), plan),
        "; ".join(shown),
    )


def _paint_at(run: BlastRun, painter: FramePainter, time_s: float, note: str) -> Frame:
    """Advance a blast to a moment, not before its present time, and paint it."""
    run.advance(time_s)
    balls = run.balls()
    # Engines with steps may be up to one step off: free flight in between.
    balls = replace(balls, position=balls.position + (time_s - run.time_s) * balls.velocity)
    return painter.paint(balls, run.obstacles, time_s, note)


def _painters(results: Sequence[BlastResult], width_px: int) -> list[FramePainter]:
    """Return one painter per blast with a shared colour scale."""
    scale = LoadScale.of(results)  # one scale, so that blasts are comparable
    painters = []
    for result in results:
        heading = None
        if len(results) > 1:  # short, because parts of a frame are narrow
            subtitle = f"{charge_text(result.blast.scene.charge)}, seed {result.blast.seed}"
            heading = barrier_text(result.blast.layout), subtitle, ONE_SEED
        painter = FramePainter(
            result.blast,
            heading=heading,
            width_px=width_px - width_px % 2,
            scale=scale._replace(unit=scale.unit.with_loads_of(result.load_unit)),
        )
        painters.append(painter)
    return painters


def _frames(
    blasts: Sequence[Blast], painters: Sequence[FramePainter], plan: FilmPlan
) -> Iterator[Frame]:
    runs = [blast.start() for blast in blasts]
    height_px = max(painter.size_px[1] for painter in painters)
    for number in range(plan.frame_count):
        time_s = plan.time_s(number)
        frames = (
            _paint_at(run, painter, time_s, plan.real_time_factor)
            for run, painter in zip(runs, painters, strict=True)
        )
        yield np.concatenate([_made_higher(frame, height_px) for frame in frames], axis=1)


def _made_higher(frame: Frame, height_px: int) -> Frame:
    """Return a frame extended below to a height; legends of parts differ in their lines."""
    below = np.full((height_px - frame.shape[0], frame.shape[1], 3), PAGE, dtype=np.uint8)
    return np.concatenate([frame, below])
