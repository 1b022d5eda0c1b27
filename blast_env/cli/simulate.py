"""`blast-env simulate`: run one blast; print its loads and write its files."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from blast_env.answers.simulate import blast_answer, blast_record
from blast_env.answers.terminal import print_line
from blast_env.cli.command import PICTURES, Target, note_target, writes
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
from blast_env.cli.output import print_outcome, print_record, progress_bar
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.geometry import Layout
from blast_env.io.export import BLAST_SUFFIXES, blast_recorders, check_blast_target, export_blast
from blast_env.layout import load_layout
from blast_env.layout.build_site import draw_threat
from blast_env.plots.blast_files import BlastFiles
from blast_env.site import Scenario, load_scenario

_GAS: Final = "Gas dynamics only"
_PARTICLES: Final = "Particles only"


def _note_export(context: typer.Context, value: Path | None) -> Path | None:
    """Add the target of `--export`, a file or a folder; `check_blast_target` checks others."""
    if value is not None:
        is_one = value.suffix.lower() in BLAST_SUFFIXES and not value.is_dir()
        note_target(context, Target("--export", value, BLAST_SUFFIXES if is_one else ()))
    return value


_StandOffOption = Annotated[
    float | None,
    typer.Option("--stand-off", help="Distance from charge to facade, m (free_field)."),
]
_SideBySideOption = Annotated[
    bool,
    typer.Option(
        "--side-by-side", help="Show in all pictures the site without the barrier as well."
    ),
]
_UntilOption = Annotated[
    str | None, typer.Option(help=UNTIL_HELP, rich_help_panel=_GAS, show_default="structures")
]
_ExportOption = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the scene with loads as glTF, the histories as CSV and the field of "
        "pressure for ParaView; or a file with one of these suffixes: .glb, .csv, .vti, .pvd (the "
        "field in time).",
        callback=_note_export,
        rich_help_panel=_GAS,
    ),
]
_TimesOption = Annotated[
    int | None,
    typer.Option(help="Most times of --export to .pvd.", show_default="40", rich_help_panel=_GAS),
]
_QuantityOption = Annotated[
    str | None,
    typer.Option(
        help="Quantity of --heat-map: impulse or peak.",
        show_default="impulse",
        rich_help_panel=_GAS,
    ),
]
_GaugeOption = Annotated[
    str | None,
    typer.Option(
        help="Gauge of --history, beside Kingery-Bulmash.",
        show_default="the scenario's first",
        rich_help_panel=_GAS,
    ),
]
_PresetOption = Annotated[
    str | None,
    typer.Option(
        help="Parameters of this name instead of the scenario's.", rich_help_panel=_PARTICLES
    ),
]


def simulate(
    context: typer.Context,
    scenario: ScenarioArgument,
    layout: LayoutOption = None,
    seed: int = typer.Option(0, help="Decides charge, fan and air.", min=0),
    engine: EngineChoice = JUDGE,
    stand_off_m: _StandOffOption = None,
    film: Path | None = writes("Write a film", ".mp4", ".gif"),
    excel: Path | None = writes("Write a workbook", ".xlsx"),
    heat_map: Path | None = writes(
        "Write a picture of the load over the protected facades", *PICTURES
    ),
    history: Path | None = writes(
        "Write a picture of the load over time (gas: at --gauge)", *PICTURES
    ),
    side_by_side: _SideBySideOption = False,
    cell_m: CellOption = None,
    cells: CellsOption = None,
    until: _UntilOption = None,
    impulse_map: Path | None = writes(
        "Write a map of the impulse over the ground", *PICTURES, panel=_GAS
    ),
    peak_map: Path | None = writes(
        "Write a map of the peak overpressure over the ground", *PICTURES, panel=_GAS
    ),
    risk_map: Path | None = writes(
        "Write a map of where windows and eardrums are at risk", *PICTURES, panel=_GAS
    ),
    export: _ExportOption = None,
    times: _TimesOption = None,
    quantity: _QuantityOption = None,
    gauge: _GaugeOption = None,
    preset: _PresetOption = None,
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run one blast and print the load on each structure.

    Each picture shows the same for either engine: --film the spread of the blast, --heat-map the
    places of the load, --history its course over time.
    """
    given = ChargeInput.of(charge, tnt_kg)
    site, elements = _site_and_layout(scenario, layout, stand_off_m, preset)
    used = find_engine(engine, cell_m, until=until, cells=cells)
    _refuse_of_other_engines(context, used)
    if side_by_side and not elements:
        raise BlastEnvError("--side-by-side compares with the empty site: --layout is missing")
    files = _files(context, export, times)
    fixed = given.fixed(site, draw_threat(site, seed))
    blast: Any = used.blast(site, elements, seed, fixed)
    files.check(blast)
    blasts = [replace(blast, layout=()), blast] if side_by_side else [blast]
    with progress_bar(f"blast in {site.name}") as progress:
        results = files.run(blasts, progress)
    written = [] if film is None else [film]
    written += _written(files, results, excel, export)
    if as_json:
        print_record(blast_record(results[-1]), written)
        return
    print_line(used.describe([site]))
    print_outcome(blast_answer(results[-1]), written)


def _site_and_layout(
    scenario: str, layout: Path | None, stand_off_m: float | None, preset: str | None
) -> tuple[Scenario, Layout]:
    """Return the site of the blast, and the layout for it."""
    own = load_scenario(scenario)
    site = own if stand_off_m is None else own.at_stand_off(stand_off_m)
    # A layout belongs to the site of the file, before preset and stand-off change it.
    elements: Layout = () if layout is None else tuple(load_layout(layout, own))
    return site.with_simulation(preset), elements


def _files(context: typer.Context, export: Path | None, times: int | None) -> BlastFiles:
    """Return the files of the command line that are made while the blast runs, or after it."""
    names = [field.name for field in fields(BlastFiles) if field.name in context.params]
    files = BlastFiles(**{name: context.params[name] for name in names})
    if export is None:
        if times is not None:
            raise BlastEnvError("--times is for --export to .pvd, which is missing")
        return files
    check_blast_target(export)  # before the blast, so that it is not lost
    return replace(files, further=blast_recorders(export, times))


def _written(
    files: BlastFiles, results: Sequence[Any], excel: Path | None, export: Path | None
) -> list[Path]:
    """Write the files that are made after the blasts, of the last one or of all."""
    written = [] if excel is None else [results[-1].to_excel(excel)]
    written += files.draw(results)
    if export is not None:
        written += export_blast(results[-1], export)
    return written


def _refuse_of_other_engines(context: typer.Context, engine: Engine) -> None:
    """Refuse the options of another kind of engine, before anything is run."""
    for panel in {_GAS, _PARTICLES} - {f"{engine.title} only"}:
        parameters = context.command.params
        names = [p.name or "" for p in parameters if getattr(p, "rich_help_panel", "") == panel]
        words = panel.removesuffix(" only").lower()
        refuse_given(context, names, f"is for {words}: engine is {engine.name!r}")
