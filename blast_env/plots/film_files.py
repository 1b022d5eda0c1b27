"""Files of films: the moments of a film, and its frames as MP4 and GIF."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import chain
from math import floor, inf
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.plots.canvas import Frame
from blast_env.plots.style import nice_numbers, render_extra
from blast_env.values import path_of

with render_extra():
    import imageio_ffmpeg
    from PIL import Image

SUFFIXES: Final = (".mp4", ".gif")
"""Suffixes of the file formats of films."""

GIF_WIDTH_PX: Final = 640
"""Largest width of a GIF."""

_SHORTEST_S, _USUAL_S, _LONGEST_S = 8.0, 10.0, 12.0
_MOST_FRAMES = 15_000
_GIF_FRAMES_PER_S = 12.5
_GIF_MOST_FRAMES = 300
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


def plan_until(
    end_s: float, frames_per_s: float = 25.0, slow_motion: float | None = None
) -> FilmPlan:
    """Plan the moments of a film that ends at a simulated time; it lasts 8 to 12 s.

    Args:
        frames_per_s: Frames per second of the film.
        slow_motion: Seconds of the film per second of the blast, instead of the factor for the
            usual duration.

    Raises:
        BlastEnvError: If an argument is not positive or the film would have too many frames.
    """
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


def _usual_slow_motion(end_s: float) -> float:
    """Return the factor of few digits that gives the duration nearest to the usual one."""
    factors = nice_numbers(_SHORTEST_S / end_s, _LONGEST_S / end_s)
    return min(factors, key=lambda factor: abs(factor * end_s - _USUAL_S))


def plan_gif(plan: FilmPlan) -> FilmPlan:
    """Return a plan that keeps a GIF small."""
    frames_per_s = min(plan.frames_per_s, _GIF_FRAMES_PER_S)
    # The duration of a frame in a GIF is a multiple of 0.01 s.
    frames_per_s = 100.0 / round(100.0 / frames_per_s)
    plan = replace(plan, frames_per_s=frames_per_s)
    if plan.frame_count > _GIF_MOST_FRAMES:
        raise BlastEnvError(
            f"the GIF would have {plan.frame_count} frames, at most {_GIF_MOST_FRAMES} are "
            "possible: lower slow_motion or write an .mp4"
        )
    return plan


class Footage(NamedTuple):
    """One blast or two, ready to be drawn at any moment.

    Attributes:
        results: The results of the blasts, from left to right.
        end_s: Simulated time at the end of a film.
        frames: Yields the frames of a plan, uint8 (height, width, 3) with even sides.
        words: The blasts in words, for the metadata of the film.
    """

    results: tuple[Any, ...]
    end_s: float
    frames: Callable[[FilmPlan], Iterator[Frame]]
    words: str


def known_suffix(path: str | Path) -> str:
    """Return the suffix of a film in lower case."""
    suffix = path_of(path).suffix
    if suffix.lower() not in SUFFIXES:
        raise BlastEnvError(
            f"{path}: cannot write a film with the suffix {suffix!r}, "
            f"must be {' or '.join(SUFFIXES)}"
        )
    return suffix.lower()


def save_frames(
    frames: Iterable[Frame], path: Path, suffix: str, plan: FilmPlan, title: str, comment: str
) -> None:
    """Write a film in the format of a suffix.

    Args:
        frames: Its frames, uint8 (height, width, 3) with even width and height.
        path: The file, with any suffix.
        suffix: One of `SUFFIXES`.
        plan: The plan, for a GIF one from `plan_gif`.
        title: Title in the metadata; a GIF has none.
        comment: Comment in the metadata.
    """
    if suffix == ".gif":
        _save_gif(frames, path, plan.frames_per_s, comment)
        return
    metadata = ["-metadata", f"title={title}", "-metadata", f"comment={comment}"]
    _save_mp4(iter(frames), path, plan.frames_per_s, metadata)


def _save_mp4(
    frames: Iterator[Frame], path: Path, frames_per_s: float, metadata: Sequence[str]
) -> None:
    """Write H.264 in yuv420p, which every player supports.

    Its frames are counted in the finished file, because the writer does not check that ffmpeg ended
    well.
    """
    first = next(frames)
    try:
        writer = imageio_ffmpeg.write_frames(
            str(path),
            first.shape[1::-1],
            fps=frames_per_s,
            codec="libx264",
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            output_params=["-crf", "20", "-movflags", "+faststart", *metadata],
        )
        writer.send(None)
    except RuntimeError as error:
        raise BlastEnvError(f"films need ffmpeg: {error}") from error
    count = 0
    with closing(writer):
        for frame in chain([first], frames):
            try:
                writer.send(np.ascontiguousarray(frame))
            except OSError as error:
                raise BlastEnvError("the film cannot be written: ffmpeg has ended") from error
            count += 1
    try:
        # A full disk ends ffmpeg without an error: count what can be read again.
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
    others = [picture.quantize(palette=first, dither=Image.Dither.NONE) for picture in pictures]
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
