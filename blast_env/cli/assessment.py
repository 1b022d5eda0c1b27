"""Verdicts of `blast-env assess` on buildings and barrier, and the effect of better glass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.cli.evaluation_report import impulse_text
from blast_env.cli.output import (
    building_words,
    print_cost,
    print_line,
    print_pieces,
    print_table,
    print_written,
    progress_bar,
    save_figures,
)
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet
from blast_env.evaluation.consequences import (
    BAY_CASE_COLUMNS,
    CASE_COLUMNS,
    BuildingResponse,
    Consequences,
    Neighbour,
    Verdict,
    bay_table,
    consequences,
    other_glazing,
    piece_table,
)
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.engines.pieces import PIECE_COLUMNS
from blast_env.evaluation.governing import governing
from blast_env.evaluation.grid_error import GridError, convergence_index
from blast_env.evaluation.probability import Uncertainty, level_probability
from blast_env.evaluation.shared import shared_consequences
from blast_env.geometry import Layout
from blast_env.provenance import versions
from blast_env.response.buildings import BuildingDamage, LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import AnyCharge, Scenario
from blast_env.site.scene import Charge
from blast_env.tables import write_csv
from blast_env.units import PA_PER_KPA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RESPONSE: Final = (
    *("building", "level of protection", "panes broken", "worst pane (GSA, ISO)", "worst panel"),
)
_NEIGHBOURS: Final = (
    *("layout", "building", "side-on peak (kPa)", "side-on impulse (Pa s)"),
    *(f"{damage} (%)" for damage in BuildingDamage),
)


@dataclass(frozen=True, eq=False)
class Assessed:
    """The consequences of the charges for a site, without a barrier and with the layout.

    Attributes:
        scenario: The scenario.
        layouts: The layouts by name, no barrier first.
        found: The consequences with each of them.
        coarse: The same under the worst charge alone, on coarser cells; empty without these.
        coarser: The engine with the coarser cells.
    """

    scenario: Scenario
    layouts: Mapping[str, Layout]
    found: Mapping[str, Consequences]
    coarse: Mapping[str, Consequences]
    coarser: Engine | None

    @property
    def name(self) -> str:
        """The name of the layout that is judged: the last one."""
        return list(self.found)[-1]

    @property
    def judged(self) -> Consequences:
        """The consequences with that layout."""
        return self.found[self.name]

    @property
    def grid_error(self) -> GridError | None:
        """The error of the cells under the worst charge; `None` without coarser cells."""
        if self.coarser is None:
            return None
        number, unprotected = self.judged.worst_number, next(iter(self.found))
        threat = LoadCase(self.judged.barriers[number].charge)
        return GridError(
            case=LoadCaseSet(self.scenario, (threat,)),
            layout=self.layouts[self.name],
            threat=threat,
            coarser=self.coarser,
            fine=(self.judged.loads[number], self.found[unprotected].loads[number]),
            coarse=(self.coarse[self.name].loads[0], self.coarse[unprotected].loads[0]),
        )

    @property
    def worst_rows(self) -> list[tuple[str, BuildingResponse]]:
        """The governing building and charge of the judged layout, one row per layout."""
        responses = self.judged.responses
        number = responses.index(governing(responses, lambda each: each.severity))
        return [(name, each.responses[number]) for name, each in self.found.items()]

    def write_table(self, path: Path, engine: Engine) -> None:
        """Write the table of the bays; a workbook also holds the barrier's pieces."""
        bays, pieces = bay_table(self.found), piece_table(self.found)
        if path.suffix.lower() == ".csv":
            print_written([write_csv(bays, path)])
            return
        from blast_env.particles.workbook import SheetTable, write_tables

        tables = [SheetTable("Bays", bays, BAY_CASE_COLUMNS)]
        if len(pieces):
            tables.append(SheetTable("Pieces", pieces, (*CASE_COLUMNS, *PIECE_COLUMNS)))
        record: dict[str, str | int | float] = {
            "scenario": self.scenario.name,
            "scenario hash": self.scenario.content_hash,
            "engine": engine.words,
            "engine version": engine.version,
            "blast-env version": versions(engine.version)["blast_env"],
        }
        print_written([write_tables(record, tables, path, f"Bays of {self.scenario.name}")])

    def draw(self, picture: Path | None, view: Path | None, diagram: Path | None) -> None:
        """Draw the facades, the site, and the pressure-impulse diagram under the worst charge."""
        rows = self.worst_rows if picture or view or diagram else []

        def title() -> str:
            building = rows[0][1].building
            return (
                f"{self.scenario.title_of(building)}: {_charge_text(rows[0][1].charge)}, the worst"
            )

        def facades() -> "Figure":
            from blast_env.plots.facade import facade_picture

            return facade_picture(rows, title())

        def pressure_impulse() -> "Figure":
            from blast_env.plots.pressure_impulse import pressure_impulse_diagram

            return pressure_impulse_diagram([(name, each.facade) for name, each in rows], title())

        def site() -> "Figure":
            from blast_env.plots.facade import damage_view

            worst = rows[0][1]
            number = self.found[rows[0][0]].of(worst.building).index(worst)
            views = [
                (name, self.layouts[name], [each.of(b)[number] for b in each.buildings])
                for name, each in self.found.items()
            ]
            words = f"{self.scenario.name}: {_charge_text(worst.charge)}, the worst"
            return damage_view(self.scenario, views, words)

        print_written(save_figures((picture, facades), (diagram, pressure_impulse), (view, site)))


def print_assessment(
    scenario: Scenario,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    engine: Engine,
    target: LevelOfProtection,
    required: Sequence[Requirement],
    mass_error: float,
    *,
    without_fallen: bool,
    cache: Path | None,
) -> Assessed:
    """Run the blasts, and print the verdict.

    Args:
        scenario: The scenario.
        layouts: The layouts by name: no barrier, and perhaps the one to judge.
        charges: The charges.
        engine: Gas dynamics.
        target: Required level of protection.
        required: Further requirements.
        mass_error: Uncertainty of the masses; see `Uncertainty`.
        without_fallen: Whether pieces that overturn are removed, and the blasts run again.
        cache: Folder of stored blasts, not used for those without fallen pieces.
    """
    coarser = engine.coarser
    print_line(engine.describe([scenario]))
    asked = [(engine, each) for each in charges] + [(coarser, charges[0])]
    print_cost((each, scenario, charge) for each, charge in asked for _ in layouts)

    def all_of(engine: Engine, charges: Sequence[AnyCharge], label: str) -> dict[str, Consequences]:
        found = {}
        for name, layout in layouts.items():
            with progress_bar(f"{label}, {name}") as progress:
                if without_fallen:
                    found[name] = consequences(
                        scenario, layout, charges, engine, progress, without_fallen=True
                    )
                    continue
                evaluator = BlastEvaluator(scenario, engine, cache=cache)
                found[name] = shared_consequences(evaluator, layout, charges, progress)
        return found

    found, coarse = all_of(engine, charges, f"{len(charges)} blasts"), {}
    if coarser is not None:
        worst = charges[list(found.values())[-1].worst_number]
        coarse = all_of(coarser, [worst], f"1 blast, {coarser.words}")
    assessed = Assessed(scenario, layouts, found, coarse, coarser)
    _print_verdict(assessed, target)
    for requirement in required:
        for name, judged in reversed(found.items()):
            kept = all(requirement.kept_by(each.facade) for each in judged.responses)
            word = Verdict.of(kept).word(judged.is_flagged).lower()
            print_line(f"{requirement.words}, {name}: {word}")
    error = assessed.grid_error
    uncertainty = Uncertainty.of(mass_error, error)
    for name, judged in reversed(found.items()):
        likely = level_probability(judged, uncertainty)
        print_line(f"probability, {name}: {likely.words(target)}")
    if error is not None:
        _print_cells(assessed, error)
    _print_buildings(assessed)
    _print_neighbours(assessed)
    _print_barriers(assessed.judged)
    _print_glazing(assessed, target)
    return assessed


def _print_verdict(assessed: Assessed, target: LevelOfProtection) -> None:
    judged, count = assessed.judged, len(assessed.judged.barriers)
    charges = "1 charge" if count == 1 else f"{count} charges"
    words = judged.verdict_words(target)
    print_line(f"{assessed.scenario.name}, {assessed.name}: {words}, under {charges}")
    for building in judged.buildings:
        stood = judged.standing(building).words
        print_line(f"standing of the load that decides, {building}: {stood}")
    for note in judged.notes:
        print_line(f"flag: {note}")
    if doubt := judged.doubt(target):
        print_line(doubt)
    print_line(judged.force_words)


def _print_cells(assessed: Assessed, error: GridError) -> None:
    """Print the impulse under the worst charge with its error, and levels that cells change."""
    judged = assessed.judged
    print_line(impulse_text(error))
    print_line(error.words)
    for building in judged.buildings:
        fine = judged.of(building)[judged.worst_number].facade.level_of_protection
        other = assessed.coarse[assessed.name].level(building)
        if other != fine:
            print_line(
                f"note: {building} reaches level {other.label!r} with {error.coarser.words}, and "
                f"{fine.label!r} with the finer cells, under the worst charge"
            )


def _print_buildings(assessed: Assessed) -> None:
    rows = [
        (
            name,
            building_words(assessed.scenario, building),
            *_response(each, building, assessed.coarse.get(name)),
        )
        for name, each in assessed.found.items()
        for building in each.buildings
    ]
    title = f"{assessed.scenario.name}: the worst of all charges"
    print_table(title, ("layout", *_RESPONSE), rows, text_columns=3)
    for name, each in list(assessed.found.items())[:-1]:
        for note in each.notes:
            print_line(f"flag, {name}: {note}")


def _print_neighbours(assessed: Assessed) -> None:
    rows = []
    for name, each in assessed.found.items():
        coarse = assessed.coarse.get(name)
        for worst in each.worst_neighbours:
            shares = (f"{100.0 * worst.probability[damage]:.0f}" for damage in BuildingDamage)
            peak = _with_cells(worst, each, coarse, "peak_pa", PA_PER_KPA, 1)
            impulse = _with_cells(worst, each, coarse, "impulse_pa_s", 1.0, 0)
            words = building_words(assessed.scenario, worst.building)
            rows.append((name, words, peak, impulse, *shares))
    if rows:
        title = "without a facade: how likely an ordinary house there is damaged, worst charge"
        print_table(title, _NEIGHBOURS, rows, text_columns=2)


def _print_barriers(judged: Consequences) -> None:
    worst = judged.worst_barrier
    if worst is not None:
        print_pieces(worst.pieces, f"the barrier under {_charge_text(worst.charge)}, the worst")
    for each in judged.barriers:
        if each.taken_away:
            print_line(
                f"{len(each.taken_away)} pieces overturned before the blast of "
                f"{_charge_text(each.charge)} was over, and were taken away for it"
            )


def _print_glazing(assessed: Assessed, target: LevelOfProtection) -> None:
    rows = []
    for name, glazing in other_glazing(assessed.scenario).items():
        other = assessed.judged.with_glazing(glazing)
        for building in other.buildings:
            passes = Verdict.of(other.level(building) >= target).word(other.is_flagged)
            words = building_words(assessed.scenario, building)
            rows.append((name, words, *_response(other, building), passes.lower()))
    headers = ("glass in all windows", *_RESPONSE, "verdict")
    print_table("the same loads, other glass", headers, rows, text_columns=3)


def _charge_text(charge: Charge) -> str:
    x_m, y_m = charge.position_m
    return f"{charge.tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m"


def _with_cells(
    worst: Neighbour,
    fine: Consequences,
    coarse: Consequences | None,
    load: str,
    unit: float,
    digits: int,
) -> str:
    """Return a load on a neighbour; its error has the share that it has under the worst charge."""
    value = float(getattr(worst, load)) / unit
    text = f"{value:,.{digits}f}"
    if coarse is None:
        return text
    own = [each for each in fine.neighbours if each.building == worst.building]
    (other,) = (each for each in coarse.neighbours if each.building == worst.building)
    of_fine = float(getattr(own[fine.worst_number], load))
    error = convergence_index(of_fine, float(getattr(other, load))) / of_fine * value
    return f"{text} +- {error:,.{digits}f}"


def _response(
    found: Consequences, building: str, coarse: Consequences | None = None
) -> tuple[str, ...]:
    """Return the response of a building; of the panes with the error of the cells."""
    facades = [each.facade for each in found.of(building)]
    worst = max(facades, key=lambda facade: facade.broken_panes)
    broken = f"{worst.broken_panes:.1f}"
    if coarse is not None:
        fine = facades[found.worst_number].broken_panes
        other = coarse.of(building)[0].facade.broken_panes
        broken += f" +- {convergence_index(fine, other):.1f}"
    return (
        found.level_words(building),
        f"{broken} of {worst.panes}",
        max(facade.worst_condition for facade in facades).words,
        max(facade.worst_damage for facade in facades).name.lower(),
    )
