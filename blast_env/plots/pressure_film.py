"""Films of overpressure in the air, alone and side by side."""

from collections.abc import Iterator, Sequence
from math import cbrt
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.curves import burst_of, kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasBlast, GasResult
from blast_env.gas.engine import Recorders
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import Snapshots
from blast_env.gas.solver import Recorder
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.plots.canvas import Frame
from blast_env.plots.film_files import FilmPlan, Footage
from blast_env.plots.gas import check_comparable, gas_subtitle
from blast_env.plots.pressure_frames import (
    PressurePainter,
    PressureShot,
    VerticalSection,
    default_section,
)
from blast_env.plots.style import barrier_text, nice_ceiling
from blast_env.runner import ProgressCallback, share_of
from blast_env.site.blast_site import BlastSite
from blast_env.statistics import counted_parts
from blast_env.units import PA_PER_KPA

_EVERY_S: Final = 0.0002  # for 100 kg
_LONGEST_S: Final = 4.0  # for 100 kg
_CURVES: Final = (0.2, 30.0)  # scaled distances, m/kg^(1/3), of the curves of both bursts
_LONGEST_WAY_M: Final = 100.0
_SHOWN_SHARE: Final = 0.9  # of the assessed walls, on the scale
_NARROWEST_PX, _WIDEST_PX = 480, 4096
_WIDTH_PX: Final = 960  # of a blast in progress
PLAN_HEIGHT_M: Final = 1.5
"""Height of the plan, where the air is at least twice as high."""


def pressure_footage(
    blasts: Sequence[GasBlast],
    width_px: int,
    section: VerticalSection | None,
    recorders: Recorders,
    progress: ProgressCallback,
) -> Footage:
    """Run blasts and record their overpressure in plan and in a section; see `write_film`."""
    check_comparable(blasts)
    if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
        raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
    count = len(blasts)
    shots = [
        record_planes(blast, section, share_of(progress, number, count), recorders)
        for number, blast in enumerate(blasts)
    ]
    results = tuple(shot.result for shot in shots)

    def frames(plan: FilmPlan) -> Iterator[Frame]:
        painter = PressurePainter(shots, scale_end_kpa(results), width_px - width_px % 2)
        for number in range(plan.frame_count):
            yield painter.paint(plan.time_s(number), plan.real_time_factor)

    layouts = " | ".join(barrier_text(blast.layout) for blast in blasts)
    words = f"{blasts[-1].scenario.name}, {gas_subtitle(blasts)}, {layouts}"
    return Footage(results, max(result.time_s for result in results), frames, words)


class PressureNow:
    """Shows a blast in progress.

    The scale ends at the free-field peak of Kingery and Bulmash at the distance of the nearest
    structure that counts, so that all layouts of a site have the same one.

    Args:
        result: The blast, whose run is advanced between the frames.
    """

    def __init__(self, result: GasResult) -> None:
        site, self._run = result.blast.site, result.run
        section = default_section(site)
        self._planes = _planes_of(self._run.grid, site, section, PLAN_HEIGHT_M)
        opening = spherical_stage(self._run.charge, self._run.remap_radius_m)
        shot = PressureShot(result, section, opening, self._planes)
        self._painter = PressurePainter([shot], _free_field_peak_kpa(site), _WIDTH_PX)

    def frame(self) -> Frame:
        """Return a picture of the present state, uint8 (height, width, 3)."""
        for plane in self._planes:
            plane.frames = [plane.now(self._run.solver)]
        return self._painter.paint(self._run.time_s)


def _free_field_peak_kpa(site: BlastSite) -> float:
    """Return a peak for the end of the scale before the blast is run, kPa, rounded up.

    It is that of the incident wave of Kingery and Bulmash at the nearest structure that counts,
    within the range of their curves; reflections exceed it.
    """
    solids = [structure for structure in site.structures if not structure.is_barrier]
    chosen = [solid for solid in solids if solid.protected] or solids
    x_y_m = site.charge.position_m
    distances_m = (solid.rectangle_m.distance_to(x_y_m) for solid in chosen)
    nearest_m = min(distances_m, default=_LONGEST_WAY_M)
    mass_kg = site.charge.tnt_kg
    low, high = (z * cbrt(mass_kg) for z in _CURVES)
    distance_m = min(max(nearest_m, low), high)
    burst = burst_of(site.charge.height_m, mass_kg)
    peak_pa = kingery_bulmash("incident_overpressure", distance_m, mass_kg, burst)
    return nice_ceiling(float(peak_pa) / PA_PER_KPA)


def scale_end_kpa(results: Sequence[GasResult]) -> float:
    """Return the end of the scale, kPa: nine tenths of the assessed walls peak below it.

    Close to a charge the peaks of a few cells are a hundred times those of the rest.
    """
    peaks_pa = np.concatenate([[PA_PER_KPA], *map(_counting_peaks_pa, results)])
    return nice_ceiling(float(np.quantile(peaks_pa, _SHOWN_SHARE)) / PA_PER_KPA)


def _counting_peaks_pa(result: GasResult) -> FloatArray:
    """Return the peaks on the cells of assessed walls, of each structure if none is protected."""
    faces = result.on_walls
    counts = [
        (faces["structure"] == counted_part.name) & faces["face"].isin(counted_part.faces)
        for counted_part in counted_parts(result.run.site.structures)
    ]
    peaks_pa = faces["peak_pa"][np.logical_or.reduce(counts)].to_numpy(dtype=np.float64)
    return np.asarray(peaks_pa[np.isfinite(peaks_pa)])


def record_planes(
    blast: GasBlast,
    section: VerticalSection | None = None,
    progress: ProgressCallback = lambda _: None,
    recorders: Recorders = lambda _: (),
    height_m: float = PLAN_HEIGHT_M,
) -> PressureShot:
    """Run a blast and record pictures of two planes.

    Args:
        section: The section; by default `default_section`.
        progress: Called from time to time with the elapsed share of the time limit.
        recorders: Further recorders, as for `GasBlast.run`.
        height_m: Height of the plan, which shows the layer of cells around it; at most half the
            height of the air.

    Raises:
        BlastEnvError: If a plane is outside the grid.
    """
    planes = PlaneRecorder(blast, section, height_m)
    result = blast.run(progress, lambda grid: (*planes.recorders(grid), *recorders(grid)))
    return planes.shot(result)


class PlaneRecorder:
    """Records pictures of two planes of a blast; see `record_planes`.

    Args:
        blast: The blast.
        section: The section; by default `default_section`.
        height_m: Height of the plan.
    """

    def __init__(
        self,
        blast: GasBlast,
        section: VerticalSection | None = None,
        height_m: float = PLAN_HEIGHT_M,
    ) -> None:
        self._site, self._height_m = blast.site, height_m
        self._section = section or default_section(blast.site)
        self._planes: tuple[Snapshots, Snapshots] | None = None

    def recorders(self, grid: GasGrid) -> tuple[Recorder, ...]:
        """Return the recorders of a grid, as for `GasBlast.run`."""
        scale = cbrt(self._site.charge.tnt_kg / 100.0)
        times_s = (scale * np.arange(0.0, _LONGEST_S, _EVERY_S)).tolist()
        self._planes = _planes_of(grid, self._site, self._section, self._height_m, times_s)
        return self._planes

    def shot(self, result: GasResult) -> PressureShot:
        """Return the pictures of the finished blast."""
        assert self._planes is not None, "the blast was run without the recorders"
        opening = spherical_stage(result.run.charge, result.run.remap_radius_m)
        return PressureShot(result, self._section, opening, self._planes)


def _planes_of(
    grid: GasGrid,
    site: BlastSite,
    section: VerticalSection,
    height_m: float,
    times_s: Sequence[float] = (),
) -> tuple[Snapshots, Snapshots]:
    """Return recorders of a plan and a section."""
    place = [*site.site_m.centre, min(height_m, 0.5 * site.air_height_m)]
    place[section.normal] = section.at_m
    cell = grid.cell_at((place[0], place[1], place[2]))
    plan, cut = (Snapshots(grid, axis, cell[axis], times_s) for axis in (2, section.normal))
    return plan, cut
