"""Tables and figures of docs/engineers/gas.md on the checks of the gas engine."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from math import cbrt, isnan
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.arrays import FloatArray
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.design.rules import random_layout, wall_near_building, wall_near_charge
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.speed import street
from blast_env.files import make_folder
from blast_env.geometry import Layout
from blast_env.layout.build_scene import draw_charge
from blast_env.particles.run import EndReason
from blast_env.plots.figures import save_figure
from blast_env.runner import run_all
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S, PA_PER_KPA
from studies.gas.cells import CellLoads, cell_loads, difference
from studies.gas.corners import EXPERIMENT, REGIONS, ExperimentalBand, corner_waves
from studies.gas.definition import LONG_RUNS, LongRun, both_loads
from studies.gas.ending import Ending, ending, layouts, sites
from studies.gas.growing import OFF_COLUMNS, cell_choice, engine_with
from studies.gas.judgement import Judgement
from studies.gas.judgement import judge as judgement
from studies.gas.loads import (
    impulse_until,
    load_from_radius,
    with_heights,
    yard,
)
from studies.gas.oblique import oblique_loads
from studies.gas.reference import extrapolated_peak, free_field, order_found, wide_wall
from studies.gas.refinement import refined_blast
from studies.gas.sources import source_ratios, trade_off_figure

CELLS_M: Final = {20.0: 0.25, 100.0: 0.5, 1000.0: 0.5}
"""Side of the cells in comparisons with Kingery and Bulmash, by the mass of the charge in kg."""
PEAK_CHARGE_KG: Final = 100.0
PEAK_DISTANCE_M: Final = 12.5
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
def source(cell: Cell = 0.5, out: Path = Path("out/gas_source.png")) -> None:
    """Print and draw possible sources for the charge against Kingery and Bulmash.

    The charge is 100 kg on the ground. No source matches both incident and reflected impulses.
    """
    with user_errors():
        make_folder(out.parent)
        with progress_bar("sources") as progress:
            found = source_ratios(cell_m=cell, progress=progress)
        rows = [
            (
                each.name,
                ", ".join(f"{wall.z_m_kg:.2f}" for wall in each.reflected),
                ", ".join(f"{wall.impulse:.3f}" for wall in each.reflected),
                ", ".join(f"{wave.impulse:.3f}" for wave in each.incident),
                ", ".join(f"{wall.arrival:.3f}" for wall in each.reflected),
            )
            for each in found
        ]
        headers = ("source", "Z (m/kg^(1/3))", "reflected", "incident", "arrival at the wall")
        print_line(markdown_table(headers, rows))
        print_line(f"wrote {save_figure(trade_off_figure(found, cell), out)}")


@app.command()
def kingery_bulmash(
    charges: Annotated[str, typer.Option(help="kg, separated by commas.")] = "20,100,1000",
    distances: Annotated[
        str, typer.Option(help="m/kg^(1/3), separated by commas.")
    ] = "1.7,2.15,2.7,3.45,4.3,5.4,8.6",
    peak_cells: Annotated[
        str, typer.Option(help="m, for 100 kg at 12.5 m; empty: leave that table out.")
    ] = "1,0.5,0.25",
) -> None:
    """Compare the waves of charges on the ground with Kingery and Bulmash.

    Peak specific impulses, arrivals and peaks over the curves; then the reflected impulse and peak
    by the size of the cells.
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
        of_sizes = []
        for cell_m in _numbers(peak_cells):
            ratio = wide_wall(PEAK_CHARGE_KG, PEAK_DISTANCE_M, cell_m)
            cells = f"{cbrt(PEAK_CHARGE_KG) / cell_m:.1f}"
            of_sizes.append((f"{cell_m:g}", cells, f"{ratio.impulse:.3f}", f"{ratio.peak:.3f}"))
        if of_sizes:
            columns = ("cell (m)", "cells per kg^(1/3)", "reflected impulse", "reflected peak")
            print_line("\n" + markdown_table(columns, of_sizes))


@app.command()
def peaks(
    distances: Annotated[
        str, typer.Option(help="m/kg^(1/3), separated by commas.")
    ] = "1.7,2.7,4.3,5.4",
    sizes: Annotated[
        str, typer.Option(help="m, three, each half of the one before.")
    ] = "1,0.5,0.25",
) -> None:
    """Print reflected peaks of 100 kg over the curve, by the size of cells, and extrapolated.

    From the two smallest sizes, with a fixed order; the order found from all three stands beside
    it.
    """
    rows = []
    with user_errors():
        for scaled in _numbers(distances):
            found = [
                wide_wall(PEAK_CHARGE_KG, scaled * cbrt(PEAK_CHARGE_KG), cell_m)
                for cell_m in _numbers(sizes)
            ]
            values = [each.peak for each in found]
            shown = (*values, order_found(values), extrapolated_peak(*values[-2:]))
            rows.append((f"{found[-1].z_m_kg:.2f}", *(f"{value:.2f}" for value in shown)))
    columns = ("Z (m/kg^(1/3))", *(f"{cell_m:g} m" for cell_m in _numbers(sizes)))
    print_line(markdown_table((*columns, "order found", "extrapolated"), rows))


@app.command()
def air_height(
    scenario: str = "courtyard",
    heights_m: Annotated[
        str, typer.Option("--heights", help="m, separated by commas.")
    ] = "9,12,18,24",
    until: Annotated[float, typer.Option(help="When loads are looked at, s.")] = 0.2,
    all_layouts: Annotated[bool, typer.Option(help="Also the wall near the charge.")] = False,
    cell: Cell = 0.5,
) -> None:
    """Print how loads depend on the height of the air, above which cells grow.

    Structures have real heights. Loads are compared with those at the last height of the air.
    """
    rows, wanted = [], _numbers(heights_m)
    with user_errors():
        loaded, engine = load_scenario(scenario), GasEngine(cell_m=cell)
        for name, layout in _rule_layouts(loaded).items():
            if name == "wall near the charge" and not all_layouts:
                continue
            sites = [with_heights(loaded, air_m=air_m) for air_m in wanted]
            loads = [impulse_until(GasBlast(site, layout, engine=engine), until) for site in sites]
            rows.append((name, *_against_last(loads)))
    print_line(markdown_table(("layout", *(f"{m:g} m" for m in wanted)), rows))


@app.command()
def handover(
    scenario: str = "courtyard",
    radii_m: Annotated[
        str, typer.Option("--radii", help="m, separated by commas.")
    ] = "1.5,3,4,6,8,12,16,22",
    until: Annotated[float, typer.Option(help="When loads are looked at, s.")] = 0.09,
    cell: Cell = 0.5,
) -> None:
    """Print how loads depend on the radius of the front at which the grid takes over.

    Without a barrier, with real heights. The radius is the same for all layouts of a scenario.
    """
    with user_errors():
        blast = GasBlast(with_heights(load_scenario(scenario)), engine=GasEngine(cell_m=cell))
        own_m = blast.engine.start_on(blast.site).handover_radius_m
        rows = [
            (f"{radius_m:g}", f"{load_from_radius(blast, radius_m, until):.1f}")
            for radius_m in _numbers(radii_m)
        ]
    print_line(markdown_table(("radius (m)", f"impulse (Pa s) at {until:g} s"), rows))
    print_line(f"the engine's own radius is {own_m:.3g} m")


@app.command()
def settling(
    scenario: str = "school_and_clinic",
    times_s: Annotated[
        str, typer.Option("--times", help="s, of 100 kg, separated by commas.")
    ] = "0.02,0.04,0.06,0.09,inf",
    until: Annotated[float, typer.Option(help="When loads are looked at, s.")] = 0.18,
    cell: Cell = 0.5,
) -> None:
    """Print how loads depend on the time at which the products settle.

    By default they never settle in the last column. A settled gas has a bound on its temperature,
    which lengthens the time step.
    """
    with user_errors():
        loaded, wanted = load_scenario(scenario), _numbers(times_s)
        engines = [GasEngine(cell_m=cell, settled_s=time_s) for time_s in wanted]
        rows = []
        for name, layout in _rule_layouts(loaded).items():
            blasts = [GasBlast(loaded, layout, engine=engine) for engine in engines]
            rows.append((name, *_against_last([impulse_until(each, until) for each in blasts])))
    print_line(markdown_table(("layout", *(f"{1e3 * time_s:g} ms" for time_s in wanted)), rows))


def _against_last(loads: list[float]) -> list[str]:
    """Return loads in Pa s as text, with their relative differences from the last one."""
    return [f"{load:.1f} ({100.0 * (load / loads[-1] - 1.0):+.2f} %)" for load in loads]


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
    processes: Processes = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Print the loads that runs miss, against longer runs, for two layouts per site."""
    with user_errors(), running_on(cluster):
        jobs = {
            (title, name): GasBlast(site, layout, engine=engine)
            for title, site, engine in sites(generated)
            for name, layout in layouts(site).items()
        }
        with progress_bar("blasts") as progress:
            run = partial(ending, times=times)
            found = run_all(run, list(jobs.values()), processes, progress)
    headers = ("site", "layout", "end (ms)", "CPU (s)", "largest share missed of a wall")
    rows = [(*job, *_ending_row(each)) for job, each in zip(jobs, found, strict=True)]
    print_line(markdown_table((*headers, "of all protected", "level", "later"), rows))
    limited = sum(each.reason is not EndReason.LOADS_KNOWN for each in found)
    print_line(
        f"{len(found)} blasts: at most {max(100.0 * each.missed for each in found):.2f} % of a wall"
        f" and {max(100.0 * each.missed_of_all for each in found):.2f} % of a site; {limited}"
        f" ended by the limit; {sum(len(set(each.levels)) > 1 for each in found)} levels differ"
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
        cases = [each for each in LONG_RUNS if not scenario or each.name in scenario]
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
    bare = both_loads(site, (), engine, until_s)
    for name, layout in placed.items() if site.build_zone else [("no barrier", ())]:
        if layout:
            found = both_loads(site, layout, engine, until_s)
            positive, peak = (
                f"{100.0 * (1.0 - own / without):.1f} %"
                for own, without in (
                    (found.positive_pa_s, bare.positive_pa_s),
                    (found.impulse_pa_s, bare.impulse_pa_s),
                )
            )
        elif name == "no barrier":
            found = bare
            positive, peak = f"{bare.positive_pa_s:,.0f} Pa s", f"{bare.impulse_pa_s:,.0f} Pa s"
        else:
            continue
        times_s = (found.reached_s, found.last_s, found.end_s)
        times = (f"{MS_PER_S * each:,.0f}" for each in times_s)
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
                *(found.told_peak_pa, found.largest_told_pa),
            )
            impulses = (found.impulse_pa_s, found.told_pa_s)
            rows.append(
                (
                    f"{angle_deg:g}",
                    *(f"{impulse:.0f}" for impulse in impulses),
                    *(f"{peak / PA_PER_KPA:.0f}" for peak in peaks_pa),
                    f"{1e3 * found.told_m:.1f}",
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
def refinement(
    scenario: str = "car_park",
    thresholds: Annotated[
        str, typer.Option(help="Jump of the pressure over the lower of two neighbours.")
    ] = "0.02,0.05,0.1,0.2",
    every: Annotated[float, typer.Option(help="When blocks are counted, s.")] = 0.01,
) -> None:
    """Print the cost of perfect refinement in blocks of 4 x 4 x 4 cells, without overhead.

    Blocks at protected walls are always refined once the blast has reached them.
    """
    with user_errors():
        blast = refined_blast(load_scenario(scenario), _numbers(thresholds), every)
    headers = ("cells", "threshold", "blocks refined (%)", "million updates", "CPU s")

    def row(cells: str, threshold: str, share: str, times: float) -> tuple[str, ...]:
        updates, cpu_s = 1e-6 * times * blast.updates, times * blast.cpu_s
        return cells, threshold, share, f"{updates:,.0f}", f"{cpu_s:.1f}"

    rows = [row("0.5 m, as run", "", "", 1.0), row("0.25 m", "", "", 16.0)]
    for each in blast.found:
        shown = f"{each.threshold:g}", f"{100.0 * each.share:.0f}"
        rows += [row("0.5, 1 m", *shown, each.coarse), row("0.25, 1 m", *shown, each.fine)]
    print_line(markdown_table(headers, rows))


@app.command()
def growing(
    scenario: Annotated[str, typer.Option(help="In the place of a street with 500 kg.")] = "",
    length: Annotated[float, typer.Option(min=20.0, help="Of the street, m.")] = 100.0,
    choices: Annotated[str, typer.Option(help="Sides in m, `coarse` and `fine`.")] = (
        "0.5,coarse,fine,0.25"
    ),
    until: Annotated[float | None, typer.Option(help="When blasts end, s.")] = None,
) -> None:
    """Print the errors and costs of growing cells, relative to the last choice."""
    with user_errors():
        site = load_scenario(scenario) if scenario else street(length)
        charge = draw_charge(site, 0)
        layouts = {"no barrier": (), "wall near the building": wall_near_building(site, charge)}
        engines = [engine_with(choice, until) for choice in choices.split(",")]
        found = {
            name: [cell_choice(site, layout, engine) for engine in engines]
            for name, layout in layouts.items()
        }
        rows = []
        for name, of_layout in found.items():
            for each, bare in zip(of_layout, found["no barrier"], strict=True):
                ways = [each.off_percent(of_layout[-1], column) for column in OFF_COLUMNS]
                rows.append(
                    (
                        *(each.cells, name, f"{each.cpu_s:.0f}", f"{1e-6 * each.updates:.0f}"),
                        *(f"{each.impulse_pa_s:.1f}",),
                        f"{100.0 * (1.0 - each.impulse_pa_s / bare.impulse_pa_s):.2f}",
                        *(f"{mean:.1f}, {most:.1f}" for mean, most in ways),
                    )
                )
        headers = ("cells", "layout", "CPU s", "million updates", "impulse (Pa s)")
        off = ("impulse of walls off by (%): mean, most", "peak of walls")
        print_line(markdown_table((*headers, "taken off (%)", *off), rows))


@app.command()
def cells(
    scenario: Annotated[
        str, typer.Option(help=f"{YARD!r} is a small site for small cells.")
    ] = YARD,
    endless: Annotated[bool, typer.Option(help="Everything as high as the air.")] = False,
    charges: Annotated[int, typer.Option(min=1, help="Charges, those of seeds from 0.")] = 1,
    random_layouts: Annotated[int, typer.Option(min=0)] = 2,
    sizes: Annotated[
        str, typer.Option(help="Sides in m, `coarse` and `fine`, from coarse to fine; all layouts.")
    ] = "0.5,0.25",
    finest: Annotated[
        float | None, typer.Option(help="m, for none and the first three layouts only.")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="When loads are looked at, s; at the end of the runs.")
    ] = None,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Print the effect of cell size on loads, reductions and the order of layouts."""
    with user_errors(), running_on(cluster):
        site = _cells_site(scenario, endless)
        for seed in range(charges):
            charge = draw_charge(site, seed)
            run = partial(cell_loads, site, charge=charge, until_s=until, processes=processes)
            _print_cells(site, charge, random_layouts, (sizes.split(","), finest), run)


def _cells_site(scenario: str, endless: bool) -> Scenario:
    if scenario == YARD:
        return yard()
    loaded = load_scenario(scenario)
    has_heights = any(each.height_m is not None for each in loaded.structures)
    return loaded if endless or has_heights else with_heights(loaded)


def _print_cells(
    site: Scenario,
    charge: Charge,
    random_layouts: int,
    sizes: tuple[list[str], float | None],
    run: Callable[..., CellLoads],
) -> None:
    rules: dict[str, Callable[[Scenario, Charge], Layout]] = {
        "wall near the charge": wall_near_charge,
        "wall near the building": wall_near_building,
    }
    layouts = {name: rule(site, charge) for name, rule in rules.items()}
    layouts |= _random_layouts(site, random_layouts)
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
        ("no barrier (Pa s)", *(f"{each.unprotected_pa_s:.1f}" for each in found)),
        *(
            (name, *(_reduction(each.reduction.tolist(), number) for each in found))
            for number, name in enumerate(layouts)
        ),
        ("CPU time of a blast (s)", *(f"{each.cpu_s:.1f}" for each in found)),
    ]
    print_line(markdown_table(("", *(each.cells for each in found)), rows) + "\n")
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
    heights: Annotated[
        str, typer.Option(help="Heights of the block, m; empty: as high as wide.")
    ] = "",
) -> None:
    """Print the impulse behind one and two corners of a block, over the free field's."""
    rows = []
    with user_errors():
        wanted: list[float | None] = [*_numbers(heights)] or [None]
        for height_m in wanted:
            for cell_m in _numbers(sizes):
                waves = corner_waves(cell_m, height_m)
                for region in REGIONS:
                    gauges, band = waves.gauges_of(region), EXPERIMENT.get(region)
                    rows.append(
                        (
                            f"{waves.height_m:g}",
                            f"{cell_m:g}",
                            region.replace("_", " "),
                            "-" if band is None else f"{band.value:.2f} ± {band.tolerance:.2f}",
                            "-" if band is None else _within(gauges, band),
                            f"{waves.mean(region):.2f}",
                            f"{gauges.min():.2f} to {gauges.max():.2f}",
                        )
                    )
    headers = ("block (m high)", "cell (m)", "gauges", "experiments", "within", "impulse")
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
    store: Annotated[
        Path | None, typer.Option(help="Folder from which a study that was broken off goes on.")
    ] = None,
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
            found = judgement(chosen, layouts, drawn, seeds, processes, progress, store=store)
    headers = ("preset", "mean (gas)", "overstated", "rank correlation", "by charge", "regret")
    rows = [(preset, *_judgement_row(each)) for preset, each in found.items()]
    print_line(markdown_table((*headers, "best factor", "error with it", "without"), rows))


def _judgement_row(found: Judgement) -> tuple[str, ...]:
    particle, gas = found.means
    error, spread = found.errors
    return (
        f"{100.0 * particle:.1f} % ({100.0 * gas:.1f} %)",
        f"{found.overstatement:.1f} times",
        f"{found.all_pairs:.2f}",
        ", ".join(f"{each:.2f}" for each in found.rank_correlations),
        f"{100.0 * found.regret.value:.1f} points",
        f"{found.factor:.2f}",
        f"{100.0 * error:.1f} points",
        f"{100.0 * spread:.1f} points",
    )


if __name__ == "__main__":
    app()
