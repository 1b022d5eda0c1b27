"""Blasts for the page: a film that starts early, loads and pictures, on one colour scale.

All colour scales of a site come from the blast without a barrier under the same threat, so that
earlier pictures stay comparable when a layout is added.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from blast_env.app import placing
from blast_env.app.records import (
    COARSE,
    FILM,
    FRAME,
    RECORD,
    BlastRecord,
    CoarseLoads,
    Film,
    Kept,
    Picture,
    Wave,
    blast_key,
    read_kept,
    read_record,
    worst_first,
    write_kept,
)
from blast_env.app.verdicts import keep_histories
from blast_env.app.work import BlastTask
from blast_env.evaluation import BlastEvaluator, BlastLoads, LoadCase, StructureLoad
from blast_env.evaluation.consequences import unchecked
from blast_env.evaluation.engines import Blast
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.files import make_folder, write_atomically
from blast_env.geometry import Layout
from blast_env.layout.build_scene import charge_against
from blast_env.layout.placement import load_relevant
from blast_env.particles.calibration.model import CalibrationError
from blast_env.plots.canvas import Frame
from blast_env.plots.figures import save_figure
from blast_env.plots.film import paint_at, plan_film, scale_end
from blast_env.plots.frames import FramePainter
from blast_env.plots.gas import Quantity, facades, full_load
from blast_env.plots.ground_map import ground_map, ground_recorders, map_levels
from blast_env.plots.pressure_film import record_planes, scale_end_kpa
from blast_env.plots.pressure_frames import (
    PressurePainter,
    PressureShot,
    default_section,
)
from blast_env.plots.style import render_extra
from blast_env.provenance import versions
from blast_env.runner import Tell, share_of
from blast_env.site import AnyCharge, Scenario, load_scenario
from blast_env.statistics import mean_estimate
from blast_env.units import MS_PER_S, PA_PER_KPA

with render_extra():
    from PIL import Image

SEEDS: Final = range(8)
"""Seeds of the particle blasts whose mean a load is."""

FRAMES: Final = 48
_FIRST_FRAMES: Final = 4  # playback can start after these; the count then grows in larger steps
_MORE_FRAMES: Final = 16
_FILM_PX: Final = 640
_PLAN_HEIGHT_M: Final = 1.5
_MOST_POINTS: Final = 600  # of a gauge's history
_LEAST_SHOWN: Final = 0.05  # of the end of a film's scale
_QUALITY: Final = 82


class Scale(Kept):
    """The colour scales of all blasts of one threat by gas dynamics.

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
_QUANTITIES: Final[tuple[Quantity, ...]] = ("peak", "impulse")


def warm_engines() -> None:
    """Run one small blast per engine, so that their compiled code is loaded for the next.

    That with growing cells is short, and ends before they merge, for which one function remains.
    """
    GasBlast(load_scenario("control_room"), engine=GasEngine(cells="coarse")).run()
    Blast(load_scenario("courtyard"), (), 0, "event").run()


def run_blasts(task: BlastTask, tell: Tell) -> None:
    """Run one blast per threat with the layout, and one without a barrier for comparison.

    Blasts with a complete record are not run again. The film of the first threat comes first. The
    worst threat of the layout runs on coarser cells at the end, for the error of the cells.

    Args:
        task: The site, layout, threats and engine.
        tell: Called with the completed share, 0 to 1.

    Raises:
        BlastEnvError: If a blast cannot be run.
    """
    scenario = task.site
    layout = load_relevant(placing.layout_from(scenario, task.layout))
    work: list[tuple[LoadCase, Layout]] = []
    for threat in task.threats:
        # Gas needs the scale of the blast without a barrier; particles show the layout first.
        both = [(threat, ()), (threat, layout)]
        work += both[::-1] if task.engine.is_first_look else both
    work = list(dict.fromkeys(work))
    for number, (threat, cells) in enumerate(work):
        part = share_of(tell, number, len(work))
        _run_one(task, scenario, threat, cells, part)
    _run_coarse(task, scenario, layout)


def _run_one(
    task: BlastTask, scenario: Scenario, threat: LoadCase, layout: Layout, tell: Tell
) -> None:
    charge = charge_against(scenario, layout, threat.charge)
    key = blast_key(scenario, layout, charge, task.engine)
    folder = Path(task.blasts) / key
    if read_record(folder) is not None:
        return
    make_folder(folder)
    began_s = perf_counter()
    run = _particles if task.engine.is_first_look else _gas
    found = run(task, scenario, layout, threat.charge, folder, tell)
    record = BlastRecord(
        key=key,
        threat=threat.name,
        engine=task.engine,
        layout=placing.plain(layout),
        seconds=perf_counter() - began_s,
        repeat={
            "scenario hash": scenario.content_hash,
            "charge": [list(charge.position_m), charge.tnt_kg, charge.height_m],
            "versions": versions(),
        },
        **found,
    )
    write_kept(record, folder / RECORD)


def _run_coarse(task: BlastTask, scenario: Scenario, layout: Layout) -> None:
    """Keep the loads with coarser cells under the charge with the largest load."""
    coarser = task.engine.coarser
    if coarser is None:
        return

    def folder_of(threat: LoadCase, cells: Layout) -> Path:
        charge = charge_against(scenario, cells, threat.charge)
        return Path(task.blasts) / blast_key(scenario, cells, charge, task.engine)

    def load(threat: LoadCase) -> float:
        record = read_record(folder_of(threat, layout))
        return nan if record is None else worst_first(scenario.objective, record)

    worst = max(task.threats, key=load)
    evaluator = BlastEvaluator(scenario, coarser.gas, cache=task.cache)
    for cells in dict.fromkeys([layout, ()]):
        path = folder_of(worst, cells) / COARSE
        if not path.is_file():
            found = evaluator.loads(cells, worst)
            write_kept(CoarseLoads(loads=found.structures), path)


# Particles.


def _particles(
    task: BlastTask, scenario: Scenario, layout: Layout, charge: AnyCharge, folder: Path, tell: Tell
) -> dict[str, Any]:
    blast = Blast(scenario, layout, 0, "event", charge)
    unprotected = Blast(scenario, (), 0, "event", charge).run()
    unit = unprotected.load_unit
    painter = FramePainter(
        blast,
        width_px=_FILM_PX,
        full_impulse=scale_end([unprotected], unit),
        unit=unit.with_loads_of(blast.run().load_unit) if layout else unit,
    )
    plan = plan_film(unprotected)
    times_s = np.linspace(0.0, plan.end_s, FRAMES).tolist()
    run = blast.start()
    frames = (paint_at(run, painter, time_s, plan.real_time_factor) for time_s in times_s)
    _write_film(frames, times_s, folder, share_of(tell, 0, 10, 5))
    notes = [*scenario.height_notes]
    kept: dict[str, Any] = {"loads": (), "unchecked": ()}
    if scenario.objective.needs_peaks:
        noun = scenario.objective.noun
        return kept | {"notes": (*notes, f"no loads: {noun} counts here; blast it with gas")}
    try:
        loads = _particle_loads(task, scenario, layout, charge, share_of(tell, 5, 10, 5))
    except CalibrationError as error:
        return kept | {"notes": (*notes, f"no loads: {error}")}
    notes += dict.fromkeys(note for each in loads for own in each.structures for note in own.notes)
    notes.append(f"particles overrate walls; mean over {len(SEEDS)} seeds, judge by gas")
    return kept | _mean_loads(scenario, loads) | {"notes": tuple(notes)}


def _particle_loads(
    task: BlastTask, scenario: Scenario, layout: Layout, charge: AnyCharge, tell: Tell
) -> list[BlastLoads]:
    evaluator = BlastEvaluator(scenario, "event", cache=task.cache)
    pairs = [(layout, LoadCase(charge, seed)) for seed in SEEDS]
    return evaluator.loads_of_many(pairs, progress=tell)


def _mean_loads(scenario: Scenario, loads: Sequence[BlastLoads]) -> dict[str, Any]:
    """Return the means over the seeds, and their intervals."""
    together = mean_estimate(np.array([each.protected_impulse_pa_s for each in loads]))
    means, intervals = [], {"": (together.low, together.high)}
    for number, structure in enumerate(scenario.structures):
        impulses_pa_s = [each.structures[number].impulse_pa_s for each in loads]
        mean = mean_estimate(np.array(impulses_pa_s))
        means.append(StructureLoad.on(structure, mean.value))
        intervals[structure.name] = mean.low, mean.high
    return {"loads": tuple(means), "intervals": intervals}


# Gas.


def _gas(
    task: BlastTask, scenario: Scenario, layout: Layout, charge: AnyCharge, folder: Path, tell: Tell
) -> dict[str, Any]:
    blast = GasBlast(scenario, layout, 0, task.engine.gas, charge)
    section = default_section(blast.site)
    height_m = min(_PLAN_HEIGHT_M, 0.5 * blast.site.air_height_m)
    recording = share_of(tell, 0, 100, 60)
    shot = record_planes(blast, height_m, section, recording, ground_recorders)
    result = shot.result
    bare_charge = charge_against(scenario, (), charge)
    bare_key = blast_key(scenario, (), bare_charge, task.engine)
    scale = _scale(shot, Path(task.blasts) / bare_key / _SCALE)
    if not layout:
        write_kept(scale, folder / _SCALE)
    evaluator = BlastEvaluator(scenario, task.engine.gas, cache=task.cache)
    evaluator.keep(layout, LoadCase(charge), result.loads())  # for searches, reports and others
    painter = PressurePainter([shot], scale.film_kpa, _FILM_PX)
    times_s = np.linspace(0.0, scale.until_s, FRAMES).tolist()
    frames = (painter.paint(time_s, "") for time_s in times_s)
    _write_film(frames, times_s, folder, share_of(tell, 60, 100, 25))
    keep_histories(result, folder)
    pictures = tuple(_pictures(result, scale, folder))
    notes = [note for name in result.structures["structure"] for note in result.impulse(name).notes]
    notes += [*result.stepped_notes, *result.gauge_notes]
    return {
        "loads": result.structure_loads,
        "notes": tuple(dict.fromkeys(notes)),
        "unchecked": (
            *unchecked(scenario, result),
            *((each.building, each.words) for each in result.unjudged),
        ),
        "pictures": pictures,
        "waves": tuple(_waves(result)),
    }


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


def _waves(result: GasResult) -> Iterator[Wave]:
    for row in result.gauges.to_dict("records"):
        history = result.history(row["name"])
        time_ms = MS_PER_S * history["time_s"].to_numpy()
        kpa = history["overpressure_pa"].to_numpy() / PA_PER_KPA
        chosen = _telling_points(kpa)
        yield Wave(
            gauge=str(row["name"]),
            peak_kpa=float(row["peak_pa"]) / PA_PER_KPA,
            impulse_pa_s=float(row["impulse_pa_s"]),
            time_ms=tuple(np.round(time_ms[chosen], 4).tolist()),
            overpressure_kpa=tuple(np.round(kpa[chosen], 4).tolist()),
        )


def _telling_points(values: Any) -> list[int]:
    """Return the indices of a thinned history: the extremes of each part, so that peaks stay."""
    if len(values) <= _MOST_POINTS:
        return list(range(len(values)))
    chosen = set()
    for part in np.array_split(np.arange(len(values)), _MOST_POINTS // 2):
        chosen |= {int(part[values[part].argmax()]), int(part[values[part].argmin()])}
    return sorted(chosen)


# Films.


def _write_film(
    frames: Iterator[Frame], times_s: Sequence[float], folder: Path, tell: Tell
) -> None:
    """Write the frames one by one; playback can start after the first few."""
    film = read_kept(Film, folder / FILM)
    if film is not None and film.count == len(film.time_ms):
        return
    times_ms = tuple(round(MS_PER_S * time_s, 3) for time_s in times_s)
    keep = partial(Film, time_ms=times_ms)
    for number, frame in enumerate(frames):
        with write_atomically(folder / FRAME.format(number)) as temporary:
            Image.fromarray(frame).save(temporary, quality=_QUALITY)
        done = number + 1
        if done in (_FIRST_FRAMES, len(times_s)) or done % _MORE_FRAMES == 0:
            write_kept(keep(count=done), folder / FILM)
        tell(done / len(times_s))
