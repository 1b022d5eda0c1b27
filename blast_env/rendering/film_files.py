"""Writers of film files: MP4 and GIF."""

from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from blast_env.errors import BlastEnvError
from blast_env.rendering.extra import render_extra
from blast_env.rendering.frames import Frame

with render_extra():
    import imageio.v2 as imageio
    from PIL import Image

_GIF_COLOURS = 128


class FilmFile(Protocol):
    """A film on its way to a file; a context manager that finishes the file at its end."""

    def append(self, frame: Frame) -> None:
        """Add a frame, uint8 (height, width, 3)."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...


class Mp4File:
    """An MP4 film: H.264 in yuv420p, which every player knows.

    Args:
        path: The file.
        frames_per_s: Frames a second.
        title: Title in the metadata.
        comment: Comment in the metadata.
    """

    def __init__(self, path: Path, frames_per_s: float, title: str, comment: str) -> None:
        metadata = ["-metadata", f"title={title}", "-metadata", f"comment={comment}"]
        try:
            self._writer = imageio.get_writer(
                path,
                format="FFMPEG",
                mode="I",
                fps=frames_per_s,
                codec="libx264",
                pixelformat="yuv420p",
                quality=None,
                macro_block_size=2,
                ffmpeg_log_level="error",
                output_params=["-crf", "20", "-movflags", "+faststart", *metadata],
            )
        except RuntimeError as error:
            raise BlastEnvError(f"films need ffmpeg: {error}") from error

    def append(self, frame: Frame) -> None:
        """Add a frame with even width and height."""
        try:
            self._writer.append_data(frame)
        except OSError as error:
            raise BlastEnvError(f"the film cannot be written: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._writer.close()


class GifFile:
    """An animated GIF that plays for ever.

    All frames share the colours of the first one, so that still parts cost nothing and nothing
    flickers: it must have every colour of the film.

    Args:
        path: The file.
        frames_per_s: Frames a second; rounded so that a frame lasts whole hundredths of a second.
        comment: Comment in the file.
    """

    def __init__(self, path: Path, frames_per_s: float, comment: str) -> None:
        self._path = path
        self._duration_ms = 10 * max(round(100.0 / frames_per_s), 2)
        self._comment = comment
        self._images: list[Image.Image] = []

    def append(self, frame: Frame) -> None:
        """Add a frame."""
        image = Image.fromarray(frame)
        if not self._images:
            colours = image.quantize(_GIF_COLOURS, method=Image.Quantize.MAXCOVERAGE)
            self._images.append(colours)
            return
        palette = self._images[0]
        self._images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if kind is not None:
            return
        first, *others = self._images
        try:
            first.save(
                self._path,
                format="GIF",
                save_all=True,
                append_images=others,
                duration=self._duration_ms,
                loop=0,
                optimize=False,
                comment=self._comment.encode(),
            )
        except OSError as failure:
            raise BlastEnvError(f"the film cannot be written: {failure}") from failure
