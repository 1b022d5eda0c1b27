"""The answers of `assess`: the verdict and what it rests on, capacity, screening, barriers."""

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, nan
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.answers.document import (
    AnyCell,
    AnyPart,
    Line,
    Number,
    Table,
    building_words,
    charge_text,
    height_words,
    lines,
    rounded_down,
    without_facade_words,
)
from blast_env.answers.left_out import left_out_words, nearer_words
from blast_env.answers.pieces import pieces_answer
from blast_env.evaluation.blasts import Blasts, NumberOf
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.questions.capacity import LEVELS, Edge, PlaceCapacity
from blast_env.evaluation.questions.grid_error import (
    FACTOR,
    ORDER,
    RATIO,
    Effect,
    GridError,
    convergence_index,
    impulse_of,
)
from blast_env.evaluation.questions.probability import Uncertainty, level_probability
from blast_env.evaluation.questions.verdict import (
    BuildingResponse,
    Consequences,
    Verdict,
    consequences_by_layout,
    consequences_of,
    other_glazing,
    side_on_peak_pa,
)
from blast_env.evaluation.record import BlastRecord
from blast_env.response.buildings import BuildingDamage
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario
from blast_env.values import count_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROUNDING: Final = 1e-9
RESPONSE_HEADERS: Final = (
    *("building", "level of protection", "panes broken", "worst pane (GSA, ISO)", "worst panel"),
)
_NEIGHBOURS: Final = (
    *("layout", "building", "side-on peak (kPa)", "side-on impulse (Pa s)"),
    *(f"{damage} (%)" for damage in BuildingDamage),
)


def governing(blasts: Blasts) -> int:
    """Return the number of the charge with the governing response behind the layout."""
    return consequences_of(blasts).worst_number


def assessment(
    blasts: Blasts,
    found: Mapping[str, Consequences],
    target: LevelOfProtection,
    mass_error: float,
    required: Sequence[Requirement] = (),
) -> Iterator[AnyPart]:
    """Yield the verdict and what it rests on.

    Args:
        blasts: The blasts, on coarser cells under the charge that governs.
        found: Their consequences; see `consequences_by_layout`.
        target: Required level of protection.
        mass_error: Uncertainty of the masses; see `Uncertainty`.
        required: Further requirements.

    Raises:
        BlastEnvError: If no building can be judged with the layout in question.
    """
    scenario, judged = blasts.scenario, found[blasts.judged]
    judged.check_judged()
    yield from _verdict(blasts, judged, target)
    # The layout in question before the site without it, where nothing may be there to judge.
    judged_first = [(name, own) for name, own in found.items() if own.responses][::-1]
    for requirement in required:
        for name, own in judged_first:
            kept = all(response.keeps(requirement) for response in own.responses)
            word = Verdict.of(kept).word(own.is_flagged).lower()
            yield Line.of(f"{requirement.words}, {name}: {word}")
    error = GridError.of(blasts)
    uncertainty = Uncertainty.of(mass_error, error)
    for name, own in judged_first:
        likely = level_probability(own, uncertainty)
        yield Line.of(f"probability, {name}: {likely.words(target)}")
    if error is not None:
        yield from impulse_lines(error)
        yield from lines(_levels_changed(blasts, judged))
    else:
        yield Line.of(f"{no_cells_words(blasts.engine)}; probabilities leave it out", kind="quiet")
    yield response_table(blasts, found)
    said = [*judged.notes, *_engine_notes(blasts, blasts.judged)]
    for name, own in [*found.items()][:-1]:
        yield from lines((f"flag, {name}: {note}" for note in own.notes), "flag")
        notes = _engine_notes(blasts, name, [*said, *own.notes])
        yield from lines((f"note, {name}: {note}" for note in notes), "flag")
    yield from _neighbours(blasts, found)
    worst = judged.worst_barrier
    if worst is not None:
        title = f"the barrier under {charge_text(worst.charge)}, the worst"
        yield from pieces_answer(worst.pieces, title)
    for barrier in judged.barriers:
        if barrier.taken_away:
            yield Line.of(
                f"{len(barrier.taken_away)} pieces overturned before the blast of "
                f"{charge_text(barrier.charge)} was over, and were taken away for it"
            )
    yield _glazing(scenario, judged, target)


def _verdict(blasts: Blasts, judged: Consequences, target: LevelOfProtection) -> Iterator[AnyPart]:
    verdict, level = judged.verdict_word(target), judged.level_words_for(target)
    charges = count_of("charge", len(judged.barriers))
    words = f"{blasts.scenario.name}, {blasts.judged}: {verdict}: {level}, under {charges}"
    yield Line.of(words, kind="answer")
    for building in judged.buildings:
        status = judged.validation(building).words
        yield Line.of(f"validation of the load that decides, {building}: {status}")
    own = [threat.charge for threat in blasts.threats]
    layout = blasts.layouts[blasts.judged]
    left_out = (
        *left_out_words(blasts.scenario, own, layout),
        *nearer_words(blasts.scenario, own),
        *without_facade_words(blasts.scenario),
    )
    yield from lines((f"flag: {note}" for note in (*left_out, *judged.notes)), "flag")
    notes = _engine_notes(blasts, blasts.judged, judged.notes)
    yield from lines((f"note: {note}" for note in notes), "flag")
    if doubt := judged.doubt(target):
        yield Line.of(doubt)
    yield Line.of(judged.force_words)


def _engine_notes(blasts: Blasts, name: str, said: Sequence[str] = ()) -> list[str]:
    """Return the engine's notes on the blasts of a layout, such as of moved gauges, once each.

    Those that are part of what was `said` are left out, and those of which a flag has an example.
    """
    notes = dict[str, None]()
    for record in blasts.records[name]:
        flagged = [why for _, why in record.complete.unchecked]
        for note in record.complete.notes:
            if not any(note in words for words in (*said, *flagged)):
                notes[note] = None
    return [*notes]


def cells_words(error: GridError) -> str:
    """Return the coarse cells and the formula of an error, for a line below a result."""
    return (
        f"(cells): grid convergence index against {error.coarser.words}, under the worst charge"
        f" (factor {FACTOR:g}, order {ORDER:g})"
    )


def no_cells_words(engine: Engine) -> str:
    """Return that the grid error is not known; empty for an engine without cells."""
    if not engine.smallest_m:
        return ""
    why = "no blast ran on cells twice as large"
    if engine.coarser is None:
        why = f"cells twice as large as those of {engine.smallest_m:g} m do not fit into a module"
    return f"(cells): the grid error is not known: {why}"


def impulse_lines(error: GridError) -> Iterator[Line]:
    """Yield the impulse on the protected structures under the worst charge, and its error."""
    words = "impulse on the protected structures under the worst charge: "
    effect = Effect.between(error.fine, impulse_of, error)
    protected = Number(effect.value, "Pa s", effect.error)
    if not error.layout:
        yield Line.of(words, protected)
    else:
        unprotected = Number(effect.unprotected, "Pa s", effect.unprotected_error)
        share = Number.reduction(effect.reduction, effect.reduction_error)
        sides = unprotected, " without barrier, ", protected, " with, reduction "
        yield Line.of(words, *sides, share)
    yield Line.of(cells_words(error), kind="quiet")


def _levels_changed(blasts: Blasts, judged: Consequences) -> Iterator[str]:
    """Yield levels that cells change under the worst charge."""
    coarse = _on_coarser_cells(blasts, judged).get(blasts.judged)
    if coarse is None or blasts.coarse is None:
        return
    for building in judged.buildings:
        if building not in coarse.buildings:
            continue  # larger cells close a gap
        fine = judged.under(judged.worst_number).level(building)
        other = coarse.level(building)
        if other != fine:
            words = blasts.coarse.engine.words
            yield (
                f"note: {building} reaches level {other.label!r} with {words}, and {fine.label!r} "
                "with the finer cells, under the worst charge"
            )


def _on_coarser_cells(blasts: Blasts, judged: Consequences) -> dict[str, Consequences]:
    """Return the consequences of the governing charge on coarser cells; empty without these."""
    governing = blasts.threats[judged.worst_number]
    if blasts.coarse is None or governing not in blasts.coarse.threats:
        return {}
    return consequences_by_layout(blasts.coarse.under([blasts.coarse.threats.index(governing)]))


def response_cells(
    found: Consequences,
    building: str,
    coarse: Consequences | None = None,
    number: int = 0,
    ratio: float = RATIO,
) -> tuple[AnyCell, ...]:
    """Return the response of a building; of the panes with the grid error.

    `coarse` has the response to the charge of a number on cells larger by a ratio.
    """
    whole = found.summary(building)
    error = nan
    if coarse is not None and building in coarse.buildings:
        fine = found.under(number).of(building)[0].facade.broken_panes
        error = convergence_index(fine, coarse.of(building)[0].facade.broken_panes, ratio)
    panes = Number(whole.broken, error=error, digits=1, flag=f" of {whole.panes}")
    return whole.level, panes, whole.condition, whole.damage


def response_table(blasts: Blasts, found: Mapping[str, Consequences]) -> Table:
    """Return the table of buildings with a facade, by layout: the worst of all charges."""
    judged = found[blasts.judged]
    number, coarse = judged.worst_number, _on_coarser_cells(blasts, judged)
    error = GridError.of(blasts)
    ratio = RATIO if error is None else error.ratio
    rows = [
        (
            name,
            building_words(blasts.scenario, building),
            *response_cells(own, building, coarse.get(name), number, ratio),
        )
        for name, own in found.items()
        for building in own.buildings
    ]
    title = f"{blasts.scenario.name}: the worst of all charges"
    return Table.of(title, ("layout", *RESPONSE_HEADERS), rows, 3, 2)


def _neighbours(blasts: Blasts, found: Mapping[str, Consequences]) -> Iterator[AnyPart]:
    rows = list[tuple[AnyCell, ...]]()
    for name, own in found.items():
        error = GridError.of(blasts, name)
        for worst in own.worst_neighbours:

            def peak_of(record: BlastRecord, building: str = worst.building) -> float:
                return side_on_peak_pa(np.array([record.complete.walls[building].peak_pa])).item()

            def reflected_of(record: BlastRecord, building: str = worst.building) -> float:
                return record.complete.walls[building].impulse_pa_s

            rows.append(
                (
                    name,
                    building_words(blasts.scenario, worst.building),
                    Number.kpa(worst.peak_pa, _off(error, peak_of) * worst.peak_pa),
                    Number(
                        worst.impulse_pa_s, error=_off(error, reflected_of) * worst.impulse_pa_s
                    ),
                    *(f"{100.0 * worst.probability[damage]:.0f}" for damage in BuildingDamage),
                )
            )
    if rows:
        title = "without a facade: how likely an ordinary house there is damaged, worst charge"
        yield Table.of(title, _NEIGHBOURS, rows, 2)


def _off(error: GridError | None, number_of: NumberOf) -> float:
    return nan if error is None else error.of_load(number_of)


def _glazing(scenario: Scenario, judged: Consequences, target: LevelOfProtection) -> Table:
    rows = []
    for name, glazing in other_glazing(scenario).items():
        other = judged.with_glazing(glazing)
        for building in other.buildings:
            passes = Verdict.of(other.level(building) >= target).word(other.is_flagged)
            words = building_words(scenario, building)
            rows.append((name, words, *response_cells(other, building), passes.lower()))
    headers = ("glass in all windows", *RESPONSE_HEADERS, "verdict")
    return Table.of("the same loads, other glass", headers, rows, 3)


def capacity_answer(scenario: Scenario, found: Sequence[PlaceCapacity]) -> Iterator[AnyPart]:
    """Yield the largest masses and the least stand-offs, one row per layout and place."""
    masses, stand_offs = list[tuple[str, ...]](), list[tuple[str, ...]]()
    for own in found:
        (x_m, y_m), _, height_m = own.charge
        place = own.layout, f"{x_m:.1f}, {y_m:.1f}{height_words(height_m)}"
        masses.append((*place, f"{own.stand_off_m:.1f} m", *map(_mass_text, own.heavier)))
        mass = f"{own.charge.tnt_kg:g} kg"
        stand_offs.append((*place, mass, *map(_stand_off_text, own.nearer)))
    blasts = sum(own.blasts for own in found)
    yield Line.of(f"{blasts} blasts; between them, histories are scaled by at most 1.3 in mass")
    notes = Consequences.together(own.judged for own in found).notes
    yield from lines((f"flag: {note}" for note in notes), "flag")
    keeps = "that keeps each level of protection"
    levels = [level.label for level in LEVELS]
    for title, third, rows in (
        ("largest charge (kg TNT)", "stand-off", masses),
        ("least stand-off (m)", "charge", stand_offs),
    ):
        headers = ("layout", "place (m)", third, *levels)
        yield Table.of(f"{scenario.name}: {title} {keeps}", headers, rows, 2)


def _mass_text(edge: Edge) -> str:
    """Return the mass in kg, rounded down, with the sign of a bound at an end of the ladder."""
    sign = (">= " if edge.is_kept else "< ") if edge.is_end else ""
    return f"{sign}{rounded_down(edge.charge.tnt_kg):.3g}"


def _stand_off_text(edge: Edge) -> str:
    """Return the stand-off in m, rounded up, with the sign of a bound at an end of the ladder."""
    sign = ("<= " if edge.is_kept else "> ") if edge.is_end else ""
    return f"{sign}{ceil(10.0 * edge.stand_off_m - _ROUNDING) / 10.0:.1f}"


def facade_figure(scenario: Scenario, found: Mapping[str, Consequences]) -> "Figure":
    """Return the facade that decides under the worst charge, with each layout."""
    from blast_env.plots.facade import facade_picture  # pictures need the extra `render`

    return facade_picture(*_deciding_facade(scenario, found))


def pressure_impulse_figure(scenario: Scenario, found: Mapping[str, Consequences]) -> "Figure":
    """Return the pressure-impulse diagram of that facade."""
    from blast_env.plots.pressure_impulse import pressure_impulse_diagram

    rows, title = _deciding_facade(scenario, found)
    return pressure_impulse_diagram([(name, own.facade) for name, own in rows], title)


def _deciding_facade(
    scenario: Scenario, found: Mapping[str, Consequences]
) -> tuple[list[tuple[str, BuildingResponse]], str]:
    """Return the response of the building that decides, by layout, and its title."""
    *_, judged = found.values()
    worst = max(judged.responses, key=lambda response: response.severity)
    title = f"{scenario.title_of(worst.building)}: {charge_text(worst.charge)}, the worst"
    rows = [
        (name, response)
        for name, own in found.items()
        for response in own.under(judged.worst_number).of(worst.building)
    ]
    return rows, title
