"""The answer of `evaluate`: mean loads of buildings and the effect of a layout over all threats."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

from blast_env.answers.assess import cells_words, no_cells_words
from blast_env.answers.document import (
    TYPOGRAPHIC,
    AnyPart,
    Line,
    Number,
    Table,
    building_words,
    height_words,
    interval,
    lines,
    percent,
    validation_lines,
)
from blast_env.answers.left_out import left_out_words
from blast_env.evaluation import BlastCounts
from blast_env.evaluation.cases import are_all, fixed_charges, has_few_places
from blast_env.evaluation.questions.reduction import Evaluation
from blast_env.geometry import layout_counts
from blast_env.site import AnyCharge, ObjectiveSection, VehicleSource
from blast_env.site.blast_site import Charge
from blast_env.statistics import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADERS: Final = (
    *("building", "protected", "without (Pa s)", "with (Pa s)", "reduction", "95 % interval"),
    *("threats in range", "validation"),
)


def evaluation_answer(found: Evaluation, seeds: Sequence[int]) -> Iterator[AnyPart]:
    """Yield the buildings' mean loads, the totals, the worst threat, and notes.

    `seeds` drew the threats.
    """
    scenario, buildings = found.scenario, found.building_table
    count = len(found.threats)
    barriers = layout_counts(found.layout, "barrier")
    title = f"{scenario.name}: {barriers} against none, {_threats_text(count, seeds)}"
    rows = [_row(found, row) for row in buildings.to_dict("records")]
    yield Table.of(title, _HEADERS, rows, 2, 1)
    yield from lines(validation_lines(scenario, buildings, "structure"))
    sampled = "threats" if found.engine.has_noise else "charges"
    yield from means(found, scenario.objective, sampled)
    yield from _objective(found)
    worst = found.worst
    yield Line.of(
        f"worst threat: {worst.charge.tnt_kg:g} kg TNT at ({worst.charge.position_m[0]:.2f}, "
        f"{worst.charge.position_m[1]:.2f}) m{height_words(worst.charge.height_m)}, "
        f"seed {worst.threat.seed}: ",
        Number.load(scenario.objective, worst.load),
        ", reduction ",
        Number.reduction(worst.reduction),
    )
    is_scaled = found.engine.needs_calibration
    law = f"calibration {found.calibration}, " if is_scaled else ""
    yield Line.of(f"{law}scenario hash {scenario.content_hash[:12]}", kind="quiet")
    yield from lines(f"note: {words}" for words in sampling_notes(found))
    yield from lines((f"note: {note}" for note in found.notes), "flag")


def sampling_notes(found: Evaluation) -> Iterator[str]:
    """Yield which charges of the site count in the means, and how."""
    scenario, charges = found.scenario, [threat.charge for threat in found.threats]
    yield from left_out_words(scenario, charges, found.layout)
    sources, fixed = scenario.charge, len(fixed_charges(scenario))
    if fixed > 1 and are_all(scenario, charges):
        weighted = len({source.weight for source in sources}) > 1
        alike = " alike, whatever their weights" if weighted else ""
        yield (
            f"the site has {fixed} fixed charges, which all count here{alike}; the interval "
            "is their spread, not an uncertainty about others"
        )
    elif not fixed and _are_at_one_place(charges) and not found.engine.has_noise:
        if len({source.weight for source in sources}) > 1:
            yield "all masses count here alike, whatever the weights of their sources"
    elif not fixed and has_few_places(scenario) and not found.engine.has_noise:
        shares = {
            source.weight / (source.places if isinstance(source, VehicleSource) else 1)
            for source in sources
        }
        if len(shares) > 1:
            yield "all places of charges count here alike, whatever the weights of their sources"


def _are_at_one_place(charges: Sequence[AnyCharge]) -> bool:
    """Return whether charges of several masses are at one place, which the user gave."""
    places = {own.position_m if isinstance(own, Charge) else own for own in charges}
    return len(charges) > 1 and len(places) == 1


def cache_line(counts: BlastCounts) -> Line:
    """Return the counts of blasts that were run, and known already."""
    return Line.of(
        f"{counts.blasts:g} blasts run, {counts.cache_hits:g} known already "
        f"(cache hit rate {percent(counts.cache_hit_rate)})"
    )


def evaluation_picture(found: Evaluation) -> "Figure":
    """Return the figure of an evaluation, with its reduction and errors as title."""
    # Here, because pictures need the extra `render`.
    from blast_env.plots.evaluation_figures import evaluation_figure

    barrier = layout_counts(found.layout, "barrier") if found.layout else "no barrier"
    share = Number.share(found.mean_reduction, found.reduction_error)
    own = f" (95 %: {interval(found.reduction)})" if len(found.threats) > 1 else ""
    noun = found.scenario.objective.noun
    title = (
        f"{found.scenario.name}, {barrier}: reduction of the {noun} {share.text(TYPOGRAPHIC)}{own}"
    )
    return evaluation_figure(found, title)


def _threats_text(count: int, seeds: Sequence[int]) -> str:
    """Return the threats of the means in words."""
    if count == 1:
        return f"seed {seeds[0]}"
    return f"means over {count} threats (seeds {seeds[0]} to {seeds[-1]})"


def _row(found: Evaluation, row: dict[Any, Any]) -> tuple[str | Number, ...]:
    reduction = Estimate(row["reduction"], row["reduction_low"], row["reduction_high"])
    return (
        building_words(found.scenario, str(row["structure"])),
        "yes" if row["protected"] else "no",
        Number(row["unprotected_impulse_pa_s"], error=row["unprotected_impulse_error_pa_s"]),
        Number(row["impulse_pa_s"], error=row["impulse_error_pa_s"]),
        Number.share(reduction.value, row["reduction_error"]),
        interval(reduction),
        f"{row['threats_in_range']} of {len(found.threats)}",
        row["validation"],
    )


def _objective(found: Evaluation) -> Iterator[Line]:
    objective = found.scenario.objective
    if objective == ObjectiveSection():
        return
    over = {"mean": "mean over", "cvar": "mean of the worst", "worst": "worst of"}
    noun = "impulse and peak" if objective.quantity == "both" else objective.noun
    yield Line.of(
        f"objective ({noun}, {over[objective.charges]} the charges): ",
        Number.load(objective, found.unprotected_load),
        " without barrier, ",
        Number.load(objective, found.load, found.objective_error),
        " with",
    )


def means(
    found: Evaluation, objective: ObjectiveSection, sampled: str = "charges"
) -> Iterator[Line]:
    """Yield the reduction, the mean loads without and with barrier, and what their errors are."""
    share = Number.reduction(found.reduction.value, found.reduction_error)
    yield Line.of(
        "protected structures, by weight: mean reduction ",
        share.sampled_by(found.reduction, sampled, 0.01),
    )
    worst = f"mean of the worst {100.0 * (1.0 - found.cvar_level):.3g} % "
    for words, load, error, cvar in (
        (
            "without barrier",
            found.unprotected_mean,
            found.unprotected_mean_error,
            found.unprotected_cvar,
        ),
        ("with barrier", found.mean, found.mean_error, found.cvar),
    ):
        number = Number.load(objective, load.value, error).sampled_by(load, sampled)
        yield Line.of(f"{words}: mean ", number, f", {worst}", Number.load(objective, cvar))
    if found.grid_error is not None:
        yield Line.of(cells_words(found.grid_error), kind="quiet")
    elif words := no_cells_words(found.engine):
        yield Line.of(words, kind="quiet")
