"""Tables of docs/engineers/gas.md on the checks of the gas engine."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from math import cbrt, isnan
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.cli.options import CacheOption, ClusterAddress, resume_words, running_on
from blast_env.cli.output import progress_bar, resumable, user_errors
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.geometry import Layout
from blast_env.layout.build_site import draw_charge
from blast_env.results import EndReason
from blast_env.rules import random_layout, wall_near_building, wall_near_charge
from blast_env.runner import run_all
from blast_env.site import Scenario, load_scenario
from blast_env.site.blast_site import Charge
from blast_env.store import Store
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S, PA_PER_KPA
from studies.gas.cells import CellLoads, cell_loads, difference, engine_with
from studies.gas.corners import EXPERIMENT, REGIONS, ExperimentalBand, corner_waves
from studies.gas.definition import LONG_RUNS, LongRun, both_loads
from studies.gas.ending import Ending, ending, layouts, sites
from studies.gas.judgement import Judgement
from studies.gas.judgement import judge as judgement
from studies.gas.loads import yard
from studies.gas.oblique import oblique_loads
from studies.gas.peaks import ENGINES, FACADES, facade_load
from studies.gas.reference import free_field, wide_wall

CELLS_M: Final = {20.0: 0.25, 100.0: 0.5, 1000.0: 0.5}
"""Side of the cells in comparisons with Kingery and Bulmash, by the mass of the charge in kg."""
YARD: Final = "yard"

Cell = Annotated[float, typer.Option(help="Side of a cell, m.")]
Processes = Annotated[int, typer.Option(min=1)]
app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


def _numbers(text: str) -> list[float]:
    """Parse a list of numbers separated by commas; an empty text has none."""
    try:
        return [float(part) for part in text.split(",") if part]
    except ValueError as error:
        raise typer.BadParameter(f"{text!r}: {error}") from error


@app.command()
def kingery_bulmash(
    charges: Annotated[str, typer.Option(help="kg, separated by commas.")] = "20,100,1000",
    distances: Annotated[
        str, typer.Option(help="m/kg^(1/3), separated by commas.")
    ] = "1.7,2.15,2.7,3.45,4.3,5.4,8.6",
) -> None:
    """Compare the waves of charges on the ground with Kingery and Bulmash.

    Peak specific impulses, arrivals and peaks over the curves.
    """
    headers = ("charge (kg)", "cell (m)", "", "Z (m/kg^(1/3))", "impulse", "arrival", "peak")
    wanted, rows = _numbers(distances), []
    with user_errors():
        for charge_kg in _numbers(charges):
            cell_m = CELLS_M.get(charge_kg, 0.5)
            walls = [wide_wall(charge_kg, z * cbrt(charge_kg), cell_m) for z in wanted]
            waves = free_field(charge_kg, wanted, cell_m)
            for name, ratios in (("reflected", walls), ("incident", waves)):
                for ratio in ratios:
                    values = (ratio.impulse, ratio.arrival, ratio.peak)
                    start = (f"{charge_kg:g}", f"{cell_m:g}", name, f"{ratio.z_m_kg:.2f}")
                    rows.append((*start, *(f"{value:.3f}" for value in values)))
        print_line(markdown_table(headers, rows))


@app.command()
def peaks(
    facades: Annotated[int, typer.Option(min=1, help="Charges before a facade.")] = len(FACADES),
) -> None:
    """Print the loads opposite a charge before a facade, over the curves, by the cells."""
    headers = ("charge (kg)", "distance (m)", "cells", "peak", "impulse", "CPU (s)")
    rows = []
    with user_errors():
        facade_load(*FACADES[0], ENGINES[0])  # compiles
        for charge_kg, distance_m in FACADES[:facades]:
            for engine in ENGINES:
                load = facade_load(charge_kg, distance_m, engine)
                start = (f"{charge_kg:g}", f"{distance_m:g}", engine.cell_words)
                numbers = (f"{load.peak:.2f}", f"{load.impulse:.2f}", f"{load.cpu_s:.1f}")
                rows.append((*start, *numbers))
        print_line(markdown_table(headers, rows))


def _rule_layouts(scenario: Scenario) -> dict[str, Layout]:
    """Return the layouts of no barrier and the two rules, for the charge of seed 0."""
    charge = draw_charge(scenario, 0)
    return {
        "no barrier": (),
        "wall near the charge": wall_near_charge(scenario, charge),
        "wall near the building": wall_near_building(scenario, charge),
    }


def _random_layouts(scenario: Scenario, count: int) -> dict[str, Layout]:
    rng = np.random.default_rng(0)
    return {f"random {number}": random_layout(scenario, rng) for number in range(1, count + 1)}


@app.command("ending")
def endings(
    generated: Annotated[
        int, typer.Option(min=0, help="Generated sites of each family, beside the bundled ones.")
    ] = 17,
    times: Annotated[float, typer.Option(min=1.0, help="Length of the longer runs.")] = 4.0,
    cache: CacheOption = None,
    processes: Processes = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Print the loads that runs miss, against longer runs, for two layouts per site."""
    with user_errors(), running_on(cluster), resumable(resume_words(cache)):
        jobs = {
            (title, name): GasBlast(site, layout, engine=engine)
            for title, site, engine in sites(generated)
            for name, layout in layouts(site).items()
        }
        with progress_bar("blasts") as progress:
            run = partial(
                ending,
                times=times,
                store=None if cache is None else Store(cache / "endings.sqlite"),
            )
            found = run_all(run, list(jobs.values()), processes, progress)
    headers = ("site", "layout", "end (ms)", "CPU (s)", "largest share missed of a wall")
    rows = [(*job, *_ending_row(result)) for job, result in zip(jobs, found, strict=True)]
    print_line(markdown_table((*headers, "of all protected", "level", "later"), rows))
    limited = sum(result.reason is not EndReason.LOADS_KNOWN for result in found)
    differing = sum(len(set(result.levels)) > 1 for result in found)
    print_line(
        f"{len(found)} blasts: at most {max(100.0 * result.missed for result in found):.2f} % of a"
        f" wall and {max(100.0 * result.missed_of_all for result in found):.2f} % of a site;"
        f" {limited} ended by the limit; {differing} levels differ"
    )


def _ending_row(found: Ending) -> tuple[str, ...]:
    return (
        f"{MS_PER_S * found.time_s:.0f}",
        f"{found.cpu_s:.1f}",
        f"{100.0 * found.missed:.2f} %",
        f"{100.0 * found.missed_of_all:.2f} %",
        *("-" if level is None else str(level) for level in found.levels),
    )


@app.command()
def definition(
    scenario: Annotated[
        list[str] | None, typer.Option(help="Sites; all of the table unless given.")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="Length of the long runs, s; that of the table's.")
    ] = None,
) -> None:
    """Print loads, and reductions of walls, by the sum of all positive phases and by the load.

    The load is the peak specific impulse. Charge, rules and random layout are those of seed 0.
    """
    rows: list[tuple[str, ...]] = []
    with user_errors():
        cases = [long_run for long_run in LONG_RUNS if not scenario or long_run.name in scenario]
        with progress_bar("blasts") as progress:
            for number, case in enumerate(cases, start=1):
                rows += _definition_rows(case, case.until_s if until is None else until)
                progress(number / len(cases))
        headers = ("site", "cells", "layout", "sum of positive phases", "peak specific impulse")
        times = ("reached after (ms)", "last face (ms)", "run ends (ms)")
        print_line(markdown_table((*headers, *times), rows))


def _definition_rows(case: LongRun, until_s: float) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a site: no barrier with loads in Pa s, layouts with reductions."""
    site, engine = case.site, case.engine
    placed = {"no barrier": (), **_rule_layouts(site), **_random_layouts(site, 1)}
    unprotected = both_loads(site, (), engine, until_s)
    for name, layout in placed.items() if site.build_zone else [("no barrier", ())]:
        if layout:
            found = both_loads(site, layout, engine, until_s)
            positive, peak = (
                f"{100.0 * (1.0 - own / without):.1f} %"
                for own, without in (
                    (found.positive_pa_s, unprotected.positive_pa_s),
                    (found.impulse_pa_s, unprotected.impulse_pa_s),
                )
            )
        elif name == "no barrier":
            found = unprotected
            positive, peak = (
                f"{unprotected.positive_pa_s:,.0f} Pa s",
                f"{unprotected.impulse_pa_s:,.0f} Pa s",
            )
        else:
            continue
        times_s = (found.reached_s, found.last_s, found.end_s)
        times = (f"{MS_PER_S * time_s:,.0f}" for time_s in times_s)
        yield case.name, case.cells, name, positive, peak, *times


@app.command()
def oblique(
    angles: Annotated[str, typer.Option(help="Degrees, separated by commas.")] = "0,20,30,45",
    until: Annotated[str, typer.Option(help="What a blast waits for.")] = "structures",
    cell: Cell = 0.5,
) -> None:
    """Print the loads on a facade of 12 m that is turned against the grid and faces the charge.

    Loads are those on cell faces, and those in tables and responses, on bays of 3 m along the
    normal of the facade.
    """
    rows = []
    with user_errors():
        for angle_deg in _numbers(angles):
            found = oblique_loads(angle_deg, cell, until)
            peaks_pa = (
                *(found.mean_peak_pa, found.largest_peak_pa),
                *(found.covered_peak_pa, found.largest_stated_pa),
            )
            impulses = (found.impulse_pa_s, found.covered_pa_s)
            rows.append(
                (
                    f"{angle_deg:g}",
                    *(f"{impulse:.0f}" for impulse in impulses),
                    *(f"{peak / PA_PER_KPA:.0f}" for peak in peaks_pa),
                    f"{1e3 * found.covered_m:.1f}",
                )
            )
    headers = ("turned by (degrees)", "impulse on faces (Pa s)", "reported")
    peaks = (
        "mean peak of faces (kPa)",
        "largest",
        "mean peak of bays, reported",
        "largest, reported",
    )
    print_line(markdown_table((*headers, *peaks, "deflection of a component of 10 ms (mm)"), rows))


@app.command()
def cells(
    scenario: Annotated[
        str, typer.Option(help=f"{YARD!r} is a small site for small cells.")
    ] = YARD,
    random_layouts: Annotated[int, typer.Option(min=0)] = 2,
    sizes: Annotated[
        str, typer.Option(help="Sides in m, `coarse` and `fine`, from coarse to fine; all layouts.")
    ] = "0.5,0.25",
    finest: Annotated[
        float | None, typer.Option(help="m, for none and the first three layouts only.")
    ] = None,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Print the effect of cell size on loads, reductions and the order of layouts."""
    with user_errors(), running_on(cluster):
        site = yard() if scenario == YARD else load_scenario(scenario)
        charge = draw_charge(site, 0)
        run = partial(cell_loads, site, charge=charge, processes=processes)
        _print_cells(site, charge, random_layouts, (sizes.split(","), finest), run)


def _print_cells(
    site: Scenario,
    charge: Charge,
    random_layouts: int,
    sizes: tuple[list[str], float | None],
    run: Callable[..., CellLoads],
) -> None:
    layouts = _rule_layouts(site) | _random_layouts(site, random_layouts)
    del layouts["no barrier"]
    all_sizes, finest = sizes
    jobs = [(size, list(layouts.values())) for size in all_sizes]
    if finest is not None:
        jobs.append((str(finest), list(layouts.values())[:3]))
    found = []
    for size, tried in jobs:
        engine = engine_with(size)
        with progress_bar(f"{site.name}, {engine.cell_words}") as progress:
            found.append(run(tried, engine=engine, progress=progress))
    x_m, y_m = charge.position_m
    print_line(f"{site.name}, {charge.tnt_kg:g} kg at ({x_m:.1f}, {y_m:.1f}) m")
    rows = [
        ("no barrier (Pa s)", *(f"{result.unprotected_pa_s:.1f}" for result in found)),
        *(
            (name, *(_reduction(result.reduction.tolist(), number) for result in found))
            for number, name in enumerate(layouts)
        ),
        ("CPU time of a blast (s)", *(f"{result.cpu_s:.1f}" for result in found)),
    ]
    print_line(markdown_table(("", *(result.cells for result in found)), rows) + "\n")
    rows = []
    for coarse, fine in combinations(found, 2):
        apart = difference(coarse, fine)
        rows.append(
            (
                f"{coarse.cells} less {fine.cells}",
                f"{100.0 * apart.impulse:+.2f} %",
                f"{100.0 * apart.reduction:+.2f}",
                f"{100.0 * apart.largest:+.2f}",
                "-" if isnan(apart.rank) else f"{apart.rank:.2f}",
            )
        )
    headers = ("", "impulse", "reduction (points)", "at most", "rank correlation")
    print_line(markdown_table(headers, rows) + "\n")


def _reduction(reductions: list[float], number: int) -> str:
    return f"{100.0 * reductions[number]:.1f} %" if number < len(reductions) else "-"


@app.command()
def corners(
    sizes: Annotated[str, typer.Option(help="Sides of cells, m.")] = "0.5,0.25",
) -> None:
    """Print the impulse behind one and two corners of a block, over the free field's."""
    rows = []
    with user_errors():
        for cell_m in _numbers(sizes):
            waves = corner_waves(cell_m)
            for region in REGIONS:
                gauges, band = waves.gauges_of(region), EXPERIMENT.get(region)
                rows.append(
                    (
                        f"{cell_m:g}",
                        region.replace("_", " "),
                        "-" if band is None else f"{band.value:.2f} ± {band.tolerance:.2f}",
                        "-" if band is None else _within(gauges, band),
                        f"{waves.mean(region):.2f}",
                        f"{gauges.min():.2f} to {gauges.max():.2f}",
                    )
                )
    headers = ("cell (m)", "gauges", "experiments", "within", "impulse")
    print_line(markdown_table((*headers, "gauge by gauge"), rows))


def _within(gauges: FloatArray, band: ExperimentalBand) -> str:
    """Return the number of gauges within a band as text."""
    low, high = band.bounds
    return f"{((gauges >= low) & (gauges <= high)).sum()} of {len(gauges)}"


@app.command()
def judge(
    scenario: str = "courtyard",
    random_layouts: Annotated[int, typer.Option(min=1)] = 58,
    charges: Annotated[int, typer.Option(min=1)] = 3,
    seeds: Annotated[int, typer.Option(min=1)] = 4,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Judge the presets of the particle model by gas dynamics: order, overstatement, regret.

    Layouts are random ones and the two walls by rule, under charges drawn from the scenario.
    """
    with user_errors(), running_on(cluster):
        chosen = load_scenario(scenario)
        rng = np.random.default_rng(0)
        drawn = [draw_charge(chosen, seed) for seed in range(charges)]
        layouts = [rule(chosen, drawn[0]) for rule in (wall_near_charge, wall_near_building)]
        layouts += [random_layout(chosen, rng) for _ in range(random_layouts)]
        with progress_bar(f"gas blasts in {chosen.name}") as progress:
            found = judgement(chosen, layouts, drawn, seeds, processes, progress)
    headers = ("preset", "mean (gas)", "overstated", "rank correlation", "regret")
    rows = [(preset, *_judgement_row(item)) for preset, item in found.items()]
    print_line(markdown_table(headers, rows))


def _judgement_row(found: Judgement) -> tuple[str, ...]:
    particle, gas = found.means
    return (
        f"{100.0 * particle:.1f} % ({100.0 * gas:.1f} %)",
        f"{found.overstatement:.1f} times",
        f"{found.all_pairs:.2f}",
        f"{100.0 * found.regret.value:.1f} points",
    )


if __name__ == "__main__":
    app()
