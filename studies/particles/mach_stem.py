"""Whether regular reflection at a long wall turns into a Mach stem, and at what angle.

Builds the mean density of the air in front of a wall from the positions of the balls over many
seeds, at several times, and finds the blast's front in it. The front near the wall is compared with
the front as far from the charge on its other side, where nothing stands: where the one near the
wall is ahead, a stem runs along the wall.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from blast_env.arrays import FloatArray
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.particles import CollisionType
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.runner import run_all
from blast_env.scenario import Scenario
from blast_env.scenario.zone import source_bounds_m
from blast_env.simulation import Blast
from blast_env.studies.shielding.scenes import BlockGeometry, structure_scenario
from blast_env.units import MODULE_SIDE_M, MS_PER_S, UNITS_PER_M

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

CELL_M: Final = 0.25

FRONT_DENSITY: Final = 1.25
"""Density at the front, in that of the air at rest: above what the noise of the mean reaches."""

_LEAST_LEAD_M: Final = 0.5  # of a front that counts as ahead: two cells

_CELLS_OF_A_MEAN: Final = 3  # along either side of a square, over which densities are averaged

_ROWS_OF_A_MEAN: Final = 5  # over which the lead is averaged, against noise

_HALF_WIDTH: Final = 5.0  # of the wall, in stand-offs

_MARGIN: Final = 2.5  # open ground behind the charge, in stand-offs

_OUTER_SHARE: Final = 5  # the last fifth of the columns is to be air at rest

_MOST_NOISE: Final = 0.001  # share of cells there that noise may make denser than a front

_MOST_OF_STAND_OFF: Final = 0.8  # a stem higher than this reaches what it is compared with


@dataclass(frozen=True, eq=False)
class DensityField:
    """The mean density of the air beside a wall, the two halves of the site folded.

    Attributes:
        time_s: Time since the detonation.
        stand_off_m: From the charge's centre to the wall.
        density: In that of the air at rest (rows, columns). Rows count from the wall to two
            stand-offs from it, columns from the charge's axis along the wall; cells of `CELL_M`.
    """

    time_s: float
    stand_off_m: float
    density: FloatArray

    @property
    def from_wall_m(self) -> FloatArray:
        """Distance of each row's middle from the wall (rows,)."""
        return CELL_M * (np.arange(len(self.density), dtype=np.float64) + 0.5)

    @property
    def has_front(self) -> bool:
        """Whether a front can be told: before it the air is as it was, but for little noise."""
        columns = self.density.shape[1] // _OUTER_SHARE
        return bool(self._dense[:, -columns:].mean() < _MOST_NOISE)

    @property
    def front_m(self) -> FloatArray:
        """How far along the wall the front is in each row (rows,); 0 where there is none."""
        dense = self._dense
        last = dense.shape[1] - np.argmax(dense[:, ::-1], axis=1)
        return np.where(dense.any(axis=1), CELL_M * last, 0.0)

    @property
    def undisturbed_front_m(self) -> FloatArray:
        """The front of the side without a wall, mirrored at the charge (rows,)."""
        return self.front_m[::-1]

    @property
    def incidence_deg(self) -> float:
        """Angle at which the undisturbed front meets the wall; 0 is head-on.

        NaN before it is at the wall, and where no front can be told.
        """
        if not self.has_front:
            return np.nan
        half = len(self.density) // 2
        radius_m = np.hypot(self.front_m[half:], self.from_wall_m[half:] - self.stand_off_m)
        ratio = self.stand_off_m / float(radius_m.mean())
        return float(np.degrees(np.arccos(ratio))) if ratio <= 1.0 else np.nan

    @property
    def stem_height_m(self) -> float:
        """How far from the wall the front is ahead of the undisturbed one; 0 is no stem."""
        half = len(self.density) // 2
        lead_m = (self.front_m - self.undisturbed_front_m)[:half]
        mean_m = np.convolve(lead_m, np.ones(_ROWS_OF_A_MEAN) / _ROWS_OF_A_MEAN, mode="valid")
        behind = np.flatnonzero(mean_m < _LEAST_LEAD_M)
        rows = int(behind[0]) if len(behind) else half
        return CELL_M * (rows + _ROWS_OF_A_MEAN // 2) if rows else 0.0

    @property
    def _dense(self) -> NDArray[np.bool_]:
        """Which cells are denser than the front (rows, columns)."""
        smooth = uniform_filter(self.density, size=_CELLS_OF_A_MEAN, mode="nearest")
        dense: NDArray[np.bool_] = smooth > FRONT_DENSITY
        return dense


def mean_density(
    scenario: Scenario, seeds: Sequence[int], times_s: Sequence[float], processes: int = 1
) -> list[DensityField]:
    """Run blasts at a wall and average the density of the air at some times.

    Args:
        scenario: A point charge, and a wall across x to the right of it.
        seeds: Seeds to average over.
        times_s: Ascending times.
        processes: Worker processes.
    """
    counts = np.mean(run_all(partial(_counts, scenario, tuple(times_s)), seeds, processes), axis=0)
    at_rest = 2.0 * (CELL_M * UNITS_PER_M / scenario.parameters.air.spacing_units) ** 2
    stand_off_m = _stand_off_m(scenario)
    return [
        DensityField(time_s, stand_off_m, count / at_rest)
        for time_s, count in zip(times_s, counts, strict=True)
    ]


def transition_deg(fields: Sequence[DensityField]) -> float:
    """Return the angle of incidence at which a stem begins; NaN where it cannot be told.

    The stem's height over the angle, extrapolated to a height of 0 by a straight line through the
    stems that are lower than the charge is far.
    """
    chosen = [
        (field.incidence_deg, field.stem_height_m)
        for field in fields
        if 0.0 < field.stem_height_m <= _MOST_OF_STAND_OFF * field.stand_off_m
        and np.isfinite(field.incidence_deg)
    ]
    if len(chosen) < 3:
        return np.nan
    angle_deg, height_m = np.array(chosen).T
    slope, level = np.polyfit(angle_deg, height_m, 1)
    return float(-level / slope) if slope > 0.0 else np.nan


def wall_scenario(stand_off_m: float, parameters: SimulationParameters) -> Scenario:
    """Return a charge before the middle of a wall, ten times as long as the charge is away."""
    geometry = BlockGeometry(stand_off_m=stand_off_m, margin_m=_MARGIN * stand_off_m)
    rows = round(2.0 * _HALF_WIDTH * stand_off_m / MODULE_SIDE_M)
    return structure_scenario("mach_stem", geometry, parameters, rows, 1)


def dense_elastic_air() -> SimulationParameters:
    """Return air in which a blast comes closest to a shock: dense, without losses."""
    return with_overrides(
        SimulationParameters(),
        {
            "air": {"spacing_units": 3.0, "radius_units": 1.0, "elasticity": 1.0, "mass": 0.1},
            "explosive": {"elasticity": 1.0},
        },
    )


def _stand_off_m(scenario: Scenario) -> float:
    (structure,), (charge,) = scenario.structures, scenario.charge
    x_m, _ = source_bounds_m(charge).centre
    return structure.rectangle_m.left - x_m


def _counts(scenario: Scenario, times_s: tuple[float, ...], seed: int) -> FloatArray:
    """Return the air balls in each cell of both halves together (times, rows, columns)."""
    blast = Blast(scenario, seed=seed, engine="event")
    run, centre = blast.start(), np.array(blast.scene.charge_centre)
    stand_off_m = _stand_off_m(scenario)
    from_wall_m = CELL_M * np.arange(round(2.0 * stand_off_m / CELL_M) + 1)
    along_m = CELL_M * np.arange(round(_HALF_WIDTH * stand_off_m / CELL_M) + 1)
    counts = []
    for time_s in times_s:
        run.advance(time_s)
        balls = run.balls()
        air = balls.kind == CollisionType.AirBall
        x_m, y_m = ((balls.position[air] - centre) / UNITS_PER_M).T
        edges = (from_wall_m, along_m)
        counts.append(np.histogram2d(stand_off_m - x_m, np.abs(y_m), bins=edges)[0])
    return np.array(counts)


_PANELS: Final = 4
_HIGHEST_DENSITY: Final = 2.5
_NEAR_WALL, _FREE = "#D55E00", "#FFFFFF"


def mach_stem_figure(
    fields: Sequence[DensityField], transition_deg: float, subtitle: str
) -> Figure:
    """Return the density at four times with both fronts, and the stem's height over the angle.

    Args:
        fields: The fields, by time.
        transition_deg: Angle of incidence at which a stem begins, or NaN.
        subtitle: What was run.
    """
    figure = Figure(figsize=(15.0, 8.0), layout="constrained")
    grid = figure.add_gridspec(2, 3, width_ratios=(1.0, 1.0, 0.9))
    shown = np.linspace(len(fields) // 4, len(fields) - 1, _PANELS).round().astype(int)
    panels = [figure.add_subplot(grid[place // 2, place % 2]) for place in range(_PANELS)]
    images = [_draw_density(axes, fields[index]) for axes, index in zip(panels, shown, strict=True)]
    bar = figure.colorbar(images[0], ax=panels, location="bottom", shrink=0.6, extend="max")
    bar.set_label("number of air balls per area / that of the air at rest")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower left", facecolor="#8FA3B0"
    )
    _draw_heights(figure.add_subplot(grid[:, 2]), fields, transition_deg)
    found = (
        "no transition can be told"
        if np.isnan(transition_deg)
        else f"a Mach stem begins at about {transition_deg:.0f}°"
    )
    write_heading(figure, f"Reflection at a long wall: {found}", subtitle)
    return figure


def _draw_density(axes: Axes, field: DensityField) -> AxesImage:
    rows_m, along_m = field.from_wall_m, field.front_m
    height_m, width_m = 2.0 * field.stand_off_m, 3.0 * field.stand_off_m
    cell_m = rows_m[1] - rows_m[0]
    image = axes.imshow(
        field.density,
        origin="lower",
        extent=(0.0, cell_m * field.density.shape[1], 0.0, height_m),
        vmin=0.0,
        vmax=_HIGHEST_DENSITY,
        cmap="viridis",
        aspect="equal",
    )
    half = len(rows_m) // 2 if field.has_front else 0
    axes.plot(along_m[:half], rows_m[:half], color=_NEAR_WALL, lw=2.0, label="front at the wall")
    axes.plot(
        field.undisturbed_front_m[:half],
        rows_m[:half],
        color=_FREE,
        lw=1.6,
        ls="--",
        label="front of the other side, mirrored",
    )
    axes.axhline(field.stand_off_m, color=_FREE, lw=0.6, ls=":")
    if field.has_front and field.stem_height_m > 0.0:
        axes.axhline(field.stem_height_m, color=_NEAR_WALL, lw=0.8, ls=":")
    axes.plot(0.0, field.stand_off_m, "*", color="#E21C24", ms=14, mec="black", clip_on=False)
    axes.set(xlim=(0.0, width_m), ylim=(0.0, height_m))
    axes.set_xlabel("along the wall (m)")
    axes.set_ylabel("from the wall (m)")
    angle = field.incidence_deg
    words = (
        "no front at the wall can be told"
        if np.isnan(angle)
        else f"incidence {angle:.0f}°, stem {field.stem_height_m:.1f} m"
    )
    axes.set_title(f"{MS_PER_S * field.time_s:.1f} ms, {words}", fontsize=11)
    return image


def _draw_heights(axes: Axes, fields: Sequence[DensityField], transition_deg: float) -> None:
    angle_deg = [field.incidence_deg for field in fields]
    axes.plot(angle_deg, [field.stem_height_m for field in fields], "o", color=_NEAR_WALL)
    axes.axhline(fields[0].stand_off_m, color="black", lw=0.8, ls=":", label="stand-off")
    if not np.isnan(transition_deg):
        axes.axvline(
            transition_deg, color="black", ls="--", label=f"transition {transition_deg:.0f}°"
        )
    axes.set_xlabel("angle of incidence of the undisturbed front\nat the wall (°); 0 is head-on")
    axes.set_ylabel("height of the stem (m)")
    axes.set_xlim(0.0, 90.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()
