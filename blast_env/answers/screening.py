"""The answer of screening: the worst place of each threat, and the stand-offs of components."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from blast_env.answers.document import AnyPart, Line, Table, lines, without_facade_words
from blast_env.evaluation.questions.screening import (
    BEHIND_LOW_BY,
    LOW_BY,
    RAISED_SCALED_M,
    BayScreening,
    Screening,
    ThreatScreening,
)
from blast_env.evaluation.questions.verdict import Consequences, Verdict
from blast_env.geometry import Layout, layout_counts
from blast_env.response.components import Wall
from blast_env.response.facade import response_words
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario
from blast_env.values import count_of

_THREATS: Final = (
    *("threat", "worst place (m)", "kg TNT", "nearest bay (m)", "needs in the open (m)"),
    *("level", "panes broken", "pane (GSA, ISO)", "panel", "verdict"),
)
_STAND_OFFS: Final = (
    *("component", "high, GSA 1, ISO A", "medium, 2, B", "low, 3a, D", "very low, 3b, E"),
)
_AROUND: Final = ("threat", "bays", "surroundings", "factor of the impulse", "largest of them")
_LEVELS: Final = tuple(sorted(LevelOfProtection, reverse=True)[:-1])


def screening_answer(
    scenario: Scenario,
    layout: Layout,
    found: Screening,
    required: Sequence[Requirement],
    gas: Mapping[str, Consequences] | None = None,
) -> Iterator[AnyPart]:
    """Yield the level of protection of facades, and the stand-off that each level needs.

    Args:
        gas: The consequences of each worst place by gas dynamics, by the name of the threat.
    """
    yield Line.of(f"required: {'; '.join(requirement.words for requirement in required)}")
    rows = []
    for threat in found.threats:
        rows.append(_threat_row(found, threat, required))
        if gas:
            own = gas[threat.name]
            words = response_words([response.facade for response in own.responses])
            rows.append(("  by gas", *[""] * 4, *words, "flagged" if own.is_flagged else ""))
    behind = layout_counts(layout, "barrier") if layout else "no barrier"
    title = f"{scenario.name}, {behind}: worst place by damage"
    yield Table.of(title, _THREATS, rows, 2)
    yield from lines(without_facade_words(scenario), "flag")
    hidden = "other structures stand before all of each bay: it is not screened"
    yield from lines((f"{building}: {hidden}" for building in found.hidden), "flag")
    for threat in found.threats:
        yield from lines(_other_words(threat, required), "flag")
        if threat.may_be_low:
            yield Line.of(_low_words(threat), kind="flag")
    around = [row for threat in found.threats for row in _around_rows(threat)]
    if around:
        yield Table.of("what stands around, by the atlas of shielding", _AROUND, around)
    for threat in found.threats:
        yield from map(Line.of, _unknown_words(threat))
        yield from map(Line.of, _edge_words(threat))
        yield from map(Line.of, _behind_words(threat))
    for threat in found.threats:
        title = (
            f"stand-off in the open (m) from which a component allows a level, {threat.name},"
            f" {threat.charge.tnt_kg:g} kg TNT (* on this site)"
        )
        yield Table.of(title, _STAND_OFFS, _stand_off_rows(found, threat))
    yield Line.of(found.left_out, kind="quiet")


def _threat_row(
    found: Screening, threat: ThreatScreening, required: Sequence[Requirement]
) -> tuple[str, ...]:
    kept = all(threat.keeps(requirement) for requirement in required)
    needed_m = max(found.needed_m(threat.name, requirement) for requirement in required)
    x_m, y_m = threat.charge.position_m
    return (
        threat.name,
        f"({x_m:.1f}, {y_m:.1f})",
        f"{threat.charge.tnt_kg:g}",
        f"{threat.nearest_m:.1f}",
        found.stand_offs[threat.name][0].in_words(needed_m),
        *threat.words,
        Verdict.of(kept).word().lower() + threat.doubts(required),
    )


def _other_words(threat: ThreatScreening, required: Sequence[Requirement]) -> Iterator[str]:
    """Yield the requirements that the place worst by damage keeps, and another place does not."""
    for requirement in required:
        if not all(requirement.kept_by(bay.response) for bay in threat.bays):
            continue
        for place in threat.others:
            if not place.keeps(requirement):
                x_m, y_m = place.charge.position_m
                yield (
                    f"{threat.name}: {requirement.words} fails with the charge at ({x_m:.1f},"
                    f" {y_m:.1f}), the worst place by {place.measure}"
                )
                break


def _low_words(threat: ThreatScreening) -> str:
    return (
        f"{threat.name}: loads may be low: {threat.charge.tnt_kg:g} kg TNT is"
        f" {threat.charge.height_m:g} m above the ground and {threat.least_m:.1f} m from a bay,"
        f" {threat.scaled_m:.1f} m/kg^(1/3); nearer than {RAISED_SCALED_M:g}, gas has up to"
        f" {LOW_BY:g} times screening's impulse: a blast by gas decides"
    )


def _around_rows(threat: ThreatScreening) -> Iterator[tuple[str, ...]]:
    """Yield one row per surroundings: how many bays they change, and by how much."""
    groups: dict[str, list[BayScreening]] = {}
    for bay in threat.bays:
        if bay.around:
            groups.setdefault(bay.around, []).append(bay)
    for words, own in groups.items():
        middle = [bay.factor[0] for bay in own]
        most = max(own, key=lambda bay: bay.factor[0])
        spread = f"x {min(middle):.2f} to {max(middle):.2f}" if len(own) > 1 else ""
        yield threat.name, str(len(own)), words, spread, _factor_words(most)


def _factor_words(bay: BayScreening) -> str:
    middle, low, high = bay.factor
    return f"{bay.filled.bay.name}: x {middle:.2f}, {low:.2f} to {high:.2f}"


def _edge_words(threat: ThreatScreening) -> Iterator[str]:
    """Yield what edges of walls and slanting waves do to the impulses of the curves."""
    changed = [bay.edges for bay in threat.bays if bay.edges != 1.0]
    if changed:
        yield (
            f"{threat.name}: impulses of {count_of('bay', len(changed))} are x {min(changed):.2f}"
            f" to {max(changed):.2f} of the curves' for the edges of walls and the angle of the"
            " wave"
        )


def _behind_words(threat: ThreatScreening) -> Iterator[str]:
    """Yield that the loads behind rows may be low."""
    if threat.behind:
        yield (
            f"{threat.name}: {count_of('bay', threat.behind)} behind pieces or buildings: on sites"
            f" that no law has met gas had up to {BEHIND_LOW_BY:g} times the impulse that counts"
            " here; a blast by gas decides"
        )


def _unknown_words(threat: ThreatScreening) -> Iterator[str]:
    """Yield what lies outside the range of the atlas, with the number of its bays."""
    counts: dict[str, int] = {}
    for bay in threat.bays:
        if bay.unknown:
            counts[bay.unknown] = counts.get(bay.unknown, 0) + 1
    for words, count in counts.items():
        yield (
            f"{threat.name}: {count_of('bay', count)} outside the range of the atlas: {words}:"
            " obstacles take nothing off there, fronts count as at the end of the range, a charge"
            " against a wall as up to twice its mass; a blast by gas decides"
        )


def _stand_off_rows(found: Screening, threat: ThreatScreening) -> Iterator[tuple[str, ...]]:
    for own in found.stand_offs[threat.name]:
        kind = "wall" if isinstance(own.component, Wall) else "glass"
        mark = " *" if own.name in found.present else ""
        cells = (own.in_words(own.distances_m[level]) for level in _LEVELS)
        yield f"{kind}: {own.name}{mark}", *cells
