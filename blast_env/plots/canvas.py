"""Figures as frames: still parts drawn once, and moving parts drawn anew in each frame."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.particles.objects import Colour
from blast_env.plots.plan import BORDER, FAINT, INK, QUIET_INK, SITE
from blast_env.plots.site_plan import add_bar, lay_out, trim_height, write_heading, write_legend
from blast_env.plots.style import render_extra, unit_interval
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine
    from matplotlib.text import Text

Frame = NDArray[np.uint8]
"""A picture: rows from the top, pixels, and red, green and blue."""

_DPI: Final = 100.0
_CLOCK: Final = ((10, 12.0, INK, True), (36, 8.5, QUIET_INK, False), (54, 8.5, QUIET_INK, False))
"""For each line of the clock: pixels from the top, points, colour, and whether it is bold."""

_USUAL_WIDTH_PX: Final = 960
_NARROWEST_PX, _WIDEST_PX = 320, 4096
_SMALLEST_SCALE: Final = 0.72  # keeps letters legible
_MARGIN_PX: Final = 12
_PAD_IN: Final = 0.07
_DECORATION_IN: Final = 6.0  # most height of heading, axes, colour bar and legend
_MOST_HIGH: Final = 0.8  # largest height of a site, as a share of the width of the frame
_HEADING_SHARE, _CLOCK_SHARE = 0.53, 0.44  # of the width
_SMALLEST_GRID_PX: Final = 6.0


class Sheet:
    """A figure of one or more columns of panels to scale, whose moving parts are drawn anew.

    Draw the still parts, call `finish`, and then `frame` for each frame.

    Args:
        width_px: Width of the frames.
        scale: Size of letters, relative to the usual one.
        columns: Number of columns.
        areas_m: The area of the panel in each row, from the top; all columns show the same areas.

    Attributes:
        figure: The figure.
        panels: The panels of each column, from the top.
        size_px: Width and height of the frames; the height is known after `finish`.
    """

    def __init__(
        self, width_px: int, scale: float, columns: int, areas_m: Sequence[Rectangle]
    ) -> None:
        self._scale, self._dpi = scale, scale * _DPI
        width_in = (width_px + 0.5) / self._dpi
        self.figure = Figure(
            figsize=(width_in, columns * width_in + _DECORATION_IN),
            dpi=self._dpi,
            layout=ConstrainedLayoutEngine(h_pad=_PAD_IN),
        )
        canvas: Any = FigureCanvasAgg  # partly without types
        self._canvas = canvas(self.figure)
        self.size_px = (width_px, 0)
        self._ground: Any = None
        self._moving: list[Artist] = []
        self._borders: list[Artist] = []
        self._clock: list[Text] = []
        heights_m = [area_m.top - area_m.bottom for area_m in areas_m]
        widest_m = max(area_m.right - area_m.left for area_m in areas_m)
        share = min(_MOST_HIGH * columns * widest_m / heights_m[0], 1.0)
        beside = [0.5 * columns * (1.0 / share - 1.0)] if share < 1.0 else []
        widths = [*beside, *[1.0] * columns, *beside]
        grid = self.figure.add_gridspec(
            len(areas_m), len(widths), width_ratios=widths, height_ratios=heights_m
        )
        self.panels = [
            [self.figure.add_subplot(grid[row, len(beside) + k]) for row in range(len(areas_m))]
            for k in range(columns)
        ]
        for column in self.panels:
            for axes, area in zip(column, areas_m, strict=True):
                axes.set(xlim=(area.left, area.right), ylim=(area.bottom, area.top))
                axes.set(aspect="equal", anchor="N")

    def finish(self, least_px: int = 0) -> None:
        """Fix the layout, with the height that the panels need, at least the given even one."""
        trim_height(self.figure, [axes for column in self.panels for axes in column])
        height_px = max(round(self.figure.get_figheight() * self._dpi), least_px)
        self.size_px = (self.size_px[0], height_px + height_px % 2)
        self.figure.set_figheight((self.size_px[1] + 0.5) / self._dpi)
        lay_out(self.figure)
        self.figure.set_layout_engine("none")
        width, height = self.size_px
        self._clock = [
            self.figure.text(
                1.0 - _MARGIN_PX * self._scale / width,
                1.0 - top_px * self._scale / height,
                "",
                ha="right",
                va="top",
                fontsize=size_pt,
                color=unit_interval(colour),
                fontweight="bold" if bold else "normal",
                animated=True,
            )
            for top_px, size_pt, colour, bold in _CLOCK
        ]

    def let_move(self, artists: Iterable[Artist]) -> None:
        """Leave artists out of the still ground; draw them in every frame, in this order."""
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
            spine.set(color=unit_interval(colour), linewidth=1.2, animated=True)
            self._borders.append(spine)

    def add_bar(self, colours: ScalarMappable, label: str, extend: str) -> Colorbar:
        """Add a colour bar below all panels."""
        panels = [axes for column in self.panels for axes in column]
        style = {"location": "bottom", "extend": extend, "aspect": 45, "pad": 0.01, "shrink": 0.8}
        bar = add_bar(self.figure, panels, colours, label, **style)
        bar.set_label(label, fontsize=9)
        bar.ax.tick_params(labelsize=8)
        return bar

    def frame(self, lines: Sequence[str], moving: Iterable[Artist] = ()) -> Frame:
        """Return the present state, uint8 (height, width, 3).

        Args:
            lines: Lines of the clock, at the upper right.
            moving: Artists of this frame alone, drawn below all other moving ones.
        """
        if self._ground is None:
            self._canvas.draw()
            self._ground = self._canvas.copy_from_bbox(self.figure.bbox)
        self._canvas.restore_region(self._ground)
        renderer = self._canvas.get_renderer()
        for number, text in enumerate(self._clock):
            line, size_pt = "".join(lines[number : number + 1]), _CLOCK[number][1]
            text.set(text=line, fontsize=size_pt)
            if line:
                share = text.get_window_extent(renderer).width / self.size_px[0]
                text.set_fontsize(size_pt * min(1.0, _CLOCK_SHARE / share))
        for artist in (*moving, *self._moving, *self._borders, *self._clock):
            artist.draw(renderer)
        pixels, frame = (
            np.asarray(self._canvas.buffer_rgba()),
            np.empty((*self.size_px[::-1], 3), np.uint8),
        )
        for channel in range(3):  # several times faster than all at once
            frame[..., channel] = pixels[..., channel]
        return frame


class SiteSheet(Sheet):
    """A site to scale under a heading, above a colour bar and a legend.

    Args:
        site_m: The simulated area.
        width_px: Width of the frames, 320 to 4096.
        handles: Entries of the legend.
        heading: The title, and two lines under it.
        colours: A colour bar with its label; `None` for no bar.
        least_px: Least height of the frames, an even one.

    Attributes:
        axes: Axes of the site, in metres.
    """

    def __init__(
        self,
        site_m: Rectangle,
        width_px: int,
        handles: Sequence[Artist],
        heading: tuple[str, str, str],
        colours: tuple[ScalarMappable, str] | None = None,
        least_px: int = 0,
    ) -> None:
        if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
            raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
        super().__init__(width_px, max(width_px / _USUAL_WIDTH_PX, _SMALLEST_SCALE), 1, [site_m])
        ((self.axes,),) = self.panels
        self.axes.set_facecolor(unit_interval(SITE))
        self.frame_axes(self.axes, ("x (m)", "y (m)"), BORDER)
        if colours is not None:
            self.add_bar(*colours, "max")
        write_legend(self.figure, handles)
        title, *lines = heading
        write_heading(self.figure, title, "\n".join(lines), _HEADING_SHARE, left=True)
        self.finish(least_px)

    @property
    def pixels_per_m(self) -> float:
        """Scale of the site."""
        left, right = self.axes.get_xlim()
        return float(self.axes.get_window_extent().width) / (right - left)

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
