"""`blast-env assess`: verdicts on buildings and barrier, and the effect of better glass."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.cli.command import argument, option
from blast_env.cli.evaluation_report import impulse_text
from blast_env.cli.options import (
    CELLS_HELP,
    FINAL_CELL_HELP,
    FINAL_CELLS,
    MASS_ERROR_HELP,
    REQUIRE_HELP,
    SCENARIO_HELP,
    TARGET_HELP,
    ChargeOptions,
    wanted_level,
)
from blast_env.cli.output import (
    ResultTable,
    building_words,
    print_cost,
    print_line,
    print_pieces,
    print_table,
    progress_bar,
    result_console,
)
from blast_env.cli.targets import PICTURES
from blast_env.evaluation import Case, Threat
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
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.engines.pieces import PIECE_COLUMNS
from blast_env.evaluation.governing import governing
from blast_env.evaluation.grid_error import GridError, convergence_index, final_engine
from blast_env.evaluation.probability import Uncertainty, level_probability
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.provenance import versions
from blast_env.response.buildings import BuildingDamage, LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.tables import write_csv
from blast_env.units import PA_PER_KPA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADERS: Final = (
    "layout",
    "building",
    "level of protection",
    "panes broken",
    "worst pane (GSA, ISO)",
    "worst panel",
)
_NEIGHBOURS: Final = (
    *("layout", "building", "side-on peak (kPa)", "side-on impulse (Pa s)"),
    *(f"{damage} (%)" for damage in BuildingDamage),
)


@dataclass(frozen=True, kw_only=True)
class AssessCommand(ChargeOptions):
    """Assess the damage of buildings by charges: panes, panels, level of protection.

    Gas dynamics runs one blast per charge, with and without the layout; the barrier is judged as
    well. A structure needs a facade in the scenario file; one without is judged as an ordinary
    house. The effect of better glass needs no further blast, and is printed as well. The worst
    charge runs on cells twice as large as well: the difference gives the error of the cells.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    target: str | None = option(None, TARGET_HELP.format("low"))
    charges: int = option(16, "Draws of the charge; each place counts once.", min=1)
    cell_m: float | None = option(None, FINAL_CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default=FINAL_CELLS)
    mass_error: float = option(0.1, MASS_ERROR_HELP, min=0.0, max=0.3)
    without_fallen: bool = option(
        False, "Remove pieces that overturn before the blast is over, and run it again."
    )
    require: tuple[str, ...] = option((), REQUIRE_HELP)
    picture: Path | None = option(
        None, "Picture of the facades under the worst charge: .png, .svg, .pdf.", writes=PICTURES
    )
    view: Path | None = option(
        None, "Picture of the site in three dimensions, bays by their damage.", writes=PICTURES
    )
    diagram: Path | None = option(
        None, "Pressure-impulse diagram with every bay on it.", writes=PICTURES
    )
    table: Path | None = option(
        None, "Table of every bay under every charge: .csv, .xlsx.", writes=(".csv", ".xlsx")
    )

    def __call__(self) -> None:
        """Run the blasts, and print the verdict."""
        scenario = load_scenario(self.scenario)
        target = wanted_level(self.target, scenario, LevelOfProtection.LOW)
        required = [Requirement.parsed(each) for each in self.require]
        layouts: dict[str, Layout] = {"no barrier": ()}
        if self.layout is not None:
            layout = tuple(load_layout(self.layout, scenario))
            layouts[layout_counts(layout, "barrier")] = layout
        charges = self.fixed_charges(scenario, self.charges)
        engine = final_engine(JUDGE, [scenario], self.cell_m, cells=self.cells)
        coarser = engine.coarser
        print_line(engine.describe([scenario]))
        asked = [(engine, each) for each in charges] + [(coarser, charges[0])]
        print_cost((each, scenario, charge) for each, charge in asked for _ in layouts)
        found = {}
        for name, layout in layouts.items():
            with progress_bar(f"{len(charges)} blasts, {name}") as progress:
                found[name] = consequences(
                    scenario, layout, charges, engine, progress, without_fallen=self.without_fallen
                )
        coarse: dict[str, Consequences] = {}
        if coarser is not None:
            worst = charges[list(found.values())[-1].worst_number]
            for name, layout in layouts.items():
                with progress_bar(f"1 blast, {coarser.words}, {name}") as progress:
                    coarse[name] = consequences(
                        scenario,
                        layout,
                        [worst],
                        coarser,
                        progress,
                        without_fallen=self.without_fallen,
                    )
        self._print_verdict(scenario, found, target)
        for each in required:
            for name, judged in reversed(found.items()):
                kept = all(each.kept_by(response.facade) for response in judged.responses)
                print_line(
                    f"{each.words}, {name}: {Verdict.of(kept).word(judged.is_flagged).lower()}"
                )
        error = _grid_error(scenario, layouts, found, coarse, coarser)
        uncertainty = Uncertainty.of(self.mass_error, error)
        for name, judged in reversed(found.items()):
            likely = level_probability(judged, uncertainty)
            print_line(f"probability, {name}: {likely.words(target)}")
        if error is not None:
            _print_cells(found, coarse, error)
        self._print(scenario, found, coarse)
        self._print_neighbours(scenario, found, coarse)
        self._print_barriers(found)
        self._print_glazing(scenario, list(found.values())[-1], target)
        self._write(scenario, layouts, found)

    def _print_verdict(
        self, scenario: Scenario, found: dict[str, Consequences], target: LevelOfProtection
    ) -> None:
        name, judged = list(found.items())[-1]
        count = len(judged.barriers)
        charges = "1 charge" if count == 1 else f"{count} charges"
        print_line(f"{scenario.name}, {name}: {judged.verdict_words(target)}, under {charges}")
        for building in judged.buildings:
            stood = judged.standing(building).words
            print_line(f"standing of the load that decides, {building}: {stood}")
        for note in judged.notes:
            print_line(f"flag: {note}")
        if doubt := judged.doubt(target):
            print_line(doubt)
        print_line(judged.force_words)

    def _print(
        self,
        scenario: Scenario,
        found: dict[str, Consequences],
        coarse: dict[str, Consequences],
    ) -> None:
        rows = [
            (name, building_words(scenario, building), *_row(each, building, coarse.get(name)))
            for name, each in found.items()
            for building in each.buildings
        ]
        print_table(f"{scenario.name}: the worst of all charges", _HEADERS, rows, text_columns=3)
        for name, each in list(found.items())[:-1]:
            for note in each.notes:
                print_line(f"flag, {name}: {note}")

    def _print_neighbours(
        self, scenario: Scenario, found: dict[str, Consequences], coarse: dict[str, Consequences]
    ) -> None:
        if not any(each.neighbours for each in found.values()):
            return
        title = "without a facade: how likely an ordinary house there is damaged, worst charge"
        table = ResultTable(title, _NEIGHBOURS, text_columns=2)
        for name, each in found.items():
            for worst in each.worst_neighbours:
                shares = (f"{100.0 * worst.probability[damage]:.0f}" for damage in BuildingDamage)
                peak, impulse = (
                    _with_cells(worst, each, coarse.get(name), load, unit, digits)
                    for load, unit, digits in (("peak_pa", PA_PER_KPA, 1), ("impulse_pa_s", 1.0, 0))
                )
                words = building_words(scenario, worst.building)
                table.add_row(name, words, peak, impulse, *shares)
        result_console().print(table)

    def _print_barriers(self, found: dict[str, Consequences]) -> None:
        judged = list(found.values())[-1]
        worst = judged.worst_barrier
        if worst is not None:
            print_pieces(worst.pieces, f"the barrier under {_charge_text(worst.charge)}, the worst")
        for each in judged.barriers:
            if each.taken_away:
                print_line(
                    f"{len(each.taken_away)} pieces overturned before the blast of "
                    f"{_charge_text(each.charge)} was over, and were taken away for it"
                )

    def _print_glazing(
        self, scenario: Scenario, judged: Consequences, target: LevelOfProtection
    ) -> None:
        headers = ("glass in all windows", *_HEADERS[1:], "verdict")
        table = ResultTable("the same loads, other glass", headers, text_columns=3)
        for name, glazing in other_glazing(scenario).items():
            other = judged.with_glazing(glazing)
            for building in other.buildings:
                passes = Verdict.of(other.level(building) >= target).word(other.is_flagged)
                words = building_words(scenario, building)
                table.add_row(name, words, *_row(other, building), passes.lower())
        result_console().print(table)

    def _write(
        self, scenario: Scenario, layouts: dict[str, Layout], found: dict[str, Consequences]
    ) -> None:
        """Write the table, and the pictures of the worst charge."""
        if self.table is not None:
            print_line(f"wrote {self._write_table(self.table, scenario, found)}")
        if self.picture is None and self.view is None and self.diagram is None:
            return
        # Here, because pictures need the extra `render`.
        from blast_env.plots.facade import damage_view, facade_picture
        from blast_env.plots.figures import save_figure
        from blast_env.plots.pressure_impulse import pressure_impulse_diagram

        rows = _worst_rows(found)
        charge = rows[0][1].charge
        title = f"{scenario.title_of(rows[0][1].building)}: {_charge_text(charge)}, the worst"
        figures: list[tuple[Path | None, Figure]] = []
        if self.picture is not None:
            figures.append((self.picture, facade_picture(rows, title)))
        if self.diagram is not None:
            points = [(name, each.facade) for name, each in rows]
            figures.append((self.diagram, pressure_impulse_diagram(points, title)))
        if self.view is not None:
            number = found[rows[0][0]].of(rows[0][1].building).index(rows[0][1])
            views = [
                (name, layouts[name], [each.of(b)[number] for b in each.buildings])
                for name, each in found.items()
            ]
            words = f"{scenario.name}: {_charge_text(charge)}, the worst"
            figures.append((self.view, damage_view(scenario, views, words)))
        for path, figure in figures:
            assert path is not None
            print_line(f"wrote {save_figure(figure, path)}")

    def _write_table(self, path: Path, scenario: Scenario, found: dict[str, Consequences]) -> Path:
        """Write the table of the bays; a workbook also holds the barrier's pieces."""
        bays = bay_table(found)
        if path.suffix.lower() == ".csv":
            return write_csv(bays, path)
        from blast_env.particles.workbook import SheetTable, write_tables

        tables = [SheetTable("Bays", bays, BAY_CASE_COLUMNS)]
        pieces = piece_table(found)
        if len(pieces):
            tables.append(SheetTable("Pieces", pieces, (*CASE_COLUMNS, *PIECE_COLUMNS)))
        engine = final_engine(JUDGE, [scenario], self.cell_m, cells=self.cells)
        record: dict[str, str | int | float] = {
            "scenario": scenario.name,
            "scenario hash": scenario.content_hash,
            "engine": engine.words,
            "engine version": engine.version,
            "blast-env version": versions(engine.version)["blast_env"],
        }
        return write_tables(record, tables, path, f"Bays of {scenario.name}")


def _worst_rows(found: dict[str, Consequences]) -> list[tuple[str, BuildingResponse]]:
    """Return the governing building and charge of the last layout, one row per layout."""
    judged = list(found.values())[-1]
    number = judged.responses.index(governing(judged.responses, lambda each: each.severity))
    return [(name, each.responses[number]) for name, each in found.items()]


def _charge_text(charge: Charge) -> str:
    x_m, y_m = charge.position_m
    return f"{charge.tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m"


def _grid_error(
    scenario: Scenario,
    layouts: dict[str, Layout],
    found: dict[str, Consequences],
    coarse: dict[str, Consequences],
    coarser: Engine | None,
) -> GridError | None:
    """Return the error of the cells under the worst charge; `None` without coarser cells."""
    if coarser is None:
        return None
    *_, (name, layout) = layouts.items()
    number = found[name].worst_number
    threat = Threat(found[name].barriers[number].charge, 0)
    bare = next(iter(found))
    return GridError(
        case=Case(scenario, (threat,)),
        layout=layout,
        threat=threat,
        coarser=coarser,
        fine=(found[name].loads[number], found[bare].loads[number]),
        coarse=(coarse[name].loads[0], coarse[bare].loads[0]),
    )


def _print_cells(
    found: dict[str, Consequences], coarse: dict[str, Consequences], error: GridError
) -> None:
    """Print the impulse under the worst charge with its error, and levels that cells change."""
    *_, (name, judged) = found.items()
    print_line(impulse_text(error))
    print_line(error.words)
    for building in judged.buildings:
        fine = judged.of(building)[judged.worst_number].facade.level_of_protection
        other = coarse[name].level(building)
        if other != fine:
            print_line(
                f"note: {building} reaches level {other.label!r} with {error.coarser.words}, and "
                f"{fine.label!r} with the finer cells, under the worst charge"
            )


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


def _row(found: Consequences, building: str, coarse: Consequences | None = None) -> Sequence[str]:
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
