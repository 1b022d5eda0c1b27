"""Blasts for the page: loads, histories and pictures, on one colour scale.

All colour scales of a site come from the blast without a barrier under the same threat, so that
earlier pictures stay comparable when a layout is added.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Final, Literal

import numpy as np

from blast_env.app.kept import FileRecord, read_kept, write_kept
from blast_env.app.work import StatusWriter, TaskWithBlasts
from blast_env.evaluation import BlastStore, LoadCase
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import BlastMeasurement, GasBlast, GasEngine, GasResult
from blast_env.files import make_folder, write_atomically
from blast_env.gas.engine import Recorders
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.plots.figures import save_figure
from blast_env.plots.gas import facades, full_load, gauge_history
from blast_env.plots.ground_map import ground_map, ground_recorders, map_levels
from blast_env.plots.pressure_film import PlaneRecorder, scale_end_kpa
from blast_env.plots.pressure_frames import PressurePainter, PressureShot
from blast_env.plots.style import render_extra
from blast_env.provenance import versions
from blast_env.runner import share_of
from blast_env.site import load_scenario
from blast_env.units import PA_PER_KPA

with render_extra():
    from PIL import Image

FRAMES: Final = 48
_FRAME_MS: Final = 95
_FILM_PX: Final = 640
_FILM: Final = "film.webp"
_LEAST_SHOWN: Final = 0.05  # of the end of a film's scale
_QUALITY: Final = 82


class Scale(FileRecord):
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


class Picture(FileRecord):
    """A picture of a blast: its file, its label and what it shows."""

    file: str
    label: str
    kind: Literal["film", "map", "walls", "gauge"]


class BlastPictures(FileRecord):
    """The pictures of a blast; written last, the file marks a complete blast.

    Attributes:
        seconds: Duration of the run and of the drawing, s.
        repeat: The data to run it again: scenario hash, charge, versions.
    """

    pictures: tuple[Picture, ...] = ()
    seconds: float
    repeat: dict[str, Any]


PICTURES: Final = "pictures.json"
"""Name of the file of `BlastPictures` in the folder of a blast."""


@dataclass(frozen=True, kw_only=True)
class BlastTask(TaskWithBlasts):
    """Blasts of one layout, one per threat.

    Attributes:
        blasts: Folder for the pictures of blasts, each under its key.
    """

    layout: Layout
    blasts: Path

    def __call__(self, writer: StatusWriter) -> None:
        """Run one blast per threat with the layout, and one without a barrier for comparison.

        Blasts with a record and pictures are not run again. The worst threat of the layout runs on
        coarser cells at the end, for the grid error.
        """
        engine, store = GasEngine.with_cells(self.cells), BlastStore(self.cache)
        layouts = {"": (), "layout": load_relevant(self.layout)}

        def campaign(names: Iterable[str], threats: Sequence[LoadCase]) -> Campaign:
            chosen = {name: layouts[name] for name in names}
            return Campaign.on(self.site, chosen, threats, engine, engine.coarser, store)

        # The scale is that of the blast without a barrier, which comes first.
        pairs = [(threat, name) for threat in self.threats for name in layouts]
        whole = campaign(layouts, self.threats)
        for number, (threat, name) in enumerate(pairs):
            keys = [whole.evaluator.key(layouts[side], threat).digest for side in ("", name)]
            bare, folder = (self.blasts / key for key in keys)
            is_known = whole.evaluator.known(layouts[name], threat) is not None
            if not (is_known and read_kept(BlastPictures, folder / PICTURES)):
                one = replace(campaign([name], [threat]), coarser=None)
                one.run(share_of(writer.share, number, len(pairs)), _BlastDrawing(folder, bare))
        whole.run()
        writer.write(state="done", share=1.0, text="done")


class _BlastDrawing:
    """Draws a blast into its folder.

    Args:
        folder: The folder.
        bare: That of the same threat without a barrier, which has the scale.
    """

    def __init__(self, folder: Path, bare: Path) -> None:
        self._folder, self._bare = folder, bare
        self._began_s = perf_counter()

    def recorders(self, blast: GasBlast) -> Recorders:
        """Return what makes the recorders of the film and of the ground."""
        self._planes = PlaneRecorder(blast)
        return lambda grid: (*self._planes.recorders(grid), *ground_recorders(grid))

    def draw(self, found: BlastMeasurement) -> None:
        """Draw film, maps, walls and gauges."""
        folder, result = self._folder, found.result
        make_folder(folder)
        shot = self._planes.shot(result)
        scale = _scale(shot, self._bare / _SCALE)
        if folder == self._bare:
            write_kept(scale, folder / _SCALE)
        film, charge = _film(shot, scale, folder), result.run.site.charge
        drawn = BlastPictures(
            pictures=(film, *_pictures(result, scale, folder)),
            seconds=perf_counter() - self._began_s,
            repeat={
                "scenario hash": result.blast.scenario.content_hash,
                "charge": [list(charge.position_m), charge.tnt_kg, charge.height_m],
                "versions": versions(),
            },
        )
        write_kept(drawn, folder / PICTURES)


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
        levels={quantity: map_levels(result, quantity) for quantity in _QUANTITIES},
        walls={
            name: {quantity: full_load(result, name, quantity) for quantity in _QUANTITIES}
            for name in _facades_of(result)
        },
    )


def _last_seen_s(shot: PressureShot, film_kpa: float) -> float:
    """Return the time of the last overpressure that the colours of a film show, s."""
    least_pa = _LEAST_SHOWN * film_kpa * PA_PER_KPA
    frames = shot.planes[0].frames
    seen = [frame.time_s for frame in frames if np.nanmax(frame.overpressure_pa) >= least_pa]
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
        yield Picture(file=name, label=f"{quantity} over the ground", kind="map")
    for building in _facades_of(result):
        title = result.blast.scenario.title_of(building)
        for quantity in _QUANTITIES[::-1]:
            name = f"walls_{building}_{quantity}.png"
            full = scale.walls.get(building, {}).get(quantity)
            save_figure(facades(result, building, quantity, full=full), folder / name)
            yield Picture(file=name, label=f"{quantity} on the walls of {title}", kind="walls")
    for number, gauge in enumerate(result.gauges["name"]):
        name = f"gauge_{number}.png"
        save_figure(gauge_history(result, gauge), folder / name)
        yield Picture(file=name, label=f"gauge {gauge}", kind="gauge")


def _film(shot: PressureShot, scale: Scale, folder: Path) -> Picture:
    painter = PressurePainter([shot], scale.film_kpa, _FILM_PX)
    times_s = np.linspace(0.0, scale.until_s, FRAMES).tolist()
    frames = [Image.fromarray(painter.paint(time_s)) for time_s in times_s]
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
    return Picture(file=_FILM, label="film", kind="film")
