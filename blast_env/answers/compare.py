"""Layouts beside each other: the table of loads and the table of buildings with a facade."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import Final, NamedTuple

import numpy as np

from blast_env.answers.assess import response_cells
from blast_env.answers.document import AnyCell, Number, Table
from blast_env.evaluation.blasts import Blasts, NumberOf, Severity
from blast_env.evaluation.questions.grid_error import GridError
from blast_env.evaluation.questions.probability import (
    Uncertainty,
    level_probability,
    probability_text,
)
from blast_env.evaluation.questions.verdict import Consequences
from blast_env.evaluation.record import BlastLoads, BlastRecord, on_buildings
from blast_env.evaluation.validation import worst_validation
from blast_env.site import Scenario
from blast_env.statistics import counted_parts, reductions

_TOGETHER: Final = "all protected"
_LOADS: Final = (
    *("layout", "threat", "structure", "impulse (Pa\N{NO-BREAK SPACE}s)", "peak (kPa)", "counts: "),
    *("reduction", "cost", "engine", "validation of the load"),
)
_LOAD, _COST = _LOADS.index("counts: "), _LOADS.index("cost")
_BUILDINGS: Final = (
    *("layout", "threat", "building", "level of protection", "its probability", "panes broken"),
    *("worst pane (GSA, ISO)", "worst wall panel", "validation of the load", "flags"),
)
_NONE: Final = "\N{EN DASH}"
_DRAWS: Final = 200  # of the uncertain quantities: the table must come at once


def comparison(
    layouts: Mapping[str, tuple[Blasts, float]], threats: Sequence[str], scenario: Scenario
) -> Table:
    """Return the comparison of layouts, one row per layout, threat and building.

    With several threats, the last rows hold the loads by the site's objective over all of them, for
    each layout blasted under all.

    Args:
        layouts: The blasts of each layout and of no barrier, and its cost, by its name.
    """
    objective = scenario.objective
    rows = []
    for threat in threats:
        for name, (blasts, cost) in layouts.items():
            numbers = [k for k, own in enumerate(blasts.threats) if own.name == threat]
            for number in numbers:
                record = blasts.records[blasts.judged][number]
                for title, parts in _shown(record.loads):
                    words = name, threat, scenario.title_of(title) if title else _TOGETHER
                    rows.append((*words, *_loads(blasts, numbers, parts, cost)))
    if len(threats) > 1:
        over = f"all {len(threats)}: {objective.charges}", _TOGETHER
        rows += [
            (name, *over, *_loads(blasts, range(len(threats)), (), cost))
            for name, (blasts, cost) in layouts.items()
            if len(blasts.threats) == len(threats)
        ]
    headers = [*_LOADS]
    headers[_LOAD] += objective.noun + (f" ({objective.unit})" if objective.unit else "")
    if scenario.build_zone is not None and scenario.zone.currency:
        headers[_COST] += f" ({scenario.zone.currency})"
    table = [tuple(headers), *rows]
    if objective.quantity == "impulse" and not objective.is_response:  # it is the load
        table = [row[:_LOAD] + row[_LOAD + 1 :] for row in table]
    return Table.of("", list(map(str, table[0])), table[1:], 3, 2)


def headline(blasts: Blasts, number: int) -> Number:
    """Return the load of the protected structures under a threat, as the objective counts it."""
    record, error = blasts.records[blasts.judged][number], GridError.of(blasts)
    load = blasts.objective_of(record)
    share = nan if error is None else error.of_load(blasts.objective_of)
    return Number.load(blasts.scenario.objective, load, share * load)


def _only(loads: BlastLoads, names: Collection[str]) -> BlastLoads:
    """Return the loads on some structures as if they alone counted.

    Of the structures named the protected ones count, or else all. Without any name, all protected
    structures of the site count.
    """
    if not names:
        return loads
    parts = counted_parts([structure for structure in loads.structures if structure.name in names])
    return replace(loads, structures=tuple(replace(part, protected=True) for part in parts))


def _shown(loads: BlastLoads) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name of each row of a blast, and the structures whose loads it has.

    The first is for all protected structures, the others are the buildings.
    """
    yield "", ()
    parts: dict[str, list[str]] = {}
    for structure in loads.structures:
        parts.setdefault(structure.building, []).append(structure.name)
    for name, own in parts.items():
        yield name if len(own) > 1 else own[0], tuple(own)


def _loads(
    blasts: Blasts, numbers: Iterable[int], names: tuple[str, ...], cost: float
) -> tuple[AnyCell, ...]:
    """Return the cells of a layout: loads on some structures over some threats."""
    objective, chosen, error = (
        blasts.scenario.objective,
        blasts.under(numbers),
        GridError.of(blasts),
    )

    def load_of(record: BlastRecord) -> float:
        return _only(record.loads, names).load(objective)

    def impulse_of(record: BlastRecord) -> float:
        found = _only(record.loads, names)
        if not names:
            return found.protected_impulse_pa_s
        return on_buildings(found.structures)[0].impulse_pa_s

    def number(number_of: NumberOf) -> Number:
        value = float(objective.risk(chosen.values(chosen.judged, number_of)))
        share = nan if error is None else error.of_load(number_of)
        return Number(value, error=share * value)

    parts = [_only(own.loads, names) for own in chosen.records[chosen.judged]]
    reduction: AnyCell = _NONE
    if chosen.judged != chosen.unprotected:
        load, unprotected = (
            float(objective.risk(chosen.values(side, load_of)))
            for side in (chosen.judged, chosen.unprotected)
        )
        off = nan if error is None else error.of_reduction(load_of)
        reduction = Number.share(reductions(load, unprotected).item(), off)
    return (
        number(impulse_of),
        Number.kpa(float(np.max([part.protected_peak_pa for part in parts]))),
        number(load_of),
        reduction,
        f"{cost:,.10g}",
        blasts.engine.words,
        worst_validation(load.validation for part in parts for load in part.protected).words,
    )


class BuildingVerdict(NamedTuple):
    """The response of a building to one blast, without the histories on its bays.

    A building of which no air touches a wall has empty cells, and the reason among its flags.

    Attributes:
        is_clipped: Whether its level on the cells, which clip peaks, is higher.
        cells: Its cells in the table of buildings.
        flags: Reasons to distrust the verdict.
    """

    building: str
    severity: Severity
    is_clipped: bool
    cells: tuple[AnyCell, ...]
    flags: tuple[str, ...]


def building_verdicts(found: Consequences) -> tuple[BuildingVerdict, ...]:
    """Return the responses of the buildings to one blast."""
    verdicts = []
    for response in found.responses:
        name = response.building
        alone, level = Consequences((response,)), response.facade.level_of_protection
        draws = level_probability(alone, Uncertainty(), _DRAWS)
        likely = probability_text(draws.of(level), _DRAWS) if level else _NONE
        words, *panes = response_cells(alone, name)
        clipped = alone.level_on_cells(name) > alone.level(name)
        cells = (words, likely, *panes, alone.validation(name).words)
        flags = _flags(found, name)
        verdicts.append(BuildingVerdict(name, response.severity, clipped, cells, flags))
    for name in dict.fromkeys(walls.building for walls in found.unjudged):
        if name not in found.buildings:
            cells = ("no verdict", *(_NONE,) * 5)
            verdicts.append(BuildingVerdict(name, Severity(), False, cells, _flags(found, name)))
    return tuple(verdicts)


def _flags(found: Consequences, name: str) -> tuple[str, ...]:
    """Return the reasons to distrust the verdict on a building."""
    flags = [why for building, why in found.unchecked if building == name]
    flags += [walls.words for walls in found.unjudged if walls.building == name]
    flags += [words for building, words in found.unloaded if building == name]
    # Thin interlayers, oblique walls, and impulses not captured; doubtful loads once.
    own = Consequences(found.of(name))
    doubts = () if flags else own.notes
    others = replace(own, responses=tuple(replace(part, site=None) for part in own.responses)).notes
    flags += [note.removeprefix(f"{name}: ") for note in doubts or others]
    return tuple(flags)


def verdict_table(
    scenario: Scenario, judged: Iterable[tuple[str, str, Sequence[BuildingVerdict]]]
) -> Table:
    """Return the table of buildings; with several threats, the worst of them first.

    Args:
        judged: Name of the layout and of the threat, and the responses.
    """
    found: dict[tuple[str, str], list[tuple[str, BuildingVerdict]]] = {}
    for name, threat, verdicts in judged:
        for verdict in verdicts:
            found.setdefault((name, verdict.building), []).append((threat, verdict))
    rows = []
    for (name, building), own in found.items():
        title = scenario.title_of(building)
        if len(own) > 1:
            worst = max((verdict for _, verdict in own), key=lambda verdict: verdict.severity)
            every = dict.fromkeys(flag for _, verdict in own for flag in verdict.flags)
            rows.append(_verdict_row(worst, name, f"worst of {len(own)}", title, every))
        rows += [
            _verdict_row(verdict, name, threat, title, verdict.flags) for threat, verdict in own
        ]
    return Table.of("", _BUILDINGS, rows, len(_BUILDINGS))


def _verdict_row(
    verdict: BuildingVerdict, layout: str, threat: str, title: str, flags: Iterable[str]
) -> tuple[AnyCell, ...]:
    return (layout, threat, title, *verdict.cells, "; ".join(flags) or _NONE)
