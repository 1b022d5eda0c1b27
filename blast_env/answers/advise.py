"""The answer of `advise`: the cost to pass, flags, errors, and the table of kinds of measures."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from blast_env.answers.assess import impulse_lines, no_cells_words
from blast_env.answers.document import (
    AnyPart,
    Line,
    Table,
    lines,
    percent,
    without_facade_words,
)
from blast_env.answers.left_out import left_out_words
from blast_env.design.search.advice import Advice, MeasureKind
from blast_env.design.search.advised import AdviceResult
from blast_env.evaluation.questions.probability import DRAWS, probability_text
from blast_env.evaluation.questions.verdict import Verdict
from blast_env.geometry import layout_words
from blast_env.layout import LayoutState
from blast_env.layout.placement import load_relevant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADERS: Final = (
    *("kind", "layout", "cost", "blasts", "level", "passes", "judged", "sharp peaks"),
    "probability",
)


def advice_answer(found: AdviceResult) -> Iterator[AnyPart]:
    """Yield the cost to pass, flags, the grid error, and the table of the kinds."""
    judge, best = found.judge, found.best
    scenario, target = judge.scenario, judge.target
    yield Line.of(_first_line(found, best), kind="answer")
    charges = [threat.charge for threat in judge.problem.threats]
    left_out = left_out_words(scenario, charges, best.layout)
    notes = *left_out, *without_facade_words(scenario), *judge.judged[best.layout].notes
    yield from lines((f"flag: {note}" for note in notes), "flag")
    error = judge.error(best.layout)
    if error is not None:
        yield from impulse_lines(error)
    else:
        yield Line.of(f"{no_cells_words(judge.engine)}; probabilities leave it out", kind="quiet")
    rows = []
    for own in found.found:
        seen = judge.judged[own.layout]
        rows.append(
            (
                str(own.kind),
                layout_words(own.layout),
                f"{LayoutState(scenario, own.layout).cost:,.10g}",
                str(own.blasts),
                min(seen.level(building) for building in seen.buildings).label,
                "yes" if own.passes else "no",
                Verdict.of(seen.passes_on_cells(target)).word(seen.is_flagged).lower(),
                seen.verdict_word(target).lower(),
                probability_text(judge.shares[own.layout], DRAWS),
            )
        )
    zone = scenario.zone
    budget = "no limit" if zone.budget is None else zone.priced(zone.budget)
    title = f"{scenario.name}: budget {budget}, required level {target.label!r}"
    yield Table.of(title, _HEADERS, rows, 2)
    yield Line.of(
        f"passes: by the search; judged: {judge.engine.words}; level, sharp peaks: the same "
        "impulses with peaks that cells do not clip as well; probability: of the required "
        "level.",
        kind="quiet",
    )


def _first_line(found: AdviceResult, best: Advice) -> str:
    """Return the answer in a line or two: the cost to pass, and whether walls help."""
    judge = found.judge
    scenario, target = judge.scenario, judge.target
    by_kind = {advice.kind: advice for advice in found.found}
    flagged = " (flagged)" if judge.judged[best.layout].is_flagged else ""
    wanted = scenario.objective.target_probability
    likely = probability_text(judge.shares[best.layout], DRAWS)
    if judge.verdict(best.layout) is not Verdict.PASSES:
        least = (
            "" if wanted is None else f" with a probability of {wanted:g}; the best has {likely}"
        )
        answer = f"{scenario.name}: nothing that was tried reaches {target.label!r}{least}."
    elif not best.layout:
        answer = f"{scenario.name}: the empty site reaches {target.label!r} with {likely}{flagged}."
    else:
        words = layout_words(best.layout)
        price = scenario.zone.priced(LayoutState(scenario, best.layout).cost)
        answer = f"{scenario.name}: {target.label!r} with {likely} costs {price}{flagged}: {words}."
    shield, nothing = by_kind.get(MeasureKind.SHIELD), by_kind[MeasureKind.NOTHING]
    if shield is None or judge.judged[shield.layout].passes(target):
        return answer
    gain = 1.0 - (shield.worth - 1.0) / (nothing.worth - 1.0) if nothing.worth > 1.0 else 0.0
    if best.passes and not load_relevant(best.layout):
        return f"Walls are worth nothing here: better components alone are cheaper. {answer}"
    if gain < 0.01:
        return (
            "Walls alone are worth nothing here: they change the shortfall by "
            f"{percent(gain)}. {answer}"
        )
    return answer


def advice_figure(advice: AdviceResult) -> "Figure":
    """Return the figure of cost against level of protection, of all layouts tried and judged."""
    # Here, because pictures need the extra `render`.
    from blast_env.plots.cost_level import DamagePrice, cost_level_figure

    judge, scenario = advice.judge, advice.judge.scenario
    tried = {
        str(own.kind): [DamagePrice(x.cost, x.damage) for x in own.tried] for own in advice.found
    }
    searched = {
        x.layout: DamagePrice(x.cost, x.damage) for part in advice.found for x in part.tried
    }
    pairs = [
        (searched[layout], searched[layout]._replace(damage=seen.worst_damage(scenario)))
        for layout, seen in judge.judged.items()
    ]
    count = len(judge.problem.threats)
    title = f"{scenario.name}: cost of each higher level, worst of {count} charges"
    engines = judge.problem.evaluator.engine.words, judge.engine.words
    axis = f"cost, {scenario.zone.cost_unit}" if scenario.zone.currency else "cost units"
    return cost_level_figure(tried, pairs, judge.target, title, engines, axis)
