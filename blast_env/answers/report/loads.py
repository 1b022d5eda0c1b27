"""The loads of a report: by threat and size of cells, bay by bay, by item, and at other places."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isnan, nan
from typing import Any, Final

from blast_env.answers.document import (
    AnyCell,
    AnyPart,
    Line,
    Number,
    Picture,
    Section,
    Table,
    height_words,
)
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.places import place_text
from blast_env.evaluation.questions.verdict import BuildingResponse
from blast_env.evaluation.study import Study, gas_of
from blast_env.geometry import layout_text
from blast_env.plots.report_figures import Drawing, worth_map

_NONE: Final = "\N{EN DASH}"
_MOST_BAYS: Final = 40
_NO_AIR: Final = {"break_probability": nan, "condition": "", "damage": "", "validation": _NONE}
_LOADS: Final = (
    *("building", "cells", "", "most loaded wall", "impulse (Pa s)", "peak (kPa)", "arrival (ms)"),
    *("impulse on that wall (Pa s)", "duration (ms)", "reduction", "validation status"),
)


def loads_of(study: Study, pictures: Mapping[str, Sequence[Drawing]]) -> Section:
    """Return the loads of every threat, the bays, and the pictures of the threats by their name."""
    words = gas_of(study.blasts).cell_words
    shown = (
        Picture(f"{name}, {own.caption}; {words}.", own.png)
        for number, (name, drawn) in enumerate(pictures.items())
        for own in drawn
        if number or not own.is_facade  # those of the first threat have a section of their own
    )
    return Section.of("Loads", _meaning(study), _threats(study), _bays(study), shown)


def _meaning(study: Study) -> Iterator[AnyPart]:
    yield Line.of(
        "Impulse is the peak specific impulse: the largest value of the integral of the "
        "overpressure over time, as the mean over the area of the assessed walls of the building. "
        "The peak is the largest overpressure on a face of a cell. The impulse of the most loaded "
        "wall is the mean over that wall; the duration is that of the first positive phase of its "
        "mean overpressure."
    )
    fine = gas_of(study.blasts).cell_words
    words = f"Peaks grow with finer cells: take those with {fine} as a lower bound."
    yield Line.of(words, kind="flag")


def _threats(study: Study) -> Iterator[AnyPart]:
    for number, threat in enumerate(study.threats):
        place = place_text(threat, study.scenario, study.layout)
        high = height_words(threat.charge.height_m)
        yield Line.of(
            f"{threat.name}: {threat.charge.tnt_kg:g} kg TNT at {place}{high}", kind="head"
        )
        rows: list[tuple[AnyCell, ...]] = []
        main, statuses = list[int](), list[str]()
        for name in study.buildings(protected=True):
            for blasts in study.sizes:
                rows += _load_rows(study, blasts, number, name)
                if blasts is study.blasts:
                    main.append(len(rows) - 1)
                for record in blasts.pairs(blasts.judged)[number][::-1]:
                    statuses.append(record.complete.buildings[name].validation.words)
        yield Table.of("Protected buildings", _LOADS, rows, 4, 1, main)
        words = "; ".join(dict.fromkeys(statuses))
        yield Line.of(f"Validation status of the impulses: {words}.", kind="quiet")
        if others := study.buildings(protected=False):
            yield _others(study, number, others)


def _load_rows(
    study: Study, blasts: Blasts, number: int, name: str
) -> Iterator[tuple[AnyCell, ...]]:
    """Yield the rows of a building without the layout and with it."""
    effect = study.effect(blasts, number, name)
    protected, unprotected = (
        record.complete.buildings[name] for record in blasts.pairs(blasts.judged)[number]
    )
    bare = Number(effect.unprotected, error=effect.unprotected_error)
    behind = Number(effect.value, error=effect.error)
    gone = Number.reduction(effect.reduction, effect.reduction_error)
    title, cells = study.scenario.title_of(name), gas_of(blasts).cell_words
    for words, load, impulse, reduction in (
        ((title, cells, "without"), unprotected, bare, ""),
        (("", "", "with"), protected, behind, gone),
    ):
        yield (
            *words,
            load.wall,
            impulse,
            Number.kpa(load.peak_pa),
            Number.ms(load.arrival_s),
            Number(load.wall_impulse_pa_s),
            Number.ms(load.duration_s),
            reduction,
            load.validation.status.label,
        )


def _others(study: Study, number: int, names: Iterable[str]) -> Table:
    rows = []
    for name in names:
        effect = study.effect(study.blasts, number, name)
        pair = study.blasts.pairs(study.blasts.judged)[number]
        protected, unprotected = (record.complete.buildings[name] for record in pair)
        rows.append(
            (
                study.scenario.title_of(name),
                Number(effect.unprotected, error=effect.unprotected_error),
                Number(effect.value, error=effect.error),
                Number.kpa(unprotected.peak_pa),
                Number.kpa(protected.peak_pa),
                Number.share(-effect.reduction, effect.reduction_error),
            )
        )
    headers = (
        *("building", "impulse without (Pa s)", "with", "peak without (kPa)", "with"),
        "change of impulse",
    )
    return Table.of(f"Other buildings, {gas_of(study.blasts).cell_words}", headers, rows)


def _bays(study: Study) -> Iterator[AnyPart]:
    """Yield the bays of each building under each threat, those with the worst panes first."""
    headers = (
        *("structure/wall/storey/number", "panes break, without", "GSA", "wall panel"),
        *("with the layout", "GSA", "wall panel", "validation status of the load"),
    )
    for number in range(len(study.threats)):
        sides = study.unprotected.under(number), study.protected.under(number)
        for name in dict.fromkeys(name for side in sides for name in side.buildings):
            own = [response for side in sides for response in side.of(name)]
            x_m, y_m = own[-1].charge.position_m
            place = f"{own[-1].charge.tnt_kg:g} kg at ({x_m:.1f}, {y_m:.1f}) m"
            title = f"Bay by bay: {study.scenario.title_of(name)}, {place}"
            rows = _bay_rows(*(side.of(name) for side in sides))
            fine = gas_of(study.blasts).cell_words
            yield Table.of(f"{title}, {fine}", headers, rows[:_MOST_BAYS], len(headers))
            if len(rows) > _MOST_BAYS:
                left_out = len(rows) - _MOST_BAYS
                words = f"And {left_out} more bays with less damage"
                yield Line.of(f"{words}; blast-env assess --table has all.", kind="quiet")


def _bay_rows(
    unprotected: Sequence[BuildingResponse], protected: Sequence[BuildingResponse]
) -> list[tuple[AnyCell, ...]]:
    """Return a row for each bay of a building, those with the worst panes with the layout first.

    A bay that no air touches on one side has no numbers there.
    """
    bare, behind = (
        {str(row["bay"]): row for response in side for row in response.rows}
        for side in (unprotected, protected)
    )
    both = [(name, bare.get(name, _NO_AIR), behind.get(name, _NO_AIR)) for name in (behind | bare)]
    # "5" is worse than "3b", and "3b" than "3a": the order of texts is right.
    both.sort(key=lambda rows: (str(rows[2]["condition"]), _share(rows[2])), reverse=True)
    return [
        (name, *_bay_cells(without), *_bay_cells(own), str(own["validation"]))
        for name, without, own in both
    ]


def _share(row: Mapping[str, Any]) -> float:
    share = float(row["break_probability"])
    return -1.0 if isnan(share) else share


def _bay_cells(row: Mapping[str, Any]) -> tuple[AnyCell, ...]:
    share = Number.share(float(row["break_probability"]))
    return share, str(row["condition"]) or _NONE, str(row["damage"]) or _NONE


def contributions(study: Study) -> Section | None:
    """Return the rank of each item of the layout; `None` if that was not asked or finished."""
    if study.items is None:
        return None
    coarse, error = gas_of(study.items).cell_words, study.grid_error
    within = (
        ""
        if isnan(error)
        else f" Contributions below {100.0 * error:.1f} points are within the grid error."
    )
    words = (
        "Each item of the layout (a module, or a piece of the catalogue) is removed in turn. Its "
        "contribution is the reduction lost without it, in percentage points of the impulse "
        "without a barrier (protected buildings by weight, mean over the threats, "
        f"{coarse}).{within} They are not additive: items interact."
    )
    zone, rows = study.scenario.zone, list[tuple[AnyCell, ...]]()
    for rank, (element, worth) in enumerate(study.worths, start=1):
        centre = (Number(at_m, digits=2) for at_m in zone.element_rectangle_m(element).centre)
        note = "within the error" if abs(worth) < error else ""
        points = Number(100.0 * worth, digits=2)
        rows.append((layout_text([element]), str(rank), *centre, points, note))
    headers = "row,column(,item)", "rank", "x (m)", "y (m)", "contribution (points)", ""
    table = Table.of("Items by contribution", headers, rows, 1, 1)
    picture = Picture(
        "The layout, each item coloured by its contribution.",
        worth_map(study.scenario, study.worths),
    )
    return Section.of("Contribution of each item", [Line.of(words), table, picture])


def other_places(study: Study) -> Section:
    """Return the loads of charges at other places."""
    blasts = study.sizes[0] if study.places is None else study.places
    words = "Mean impulse on protected facades, weighted sum over the structures, "
    rows = [
        (
            outcome.threat.name,
            outcome.threat.why,
            Number(outcome.unprotected_load),
            Number(outcome.load),
            Number.reduction(outcome.reduction),
        )
        for outcome in study.outcomes
    ]
    headers = "place", "source", "without (Pa s)", "with (Pa s)", "reduction"
    table = Table.of("Places examined", headers, rows, 2)
    return Section.of("Other places", [Line.of(f"{words}{gas_of(blasts).cell_words}."), table])
