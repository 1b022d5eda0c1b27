"""Films of overpressure in the air, alone and side by side."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cbrt
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.physics.gas.engine import Recorders
from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.opening import opening_of
from blast_env.physics.gas.probes import Snapshots
from blast_env.physics.gas.solver import Recorder
from blast_env.rendering.film import FilmPlan, for_gif, known_suffix, open_film, plan_until
from blast_env.rendering.frames import Frame
from blast_env.rendering.gas import (
    PA_PER_KPA,
    check_comparable,
    gas_subtitle,
    layout_words,
)
from blast_env.rendering.pressure_frames import (
    PressurePainter,
    PressureShot,
    Section,
    default_section,
)
from blast_env.rendering.site_plan import in_metres
from blast_env.rendering.style import PAGE, nice_ceiling
from blast_env.simulation.gas import GasBlast, GasResult

_EVERY_S: Final = 0.0002  # of 100 kg
_LONGEST_S: Final = 4.0  # of 100 kg
_SHARE_OF_RUNS: Final = 0.5  # of the progress
_NARROWEST_PX, _WIDEST_PX = 480, 4096
_PLAN_HEIGHT_M: Final = 1.5


def write_pressure_film(
    blast: GasBlast,
    path: str | Path,
    *,
    beside: GasBlast | None = None,
    height_m: float = _PLAN_HEIGHT_M,
    section: Section | None = None,
    full_kpa: float | None = None,
    frames_per_s: float = 25.0,
    slow_motion: float | None = None,
    width_px: int | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[GasResult, ...]:
    """Run a blast and write a film of the overpressure in plan and in a section.

    Args:
        blast: The blast.
        path: The film, `.mp4` or `.gif`; a GIF is at most 640 pixels wide.
        beside: Another blast with the same site and charge, shown to the left, at the same moments
            and on the same scale: without the barrier, or with another layout.
        height_m: Height of the plan; the layer of cells that holds it is drawn.
        section: The section; without it `default_section`.
        full_kpa: Overpressure at the end of the scale; without it the largest peak on the walls
            that count, rounded up.
        frames_per_s: Frames in a second of the film.
        slow_motion: Seconds of the film for a second of the blast; by default it lasts about 10 s.
        width_px: Width of the film; 960, or 1600 with two blasts.
        progress: Called from time to time with the share of the work that is done.

    Returns:
        The results of the blasts, from left to right.

    Raises:
        BlastEnvError: If site or charge of the blasts differ, the suffix is another one, an
            argument is out of bounds or the file cannot be written; nothing is left behind then.
    """
    suffix = known_suffix(path)
    blasts = [blast] if beside is None else [beside, blast]
    check_comparable(blasts)
    if full_kpa is not None and not full_kpa > 0.0:
        raise BlastEnvError(f"full_kpa is {full_kpa:g}, must be above 0")
    width_px = width_px or (960 if beside is None else 1600)
    if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
        raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
    section = default_section(blast.site) if section is None else section
    with write_atomically(path) as temporary:
        shots = []
        for number, each in enumerate(blasts):
            part = _SHARE_OF_RUNS / len(blasts)
            shots.append(
                record_planes(each, height_m, section, _part(progress, number * part, part))
            )
        end_s = max(shot.result.time_s for shot in shots)
        plan = plan_until(end_s, frames_per_s, slow_motion)
        if suffix == ".gif":
            plan, width_px = for_gif(plan, width_px)
        full_kpa = scale_end_kpa([shot.result for shot in shots]) if full_kpa is None else full_kpa
        painter = PressurePainter(shots, full_kpa, width_px - width_px % 2)
        with open_film(suffix, temporary, plan, blast.scenario.name, _comment(shots, plan)) as film:
            for number in range(plan.frame_count):
                film.append(painter.paint(plan.time_s(number), plan.real_time_factor))
                drawn = (number + 1) / plan.frame_count
                progress(_SHARE_OF_RUNS + (1.0 - _SHARE_OF_RUNS) * drawn)
    return tuple(shot.result for shot in shots)


@dataclass(frozen=True)
class PressureScreening:
    """Shows a blast as overpressure, in frames of a size that something else sets.

    Attributes:
        blast: The blast.
        size_px: Width and height of the frames, both even.
    """

    blast: GasBlast
    size_px: tuple[int, int]

    def frames(self, frames_per_s: float) -> Iterator[Frame]:
        """Yield the frames of a film of 8 to 12 s, uint8 (height, width, 3) each.

        Args:
            frames_per_s: Frames in a second of the film.
        """
        shot = record_planes(self.blast, _PLAN_HEIGHT_M, default_section(self.blast.site))
        plan = plan_until(shot.result.time_s, frames_per_s)
        width_px, height_px = self.size_px
        painter = PressurePainter([shot], scale_end_kpa([shot.result]), width_px, height_px)
        for number in range(plan.frame_count):
            frame = painter.paint(plan.time_s(number), plan.real_time_factor)
            below = np.full((height_px - len(frame), width_px, 3), PAGE, dtype=np.uint8)
            yield np.concatenate([frame, below])


def _part(progress: Callable[[float], None], first: float, part: float) -> Callable[[float], None]:
    """Return the progress of a part of the work."""
    return lambda share: progress(first + part * share)


def _comment(shots: Sequence["PressureShot"], plan: FilmPlan) -> str:
    blasts = [shot.result.blast for shot in shots]
    scenario, layouts = blasts[-1].scenario, " | ".join(map(layout_words, blasts))
    return (
        f"{scenario.name}, {gas_subtitle(blasts)}, {layouts}, {plan.real_time_factor}, "
        f"scenario {scenario.content_hash}"
    )


def scale_end_kpa(results: Sequence[GasResult]) -> float:
    """Return the end of the scale: the largest peak on the walls that count, rounded up."""
    peaks = []
    for result in results:
        table = result.structures
        chosen = table[table["protected"]] if table["protected"].any() else table
        peaks.append(float(np.nan_to_num(chosen["peak_pa"].to_numpy()).max(initial=0.0)))
    return nice_ceiling(max(*peaks, 1.0) / PA_PER_KPA)


def record_planes(
    blast: GasBlast,
    height_m: float,
    section: Section,
    progress: Callable[[float], None] = lambda _: None,
    further: Recorders = lambda _: (),
) -> PressureShot:
    """Run a blast and take pictures of two planes all the while.

    Args:
        blast: The blast.
        height_m: Height of the plan.
        section: The section.
        progress: Called from time to time with the share of the time limit that has passed.
        further: Further recorders, as for `GasBlast.run`.

    Raises:
        BlastEnvError: If a plane is outside the grid.
    """
    made: list[Snapshots] = []
    site_m = in_metres(blast.site.site)
    scale = cbrt(blast.site.charge.tnt_kg / 100.0)
    times_s = (scale * np.arange(0.0, _LONGEST_S, _EVERY_S)).tolist()

    def recorders(grid: GasGrid) -> Sequence[Recorder]:
        place = [*site_m.centre]
        place[section.normal] = section.at_m
        cell = grid.cell_at((place[0], place[1], height_m))
        made.extend(Snapshots(grid, axis, cell[axis], times_s) for axis in (2, section.normal))
        return (*made, *further(grid))

    result = blast.run(progress, recorders)
    opening = opening_of(result.run.charge, result.run.handover_radius_m)
    return PressureShot(result, section, opening, (made[0], made[1]))
