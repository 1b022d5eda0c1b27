"""Page one of a report: the verdict, the reasons, and what it rests on."""

from collections.abc import Iterator

from blast_env.answers.assess import response_table
from blast_env.answers.document import (
    AnyPart,
    Kind,
    Line,
    Number,
    Section,
    Table,
    height_words,
    lines,
    percent,
    rounded_down,
    without_facade_words,
)
from blast_env.answers.left_out import left_out_words
from blast_env.evaluation.engines.pieces import outcome_words
from blast_env.evaluation.places import place_text
from blast_env.evaluation.questions.capacity import mass_near
from blast_env.evaluation.questions.probability import level_probability, probability_text
from blast_env.evaluation.study import Study, gas_of
from blast_env.geometry import layout_counts
from blast_env.layout import LayoutState
from blast_env.response.buildings import BuildingDamage
from blast_env.values import count_of


def summary_of(study: Study) -> Section:
    """Return the summary of a study."""
    return Section.of("Verdict", _verdict(study), _loads(study), is_summary=True)


def charge_words(study: Study) -> str:
    """Return the threats in words, each with its mass and its places."""
    return "; ".join(
        f"{threat.name}, {threat.charge.tnt_kg:g} kg TNT at "
        f"{place_text(threat, study.scenario, study.layout)}{height_words(threat.charge.height_m)}"
        for threat in study.threats
    )


def grid_error_words(study: Study) -> str:
    """Return the largest grid error of a reduction in words."""
    return f"grid error is up to {percent(study.grid_error)} of the impulse"


def _verdict(study: Study) -> Iterator[AnyPart]:
    bare, behind = study.verdicts
    if not behind.is_asked:
        yield Line.of(behind.word, kind="answer")
        found = "can be judged" if study.protected.unjudged else "has a facade"
        yield Line.of(
            f"No load limit was given, and no building {found}: a specialist has to interpret "
            "the loads."
        )
    else:
        kind: Kind = "passes" if behind.passes else "fails"
        yield Line.of(f"{behind.word}: {behind.words}.", kind=kind)
        yield Table.of("", ("", ""), _facts(study), 2)
    if study.stopped:
        missing = "The parts after it are missing."
        yield Line.of(f"This report was stopped before: {study.stopped}. {missing}", kind="flag")
    for walls in study.protected.unjudged:
        title = study.scenario.title_of(walls.building)
        yield Line.of(f"{title}: {walls.words}.", kind="flag")
    for building, words in study.protected.unloaded:
        yield Line.of(f"{study.scenario.title_of(building)}: {words}.", kind="flag")
    for limit in study.unloaded_limits:
        title = study.scenario.title_of(limit.building)
        yield Line.of(f"{title}: it has no load, and its limit is not checked.", kind="flag")
    if behind.is_asked:
        limited = [own.limit.building for own in behind.limited]
        yield from lines(without_facade_words(study.scenario, limited), "flag")
        charges = [threat.charge for threat in study.threats]
        yield from lines(left_out_words(study.scenario, charges, study.layout), "flag")
    if behind.doubt:
        yield Line.of(f"Cells clip peaks: {behind.doubt}.")
    if behind.found.buildings:
        yield response_table(study.blasts, study.found)
        yield Line.of(f"With the layout: {study.protected.force_words}.", kind="quiet")
    if behind.limited:
        kept, of_bare = (sum(load.is_kept for load in side.limited) for side in (behind, bare))
        cases = f"{kept} of {len(behind.limited)} cases with the layout, {of_bare} without"
        yield Line.of(f"Limits are kept in {cases}.")


def _facts(study: Study) -> Iterator[tuple[str, str]]:
    bare, behind = study.verdicts
    zone = study.scenario.zone
    required = [f"level of protection {study.target.title}"] * bool(behind.found.buildings)
    required += ["load limits"] * bool(behind.limited)
    under = f"under {count_of('threat', len(study.threats))}, {gas_of(study.blasts).cell_words}"
    yield "Required", f"{'; '.join(required)}, {under}"
    if behind.found.buildings:
        yield "Probability", _probability(study)
        yield "Largest charge", _masses(study)
    budget = "" if zone.budget is None else f" of a budget of {zone.priced(zone.budget)}"
    cost = zone.priced(LayoutState.of(study.scenario, study.layout).cost)
    yield "Cost", f"{cost}{budget}, for {layout_counts(study.layout)}"
    yield "Without the layout", bare.word.lower()
    yield "Why", " ".join(_reasons(study))
    yield "What it rests on", " ".join(_basis(study))


def _probability(study: Study) -> str:
    behind = level_probability(study.protected, study.uncertainty)
    without = "no verdict"
    if study.unprotected.responses:
        bare = level_probability(study.unprotected, study.uncertainty)
        without = probability_text(bare.of(study.target), len(bare.levels))
    return f"level {behind.words(study.target)}; without the layout {without}"


def _masses(study: Study) -> str:
    words = []
    for number, threat in enumerate(study.threats):
        found = study.protected.under(number)
        kg, is_found = mass_near(found, study.target)
        bound = "at least " if found.passes(study.target) else "less than "
        mass = Number(rounded_down(kg), "kg TNT").text()
        words.append(f"{threat.name} {'' if is_found else bound}{mass}")
    return (
        f"{', '.join(words)}: with it the level is kept at the same place; blast-env assess "
        "--capacity examines more"
    )


def _reasons(study: Study) -> Iterator[str]:
    title_of, behind = study.scenario.title_of, study.protected
    for name in behind.buildings:
        is_known = name in study.unprotected.buildings
        bare = study.unprotected.summary(name).level if is_known else "no verdict"
        own = behind.summary(name)
        yield (
            f"{title_of(name)} has the level {own.level}; without the layout: {bare}. With it"
            f" {own.broken:.1f} of {own.panes} panes break and {own.failed} of {own.panels} panels"
            f" fail; worst pane {own.condition}, worst panel {own.damage}."
        )
    for name, effects in [*study.effects.items()][:1]:
        least, most = (
            Number.reduction(end(effect.reduction for effect in effects)).text()
            for end in (min, max)
        )
        yield f"The impulse on {title_of(name)} falls by {_span(least, most)}."
    if behind.worst_barrier is not None:
        yield f"Under the worst threat, {outcome_words(behind.worst_barrier.pieces)}."
    for house in behind.worst_neighbours[:1]:
        likely = percent(house.probability[BuildingDamage.MAJOR])
        where = f"in the place of {title_of(house.building)}"
        yield f"An ordinary house {where} has major damage with a probability of {likely}."


def _span(least: str, most: str) -> str:
    return least if least == most else f"{least} to {most}"


def _basis(study: Study) -> Iterator[str]:
    mass = f"{100.0 * study.uncertainty.mass:g} %"
    yield f"The charges: {charge_words(study)}; masses within {mass} (95 %)."
    parts = ["Loads are by gas dynamics"]
    if study.blasts.coarse is not None:
        parts.append(f"the {grid_error_words(study)}")
    notes = study.notes_of(study.blasts)
    words = f"{count_of('note', len(notes))} on loads outside the validated range of the engine"
    yield ", ".join(parts) + (f"; {words}" if notes else "") + "."
    for name in study.protected.buildings:
        words = study.protected.validation(name).words
        title = study.scenario.title_of(name)
        yield f"Validation of the load that decides on {title}: {words}."
    yield "Components and costs of the site file; frames and anchors hold."


def _loads(study: Study) -> Iterator[AnyPart]:
    """Yield the impulse on each protected building under its worst threat."""
    rows = []
    for name, effects in study.effects.items():
        number = max(range(len(effects)), key=lambda k: effects[k].value)
        worst, gone = effects[number], sorted(effects, key=lambda effect: effect.reduction)
        load = study.blasts.records[study.blasts.judged][number].complete.buildings[name]
        error = max(effect.reduction_error for effect in effects)
        span = [Number.reduction(gone[0].reduction), Number.reduction(gone[-1].reduction, error)]
        rows.append(
            (
                study.scenario.title_of(name),
                study.threats[number].name,
                Number(worst.unprotected, error=worst.unprotected_error),
                Number(worst.value, error=worst.error),
                span[1] if len(effects) == 1 else Line.of(span[0], " to ", span[1]),
                Number.kpa(load.peak_pa),
                load.validation.status.label,
            )
        )
    headers = (
        *("protected building", "worst under", "impulse without (Pa s)", "with the layout (Pa s)"),
        *("reduction, over the threats", "peak with (kPa)", "validation status"),
    )
    known = ", with their grid errors" if study.blasts.coarse is not None else ""
    yield Table.of(f"Loads of the protected buildings{known}", headers, rows, 2, 1)
