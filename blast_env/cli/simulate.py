"""`blast-env simulate`: run one blast; print its loads and write its files."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from blast_env.answers.document import building_words, validation_lines
from blast_env.answers.pieces import pieces_answer
from blast_env.answers.terminal import print_line, print_parts, print_table
from blast_env.cli.command import PICTURES, writes
from blast_env.cli.options import (
    UNTIL_HELP,
    CellOption,
    CellsOption,
    ChargeInput,
    ChargeOption,
    EngineChoice,
    JsonOption,
    LayoutOption,
    ScenarioArgument,
    TntOption,
    refuse_given,
)
from blast_env.cli.output import print_json, print_written, progress_bar
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import JUDGE, BlastResult, Engine, find_engine
from blast_env.evaluation.record import StructureLoad, on_buildings
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.layout.build_site import draw_threat
from blast_env.plots.blast_files import BlastFiles
from blast_env.site import load_scenario
from blast_env.site.blast_site import Charge
from blast_env.tables import table_records
from blast_env.units import MS_PER_S, PA_PER_KPA

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasResult

_GAS: Final = "Gas dynamics only"
_PARTICLES: Final = "Particles only"
_PARTICLE_HEADERS: Final = (
    *("building", "protected", "modules", "hits", "impulse m|v| (sim)"),
    *("transferred (sim)", "impulse (Pa s)", "first hit (ms)"),
)
_GAS_HEADERS: Final = (
    *("building", "protected", "impulse (Pa s)", "captured"),
    *("peak (kPa)", "arrival (ms)", "most loaded wall", "roof (Pa s)"),
    "validation",
)
_GAUGES: Final = ("gauge", "x (m)", "y (m)", "z (m)", "peak (kPa)", "impulse (Pa s)", "captured")


def simulate(
    context: typer.Context,
    scenario: ScenarioArgument,
    layout: LayoutOption = None,
    seed: int = typer.Option(0, help="Decides charge, fan and air.", min=0),
    engine: EngineChoice = JUDGE,
    stand_off_m: float | None = typer.Option(
        None, "--stand-off", help="Distance from charge to facade, m (free_field)."
    ),
    film: Path | None = writes("Write a film", ".mp4", ".gif"),
    excel: Path | None = writes("Write a workbook", ".xlsx"),
    heat_map: Path | None = writes(
        "Write a picture of the load over the protected facades", *PICTURES
    ),
    history: Path | None = writes(
        "Write a picture of the load over time (gas: at --gauge)", *PICTURES
    ),
    side_by_side: bool = typer.Option(
        False, "--side-by-side", help="Show in all pictures the site without the barrier as well."
    ),
    cell_m: CellOption = None,
    cells: CellsOption = None,
    until: str | None = typer.Option(
        None, help=UNTIL_HELP, rich_help_panel=_GAS, show_default="structures"
    ),
    impulse_map: Path | None = writes(
        "Write a map of the impulse over the ground", *PICTURES, panel=_GAS
    ),
    peak_map: Path | None = writes(
        "Write a map of the peak overpressure over the ground", *PICTURES, panel=_GAS
    ),
    risk_map: Path | None = writes(
        "Write a map of where windows and eardrums are at risk", *PICTURES, panel=_GAS
    ),
    quantity: str | None = typer.Option(
        None,
        help="Quantity of --heat-map: impulse or peak.",
        show_default="impulse",
        rich_help_panel=_GAS,
    ),
    gauge: str | None = typer.Option(
        None,
        help="Gauge of --history, beside Kingery-Bulmash.",
        show_default="the scenario's first",
        rich_help_panel=_GAS,
    ),
    preset: str | None = typer.Option(
        None,
        help="Parameters of this name instead of the scenario's.",
        rich_help_panel=_PARTICLES,
    ),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run one blast and print the load on each structure.

    Each picture shows the same for either engine: --film the spread of the blast, --heat-map the
    places of the load, --history its course over time.
    """
    given = ChargeInput.of(charge, tnt_kg)
    own = load_scenario(scenario)
    site = own if stand_off_m is None else own.at_stand_off(stand_off_m)
    site = site.with_simulation(preset)
    # A layout belongs to the site of the file, before preset and stand-off change it.
    elements: Layout = () if layout is None else tuple(load_layout(layout, own))
    used = find_engine(engine, cell_m, until=until, cells=cells)
    _refuse_of_other_engines(context, used)
    if side_by_side and not elements:
        raise BlastEnvError("--side-by-side compares with the empty site: --layout is missing")
    files = BlastFiles(**{field.name: context.params[field.name] for field in fields(BlastFiles)})
    fixed = given.fixed(site, draw_threat(site, seed))
    blast: Any = used.blast(site, elements, seed, fixed)
    files.check(blast)
    blasts = [replace(blast, layout=()), blast] if side_by_side else [blast]
    with progress_bar(f"blast in {site.name}") as progress:
        results = files.run(blasts, progress)
    result, written = results[-1], [] if film is None else [film]
    if excel is not None:
        written.append(result.to_excel(excel))
    written += files.draw(results)
    if as_json:
        print_json(_record(result, written))
        return
    print_line(used.describe([site]))
    if isinstance(result, BlastResult):
        _print_particles(result)
    else:
        _print_gas(result)
    print_written(written)


def _refuse_of_other_engines(context: typer.Context, engine: Engine) -> None:
    """Refuse the options of another kind of engine, before anything is run."""
    for panel in {_GAS, _PARTICLES} - {f"{engine.title} only"}:
        parameters = context.command.params
        names = [p.name or "" for p in parameters if getattr(p, "rich_help_panel", "") == panel]
        words = panel.removesuffix(" only").lower()
        refuse_given(context, names, f"is for {words}: engine is {engine.name!r}")


def _print_particles(result: BlastResult) -> None:
    """Print a table of the buildings' loads, and the end of the run."""
    blast, scene = result.blast, result.blast.scene
    loads, error = _loads(result)
    impulses = _impulse_texts(loads)
    rows = [
        (
            building_words(blast.scenario, row["building"]),
            "yes" if row["protected"] else "no",
            f"{row['modules']:,}",
            f"{row['hits']:,}",
            f"{row['impulse_sim']:,.0f}",
            f"{row['transferred_impulse_sim']:,.0f}",
            impulses.get(row["building"], "-"),
            _number(MS_PER_S * row["first_hit_s"], ".1f", "never"),
        )
        for row in result.buildings.to_dict("records")
    ]
    _print_loads(result, scene.charge, f"seed {blast.seed}", _PARTICLE_HEADERS, rows)
    outside = "outside the range of the calibration (marked ~)"
    notes = {f"{outside}: {load.name}, {note}" for load in loads for note in load.notes}
    notes |= {error} if error else set()
    texts = [*(f"impulse (Pa s): {note}" for note in sorted(notes)), *blast.scenario.height_notes]
    _print_end(result, f"{len(scene.balls):,} balls", result.step_name, texts)


def _loads(result: "BlastResult | GasResult") -> tuple[tuple[StructureLoad, ...], str]:
    """Return the loads on the structures, or none with the reason."""
    try:
        return result.loads().structures, ""
    except BlastEnvError as error:
        return (), str(error)


def _impulse_texts(loads: Sequence[StructureLoad]) -> dict[str, str]:
    """Return the impulse on each building, marked if it is outside the range."""
    return {
        on_building.name: f"{'' if on_building.in_range else '~'}{on_building.impulse_pa_s:,.0f}"
        for on_building in on_buildings(loads)
    }


def _print_gas(result: "GasResult") -> None:
    """Print tables of the buildings' loads and of the gauges, and the end of the run."""
    scenario, charge = result.blast.scenario, result.run.site.charge
    loads, _ = _loads(result)
    impulses = _impulse_texts(loads)
    rows = [
        (
            building_words(scenario, row["building"]),
            "yes" if row["protected"] else "no",
            impulses[row["building"]],
            _captured(row),
            f"{row['peak_pa'] / PA_PER_KPA:,.1f}",
            _number(MS_PER_S * row["arrival_s"], ".1f"),
            f"{row['most_loaded_face']} {row['most_loaded_pa_s']:,.0f}",
            _number(row["roof_impulse_pa_s"], ",.0f"),
            row["validation"],
        )
        for row in result.buildings.to_dict("records")
    ]
    _print_loads(result, charge, f"{charge.height_m:g} m high", _GAS_HEADERS, rows)
    gauges = [
        (
            *(row["name"], f"{row['x_m']:.2f}", f"{row['y_m']:.2f}", f"{row['z_m']:.2f}"),
            f"{row['peak_pa'] / PA_PER_KPA:,.1f}",
            f"{row['impulse_pa_s']:,.0f}",
            _captured(row),
        )
        for row in result.gauges.to_dict("records")
    ]
    if gauges:
        print_table("gauges", _GAUGES, gauges)
    print_parts(pieces_answer(result.pieces, "stability of the barrier"))
    texts = [*validation_lines(scenario, result.buildings, "building")]
    # One line a cause: a validation status has named its own.
    said = tuple(result.buildings["reason"])
    notes = dict.fromkeys(note for load in loads for note in load.notes)
    texts += [
        f"outside the validated range (marked ~): {note}"
        for note in notes
        if not note.startswith(said)
    ]
    texts += [note for note in result.stepped_notes if not note.endswith(said)]
    texts += result.moved_gauges
    texts += (f"{wall.building}: {wall.words}" for wall in result.unjudged)
    cells = " x ".join(str(count) for count in result.run.grid.shape)
    _print_end(result, f"{cells} cells", "steps", texts)


def _print_loads(
    result: "BlastResult | GasResult",
    charge: Charge,
    more: str,
    headers: Sequence[str],
    rows: Iterable[Sequence[str]],
) -> None:
    (x_m, y_m), blast = charge.position_m, result.blast
    title = (
        f"{blast.scenario.name}: {charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, {more}, "
        f"{layout_counts(blast.layout, 'barrier')}"
    )
    print_table(title, headers, rows, 2)


def _print_end(
    result: "BlastResult | GasResult", size: str, steps: str, notes: Sequence[str]
) -> None:
    """Print the size and the end of the run, notes and the digest."""
    print_line(
        f"{size}, {result.steps:,} {steps}, {MS_PER_S * result.time_s:.0f} ms simulated; ended "
        f"because {result.end_reason}"
    )
    for note in notes:
        print_line(note)
    print_line(f"digest {result.digest}")


def _captured(row: Mapping[Any, Any]) -> str:
    """Return whether an impulse was captured when the run ended."""
    return "yes" if row["known"] else "not yet"


def _number(value: float, form: str, missing: str = "-") -> str:
    return missing if isnan(value) else format(value, form)


def _record(result: "BlastResult | GasResult", written: Sequence[Path]) -> dict[str, object]:
    """Return the result as plain data; missing numbers are null.

    The modules and the single parameters, which the preset implies, are in the workbook.
    """
    loads, error = _loads(result)
    impulse = {
        load.name: {"pa_s": load.impulse_pa_s, "in_range": load.in_range, "notes": load.notes}
        for load in loads
    }
    content: dict[str, object] = {
        "run": {
            name: value
            for name, value in result.run_record.items()
            if not name.startswith("parameter ")
        },
        "structures": table_records(result.structures),
        "buildings": table_records(result.buildings),
        "impulse": impulse or {"error": error},
    }
    if not isinstance(result, BlastResult):
        content["gauges"] = table_records(result.gauges)
        content["bays"] = table_records(result.bays)
        content["pieces"] = table_records(result.pieces)
    return content | {"files": [str(path) for path in written]}
