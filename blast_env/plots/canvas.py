"""The page of a frame, laid out in pixels: a static ground and moving parts for each frame."""

from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.particles.structure import Colour
from blast_env.plots.plan import BORDER, FAINT, INK, QUIET_INK, SITE
from blast_env.plots.style import number_on_axis, render_extra, unit_interval
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from matplotlib.ticker import Formatter, FuncFormatter

Frame = NDArray[np.uint8]
"""A picture: rows from the top, pixels, and red, green and blue."""

_DPI: Final = 100.0
_LINES: Final = ((10, 12.0, INK, True), (36, 8.5, QUIET_INK, False), (54, 8.5, QUIET_INK, False))
"""For each line of a heading: pixels from the top, points, colour, and whether it is bold."""

_MARGIN_PX: Final = 12
_BAR_PX, BAR_LABELS_PX = 14, 52

# Lengths of a page with one site, in pixels at a width of 960.
_USUAL_WIDTH_PX: Final = 960
_NARROWEST_PX, _WIDEST_PX = 320, 4096
_SMALLEST_SCALE: Final = 0.72  # keeps letters legible
_HEADER_PX, _LEFT_PX, _RIGHT_PX, _AXIS_PX = 78, 58, 20, 52
_LETTER_PX, _LINE_PX, _SIGN_LETTERS = 6.6, 20, 7  # of a legend
_LEAST_LINES: Final = 3
_MOST_HIGH: Final = 0.8  # largest height of a site, as a share of the width
_HEADING_SHARE, _CLOCK_SHARE = 0.53, 0.44  # of the width
_SMALLEST_GRID_PX: Final = 6.0


class Sheet:
    """A page in pixels.

    Args:
        width_px: Width of the page.
        height_px: Its height.
        scale: Size of letters and gaps, relative to the usual one.

    Attributes:
        figure: The page.
        size_px: Its width and height.
        scale: As given.
    """

    def __init__(self, width_px: int, height_px: int, scale: float = 1.0) -> None:
        self.size_px, self.scale = (width_px, height_px), scale
        dpi = scale * _DPI
        self.figure = Figure(figsize=((width_px + 0.5) / dpi, (height_px + 0.5) / dpi), dpi=dpi)
        canvas: Any = FigureCanvasAgg  # partly without types
        self._canvas = canvas(self.figure)
        self._ground: Any = None
        self._moving: list[Artist] = []
        self._clock: list[Text] = []
        self._clock_share = 1.0

    def panel(self, left_px: float, bottom_px: float, wide_px: float, high_px: float) -> Axes:
        """Return axes at a position in pixels; `bottom_px` is counted from the top of the page."""
        width, height = self.size_px
        place = (left_px / width, 1.0 - bottom_px / height, wide_px / width, high_px / height)
        return self.figure.add_axes(place)

    def write_heading(self, lines: Sequence[str], share: float) -> None:
        """Write the lines at the upper left, shrunk to at most a share of the width."""
        for text, line in zip(self._texts("left"), lines, strict=False):
            text.set_text(line)
            self._fit(text, share)

    def add_clock(self, share: float) -> None:
        """Add lines at the upper right that change with every frame; see `frame`."""
        self._clock, self._clock_share = self._texts("right"), share
        for text in self._clock:
            text.set_animated(True)

    def add_bar(
        self, colours: ScalarMappable, bottom_px: float, label: str, form: Formatter, extend: str
    ) -> Colorbar:
        """Add a colour bar across the middle of the page."""
        width, scale = self.size_px[0], self.scale
        wide_px = min(0.7 * width, 720.0 * scale)
        place = self.panel((width - wide_px) / 2.0, bottom_px, wide_px, _BAR_PX * scale)
        bar = self.figure.colorbar(
            colours, cax=place, orientation="horizontal", extend=extend, format=form
        )
        place.tick_params(labelsize=8)
        bar.set_label(label, fontsize=9)
        return bar

    def add_legend(self, handles: Sequence[Artist], columns: int) -> None:
        """Add a legend at the bottom of the page."""
        self.figure.legend(
            handles=handles,
            loc="lower center",
            ncols=columns,
            fontsize=8,
            frameon=False,
            bbox_to_anchor=(0.5, 0.0),
            borderaxespad=0.3,
        )

    def let_move(self, artists: Iterable[Artist]) -> None:
        """Leave artists out of the static ground; draw them in every frame, in this order."""
        for artist in artists:
            artist.set_animated(True)
            self._moving.append(artist)

    def frame_axes(self, axes: Axes, labels: tuple[str, str], colour: Colour) -> None:
        """Label the axes, and draw their border over everything."""
        axes.tick_params(labelsize=8)
        axes.set_xlabel(labels[0], fontsize=9, labelpad=2.0)
        axes.set_ylabel(labels[1], fontsize=9)
        if not labels[1]:
            axes.tick_params(labelleft=False)
        for spine in axes.spines.values():
            spine.set_color(unit_interval(colour))
            spine.set_linewidth(1.2)
        self.let_move(axes.spines.values())

    def frame(self, lines: Sequence[str], moving: Iterable[Artist] = ()) -> Frame:
        """Return the page in its present state, uint8 (height, width, 3).

        Args:
            lines: Lines of the clock.
            moving: Artists of this frame alone, drawn below all other moving ones.
        """
        if self._ground is None:
            self._canvas.draw()
            self._ground = self._canvas.copy_from_bbox(self.figure.bbox)
        self._canvas.restore_region(self._ground)
        for text, line in zip_longest(self._clock, lines[: len(self._clock)], fillvalue=""):
            assert isinstance(text, Text)
            text.set_text(line)
            if line:
                self._fit(text, self._clock_share)
        renderer = self._canvas.get_renderer()
        for artist in (*moving, *self._moving, *self._clock):
            artist.draw(renderer)
        pixels, frame = (
            np.asarray(self._canvas.buffer_rgba()),
            np.empty((*self.size_px[::-1], 3), np.uint8),
        )
        for channel in range(3):  # several times faster than all at once
            frame[..., channel] = pixels[..., channel]
        return frame

    def _texts(self, side: str) -> list[Text]:
        width, height = self.size_px
        margin = _MARGIN_PX * self.scale / width
        return [
            self.figure.text(
                margin if side == "left" else 1.0 - margin,
                1.0 - top_px * self.scale / height,
                "",
                ha=side,
                va="top",
                fontsize=size_pt,
                color=unit_interval(colour),
                fontweight="bold" if bold else "normal",
            )
            for top_px, size_pt, colour, bold in _LINES
        ]

    def _fit(self, text: Text, share: float) -> None:
        """Set a line to its usual size, or shrink it to a share of the width."""
        usual_pt = next(
            size for _, size, _, bold in _LINES if bold == (text.get_fontweight() == "bold")
        )
        text.set_fontsize(usual_pt)
        wide_px = text.get_window_extent(self._canvas.get_renderer()).width
        text.set_fontsize(usual_pt * min(1.0, share * self.size_px[0] / max(wide_px, 1.0)))


class SiteSheet(Sheet):
    """A page with a site to scale, and below it a legend and a colour bar.

    Args:
        site_m: The simulated area.
        width_px: Width of the page, 320 to 4096.
        handles: Entries of the legend.
        has_bar: Whether there is a colour bar; see `add_scale`.
        least_px: Least height of the page; the height is even.

    Attributes:
        axes: Axes of the site, in metres.
        pixels_per_m: Scale of the site.

    Raises:
        BlastEnvError: If the width is out of bounds.
    """

    def __init__(
        self,
        site_m: Rectangle,
        width_px: int,
        handles: Sequence[Artist],
        has_bar: bool,
        least_px: int = 0,
    ) -> None:
        if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
            raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
        scale = max(width_px / _USUAL_WIDTH_PX, _SMALLEST_SCALE)
        width_m, height_m = site_m.right - site_m.left, site_m.top - site_m.bottom
        room_px = width_px - (_LEFT_PX + _RIGHT_PX) * scale
        # Both width and height are bounded.
        self.pixels_per_m = min(room_px / width_m, _MOST_HIGH * width_px / height_m)
        longest = max(len(str(each.get_label())) for each in handles)
        entry_px = _LETTER_PX * scale * (longest + _SIGN_LETTERS)
        columns = max(min(int(width_px / entry_px), len(handles)), 1)
        # The same for most sites, so that all frames of an environment have one size.
        lines = max(-(-len(handles) // columns), _LEAST_LINES)
        lines_px = (lines * _LINE_PX + _MARGIN_PX) * scale
        self._bar_px = _HEADER_PX * scale + self.pixels_per_m * height_m + _AXIS_PX * scale
        bar_px = (_BAR_PX + BAR_LABELS_PX) * scale if has_bar else 0.0
        height_px = max(round(self._bar_px + bar_px + lines_px), least_px)
        super().__init__(width_px, height_px + height_px % 2, scale)
        wide_px, high_px = self.pixels_per_m * width_m, self.pixels_per_m * height_m
        left_px = _LEFT_PX * scale + (room_px - wide_px) / 2.0
        self.axes = self.panel(left_px, _HEADER_PX * scale + high_px, wide_px, high_px)
        self.axes.set(xlim=(site_m.left, site_m.right), ylim=(site_m.bottom, site_m.top))
        self.axes.set_facecolor(unit_interval(SITE))
        self.add_legend(handles, columns)
        self.add_clock(_CLOCK_SHARE)

    def write(self, lines: Sequence[str]) -> None:
        """Write the heading and draw the border; call it after adding the other moving parts."""
        self.write_heading(lines, _HEADING_SHARE)
        self.frame_axes(self.axes, ("x (m)", "y (m)"), BORDER)

    def add_scale(self, colours: ScalarMappable, label: str) -> None:
        """Add the colour bar."""
        bottom_px = self._bar_px + _BAR_PX * self.scale
        self.add_bar(colours, bottom_px, label, FuncFormatter(number_on_axis), "max")

    def draw_grid(self, zone_m: Rectangle) -> Artist | None:
        """Draw the grid of a build zone; None if cells are smaller than 6 pixels."""
        if self.pixels_per_m * MODULE_SIDE_M < _SMALLEST_GRID_PX:
            return None
        left, bottom, right, top = zone_m
        lines = [((x, bottom), (x, top)) for x in np.arange(left, right, MODULE_SIDE_M)]
        lines += [((left, y), (right, y)) for y in np.arange(bottom, top, MODULE_SIDE_M)]
        grid = LineCollection(lines, colors=[unit_interval(FAINT)], linewidths=0.6, zorder=1.15)
        return self.axes.add_collection(grid, autolim=False)

    def pixel(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return the pixel of a place: x, and y from the top."""
        across, up = self.axes.transData.transform((x_m, y_m))
        return int(across), int(self.size_px[1] - up)
