"""`blast-env assess`: verdicts on buildings and barrier, and the effect of better glass."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.cli.command import argument, option
from blast_env.cli.options import (
    CELL_HELP,
    CELLS_HELP,
    SCENARIO_HELP,
    TARGET_HELP,
    ChargeOptions,
    wanted_level,
)
from blast_env.cli.output import (
    ResultTable,
    print_line,
    print_pieces,
    print_table,
    progress_bar,
    result_console,
)
from blast_env.cli.targets import PICTURES
from blast_env.engines import JUDGE, find_engine
from blast_env.engines.bays import LOADED_BAY_COLUMNS
from blast_env.engines.pieces import PIECE_COLUMNS
from blast_env.evaluation import draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import (
    CASE_COLUMNS,
    BuildingResponse,
    Consequences,
    bay_table,
    consequences,
    other_glazing,
    piece_table,
    verdict_word,
)
from blast_env.evaluation.governing import governing
from blast_env.geometry import Layout, layout_counts
from blast_env.physics.scene import Charge
from blast_env.provenance import versions
from blast_env.response.buildings import BuildingDamage, LevelOfProtection
from blast_env.scenario import AnyCharge, Scenario, load_layout, load_scenario
from blast_env.tables import write_csv
from blast_env.units import PA_PER_KPA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADERS: Final = (
    "layout",
    "building",
    "level of protection",
    "panes broken",
    "worst pane (GSA)",
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
    house. The effect of better glass needs no further blast, and is printed as well.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    target: str | None = option(None, TARGET_HELP.format("low"))
    charges: int = option(16, "Draws of the charge; each place counts once.", min=1)
    cell_m: float | None = option(None, CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default="uniform")
    without_fallen: bool = option(
        False, "Remove pieces that overturn before the blast is over, and run it again."
    )
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
        layouts: dict[str, Layout] = {"no barrier": ()}
        if self.layout is not None:
            layout = tuple(load_layout(self.layout, scenario))
            layouts[layout_counts(layout, "barrier")] = layout
        charges = self._charges(scenario)
        engine = find_engine(JUDGE, self.cell_m, cells=self.cells)
        found = {}
        for name, layout in layouts.items():
            with progress_bar(f"{len(charges)} blasts, {name}") as progress:
                found[name] = consequences(
                    scenario, layout, charges, engine, progress, without_fallen=self.without_fallen
                )
        print_line(engine.describe([scenario]))
        self._print_verdict(scenario, found, target)
        self._print(scenario, found)
        self._print_neighbours(found)
        self._print_barriers(found)
        self._print_glazing(scenario, list(found.values())[-1], target)
        self._write(scenario, layouts, found)

    def _charges(self, scenario: Scenario) -> list[AnyCharge]:
        threats = one_of_each_charge(draw_threats(scenario, range(self.charges)))
        fixed = [self.fixed(scenario, threat.charge) for threat in threats]
        return list(dict.fromkeys(fixed))

    def _print_verdict(
        self, scenario: Scenario, found: dict[str, Consequences], target: LevelOfProtection
    ) -> None:
        name, judged = list(found.items())[-1]
        count = len(judged.barriers)
        print_line(
            f"{scenario.name}, {name}: {judged.verdict(target)} level {target.label!r} "
            f"under {count} charges"
        )
        for note in judged.notes:
            print_line(f"flag: {note}")
        if doubt := judged.doubt(target):
            print_line(doubt)

    def _print(self, scenario: Scenario, found: dict[str, Consequences]) -> None:
        rows = [
            (name, building, *_row(each, building))
            for name, each in found.items()
            for building in each.buildings
        ]
        print_table(f"{scenario.name}: the worst of all charges", _HEADERS, rows, text_columns=3)
        for name, each in list(found.items())[:-1]:
            for note in each.notes:
                print_line(f"flag, {name}: {note}")

    def _print_neighbours(self, found: dict[str, Consequences]) -> None:
        if not any(each.neighbours for each in found.values()):
            return
        title = "without a facade: how likely an ordinary house there is damaged, worst charge"
        table = ResultTable(title, _NEIGHBOURS, text_columns=2)
        for name, each in found.items():
            for worst in each.worst_neighbours:
                shares = (f"{100.0 * worst.probability[damage]:.0f}" for damage in BuildingDamage)
                peak = f"{worst.peak_pa / PA_PER_KPA:.1f}"
                table.add_row(name, worst.building, peak, f"{worst.impulse_pa_s:,.0f}", *shares)
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
                passes = verdict_word(other.level(building) >= target, other.is_flagged)
                table.add_row(name, building, *_row(other, building), passes.lower())
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
        from blast_env.rendering.facade import damage_view, facade_picture
        from blast_env.rendering.figures import save_figure
        from blast_env.rendering.pressure_impulse import pressure_impulse_diagram

        rows = _worst_rows(found)
        charge = rows[0][1].charge
        title = f"{rows[0][1].building}: {_charge_text(charge)}, the worst"
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
        from blast_env.recording.excel import SheetTable, write_tables

        tables = [SheetTable("Bays", bays, (*CASE_COLUMNS, *LOADED_BAY_COLUMNS))]
        pieces = piece_table(found)
        if len(pieces):
            tables.append(SheetTable("Pieces", pieces, (*CASE_COLUMNS, *PIECE_COLUMNS)))
        engine = find_engine(JUDGE, self.cell_m, cells=self.cells)
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


def _row(found: Consequences, building: str) -> Sequence[str]:
    facades = [each.facade for each in found.of(building)]
    worst = max(facades, key=lambda facade: facade.broken_panes)
    return (
        found.level_words(building),
        f"{worst.broken_panes:.1f} of {worst.panes}",
        max(facade.worst_condition for facade in facades).label,
        max(facade.worst_damage for facade in facades).name.lower(),
    )
