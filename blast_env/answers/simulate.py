"""The answer of `simulate`: the loads of one blast on the buildings and at the gauges."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isnan
from typing import TYPE_CHECKING, Any, Final

from blast_env.answers.document import AnyPart, Line, Table, building_words, lines, validation_lines
from blast_env.answers.pieces import pieces_answer
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.evaluation.record import StructureLoad, on_buildings
from blast_env.geometry import layout_counts
from blast_env.site.blast_site import Charge
from blast_env.tables import number_or_none, table_records
from blast_env.units import MS_PER_S, PA_PER_KPA

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasResult

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


def blast_answer(result: "BlastResult | GasResult") -> Iterator[AnyPart]:
    """Yield the loads of a blast, and the end of the run."""
    if isinstance(result, BlastResult):
        yield from _particle_answer(result)
    else:
        yield from _gas_answer(result)


def _particle_answer(result: BlastResult) -> Iterator[AnyPart]:
    """Yield a table of the buildings' loads, and the end of the run."""
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
    yield _loads_table(result, scene.charge, f"seed {blast.seed}", _PARTICLE_HEADERS, rows)
    outside = "outside the range of the calibration (marked ~)"
    notes = {f"{outside}: {load.name}, {note}" for load in loads for note in load.notes}
    notes |= {error} if error else set()
    texts = [*(f"impulse (Pa s): {note}" for note in sorted(notes)), *blast.scenario.height_notes]
    yield from _end(result, f"{len(scene.balls):,} balls", result.step_name, texts)


def _loads(result: "BlastResult | GasResult") -> tuple[tuple[StructureLoad, ...], str]:
    """Return the loads on the structures, or none with the reason."""
    try:
        return result.loads().structures, ""
    except BlastEnvError as error:
        return (), str(error)


def _impulse_texts(loads: Sequence[StructureLoad]) -> dict[str, str]:
    """Return the impulse on each building, marked if it is outside the range."""
    return {
        load.name: "-"
        if isnan(load.impulse_pa_s)
        else f"{'' if load.in_range else '~'}{load.impulse_pa_s:,.0f}"
        for load in on_buildings(loads)
    }


def _gas_answer(result: "GasResult") -> Iterator[AnyPart]:
    """Yield tables of the buildings' loads and of the gauges, and the end of the run."""
    scenario, charge = result.blast.scenario, result.run.site.charge
    loads, _ = _loads(result)
    impulses = _impulse_texts(loads)
    rows = [
        (
            building_words(scenario, row["building"]),
            "yes" if row["protected"] else "no",
            impulses[row["building"]],
            _captured(row),
            _number(row["peak_pa"] / PA_PER_KPA, ",.1f"),
            _number(MS_PER_S * row["arrival_s"], ".1f"),
            f"{row['most_loaded_face']} {_number(row['most_loaded_pa_s'], ',.0f')}".strip(),
            _number(row["roof_impulse_pa_s"], ",.0f"),
            row["validation"],
        )
        for row in result.buildings.to_dict("records")
    ]
    yield _loads_table(result, charge, f"{charge.height_m:g} m high", _GAS_HEADERS, rows)
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
        yield Table.of("gauges", _GAUGES, gauges)
    yield from pieces_answer(result.pieces, "stability of the barrier")
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
    texts += [
        f"{row['building']}: no air touches its assessed walls ({row['faces']}): it has no load"
        for row in result.buildings.to_dict("records")
        if not row["most_loaded_face"]
    ]
    texts += result.moved_gauges
    texts += (f"{wall.building}: {wall.words}" for wall in result.unjudged)
    texts += (
        f"{load.name}: {words}" for load in result.structure_loads if (words := load.unloaded_words)
    )
    cells = " x ".join(str(count) for count in result.run.grid.shape)
    yield from _end(result, f"{cells} cells", "steps", texts)


def _loads_table(
    result: "BlastResult | GasResult",
    charge: Charge,
    more: str,
    headers: Sequence[str],
    rows: Iterable[Sequence[str]],
) -> Table:
    (x_m, y_m), blast = charge.position_m, result.blast
    title = (
        f"{blast.scenario.name}: {charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, {more}, "
        f"{layout_counts(blast.layout, 'barrier')}"
    )
    return Table.of(title, headers, rows, 2)


def _end(
    result: "BlastResult | GasResult", size: str, steps: str, notes: Sequence[str]
) -> Iterator[Line]:
    """Yield the size and the end of the run, notes and the digest."""
    end = (
        f"{size}, {result.steps:,} {steps}, {MS_PER_S * result.time_s:.0f} ms simulated; ended "
        f"because {result.end_reason}"
    )
    yield from lines((end, *notes, f"digest {result.digest}"))


def _captured(row: Mapping[Any, Any]) -> str:
    """Return whether an impulse was captured when the run ended."""
    return "yes" if row["known"] else "not yet"


def _number(value: float, form: str, missing: str = "-") -> str:
    return missing if isnan(value) else format(value, form)


def blast_record(result: "BlastResult | GasResult") -> dict[str, object]:
    """Return the result as plain data; missing numbers are null.

    The modules and the single parameters, which the preset implies, are in the workbook.
    """
    loads, error = _loads(result)
    impulse: dict[str, object] = {
        load.name: {
            "pa_s": number_or_none(load.impulse_pa_s),
            "in_range": load.in_range,
            "notes": load.notes,
        }
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
    return content
