"""What a report rests on: alternatives and cost, threats and buildings, assumptions, limits."""

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite, nan
from typing import Final

from blast_env.answers.document import AnyCell, AnyPart, Line, Number, Section, Table, lines
from blast_env.answers.report.summary import charge_words, grid_error_words
from blast_env.evaluation.engines.walls import PeakSource
from blast_env.evaluation.places import place_text
from blast_env.evaluation.questions.grid_error import FACTOR, ORDER
from blast_env.evaluation.questions.limits import LoadLimit, SiteVerdict
from blast_env.evaluation.questions.verdict import consequences_of, other_glazing
from blast_env.evaluation.record import BuildingLoad
from blast_env.evaluation.study import Study, gas_of
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import Rectangle
from blast_env.io.export.bill import LayoutPlan, bill_of_quantities
from blast_env.layout import LayoutState
from blast_env.plots.plan import stand_off_text
from blast_env.response.components import Glazing
from blast_env.site.structures import buildings_of
from blast_env.tables import table_records
from blast_env.values import count_of

_ABOVE: Final = "air"  # of a height that is that of the air
_NOTHING: Final = ""


def alternatives(study: Study) -> Section:
    """Return other glass in all windows, and the bill of quantities."""
    return Section.of("Alternatives and cost", _glazing(study), _bill(study))


def _glazing(study: Study) -> Iterator[AnyPart]:
    if not any(response.facade.panes for response in study.protected.responses):
        return
    zone, (bare, behind) = study.scenario.zone, study.verdicts
    cost = zone.priced(LayoutState.of(study.scenario, study.layout).cost)
    rows = [("the layout of this report", behind.word.lower(), cost)]
    for name, glazing in other_glazing(study.scenario).items():
        with_it, without = (_word(side, glazing) for side in (behind, bare))
        result = f"{with_it} with the layout, {without} without"
        rows.append((f"all windows: {glazing.title}", result, _priced(study, name)))
    headers = "alternative", "result", "cost"
    yield Table.of("Alternatives examined", headers, rows, 2, main=[0])


def _word(side: SiteVerdict, glazing: Glazing) -> str:
    return replace(side, found=side.found.with_glazing(glazing)).word.lower()


def _priced(study: Study, glazing: str) -> str:
    cost = glazing_cost(study, glazing)
    if cost is None:
        return "no price given in the site file"
    return f"{study.scenario.zone.priced(cost)} for the glass" if cost else "installed already"


def glazing_cost(study: Study, glazing: str) -> float | None:
    """Return the cost by the site's measures of a glass in all windows that lack it.

    Of overlapping measures, the dearest ones that are not needed are left out. `None` if they do
    not put it into all windows.
    """
    bays = [bay for bay in study.scenario.named_bays(study.layout) if bay.glazing]
    missing = [bay.bay for bay in bays if bay.glazing != glazing]
    taken = [measure for measure in study.scenario.zone.hardening if measure.glazing == glazing]
    for measure in sorted(taken, key=lambda own: -own.cost):
        fewer = [other for other in taken if other is not measure]
        if all(any(other.covers(bay) for other in fewer) for bay in missing):
            taken = fewer
    if not all(any(other.covers(bay) for other in taken) for bay in missing):
        return None
    return sum(measure.cost for measure in taken)


def _bill(study: Study) -> Iterator[AnyPart]:
    headers = (
        *("item", "description", "number", "in stock", "length (m)", "thickness (m)"),
        *("height (m)", "unit cost", "cost"),
    )
    rows = []
    *items, total = table_records(bill_of_quantities(LayoutPlan(study.scenario, study.layout)))
    for line in items:
        size = (_stated(line[name]) for name in ("length_m", "thickness_m"))
        height = _ABOVE if line["height_m"] is None else _stated(line["height_m"])
        sizes = (_NOTHING,) * 3 if line["length_m"] is None else (*size, height)
        counts = str(line["count"]), str(line["in_stock"])
        costs = _stated(line["unit_cost"]), _stated(line["cost"])
        rows.append((line["item"], line["description"], *counts, *sizes, *costs))
    empty = (_NOTHING,) * 5
    last = total["item"], total["description"], str(total["count"]), *empty, _stated(total["cost"])
    yield Table.of("Bill of quantities", headers, [*rows, last], 2, main=[len(rows)])
    unit = study.scenario.zone.cost_unit
    yield Line.of(
        f"Costs are in {unit}; the unit cost is that outside all cost areas.", kind="quiet"
    )


def _stated(value: float | None) -> Number:
    return Number.stated(nan if value is None else value)


def design_basis(study: Study) -> Section:
    """Return the threats, the buildings, and what an import changed."""
    return Section.of("Design-basis threat", _threats(study), _buildings(study))


def _threats(study: Study) -> Iterator[AnyPart]:
    scenario = study.scenario
    if scenario.description:
        yield Line.of(scenario.description)
    rows = [
        (
            threat.name,
            place_text(threat, scenario, study.layout),
            Number.stated(threat.charge.tnt_kg),
            Number.stated(threat.charge.height_m),
            threat.why,
        )
        for threat in study.threats
    ]
    headers = "threat", "place", "mass (kg TNT)", "height (m)", "reason for the choice"
    yield Table.of("Threats of this report", headers, rows, 2, 1)
    sources = count_of("source", len(scenario.charge))
    vehicles = stand_off_text(scenario, study.layout)
    words = f"The scenario has {sources} of charges; other places are examined below."
    yield Line.of(words + (f" Vehicles: {vehicles}." if vehicles else ""), kind="quiet")


def _buildings(study: Study) -> Iterator[AnyPart]:
    found = []
    for name, parts in buildings_of(study.scenario.structures).items():
        title = study.scenario.title_of(name)
        heights = [part.height_m for part in parts]
        known = [height_m for height_m in heights if height_m is not None]
        height = _stated(max(known)) if len(known) == len(heights) else _ABOVE
        around = Rectangle.around([part.rectangle_m for part in parts])
        ends = (around.left, around.right), (around.bottom, around.top)
        spans = (Line.of(_stated(low), " to ", _stated(high)) for low, high in ends)
        protected = any(part.protected for part in parts)
        words = title if title == name else f"{title} ({name})"
        role = "protected" if protected else "other"
        found.append((not protected, (words, role, height, *spans, str(len(parts)))))
    rows = [row for _, row in sorted(found, key=lambda pair: pair[0])]
    headers = "building", "role", "height (m)", "x (m)", "y (m)", "parts"
    yield Table.of("Buildings", headers, rows, 2)
    if study.scenario.import_notes:
        yield Line.of("Changes to the map by the import", kind="head")
        yield from lines(study.scenario.import_notes, "item")


def assumptions(study: Study, versions: dict[str, str]) -> Section:
    """Return the assumptions, and the method and the errors of each number."""
    rows = [*_assumptions(study, versions)]
    table = Table.of("", ("subject", "assumption", "to be checked by"), rows, 3)
    return Section.of("Assumptions", [table, _methods(study)])


def _assumptions(study: Study, versions: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    reviewer = "the reviewer of this report"
    heights = ", ".join(f"{threat.charge.height_m:g} m" for threat in study.threats)
    charges = f"{charge_words(study)}; heights {heights}"
    yield "charges", charges, "the person who specifies the threat"
    sizes = cells_words(study)
    method = f"gas dynamics, {versions['engine']}; blast-env {versions['blast_env']}; {sizes}"
    yield "method", method, reviewer
    yield "grid error", _grid_error(study), reviewer
    notes, last = (study.notes_of(blasts) for blasts in (study.sizes[0], study.blasts))
    words = "nothing"
    if study.blasts.coarse is not None and (notes or last):
        every = count_of("note", len(notes) + len(last))
        words = f"{every}, under validity; {len(last)} with the finer cells, which decide"
    elif last:
        words = f"{count_of('note', len(last))}, under validity"
    yield "outside the validated range", words, "a blast specialist, if there are notes"
    yield "site", "flat ground, still air, rigid buildings as in the plan", "a surveyor"
    if study.protected.buildings:
        words = "components of the scenario file; frames and anchors hold"
        yield "windows and panels", words, "a structural engineer, the maker of the glazing"
    if study.protected.worst_barrier is not None:
        words = "mass, base, friction and anchors of the catalogue; every piece stands alone"
        yield "barrier", words, "a structural engineer, the supplier"
    yield "costs", "those of the scenario file", "a quantity surveyor"


def cells_words(study: Study) -> str:
    """Return the sizes of the cells in words."""
    return " and ".join(gas_of(blasts).cell_words for blasts in study.sizes)


def _grid_error(study: Study) -> str:
    coarse = study.blasts.coarse
    if coarse is None:
        return "not known: only one cell size was used"
    ratio = gas_of(coarse).smallest_m / gas_of(study.blasts).smallest_m
    formula = f"{FACTOR:g} |fine - coarse| / ({ratio:g}^{ORDER:g} - 1)"
    words = (
        f"the {grid_error_words(study)} without a barrier (grid convergence index of Roache from "
        f"both sizes: {formula}): smaller differences are not significant"
    )
    if study.protected.buildings:
        found = consequences_of(coarse)
        levels = (
            f"{study.scenario.title_of(name)} {found.level_words(name)}" for name in found.buildings
        )
        words += f"; levels with the layout on the coarser cells: {', '.join(levels)}"
    return words


def _methods(study: Study) -> Table:
    known, found = study.blasts.coarse is not None, study.uncertainty
    shares = {name: f"{100.0 * value:g} %" for name, value in vars(found).items()}
    error = "beside each number (grid convergence index)" if known else "not known: one cell size"
    rows = [
        (
            *("impulse (Pa s)", "gas dynamics, peak specific impulse", error),
            f"{shares['in_sight']} in sight of the charge, {shares['in_shade']} in the shade; test "
            f"to test {shares['scatter']}",
        ),
        (
            *("peak (kPa)", "gas dynamics; for limits the unclipped peak"),
            *("lower bound: peaks grow with finer cells", f"test to test {shares['scatter']}"),
        ),
        (
            *("reduction (%)", "1 - impulse with / without"),
            "beside each number, in percentage points" if known else "not known",
            "shared by both impulses; not known apart",
        ),
        (
            *("level of protection", "single degree of freedom, bay by bay", "both cell sizes"),
            f"its probability; resistance of panels {shares['panels']}, glass by ASTM E1300",
        ),
    ]
    reductions = [own.reduction for own in study.outcomes if isfinite(own.reduction)]
    if reductions:
        ends = (Number.reduction(end(reductions)).text() for end in (min, max))
        words = f"not an error: reductions of the impulse range from {' to '.join(ends)}"
        first = gas_of(study.sizes[0]).cell_words
        rows.append(("other places", f"the same, {first}", "", words))
    headers = "number", "method", "numerical error", "uncertainty of the method"
    return Table.of("Numbers, with their method and errors", headers, rows, 4)


def limits(study: Study) -> Section:
    """Return the loads against the given limits, and where the loads are valid."""
    return Section.of("Limits", _limits(study), _validity(study))


def _limits(study: Study) -> Iterator[AnyPart]:
    bare, behind = study.verdicts
    if not behind.limited:
        yield Line.of("None were given (--limit NAME=IMPULSE,PEAK).")
        return
    fine = gas_of(study.blasts).cell_words
    yield Line.of(
        f"Comparison with the given limits: impulse of the most loaded wall and peak, {fine}. "
        "Cells clip peaks. On faces in sight of the charge the larger of the computed peak and the "
        "reflected peak of Kingery and Bulmash decides; on others the peak extrapolated from the "
        "cells, up to that reflected peak."
    )
    headers = (
        *("building", "threat", "impulse limit (Pa s)", "without", "with", "peak limit (kPa)"),
        *("without", "with", "without", "with the layout"),
    )
    rows = [
        (
            study.scenario.title_of(own.limit.building),
            own.threat,
            Number(own.limit.impulse_pa_s),
            *(Number(side.load.wall_impulse_pa_s) for side in (without, own)),
            Number.kpa(own.limit.peak_pa),
            *(_counted(side.load) for side in (without, own)),
            *(side.word for side in (without, own)),
        )
        for without, own in _both(bare, behind)
    ]
    yield Table.of("Limits of loads", headers, rows, 2, 2)


def _both(bare: SiteVerdict, behind: SiteVerdict) -> Iterator[tuple[LoadLimit, LoadLimit]]:
    # A building that the layout takes away has no load with it.
    without = {(own.limit.building, own.threat): own for own in bare.limited}
    yield from ((without[own.limit.building, own.threat], own) for own in behind.limited)


def _counted(load: BuildingLoad) -> AnyCell:
    """Return the peak to compare with limits, and its source."""
    peak = Number.kpa(load.counted_pa)
    if load.counted_by == PeakSource.GAS:
        return Line.of(peak, f" ({load.counted_by})")
    return Line.of(peak, f" ({load.counted_by}; gas ", Number.kpa(load.peak_pa), ")")


def _validity(study: Study) -> Iterator[AnyPart]:
    yield Line.of("Validity", kind="head")
    yield from lines(_VALIDITY, "item")
    notes = [note for blasts in study.sizes for note in study.notes_of(blasts)]
    if not notes:
        yield Line.of("No load in this report is outside that range.")
        return
    yield Line.of("Loads outside the validated range in this report:", kind="flag")
    yield from lines(dict.fromkeys(notes), "item")


_VALIDITY: Final = (
    "In the air, structures and modules are rigid and fixed, without an interior. Breakage and "
    "overturning are computed afterwards from the loads.",
    "Ground and roofs are flat, air is still, at 101.3 kPa. All surfaces reflect completely.",
    "The charge is a bare hemisphere (on the ground) or sphere of TNT. Casings and the shapes of "
    "real charges change the loads nearby.",
    f"The engine was validated from {CHECKED_SCALED_DISTANCE[0]} to {CHECKED_SCALED_DISTANCE[1]} "
    "m/kg^(1/3) against Kingery and Bulmash's curves. Impulses on a wall that faces the charge "
    "agree within several per cent; peaks are too low, the more so the coarser the cells; places "
    "right behind an edge are the least certain (docs/engineers/gas.md has the figures).",
    "Walls of realistic height often reduce the impulse by only a few per cent, about the size of "
    "these errors.",
    "The report covers the threats of the table above; others can be worse.",
)


def references() -> Section:
    """Return the reference list."""
    return Section.of("References", lines(_REFERENCES, "item"))


_REFERENCES: Final = (
    "UFC 4-010-01, DoD minimum antiterrorism standards for buildings (levels of protection)",
    "UFC 3-340-02, Structures to resist the effects of accidental explosions (single degree of "
    "freedom; types of bursts)",
    "PDC-TR 06-08, Single degree of freedom structural response limits for antiterrorism design "
    "(damage of wall panels)",
    "ASTM E1300, Determining load resistance of glass in buildings (strength of panes)",
    "GSA P100, Facilities standards for the public buildings service, table 8-1 (performance "
    "conditions of glazing)",
    "ISO 16933, Explosion-resistant security glazing, arena air-blast test (hazard ratings)",
    "C. N. Kingery and G. Bulmash, ARBRL-TR-02555, 1984 (airblast of TNT)",
    "TNO, Methods for the determination of possible damage, CPR 16E, Green Book (houses)",
    "P. J. Roache, J. Fluids Eng. 116 (1994) 405 (grid error)",
    "T. Yang and Y. Luo, J. Civil Environ. Eng. 42(2) (2020) 115 (scatter of loads)",
)
