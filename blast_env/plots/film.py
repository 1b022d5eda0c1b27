"""Films of blasts, alone and side by side."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from math import floor, inf
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import IO, Final

import numpy as np

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.files import write_atomically
from blast_env.particles.run import BlastRun
from blast_env.plots.canvas import Frame
from blast_env.plots.frames import FramePainter
from blast_env.plots.plan import PAGE
from blast_env.plots.style import (
    barrier_text,
    blast_title,
    charge_text,
    nice_load,
    nice_numbers,
    render_extra,
    shown_until_s,
)
from blast_env.runner import Tell, share_of
from blast_env.units import MS_PER_S
from blast_env.values import path_of

with render_extra():
    import imageio_ffmpeg
    from PIL import Image

SUFFIXES = (".mp4", ".gif")
"""Suffixes of the file formats of films."""

_SHORTEST_S, _USUAL_S, _LONGEST_S = 8.0, 10.0, 12.0
_TENTHS_OF_FIRST_RUNS: Final = 2  # of the progress
_MOST_FRAMES = 15_000
_GIF_FRAMES_PER_S = 12.5
_GIF_MOST_FRAMES = 300
_GIF_WIDTH_PX = 640
_GIF_COLOURS = 128


@dataclass(frozen=True)
class FilmPlan:
    """The moments of a blast in a film.

    Attributes:
        end_s: Approximate simulated time of the last frame.
        slow_motion: Seconds of the film per second of the blast.
        frames_per_s: Frames per second of the film.
    """

    end_s: float
    slow_motion: float
    frames_per_s: float

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return floor(self.end_s * self.slow_motion * self.frames_per_s + 1e-6) + 1

    @property
    def real_time_factor(self) -> str:
        """The real-time factor in words, as written in every frame."""
        if self.slow_motion == 1.0:
            return "real time"
        if self.slow_motion > 1.0:
            return f"1/{self.slow_motion:g} of real time"
        return f"{1.0 / self.slow_motion:g} times real time"

    def time_s(self, frame: int) -> float:
        """Return the simulated time of a frame."""
        return frame / (self.slow_motion * self.frames_per_s)


def plan_film(
    result: BlastResult, frames_per_s: float = 25.0, slow_motion: float | None = None
) -> FilmPlan:
    """Plan the moments of a film of a blast.

    It lasts 8 to 12 s and ends a little after 99.9 % of the impulse on the protected structures
    has arrived (on all structures, if none is protected or hit), but at the latest at twice the
    arrival time of 95 %.

    Args:
        result: The blast.
        frames_per_s: Frames per second of the film.
        slow_motion: Seconds of the film per second of the blast, instead of the factor for the
            usual duration.

    Raises:
        BlastEnvError: If an argument is not positive or the film would have too many frames.
    """
    return plan_until(shown_until_s(result), frames_per_s, slow_motion)


def plan_until(
    end_s: float, frames_per_s: float = 25.0, slow_motion: float | None = None
) -> FilmPlan:
    """Return the plan of a film that ends at a simulated time; see `plan_film`."""
    for name, value in (("frames_per_s", frames_per_s), ("slow_motion", slow_motion)):
        if value is not None and not 0.0 < value < inf:
            raise BlastEnvError(f"{name} is {value}, must be positive")
    if slow_motion is None:
        slow_motion = _usual_slow_motion(end_s) if end_s > 0.0 else 1.0
    plan = FilmPlan(end_s, slow_motion, frames_per_s)
    if plan.frame_count > _MOST_FRAMES:
        raise BlastEnvError(
            f"the film would have {plan.frame_count} frames, at most {_MOST_FRAMES} are possible: "
            "lower slow_motion or frames_per_s"
        )
    return plan


def write_film(
    blast: Blast,
    path: str | Path,
    *,
    beside: Blast | None = None,
    frames_per_s: float = 25.0,
    slow_motion: float | None = None,
    width_px: int | None = None,
    progress: Tell = lambda _: None,
) -> tuple[BlastResult, ...]:
    """Write a film of a blast, or of two side by side.

    Each blast is run twice: first to determine the loads and their arrival times, then to draw it.
    Between the engine's steps, balls are drawn in free flight. Two blasts are shown at the same
    moments and with one colour scale; the film has the length of the longer one.

    Args:
        blast: The blast.
        path: The film, `.mp4` or `.gif`. A GIF is at most 640 pixels wide and has at most 12.5
            frames per second, to limit its size.
        beside: Another blast, shown to the left: without the barrier, or with another layout.
        frames_per_s: Frames per second of the film.
        slow_motion: Seconds of the film per second of the blast; by default as in `plan_film`.
        width_px: Width of the film; by default 960, or 1600 with two blasts. Each blast gets an
            equal part, rounded down to an even width.
        progress: Called from time to time with the finished share of the work.

    Returns:
        The results of the blasts, from left to right.

    Raises:
        BlastEnvError: If the suffix is another one, an argument is out of bounds or the file
            cannot be written; no file remains then, nor after Ctrl-C.
    """
    suffix = known_suffix(path)
    blasts = [blast] if beside is None else [beside, blast]
    width_px = width_px or (960 if beside is None else 1600)
    with write_atomically(path) as temporary:
        running = share_of(progress, 0, 10, _TENTHS_OF_FIRST_RUNS)
        results = tuple(
            each.run(share_of(running, number, len(blasts))) for number, each in enumerate(blasts)
        )
        plans = [plan_film(result, frames_per_s, slow_motion) for result in results]
        plan = max(plans, key=lambda each: each.end_s)
        if suffix == ".gif":
            plan, width_px = for_gif(plan, width_px)
        painters = _painters(results, width_px // len(blasts))
        drawing = share_of(progress, _TENTHS_OF_FIRST_RUNS, 10, 10 - _TENTHS_OF_FIRST_RUNS)
        frames = with_progress(_frames(blasts, painters, plan), plan, drawing)
        title = blast.scenario.name
        save_frames(frames, temporary, suffix, plan, title, _comment(plan, blasts))
    return results


def known_suffix(path: str | Path) -> str:
    """Return the suffix of a film in lower case.

    Raises:
        BlastEnvError: If it is none of `SUFFIXES`.
    """
    suffix = path_of(path).suffix
    if suffix.lower() not in SUFFIXES:
        raise BlastEnvError(
            f"{path}: cannot write a film with the suffix {suffix!r}, "
            f"must be {' or '.join(SUFFIXES)}"
        )
    return suffix.lower()


def paint_at(run: BlastRun, painter: FramePainter, time_s: float, note: str) -> Frame:
    """Advance a blast to a moment and paint it.

    Args:
        run: The blast in progress.
        painter: Its painter.
        time_s: The moment; not before the present time of the run.
        note: Remark beside the time.
    """
    run.advance(time_s)
    balls = run.balls()
    # Engines with steps may be up to one step off: free flight in between.
    balls = replace(balls, position=balls.position + (time_s - run.time_s) * balls.velocity)
    return painter.paint(balls, run.obstacles, time_s, note)


def save_frames(
    frames: Iterable[Frame], path: Path, suffix: str, plan: FilmPlan, title: str, comment: str
) -> None:
    """Write a film in the format of a suffix.

    Args:
        frames: Its frames, uint8 (height, width, 3) with even width and height.
        path: The file, with any suffix.
        suffix: One of `SUFFIXES`.
        plan: The plan, for a GIF one from `for_gif`.
        title: Title in the metadata; a GIF has none.
        comment: Comment in the metadata.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    if suffix == ".gif":
        _save_gif(frames, path, plan.frames_per_s, comment)
        return
    metadata = ["-metadata", f"title={title}", "-metadata", f"comment={comment}"]
    with TemporaryFile() as messages:  # not a pipe, which would fill and stop ffmpeg
        _save_mp4(iter(frames), path, plan.frames_per_s, metadata, messages)


def _save_mp4(
    frames: Iterator[Frame], path: Path, frames_per_s: float, metadata: list[str], said: IO[bytes]
) -> None:
    """Write H.264 in yuv420p, which every player supports.

    Checks of ffmpeg's exit status and of the frames in the finished file ensure a complete film.
    (The writer of imageio checks neither.)
    """
    first = next(frames)
    rate = str(Fraction(frames_per_s).limit_denominator())
    size = f"{first.shape[1]}x{first.shape[0]}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate]
    coded = ["-an", "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", "20"]
    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise BlastEnvError(f"films need ffmpeg: {error}") from error
    encoder = Popen(
        [
            *(program, "-y", "-v", "error", *raw, "-i", "-", *coded),
            *("-movflags", "+faststart", *metadata, str(path)),
        ],
        stdin=PIPE,
        stdout=DEVNULL,
        stderr=said,
        start_new_session=True,  # Ctrl-C must reach this process alone
    )
    assert encoder.stdin is not None
    count = 0
    try:
        for frame in chain([first], frames):
            try:
                encoder.stdin.write(np.ascontiguousarray(frame).data)
            except OSError:  # ffmpeg has ended; `said` has its message
                break
            count += 1
        with suppress(BrokenPipeError):
            encoder.communicate()
    except BaseException:
        encoder.kill()
        encoder.communicate()
        raise
    if encoder.wait() != 0:
        said.seek(0)
        lines = said.read().decode(errors="replace").split("\n")
        last = [line.strip() for line in lines if line.strip()][-1:]
        reason = last[0] if last else f"ffmpeg ended with status {encoder.returncode}"
        raise BlastEnvError(f"the film cannot be written: {reason}")
    try:
        found, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    except RuntimeError as error:
        raise BlastEnvError("the film cannot be written: it cannot be read again") from error
    if found != count:
        raise BlastEnvError(
            f"the film cannot be written: {found} of {count} frames are in the file"
        )


def _save_gif(frames: Iterable[Frame], path: Path, frames_per_s: float, comment: str) -> None:
    """Write an animated GIF that repeats endlessly.

    All frames share the colours of the first one, so that static parts take no space and nothing
    flickers; the first one must have every colour of the film.
    """
    pictures = (Image.fromarray(frame) for frame in frames)
    first = next(pictures).quantize(_GIF_COLOURS, method=Image.Quantize.MAXCOVERAGE)
    others = [each.quantize(palette=first, dither=Image.Dither.NONE) for each in pictures]
    try:
        first.save(
            path,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=10 * max(round(100.0 / frames_per_s), 2),  # whole hundredths of a second
            loop=0,
            optimize=False,
            comment=comment.encode(),
        )
    except OSError as failure:
        raise BlastEnvError(f"the film cannot be written: {failure}") from failure


def with_progress(frames: Iterable[Frame], plan: FilmPlan, progress: Tell) -> Iterator[Frame]:
    """Yield frames, and report the share of the film so far."""
    for number, frame in enumerate(frames, start=1):
        yield frame
        progress(number / plan.frame_count)


def _comment(plan: FilmPlan, blasts: Sequence[Blast]) -> str:
    shown = dict.fromkeys(f"{blast.scenario.name}, seed {blast.seed}" for blast in blasts)
    return (
        f"{'; '.join(shown)}, {plan.real_time_factor}, {plan.end_s * MS_PER_S:.4g} ms of "
        f"simulated time, scenario {blasts[-1].scenario.content_hash}"
    )


def for_gif(plan: FilmPlan, width_px: int) -> tuple[FilmPlan, int]:
    """Return a plan and a width that keep a GIF small.

    Raises:
        BlastEnvError: If it would have more than 300 frames.
    """
    frames_per_s = min(plan.frames_per_s, _GIF_FRAMES_PER_S)
    # The duration of a frame in a GIF is a multiple of 0.01 s.
    frames_per_s = 100.0 / round(100.0 / frames_per_s)
    plan = replace(plan, frames_per_s=frames_per_s)
    if plan.frame_count > _GIF_MOST_FRAMES:
        raise BlastEnvError(
            f"the GIF would have {plan.frame_count} frames, at most {_GIF_MOST_FRAMES} are "
            "possible: lower slow_motion or write an .mp4"
        )
    return plan, min(width_px, _GIF_WIDTH_PX)


def _usual_slow_motion(end_s: float) -> float:
    """Return the factor of few digits that gives the duration nearest to the usual one."""
    factors = nice_numbers(_SHORTEST_S / end_s, _LONGEST_S / end_s)
    return min(factors, key=lambda factor: abs(factor * end_s - _USUAL_S))


def scale_end(results: Sequence[BlastResult], unit: LoadUnit) -> float | None:
    """Return the module impulse at the end of a common colour scale; None without any load.

    It is the largest load of all results, rounded up to few digits in the unit.
    """
    largest = max(map(_largest_load, results))
    return nice_load(unit, largest) if largest > 0.0 else None


def _largest_load(result: BlastResult) -> float:
    """Return the largest load of a protected module, or of any module if these have none."""
    for obstacles in (
        [obstacle for obstacle in result.obstacles if obstacle.protected],
        list(result.obstacles),
    ):
        loads = [part.impulse for obstacle in obstacles for part in obstacle.parts]
        if max(loads, default=0.0) > 0.0:
            return max(loads)
    return 0.0


def _painters(results: Sequence[BlastResult], width_px: int) -> list[FramePainter]:
    """Return one painter per blast with a shared colour scale."""
    unit = max(results, key=_largest_load).load_unit  # one scale, so that blasts are comparable
    painters = []
    for result in results:
        title, subtitle = blast_title(result.blast)
        if len(results) > 1:  # short, because parts of a frame are narrow
            title = barrier_text(result.blast.layout)
            subtitle = f"{charge_text(result.blast.scene.charge)}, seed {result.blast.seed}"
        painter = FramePainter(
            result.blast,
            title=title,
            subtitle=subtitle,
            width_px=width_px - width_px % 2,
            full_impulse=scale_end(results, unit),
            unit=unit.with_loads_of(result.load_unit),
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
            paint_at(run, painter, time_s, plan.real_time_factor)
            for run, painter in zip(runs, painters, strict=True)
        )
        yield np.concatenate([made_higher(frame, height_px) for frame in frames], axis=1)


def made_higher(frame: Frame, height_px: int) -> Frame:
    """Return a frame extended below to a height; legends of parts differ in their lines."""
    below = np.full((height_px - frame.shape[0], frame.shape[1], 3), PAGE, dtype=np.uint8)
    return np.concatenate([frame, below])
