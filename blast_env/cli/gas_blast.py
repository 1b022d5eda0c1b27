"""What `blast-env simulate --engine gas` prints and writes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pandas as pd

from blast_env.cli.output import (
    engine_text,
    make_table,
    print_json,
    print_line,
    progress_bar,
    result_console,
)
from blast_env.errors import BlastEnvError, UnknownNameError, import_extra
from blast_env.geometry import layout_counts
from blast_env.physics.gas.engine import Recorders
from blast_env.simulation.gas import GasBlast, GasResult
from blast_env.units import MS_PER_S, PA_PER_KPA

_HEADERS: Final = (
    "structure",
    "protected",
    "impulse (Pa s)",
    "first phase (Pa s)",
    "peak (kPa)",
    "arrival (ms)",
    "most loaded wall",
    "roof (Pa s)",
)


class SectionAt(NamedTuple):
    """A vertical section, as the command line names it: without the extra that draws it."""

    axis: Literal["x", "y"]
    at_m: float


@dataclass(frozen=True)
class GasOutput:
    """What is written beside the table, and how the result is printed; see `simulate`."""

    film: Path | None
    excel: Path | None
    parquet: Path | None
    heat_map: Path | None
    history: Path | None
    impulse_map: Path | None
    peak_map: Path | None
    quantity: str
    gauge: str | None
    film_height_m: float | None
    film_section: SectionAt | None
    side_by_side: bool
    as_json: bool
    json_all: bool


def parsed_section(text: str | None) -> SectionAt | None:
    """Return the section of `--film-section`.

    Raises:
        BlastEnvError: If it is none.
    """
    if text is None:
        return None
    axis, _, number = text.partition("=")
    try:
        at_m = float(number)
    except ValueError:
        at_m = np.nan
    if np.isfinite(at_m):
        if axis == "x":
            return SectionAt("x", at_m)
        if axis == "y":
            return SectionAt("y", at_m)
    raise BlastEnvError(f"--film-section is {text!r}, must be x=M or y=M, e.g. x=12.5")


def report_gas_blast(blast: GasBlast, output: GasOutput) -> None:
    """Run one blast of gas dynamics; print and write what it did.

    Raises:
        BlastEnvError: If it cannot be run, or a file cannot be written.
    """
    gauge = _checked(blast, output)
    with progress_bar(f"gas blast in {blast.scenario.name}") as progress:
        bare, result = _run(blast, output, progress)
    written = [path for path in (output.film,) if path is not None]
    if output.excel is not None:
        written.append(result.to_excel(output.excel))
    if output.parquet is not None:
        written.append(result.to_parquet(output.parquet))
    written += _write_pictures(result, bare, output, gauge)
    if output.as_json or output.json_all:
        print_json(_record(result, written, all_of_it=output.json_all))
    else:
        _print(result, written)


def _checked(blast: GasBlast, output: GasOutput) -> str | None:
    """Refuse options of no use before anything is run; return the gauge of the history."""
    if output.side_by_side and not blast.layout:
        raise BlastEnvError("--side-by-side compares with the empty site: --layout is missing")
    for option, value in (
        ("--film-height", output.film_height_m),
        ("--film-section", output.film_section),
    ):
        if value is not None and output.film is None:
            raise BlastEnvError(f"{option} is for --film: no film is to be written")
    if output.heat_map is not None:
        with import_extra("render", "pictures and films"):
            from blast_env.rendering.gas import kind_of
        kind_of(output.quantity)
    names = [gauge.name for gauge in blast.site.gauges]
    if output.history is None:
        if output.gauge is not None:
            raise BlastEnvError("--gauge is for --history: no history is to be drawn")
        return None
    if not names:
        raise BlastEnvError(
            f"--history: {blast.scenario.name} has no gauges ([[gauges]]), and gas dynamics keeps "
            "the load over time at gauges only"
        )
    if output.gauge is not None and output.gauge not in names:
        raise UnknownNameError("gauge", output.gauge, names)
    return output.gauge or names[0]


def _run(
    blast: GasBlast, output: GasOutput, progress: Callable[[float], None]
) -> tuple[GasResult | None, GasResult]:
    """Run the blast, and the one without a barrier where it is to stand beside it."""
    recorders: Recorders = lambda _: ()  # noqa: E731
    if output.impulse_map is not None or output.peak_map is not None:
        from blast_env.rendering.ground_map import ground_recorders

        recorders = ground_recorders
    bare = replace(blast, layout=()) if output.side_by_side else None
    if output.film is None:
        if bare is None:
            return None, blast.run(progress, recorders)
        return bare.run(lambda share: progress(0.5 * share), recorders), blast.run(
            lambda share: progress(0.5 + 0.5 * share), recorders
        )
    # Here, because films need the extra `render`.
    from blast_env.rendering.pressure_film import PLAN_HEIGHT_M, write_pressure_film
    from blast_env.rendering.pressure_frames import Section

    section = None if output.film_section is None else Section(*output.film_section)
    height_m = PLAN_HEIGHT_M if output.film_height_m is None else output.film_height_m
    results = write_pressure_film(
        blast,
        output.film,
        beside=bare,
        height_m=height_m,
        section=section,
        further=recorders,
        progress=progress,
    )
    return (None if bare is None else results[0]), results[-1]


def _write_pictures(
    result: GasResult, bare: GasResult | None, output: GasOutput, gauge: str | None
) -> list[Path]:
    if not any((output.heat_map, gauge, output.impulse_map, output.peak_map)):
        return []
    # Here, because pictures need the extra `render`.
    from blast_env.rendering import gas
    from blast_env.rendering.figures import save_figure
    from blast_env.rendering.ground_map import ground_map

    kind = gas.kind_of(output.quantity)
    pictures: tuple[tuple[Path | None, Callable[[], Any]], ...] = (
        (output.heat_map, lambda: gas.facades(result, quantity=kind, beside=bare)),
        (
            output.history,
            lambda: gas.gauge_history(result, str(gauge), free_field=True, beside=bare),
        ),
        (output.impulse_map, lambda: ground_map(result, "impulse", bare)),
        (output.peak_map, lambda: ground_map(result, "peak", bare)),
    )
    return [save_figure(draw(), path) for path, draw in pictures if path is not None]


def _print(result: GasResult, written: Sequence[Path]) -> None:
    charge = result.run.site.charge
    x_m, y_m = charge.position_m
    table = make_table(
        f"{result.blast.scenario.name}: {charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, "
        f"{charge.height_m:g} m high, {layout_counts(result.blast.layout, 'barrier')}",
        _HEADERS,
        text_columns=2,
    )
    for row in result.structures.to_dict("records"):
        impulse = result.impulse(row["structure"])
        mark = "" if impulse.in_range else "~"
        table.add_row(
            row["structure"],
            "yes" if row["protected"] else "no",
            f"{mark}{impulse.pa_s:,.0f}",
            f"{row['first_impulse_pa_s']:,.0f}",
            f"{row['peak_pa'] / PA_PER_KPA:,.1f}",
            _number(MS_PER_S * row["arrival_s"], ".1f"),
            f"{row['most_loaded_face']} {row['most_loaded_pa_s']:,.0f}",
            _number(row["roof_impulse_pa_s"], ",.0f"),
        )
    result_console().print(table)
    if len(result.gauges):
        result_console().print(_gauges(result.gauges))
    cells = " x ".join(str(count) for count in result.run.grid.shape)
    print_line(
        f"{engine_text(result.blast.engine)}: {cells} cells, {result.steps:,} steps, "
        f"{MS_PER_S * result.time_s:.0f} ms simulated; ended because {result.end_reason}"
    )
    notes = [note for name in result.structures["structure"] for note in result.impulse(name).notes]
    for note in dict.fromkeys(notes):
        print_line(f"outside what was checked (~): {note}")
    print_line(f"digest {result.digest}")
    for path in written:
        print_line(f"wrote {path}")


def _gauges(gauges: pd.DataFrame) -> Any:
    table = make_table(
        "gauges", ("gauge", "x (m)", "y (m)", "z (m)", "peak (kPa)", "impulse (Pa s)"), 1
    )
    for row in gauges.to_dict("records"):
        places = (f"{row[axis]:.2f}" for axis in ("x_m", "y_m", "z_m"))
        peak, impulse = row["peak_pa"] / PA_PER_KPA, row["positive_impulse_pa_s"]
        table.add_row(row["name"], *places, f"{peak:,.1f}", f"{impulse:,.0f}")
    return table


def _record(result: GasResult, written: Sequence[Path], *, all_of_it: bool) -> dict[str, object]:
    """Return the result as plain data; numbers that do not exist are null.

    In short it is without the modules.
    """
    names = result.structures["structure"]
    content: dict[str, object] = {
        "run": result.run_record,
        "structures": _rows(result.structures),
        "impulse": {
            name: {**result.impulse(name)._asdict(), "pa_s": result.impulse(name).pa_s}
            for name in names
        },
        "gauges": _rows(result.gauges),
    }
    if all_of_it:
        content["modules"] = _rows(result.modules)
    return content | {"files": [str(path) for path in written]}


def _rows(table: pd.DataFrame) -> list[dict[str, object]]:
    plain = table.astype(object).where(table.notna(), None)
    return [{str(key): value for key, value in row.items()} for row in plain.to_dict("records")]


def _number(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)
