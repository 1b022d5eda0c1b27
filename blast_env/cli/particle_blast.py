"""What `blast-env simulate` prints and writes of a blast of particles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import pandas as pd

from blast_env.cli.output import (
    engine_text,
    make_table,
    print_json,
    print_line,
    progress_bar,
    result_console,
)
from blast_env.errors import BlastEnvError
from blast_env.geometry import layout_counts
from blast_env.physics.structure import ModularObstacle
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
_WITHOUT: Final = "_without"


@dataclass(frozen=True)
class ParticleOutput:
    """What is written beside the table, and how the result is printed; see `simulate`."""

    film: Path | None
    excel: Path | None
    parquet: Path | None
    heat_map: Path | None
    history: Path | None
    scheme: Path | None
    velocities: Path | None
    side_by_side: bool
    as_json: bool
    json_all: bool


def report_particle_blast(blast: Blast, output: ParticleOutput) -> None:
    """Run one blast of particles; print and write what it did.

    Raises:
        BlastEnvError: If it cannot be run, or a file cannot be written.
    """
    _check(blast, output)
    with progress_bar(f"blast in {blast.scenario.name}") as progress:
        bare, result = _run(blast, output, progress)
    written = [path for path in (output.film,) if path is not None]
    if output.excel is not None:
        written.append(result.to_excel(output.excel))
    if output.parquet is not None:
        written.append(result.to_parquet(output.parquet))
    written += _write_pictures(result, bare, output)
    if output.as_json or output.json_all:
        print_json(_record(result, written, all_of_it=output.json_all))
    else:
        print_summary(result, written)


def _check(blast: Blast, output: ParticleOutput) -> None:
    """Refuse a comparison that says nothing, or that there is no picture for."""
    if not output.side_by_side:
        return
    if not blast.layout:
        raise BlastEnvError("--side-by-side compares with the empty site: --layout is missing")
    if output.film is not None and output.film.suffix.lower() != ".mp4":
        raise BlastEnvError(f"--film {output.film}: of two blasts of particles it must be .mp4")


def _run(
    blast: Blast, output: ParticleOutput, progress: Callable[[float], None]
) -> tuple[BlastResult | None, BlastResult]:
    """Run the blast, and the one without a barrier where it is to stand beside it."""
    bare = replace(blast, layout=()) if output.side_by_side else None
    if output.film is None:
        return None if bare is None else bare.run(), blast.run(progress)
    # Here, because films need the extra `render`.
    from blast_env.rendering.film import FilmPanel, write_film, write_side_by_side

    if bare is None:
        return None, write_film(blast, output.film, progress=progress)
    panels = [FilmPanel(bare, "no barrier"), FilmPanel(blast, layout_words(blast))]
    first, second = write_side_by_side(panels, output.film, progress=progress)
    return first, second


def layout_words(blast: Blast) -> str:
    """Return what barrier a blast has, in words."""
    return f"barrier of {layout_counts(blast.layout)}" if blast.layout else "no barrier"


def _write_pictures(
    result: BlastResult, bare: BlastResult | None, output: ParticleOutput
) -> list[Path]:
    if not any((output.heat_map, output.history, output.scheme, output.velocities)):
        return []
    # Here, because pictures need the extra `render`.
    from blast_env.rendering import figures

    results = [result] if bare is None else [result, bare]
    scale = figures.common_scale(results)
    pictures: list[tuple[Path | None, Callable[[], figures.Figure]]] = []
    for each in results:
        pictures += [
            (_named(output.heat_map, each is bare), partial(figures.heat_map, each, scale=scale)),
            (_named(output.history, each is bare), partial(figures.impulse_over_time, each)),
        ]
    pictures += [
        (output.scheme, partial(figures.model_scheme, result.blast.scene)),
        (
            output.velocities,
            partial(figures.initial_velocities, result.blast.scenario.parameters),
        ),
    ]
    return [figures.save_figure(draw(), path) for path, draw in pictures if path is not None]


def _named(path: Path | None, is_bare: bool) -> Path | None:
    """Return the path of a picture, that of the empty site beside it."""
    if path is None or not is_bare:
        return path
    return path.with_name(f"{path.stem}{_WITHOUT}{path.suffix}")


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
        f"{engine_text(blast.particle_engine, [blast.scenario])}: {len(scene.balls):,} balls, "
        f"{result.steps:,} {result.step_name}, {MS_PER_S * result.time_s:.0f} ms simulated; "
        f"ended because {result.end_reason}"
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


def _record(result: BlastResult, written: Sequence[Path], *, all_of_it: bool) -> dict[str, object]:
    """Return the result as plain data; numbers that do not exist are null.

    In short it has neither the modules nor every parameter, which the preset stands for.
    """
    record = {
        name: value
        for name, value in result.run_record.items()
        if all_of_it or not name.startswith("parameter ")
    }
    content: dict[str, object] = {
        "run": record,
        "structures": _records(result.structures),
        "impulse": _scaled(result),
    }
    if all_of_it:
        content["modules"] = _records(result.modules)
    return content | {"files": [str(path) for path in written]}


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
