"""Films of overpressure in the air, alone and side by side."""

from collections.abc import Sequence
from math import cbrt
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasBlast, GasResult
from blast_env.files import write_atomically
from blast_env.gas.engine import Recorders
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import Snapshots
from blast_env.gas.solver import Recorder
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.particles.calibration.references import burst_of, kingery_bulmash
from blast_env.plots.canvas import Frame
from blast_env.plots.film import (
    FilmPlan,
    for_gif,
    known_suffix,
    plan_until,
    save_frames,
    with_progress,
)
from blast_env.plots.gas import (
    check_comparable,
    gas_subtitle,
)
from blast_env.plots.pressure_frames import (
    PlaneNow,
    PressurePainter,
    PressureShot,
    VerticalSection,
    default_section,
)
from blast_env.plots.style import barrier_text, nice_ceiling
from blast_env.runner import Tell, share_of
from blast_env.site.blast_site import BlastSite
from blast_env.units import PA_PER_KPA

_EVERY_S: Final = 0.0002  # for 100 kg
_LONGEST_S: Final = 4.0  # for 100 kg
_CURVES: Final = (0.2, 30.0)  # scaled distances, m/kg^(1/3), of the curves of both bursts
_LONGEST_WAY_M: Final = 100.0
_NARROWEST_PX, _WIDEST_PX = 480, 4096
PLAN_HEIGHT_M: Final = 1.5
"""Default height of the plan of a film."""


def write_pressure_film(
    blast: GasBlast,
    path: str | Path,
    *,
    beside: GasBlast | None = None,
    height_m: float = PLAN_HEIGHT_M,
    section: VerticalSection | None = None,
    frames_per_s: float = 25.0,
    slow_motion: float | None = None,
    width_px: int | None = None,
    further: Recorders = lambda _: (),
    progress: Tell = lambda _: None,
) -> tuple[GasResult, ...]:
    """Run a blast and write a film of the overpressure in plan and in a section.

    Args:
        blast: The blast.
        path: The film, `.mp4` or `.gif`; a GIF is at most 640 pixels wide.
        beside: Another blast with the same site and charge, shown to the left, at the same moments
            and on the same scale: without the barrier, or with another layout.
        height_m: Height of the plan, which shows the layer of cells around it.
        section: The section; by default `default_section`.
        frames_per_s: Frames per second of the film.
        slow_motion: Seconds of the film per second of the blast; by default it lasts about 10 s.
        width_px: Width of the film; by default 960, or 1600 with two blasts.
        further: Further recorders for each blast, as for `GasBlast.run`.
        progress: Called from time to time with the finished share of the work.

    Returns:
        The results of the blasts, from left to right.

    Raises:
        BlastEnvError: If site or charge of the blasts differ, the suffix is another one, an
            argument is out of bounds or the file cannot be written; no file remains then.
    """
    suffix = known_suffix(path)
    blasts = [blast] if beside is None else [beside, blast]
    check_comparable(blasts)
    width_px = width_px or (960 if beside is None else 1600)
    if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
        raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
    section = default_section(blast.site) if section is None else section
    with write_atomically(path) as temporary:
        running = share_of(progress, 0, 2)
        shots = [
            record_planes(each, height_m, section, share_of(running, number, len(blasts)), further)
            for number, each in enumerate(blasts)
        ]
        end_s = max(shot.result.time_s for shot in shots)
        plan = plan_until(end_s, frames_per_s, slow_motion)
        if suffix == ".gif":
            plan, width_px = for_gif(plan, width_px)
        full_kpa = scale_end_kpa([shot.result for shot in shots])
        painter = PressurePainter(shots, full_kpa, width_px - width_px % 2)
        times_s = map(plan.time_s, range(plan.frame_count))
        frames = (painter.paint(time_s, plan.real_time_factor) for time_s in times_s)
        reported = with_progress(frames, plan, share_of(progress, 1, 2))
        save_frames(reported, temporary, suffix, plan, blast.scenario.name, _comment(shots, plan))
    return tuple(shot.result for shot in shots)


class PressureNow:
    """Shows a blast in progress.

    The scale ends at the free-field peak of Kingery and Bulmash at the distance of the nearest
    structure that counts, so that all layouts of a site have the same one.

    Args:
        result: The blast, whose run is advanced between the frames.
        width_px: Width of the frames.
    """

    def __init__(self, result: GasResult, width_px: int = 960) -> None:
        blast, run = result.blast, result.run
        section = default_section(blast.site)
        cell = _cell_of(run.grid, blast.site, PLAN_HEIGHT_M, section)
        planes = (
            PlaneNow(run, 2, cell[2]),
            PlaneNow(run, section.normal, cell[section.normal]),
        )
        opening = spherical_stage(run.charge, run.remap_radius_m)
        shot = PressureShot(result, section, opening, planes)
        self._run = run
        self._painter = PressurePainter([shot], _free_field_peak_kpa(blast.site), width_px)

    def frame(self) -> Frame:
        """Return a picture of the present state, uint8 (height, width, 3)."""
        return self._painter.paint(self._run.time_s)


def _free_field_peak_kpa(site: BlastSite) -> float:
    """Return a peak for the end of the scale before the blast is run, kPa, rounded up.

    It is that of the incident wave of Kingery and Bulmash at the nearest structure that counts,
    within the range of their curves; reflections exceed it.
    """
    solids = [each for each in site.structures if not each.is_barrier]
    chosen = [each for each in solids if each.protected] or solids
    x_y_m = site.charge.position_m
    distances_m = (each.rectangle_m.distance_to(x_y_m) for each in chosen)
    nearest_m = min(distances_m, default=_LONGEST_WAY_M)
    mass_kg = site.charge.tnt_kg
    low, high = (z * cbrt(mass_kg) for z in _CURVES)
    distance_m = min(max(nearest_m, low), high)
    burst = burst_of(site.charge.height_m, mass_kg)
    peak_pa = kingery_bulmash("incident_overpressure", distance_m, mass_kg, burst)
    return nice_ceiling(float(peak_pa) / PA_PER_KPA)


def _comment(shots: Sequence["PressureShot"], plan: FilmPlan) -> str:
    blasts = [shot.result.blast for shot in shots]
    scenario, layouts = (
        blasts[-1].scenario,
        " | ".join(barrier_text(each.layout) for each in blasts),
    )
    return (
        f"{scenario.name}, {gas_subtitle(blasts)}, {layouts}, {plan.real_time_factor}, "
        f"scenario {scenario.content_hash}"
    )


def scale_end_kpa(results: Sequence[GasResult]) -> float:
    """Return the end of the scale, kPa: the largest peak on the walls that count, rounded up."""
    peaks = []
    for result in results:
        table = result.structures
        chosen = table[table["protected"]] if table["protected"].any() else table
        peaks.append(float(np.nan_to_num(chosen["peak_pa"].to_numpy()).max(initial=0.0)))
    return nice_ceiling(max(*peaks, 1.0) / PA_PER_KPA)


def record_planes(
    blast: GasBlast,
    height_m: float,
    section: VerticalSection,
    progress: Tell = lambda _: None,
    further: Recorders = lambda _: (),
) -> PressureShot:
    """Run a blast and record pictures of two planes.

    Args:
        blast: The blast.
        height_m: Height of the plan.
        section: The section.
        progress: Called from time to time with the elapsed share of the time limit.
        further: Further recorders, as for `GasBlast.run`.

    Raises:
        BlastEnvError: If a plane is outside the grid.
    """
    made: list[Snapshots] = []
    scale = cbrt(blast.site.charge.tnt_kg / 100.0)
    times_s = (scale * np.arange(0.0, _LONGEST_S, _EVERY_S)).tolist()

    def recorders(grid: GasGrid) -> Sequence[Recorder]:
        cell = _cell_of(grid, blast.site, height_m, section)
        made.extend(Snapshots(grid, axis, cell[axis], times_s) for axis in (2, section.normal))
        return (*made, *further(grid))

    result = blast.run(progress, recorders)
    opening = spherical_stage(result.run.charge, result.run.remap_radius_m)
    return PressureShot(result, section, opening, (made[0], made[1]))


def _cell_of(
    grid: GasGrid, site: BlastSite, height_m: float, section: VerticalSection
) -> tuple[int, int, int]:
    """Return a cell on both planes.

    Raises:
        BlastEnvError: If a plane is outside the grid.
    """
    place = [*site.site_m.centre]
    place[section.normal] = section.at_m
    return grid.cell_at((place[0], place[1], height_m))
