"""Blasts for the page: loads, histories and pictures, on one colour scale.

All colour scales of a site come from the blast without a barrier under the same threat, so that
earlier pictures stay comparable when a layout is added.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Final

import numpy as np

from blast_env.app import placing
from blast_env.app.records import (
    COARSE,
    RECORD,
    BlastRecord,
    CoarseLoads,
    Picture,
    StoredRecord,
    blast_key,
    read_kept,
    read_record,
    worst_first,
    write_kept,
)
from blast_env.app.verdicts import keep_facades
from blast_env.app.work import StatusWriter
from blast_env.evaluation import BlastEvaluator, LoadCase
from blast_env.evaluation.consequences import consequences_of
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.files import make_folder, write_atomically
from blast_env.gas.settings import Cells
from blast_env.geometry import Layout
from blast_env.layout.build_site import charge_against
from blast_env.layout.placement import load_relevant
from blast_env.plots.figures import save_figure
from blast_env.plots.gas import facades, full_load, gauge_history
from blast_env.plots.ground_map import ground_map, ground_recorders, map_levels
from blast_env.plots.pressure_film import record_planes, scale_end_kpa
from blast_env.plots.pressure_frames import PressurePainter, PressureShot
from blast_env.plots.style import render_extra
from blast_env.provenance import versions
from blast_env.runner import ProgressCallback, share_of
from blast_env.site import Scenario, load_scenario
from blast_env.units import PA_PER_KPA

with render_extra():
    from PIL import Image

FRAMES: Final = 48
_FRAME_MS: Final = 95
_FILM_PX: Final = 640
_FILM: Final = "film.webp"
_LEAST_SHOWN: Final = 0.05  # of the end of a film's scale
_QUALITY: Final = 82


class Scale(StoredRecord):
    """The colour scales of all blasts of one threat.

    Attributes:
        film_kpa: End of the films' scale.
        until_s: End of all films: the last visible overpressure, so that all share their moments.
        levels: Contours of the maps, by quantity.
        walls: Ends of the walls' scales, by structure and quantity.
    """

    film_kpa: float
    until_s: float
    levels: dict[str, tuple[float, ...]]
    walls: dict[str, dict[str, float]]


_SCALE: Final = "scale.json"
_QUANTITIES: Final = ("peak", "impulse")


def warm_engine() -> None:
    """Run one small blast, so that the compiled code is loaded for the next.

    One with growing cells is short, and ends before they merge, for which one function remains.
    """
    GasBlast(load_scenario("control_room"), engine=GasEngine(cells="coarse")).run()


@dataclass(frozen=True, kw_only=True)
class BlastTask:
    """Blasts of one layout, one per threat.

    Attributes:
        site: The site.
        threats: The threats.
        cache: Folder for the loads of blasts.
        cells: The cells.
        layout: The layout.
        blasts: Folder for the blasts, each under its key.
    """

    site: Scenario
    threats: tuple[LoadCase, ...]
    cache: Path
    cells: Cells
    layout: Layout
    blasts: Path

    def __call__(self, writer: StatusWriter) -> None:
        """Run one blast per threat with the layout, and one without a barrier for comparison.

        Blasts with a complete record are not run again. The worst threat of the layout runs on
        coarser cells at the end, for the error of the cells.

        Raises:
            BlastEnvError: If a blast cannot be run.
        """
        layout = load_relevant(self.layout)
        # The scale is that of the blast without a barrier, which comes first.
        pairs = ((threat, each) for threat in self.threats for each in ((), layout))
        work = list(dict.fromkeys(pairs))
        for number, (threat, cells) in enumerate(work):
            self._run(threat, cells, share_of(writer.share, number, len(work)))
        self._run_coarse(layout)
        writer.write(state="done", share=1.0, text="done")

    def _folder_of(self, layout: Layout, threat: LoadCase) -> Path:
        charge = charge_against(self.site, layout, threat.charge)
        return self.blasts / blast_key(self.site, layout, charge, self.cells)

    def _run(self, threat: LoadCase, layout: Layout, tell: ProgressCallback) -> None:
        site, folder = self.site, self._folder_of(layout, threat)
        if read_record(folder) is not None:
            return
        make_folder(folder)
        began_s, engine = perf_counter(), GasEngine.with_cells(self.cells)
        blast = GasBlast(site, layout, 0, engine, threat.charge)
        recording = share_of(tell, 0, 100, 60)
        shot = record_planes(blast, progress=recording, recorders=ground_recorders)
        result = shot.result
        scale = _scale(shot, self._folder_of((), threat) / _SCALE)
        if not layout:
            write_kept(scale, folder / _SCALE)
        evaluator = BlastEvaluator(site, engine, cache=self.cache)
        evaluator.keep(layout, threat, result.loads())  # for searches, reports and others
        found = consequences_of(site, result, blast.site.charge)
        keep_facades(found, folder)
        film = _film(shot, scale, folder, share_of(tell, 60, 100, 25))
        names = result.structures["structure"]
        notes = [note for name in names for note in result.impulse(name).notes]
        notes += [*result.stepped_notes, *result.gauge_notes]
        unjudged = ((each.building, each.words) for each in found.unjudged)
        charge = blast.site.charge
        record = BlastRecord(
            key=folder.name,
            threat=threat.name,
            cells=self.cells,
            layout=placing.plain(layout),
            loads=result.structure_loads,
            notes=tuple(dict.fromkeys(notes)),
            unchecked=(*found.unchecked, *unjudged),
            pictures=(film, *_pictures(result, scale, folder)),
            seconds=perf_counter() - began_s,
            repeat={
                "scenario hash": site.content_hash,
                "charge": [list(charge.position_m), charge.tnt_kg, charge.height_m],
                "versions": versions(),
            },
        )
        write_kept(record, folder / RECORD)

    def _run_coarse(self, layout: Layout) -> None:
        """Keep the loads with coarser cells under the charge with the largest load."""
        coarser = GasEngine.with_cells(self.cells).coarser
        if coarser is None:
            return

        def load(threat: LoadCase) -> float:
            record = read_record(self._folder_of(layout, threat))
            assert record is not None
            return worst_first(self.site.objective, record)

        worst = max(self.threats, key=load)
        evaluator = BlastEvaluator(self.site, coarser, cache=self.cache)
        for cells in dict.fromkeys([layout, ()]):
            path = self._folder_of(cells, worst) / COARSE
            if not path.is_file():
                found = evaluator.loads(cells, worst)
                write_kept(CoarseLoads(loads=found.structures), path)


def _scale(shot: PressureShot, kept: Path) -> Scale:
    """Return the scale stored with the blast without a barrier; if none, that of this shot."""
    known = read_kept(Scale, kept)
    if known is not None:
        return known
    result = shot.result
    film_kpa = scale_end_kpa([result])
    return Scale(
        film_kpa=film_kpa,
        until_s=_last_seen_s(shot, film_kpa),
        levels={each: map_levels(result, each) for each in _QUANTITIES},
        walls={
            name: {each: full_load(result, name, each) for each in _QUANTITIES}
            for name in _facades_of(result)
        },
    )


def _last_seen_s(shot: PressureShot, film_kpa: float) -> float:
    """Return the time of the last overpressure that the colours of a film show, s."""
    least_pa = _LEAST_SHOWN * film_kpa * PA_PER_KPA
    frames = shot.planes[0].frames
    seen = [each.time_s for each in frames if np.nanmax(each.overpressure_pa) >= least_pa]
    return seen[-1] if seen else shot.result.time_s


def _facades_of(result: GasResult) -> list[str]:
    """Return the names of the protected buildings, whose walls are drawn."""
    table = result.buildings
    return [str(name) for name in table[table["protected"]]["building"]]


def _pictures(result: GasResult, scale: Scale, folder: Path) -> Iterator[Picture]:
    for quantity in _QUANTITIES:
        name = f"map_{quantity}.png"
        levels = scale.levels[quantity]
        save_figure(ground_map(result, quantity, levels=levels), folder / name)
        yield Picture(file=name, label=f"{quantity} over the ground")
    for building in _facades_of(result):
        title = result.blast.scenario.title_of(building)
        for quantity in _QUANTITIES[::-1]:
            name = f"walls_{building}_{quantity}.png"
            full = scale.walls.get(building, {}).get(quantity)
            save_figure(facades(result, building, quantity, full=full), folder / name)
            yield Picture(file=name, label=f"{quantity} on the walls of {title}")
    for number, gauge in enumerate(result.gauges["name"]):
        name = f"gauge_{number}.png"
        save_figure(gauge_history(result, gauge), folder / name)
        yield Picture(file=name, label=f"gauge {gauge}")


def _film(shot: PressureShot, scale: Scale, folder: Path, tell: ProgressCallback) -> Picture:
    painter = PressurePainter([shot], scale.film_kpa, _FILM_PX)
    frames = []
    for number, time_s in enumerate(np.linspace(0.0, scale.until_s, FRAMES).tolist(), start=1):
        frames.append(Image.fromarray(painter.paint(time_s)))
        tell(number / FRAMES)
    with write_atomically(folder / _FILM) as temporary:
        frames[0].save(
            temporary,
            "WEBP",
            save_all=True,
            append_images=frames[1:],
            duration=_FRAME_MS,
            loop=0,
            quality=_QUALITY,
        )
    return Picture(file=_FILM, label="film")
