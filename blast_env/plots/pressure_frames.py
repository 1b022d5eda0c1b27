"""Frames of overpressure in the air: in plan at a height, and in a vertical section.

They begin at the detonation, with the spherical stage of the blast before the grid takes over.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from blast_env.arrays import FloatArray
from blast_env.errors import UnknownNameError
from blast_env.evaluation.engines.gas import GasResult
from blast_env.gas.probes import Snapshots
from blast_env.gas.spherical_stage import SphericalStage
from blast_env.geometry import Rectangle
from blast_env.plots.canvas import Frame, Sheet
from blast_env.plots.gas import MINUS, gas_heading
from blast_env.plots.plan import (
    BARRIER,
    BORDER,
    FAINT,
    INK,
    PROTECTED,
    QUIET_INK,
    STANDING,
    STRUCTURE,
    Feature,
    Kinds,
    area_feature,
    blast_features,
    without,
)
from blast_env.plots.site_plan import (
    draw_features,
    legend_of,
    outline_path,
    write_heading,
    write_legend,
)
from blast_env.plots.style import barrier_text, render_extra, unit_interval
from blast_env.site.blast_site import BlastSite
from blast_env.site.structures import Block, StructureOutline
from blast_env.units import MS_PER_S, PA_PER_KPA

with render_extra():
    from matplotlib import colormaps
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import AsinhNorm
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D
    from matplotlib.patches import PathPatch
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

_FINER: Final = 4  # pixels along a cell
_COLOURS: Final = "RdBu_r"  # darker to both sides; red and blue suit any colour vision
_LINEAR_SHARE: Final = 0.1  # of the scale
_TICKS: Final = (1.0, 0.5, 0.2, 0.05)
_CUT_STYLE: Final[Mapping[str, Any]] = MappingProxyType(
    {"color": unit_interval(INK), "linewidth": 0.8, "linestyle": (0, (6, 3, 1, 3))}
)


@dataclass(frozen=True)
class VerticalSection:
    """A vertical section: the plane x = `at_m` or y = `at_m`.

    Attributes:
        axis: The axis normal to it.
        at_m: Its coordinate; pictures show the layer of cells around it.
    """

    axis: Literal["x", "y"]
    at_m: float

    def __post_init__(self) -> None:
        """Check the axis.

        Raises:
            UnknownNameError: If it is neither x nor y.
        """
        if self.axis not in ("x", "y"):
            raise UnknownNameError("axis", self.axis, ("x", "y"))

    @property
    def normal(self) -> int:
        """Index of the axis normal to it."""
        return "xy".index(self.axis)


def default_section(site: BlastSite) -> VerticalSection:
    """Return the section through the charge that is best aligned with the protected structures."""
    x_m, y_m = site.charge.position_m
    solids = [structure for structure in site.structures if not structure.is_barrier]
    chosen = [solid for solid in solids if solid.protected] or solids
    centres = [solid.rectangle_m.centre for solid in chosen]
    if not centres:
        return VerticalSection("y", y_m)
    across = sum(abs(centre[0] - x_m) for centre in centres)
    along = sum(abs(centre[1] - y_m) for centre in centres)
    return VerticalSection("y", y_m) if across >= along else VerticalSection("x", x_m)


@dataclass(frozen=True, eq=False)
class PressureShot:
    """A blast with pictures of the overpressure in two planes.

    Attributes:
        opening: Its stage before the grid.
        planes: Pictures in plan and in the section.
    """

    result: GasResult
    section: VerticalSection
    opening: SphericalStage
    planes: tuple[Snapshots, Snapshots]

    def at(self, time_s: float, plane: int) -> FloatArray | None:
        """Return the overpressure in a plane at a time, Pa, along its two axes; NaN in solids.

        It is that of the nearest picture; None before the grid takes over.
        """
        frames = self.planes[plane].frames
        if time_s < self.opening.end_s or not frames:
            return None
        times_s = [frame.time_s for frame in frames]
        after = min(bisect_left(times_s, time_s), len(frames) - 1)
        before = max(after - 1, 0)
        nearest = min((before, after), key=lambda k: abs(times_s[k] - time_s))
        return frames[nearest].overpressure_pa.astype(np.float64)

    def layer_m(self, plane: int) -> float:
        """Return the coordinate of a plane along its normal axis, m."""
        snapshots = self.planes[plane]
        return float(self.result.run.grid.centres_m(snapshots.axis)[snapshots.layer])

    def distances_m(self, plane: int, finer: int) -> FloatArray:
        """Return the distances of the parts of cells in a plane from the centre of the blast, m.

        Args:
            plane: Index of the plane.
            finer: Number of parts along each side of a cell.
        """
        grid, normal = self.result.run.grid, self.planes[plane].axis
        first, second = (
            grid.origin_m[axis]
            + grid.cell_m / finer * (np.arange(finer * grid.shape[axis]) + 0.5)
            - self.opening.centre_m[axis]
            for axis in range(3)
            if axis != normal
        )
        away_m = self.layer_m(plane) - self.opening.centre_m[normal]
        return np.asarray(np.sqrt(first[:, np.newaxis] ** 2 + second**2 + away_m**2))


class Smooth:
    """Interpolates cell values linearly to pixels, from air cells only.

    Args:
        air: Mask of the air cells (nx, ny).
    """

    def __init__(self, air: NDArray[np.bool_]) -> None:
        self._air = air
        self._weights = [self._along(count) for count in air.shape]
        self._inside = np.repeat(np.repeat(air, _FINER, axis=0), _FINER, axis=1)
        self._shares = np.maximum(self._spread(air.astype(np.float64)), 1e-12)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the pixels (n nx, n ny) of values (nx, ny), 0 in solids; n is 4."""
        known = np.where(self._air, values, 0.0)
        return np.where(self._inside, self._spread(known) / self._shares, 0.0)

    def _spread(self, values: FloatArray) -> FloatArray:
        across, along = self._weights
        return np.asarray((along @ (across @ values).T).T)

    @staticmethod
    def _along(count: int) -> csr_matrix:
        """Return the weights of the cells in the pixels along an axis (n count, count)."""
        place = np.clip((np.arange(_FINER * count) + 0.5) / _FINER - 0.5, 0.0, count - 1.0)
        return csr_matrix(np.maximum(1.0 - np.abs(place[:, np.newaxis] - np.arange(count)), 0.0))


class _Picture(NamedTuple):
    """The picture of a plane of a blast, with the distances of its pixels from the charge."""

    shot: int
    plane: int
    image: AxesImage
    smooth: Smooth
    distances_m: FloatArray


_USUAL_WIDTH_PX: Final = 960  # of one blast
_SHARE_OF_TITLES: Final = 0.74  # of the width; the clock has the rest


class PressurePainter:
    """Paints moments of blasts side by side, all on one colour scale.

    Args:
        shots: The blasts, from left to right.
        full_kpa: Overpressure at the end of the scale.
        width_px: Width of the frames, even.

    Attributes:
        sheet: The page; its moving parts show the last moment painted.
        scale: The colour scale, kPa.
    """

    def __init__(
        self,
        shots: Sequence[PressureShot],
        full_kpa: float,
        width_px: int,
    ) -> None:
        self.shots = tuple(shots)
        self.scale = AsinhNorm(_LINEAR_SHARE * full_kpa, -full_kpa, full_kpa)
        self._per_unit = 0.5 / float(np.arcsinh(1.0 / _LINEAR_SHARE))
        self._colours: Frame = colormaps[_COLOURS](np.arange(256), bytes=True)
        site = shots[0].result.run.site
        self._site_m = site.site_m
        along = 1 - shots[0].section.normal
        low, high = site.site_m[along], site.site_m[along + 2]
        self._section_m = Rectangle(low, 0.0, high, site.air_height_m)
        self._images: list[_Picture] = []
        scale = max(width_px / (_USUAL_WIDTH_PX * len(shots)), 1.0)
        self.sheet = Sheet(width_px, scale, len(shots), (self._site_m, self._section_m))
        for number in range(len(shots)):
            self._draw_plan(number)
            self._draw_section(number)
        self._draw_bar()
        write_legend(self.sheet.figure, self._handles())
        title, subtitle = gas_heading([shot.result for shot in shots], "overpressure")
        write_heading(self.sheet.figure, title, subtitle, _SHARE_OF_TITLES, left=True)
        self.sheet.finish()

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self.sheet.size_px

    def paint(self, time_s: float, note: str = "") -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            time_s: Simulated time.
            note: A remark under the time.
        """
        for image in self._images:
            shot = self.shots[image.shot]
            values = shot.at(time_s, image.plane)
            if values is None:
                pixels = shot.opening.at(time_s, image.distances_m)
            else:
                pixels = image.smooth(values)
            image.image.set_data(self.colours(pixels.T / PA_PER_KPA))
        return self.sheet.frame((f"{time_s * MS_PER_S:.1f} ms", note))

    def colours(self, overpressure_kpa: FloatArray) -> Frame:
        """Return the colours of overpressures, uint8 (..., 4)."""
        # The same as the scale, but much faster.
        share = np.arcsinh(overpressure_kpa * (1.0 / self.scale.linear_width)) * self._per_unit
        last = len(self._colours) - 1
        index = np.clip((share + 0.5) * (last + 1), 0.0, last).astype(np.intp)
        return self._colours[index]

    def _draw_plan(self, number: int) -> None:
        axes, shot = self.sheet.panels[number][0], self.shots[number]
        site, height_m = shot.result.run.site, shot.layer_m(0)
        self._add_image(number, 0)
        for outline, blocks in _wholes(shot):
            is_cut = blocks[0].base_m < height_m < _top_m(site, blocks[0])
            self._add_solid(axes, [block.rectangle_m for block in blocks], outline, is_cut=is_cut)
        self.sheet.let_move(draw_features(axes, _on_ground(shot)))
        line = axes.axhline if shot.section.axis == "y" else axes.axvline
        self.sheet.let_move([line(shot.layer_m(1), **_CUT_STYLE)])
        self.sheet.frame_axes(axes, ("x (m)", "y (m)" if number == 0 else ""), BORDER)
        axes.set_title(f"plan at z = {height_m:g} m", fontsize=9, loc="left")
        if len(self.shots) > 1:
            axes.annotate(
                barrier_text(shot.result.blast.layout),
                (0.5, 1.0),
                (0.0, 20.0),
                xycoords="axes fraction",
                textcoords="offset points",
                ha="center",
                fontsize=10.5,
                fontweight="bold",
            )

    def _draw_section(self, number: int) -> None:
        axes, shot = self.sheet.panels[number][1], self.shots[number]
        site, at_m = shot.result.run.site, shot.layer_m(1)
        along = 1 - shot.section.normal
        self._add_image(number, 1)
        for outline, blocks in _wholes(shot):
            cut = []
            for block in blocks:
                part, top_m = block.rectangle_m, _top_m(site, block)
                if part[shot.section.normal] < at_m < part[shot.section.normal + 2]:
                    cut.append(Rectangle(part[along], block.base_m, part[along + 2], top_m))
            if cut:
                self._add_solid(axes, cut, outline, is_cut=True)
        charge = site.charge
        if abs(charge.position_m[shot.section.normal] - at_m) <= shot.result.run.grid.cell_m:
            place_m = (charge.position_m[along], charge.height_m)
            star = Feature(Kinds.CHARGE, (place_m,), "charge")
            self.sheet.let_move(draw_features(axes, [star]))
        self.sheet.let_move([axes.axhline(shot.layer_m(0), **_CUT_STYLE)])
        labels = (f"{'xy'[along]} (m)", "z (m)" if number == 0 else "")
        self.sheet.frame_axes(axes, labels, QUIET_INK)
        axes.set_title(f"section at {shot.section.axis} = {at_m:g} m", fontsize=9, loc="left")

    def _add_image(self, number: int, plane: int) -> None:
        axes, shot = self.sheet.panels[number][plane], self.shots[number]
        grid = shot.result.run.grid
        normal = shot.planes[plane].axis
        first, second = (axis for axis in range(3) if axis != normal)
        air = ~np.take(grid.solid, shot.planes[plane].layer, axis=normal)
        low, high = (
            [grid.origin_m[axis] + grid.cell_m * end * grid.shape[axis] for axis in (first, second)]
            for end in (0, 1)
        )
        image = AxesImage(
            axes,
            interpolation="nearest",
            origin="lower",
            extent=(low[0], high[0], low[1], high[1]),
        )
        image.set_clip_path(axes.patch)
        image.set_data(self.colours(np.zeros((2, 2))))
        axes.add_artist(image)
        self.sheet.let_move([image])
        distances_m = shot.distances_m(plane, _FINER)
        self._images.append(_Picture(number, plane, image, Smooth(air), distances_m))

    def _add_solid(
        self, axes: Axes, parts: Sequence[Rectangle], outline: StructureOutline, *, is_cut: bool
    ) -> None:
        """Draw a solid: filled if the plane cuts it, its outline alone if not."""
        patch = PathPatch(outline_path(parts))
        if outline.is_barrier:
            patch.set(edgecolor=unit_interval(BARRIER), linewidth=0.8)
            colour = unit_interval(BARRIER)
        else:
            edge = PROTECTED if outline.protected else STRUCTURE
            patch.set(edgecolor=unit_interval(edge), linewidth=2.0)
            colour = unit_interval(FAINT)
        patch.set(facecolor=colour if is_cut else "none")
        self.sheet.let_move([axes.add_patch(patch)])

    def _draw_bar(self) -> None:
        colours = ScalarMappable(self.scale, _COLOURS)
        label = "overpressure (kPa), the same scale everywhere"
        bar = self.sheet.add_bar(colours, label, "both")
        full = float(self.scale.vmax or 0.0)
        marks = [sign * share * full for share in _TICKS for sign in (-1.0, 1.0)]
        bar.ax.xaxis.set_major_locator(FixedLocator(sorted({*marks, 0.0})))
        bar.ax.xaxis.set_minor_locator(NullLocator())
        bar.ax.xaxis.set_major_formatter(FuncFormatter(_signed))

    def _handles(self) -> list[Artist]:
        features = [
            feature for shot in self.shots for feature in (*_on_ground(shot), *_solids(shot))
        ]
        return [*legend_of(features), Line2D([], [], **_CUT_STYLE, label="cut of the other view")]


def _signed(value: float, position: int | None) -> str:  # noqa: ARG001
    """Return the number at a tick, with a minus sign if negative."""
    return f"{value:g}".replace("-", MINUS)


def _on_ground(shot: PressureShot) -> tuple[Feature, ...]:
    blast = shot.result.blast
    features = blast_features(blast.scenario, (), shot.result.run.site.charge)
    return without(features, Kinds.SITE, *STANDING)


def _wholes(shot: PressureShot) -> list[tuple[StructureOutline, list[Block]]]:
    """Return solids with their blocks, the lowest first; blocks of a barrier are apart."""
    found: list[tuple[StructureOutline, list[Block]]] = []
    for outline in shot.result.run.site.structures:
        if outline.is_barrier:
            found += ((outline, [block]) for block in outline.blocks)
        else:
            found.append((outline, list(outline.blocks)))
    return sorted(found, key=lambda item: item[1][0].base_m)


def _solids(shot: PressureShot) -> list[Feature]:
    """Return the solids as features, in their colours in a cut."""
    site, found = shot.result.run.site, []
    for outline in site.structures:
        words = ""
        if outline.is_barrier:
            kind, fill = Kinds.BARRIER, BARRIER
            is_low = any(_top_m(site, block) <= shot.layer_m(0) for block in outline.blocks)
            words = "barrier (low: outline)" if is_low else "barrier"
        else:
            kind, fill = Kinds.PROTECTED_STRUCTURE if outline.protected else Kinds.STRUCTURE, FAINT
        feature = area_feature(kind, outline.rectangle_m, outline.name)
        found.append(replace(feature, fill=fill, words=words))
    return found


def _top_m(site: BlastSite, block: Block) -> float:
    return site.air_height_m if block.height_m is None else block.height_m
