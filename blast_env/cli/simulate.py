"""`blast-env simulate`: run one blast."""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import pandas as pd
import typer

from blast_env.cli.output import make_table, print_line, progress_bar, result_console, user_errors
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, layout_counts
from blast_env.physics.engines import find_engine, is_gas
from blast_env.physics.structure import ModularObstacle
from blast_env.scenario import Scenario, load_layout, load_scenario
from blast_env.simulation import Blast, BlastResult
from blast_env.units import MS_PER_S

_HEADERS: Final = (
    "structure",
    "protected",
    "modules",
    "hits",
    "impulse m|v| (sim)",
    "transferred (sim)",
    "impulse (Pa s)",
    "first hit (ms)",
)


def simulate(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")],
    layout: Annotated[
        Path | None, typer.Option(help="JSON file with the barrier's [row, column] cells.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Decides charge, fan and air.")] = 0,
    preset: Annotated[
        str | None, typer.Option(help="Parameters of this name instead of the scenario's.")
    ] = None,
    engine: Annotated[
        str, typer.Option(help="pymunk or event (particles), or gas (gas dynamics).")
    ] = "pymunk",
    cell: Annotated[
        float | None, typer.Option(help="Side of the cells of gas dynamics, m; 0.5 unless given.")
    ] = None,
    charge: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="X Y", help="Where the charge is, m, instead of drawing it."),
    ] = None,
    stand_off: Annotated[
        float | None, typer.Option(help="Distance from charge to facade, m (free_field).")
    ] = None,
    film: Annotated[Path | None, typer.Option(help="Write a film: .mp4 or .gif.")] = None,
    excel: Annotated[Path | None, typer.Option(help="Write a workbook: .xlsx.")] = None,
    parquet: Annotated[Path | None, typer.Option(help="Write the collisions: .parquet.")] = None,
    heat_map: Annotated[
        Path | None, typer.Option(help="Write a picture of the load: .png, .svg, .pdf.")
    ] = None,
    history: Annotated[
        Path | None, typer.Option(help="Write a picture of the impulse over time, likewise.")
    ] = None,
    scheme: Annotated[
        Path | None, typer.Option(help="Write a picture of the initial state, likewise.")
    ] = None,
    velocities: Annotated[
        Path | None, typer.Option(help="Write a picture of the fan's velocities, likewise.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Run one blast and print what each structure took."""
    with user_errors():
        named = load_scenario(scenario)
        chosen = _changed(named, preset, stand_off)
        # A layout is for the site of the file; preset and stand-off are this command's.
        cells: Sequence[Element] = () if layout is None else load_layout(layout, named)
        found = find_engine(engine, cell)
        if is_gas(found):
            # Here, because Numba takes half a second to import.
            from blast_env.cli.gas_blast import GasOutput, report_gas_blast

            for option, path in {
                "--film": film,
                "--heat-map": heat_map,
                "--history": history,
                "--scheme": scheme,
                "--velocities": velocities,
            }.items():
                if path is not None:
                    raise BlastEnvError(f"{option} draws particles: engine 'gas' has none")
            output = GasOutput(excel, parquet, as_json)
            report_gas_blast(chosen, cells, seed, found, charge, output)
            return
        blast = Blast(chosen, cells, seed, found)
        if charge is not None:
            blast = blast.with_charge_at(charge)
        with progress_bar(f"blast in {chosen.name}") as progress:
            result = _run(blast, film, progress)
        written = [path for path in (film,) if path is not None]
        written += _write_tables(result, excel, parquet)
        written += _write_pictures(result, heat_map, history, scheme, velocities)
    if as_json:
        print_line(json.dumps(_as_json(result, written), indent=2))
    else:
        print_summary(result, written)


def _changed(scenario: Scenario, preset: str | None, stand_off: float | None) -> Scenario:
    if stand_off is not None:
        scenario = scenario.at_stand_off(stand_off)
    return scenario.with_simulation(preset)


def _run(blast: Blast, film: Path | None, progress: Callable[[float], None]) -> BlastResult:
    if film is None:
        return blast.run(progress)
    # Here, because films need the extra `render`.
    from blast_env.rendering.film import write_film

    return write_film(blast, film, progress=progress)


def _write_tables(result: BlastResult, excel: Path | None, parquet: Path | None) -> list[Path]:
    written = []
    if excel is not None:
        written.append(result.to_excel(excel))
    if parquet is not None:
        written.append(result.to_parquet(parquet))
    return written


def _write_pictures(
    result: BlastResult,
    heat_map: Path | None,
    history: Path | None,
    scheme: Path | None,
    velocities: Path | None,
) -> list[Path]:
    if not any((heat_map, history, scheme, velocities)):
        return []
    # Here, because pictures need the extra `render`.
    from blast_env.rendering import figures

    blast = result.blast
    pictures = (
        (heat_map, partial(figures.heat_map, result)),
        (history, partial(figures.impulse_over_time, result)),
        (scheme, partial(figures.model_scheme, blast.scene)),
        (velocities, partial(figures.initial_velocities, blast.scenario.parameters)),
    )
    return [figures.save_figure(draw(), path) for path, draw in pictures if path is not None]


def print_summary(result: BlastResult, written: Sequence[Path]) -> None:
    """Print a table of the structures' loads, how the run went, and the files."""
    scene, blast = result.blast.scene, result.blast
    x_m, y_m = scene.charge.position_m
    table = make_table(
        f"{blast.scenario.name}: {scene.charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, "
        f"seed {blast.seed}, {layout_counts(blast.layout, 'barrier')}",
        _HEADERS,
        text_columns=2,
    )
    notes: set[str] = set()
    for obstacle in result.obstacles:
        first_hit_s = obstacle.first_hit_s
        table.add_row(
            obstacle.name,
            "yes" if obstacle.protected else "no",
            f"{len(obstacle.parts):,}",
            f"{obstacle.hits:,}",
            f"{obstacle.impulse:,.0f}",
            f"{obstacle.transferred_impulse:,.0f}",
            _scaled_text(result, obstacle, notes),
            "never" if first_hit_s is None else f"{MS_PER_S * first_hit_s:.1f}",
        )
    result_console().print(table)
    print_line(
        f"{len(scene.balls):,} balls, {result.steps:,} steps, "
        f"{MS_PER_S * result.time_s:.0f} ms simulated; ended because {result.end_reason}"
    )
    for note in sorted(notes):
        print_line(f"impulse (Pa s): {note}")
    print_line(f"digest {result.digest}")
    for path in written:
        print_line(f"wrote {path}")


def _scaled_text(result: BlastResult, obstacle: ModularObstacle, notes: set[str]) -> str:
    """Return the calibrated impulse of a structure; `notes` gets what there is to say about it."""
    if obstacle.cells is not None:
        return "-"
    try:
        scaled = result.impulse(obstacle.name)
    except BlastEnvError as error:
        notes.add(str(error))
        return "-"
    notes.update(f"outside the calibration (~): {obstacle.name}, {note}" for note in scaled.notes)
    return f"{scaled.pa_s:,.0f}" if scaled.in_range else f"~{scaled.pa_s:,.0f}"


def _as_json(result: BlastResult, written: Sequence[Path]) -> dict[str, object]:
    """Return the result as plain data; numbers that do not exist are null."""
    return {
        "run": result.run_record,
        "structures": _records(result.structures),
        "impulse": _scaled(result),
        "modules": _records(result.modules),
        "files": [str(path) for path in written],
    }


def _scaled(result: BlastResult) -> dict[str, object]:
    """Return the calibrated impulses of the structures by name; the error where there is none."""
    scaled: dict[str, object] = {}
    for obstacle in result.obstacles:
        try:
            impulse = result.impulse(obstacle.name)
        except BlastEnvError as error:
            scaled[obstacle.name] = {"error": str(error)}
        else:
            scaled[obstacle.name] = {**impulse._asdict(), "pa_s": impulse.pa_s}
    return scaled


def _records(table: pd.DataFrame) -> list[dict[str, object]]:
    return [
        {str(name): None if pd.isna(value) else value for name, value in row.items()}
        for row in table.to_dict("records")
    ]
