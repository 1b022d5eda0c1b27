"""`blast-env screen`: levels of protection and stand-offs by Kingery and Bulmash, in seconds."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from blast_env.cli.command import Command, argument, option
from blast_env.cli.options import (
    CELLS_HELP,
    FINAL_CELL_HELP,
    FINAL_CELLS,
    REQUIRE_HELP,
    SCENARIO_HELP,
)
from blast_env.cli.output import (
    ResultTable,
    print_cost,
    print_line,
    progress_bar,
    result_console,
)
from blast_env.cli.targets import PICTURES
from blast_env.evaluation.consequences import Consequences, consequences
from blast_env.evaluation.engines import JUDGE
from blast_env.evaluation.grid_error import final_engine
from blast_env.evaluation.screening import (
    LEFT_OUT,
    STAND_OFF_HEADERS,
    THREAT_HEADERS,
    Screened,
    Screening,
    facades_for,
    screen,
)
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario, load_scenario
from blast_env.site.presets import (
    CHARGE_PRESETS,
    EQUIVALENTS_SOURCE,
    PRESETS_SOURCE,
    TNT_EQUIVALENTS,
    NamedMass,
)


@dataclass(frozen=True, kw_only=True)
class ScreenCommand(Command):
    """Screen a site before any blast: level of protection, and the stand-off that it needs.

    Loads are Kingery and Bulmash's in the open, by angle of incidence and sight; takes seconds.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    mass: tuple[str, ...] = option(
        (),
        f"Charge at every place of the site's charges: {', '.join(CHARGE_PRESETS)}, or "
        f"NAME=KG[,EXPLOSIVE] with {', '.join(TNT_EQUIVALENTS)}; else the site's own. May be "
        "repeated.",
    )
    require: tuple[str, ...] = option((), REQUIRE_HELP)
    glazing: str | None = option(
        None, "Windows of protected structures that have no facade, a component."
    )
    wall: str | None = option(
        None, "Walls of protected structures that have no facade, a component."
    )
    gas: bool = option(False, "Gas dynamics of each worst place, for comparison.")
    cell_m: float | None = option(None, FINAL_CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default=FINAL_CELLS)
    picture: Path | None = option(
        None, "Plan with the stand-off of each level as rings: .png, .svg, .pdf.", writes=PICTURES
    )

    def __call__(self) -> None:
        """Print the tables, and draw the picture."""
        scenario = facades_for(load_scenario(self.scenario), self.glazing, self.wall)
        named = [NamedMass.parsed(each) for each in self.mass]
        level = scenario.objective.level or LevelOfProtection.LOW
        required = [Requirement.parsed(each) for each in self.require]
        required = required or [Requirement.of_level(level)]
        layout: Layout = ()
        if self.layout is not None:
            layout = tuple(load_layout(self.layout, scenario))
        found = screen(scenario, layout, named)
        beside = self._gas(scenario, layout, found) if self.gas else {}
        title = layout_counts(layout, "barrier") if layout else "no barrier"
        print_line(f"required: {'; '.join(each.words for each in required)}")
        _print_threats(f"{scenario.name}, {title}: worst place by damage", found, required, beside)
        for each in found.threats:
            _print_stand_offs(found, each)
        if named:
            print_line(f"presets: {PRESETS_SOURCE}")
        if any("," in each for each in self.mass):
            print_line(f"TNT equivalents: {EQUIVALENTS_SOURCE}")
        print_line(LEFT_OUT)
        if not self.gas:
            print_line("--gas shows by how much that matters at each worst place")
        if self.picture is not None:
            # Here, because pictures need the extra `render`.
            from blast_env.plots.figures import save_figure
            from blast_env.plots.screening import screening_picture

            figure = screening_picture(scenario, layout, found)
            print_line(f"wrote {save_figure(figure, self.picture)}")

    def _gas(self, scenario: Scenario, layout: Layout, found: Screening) -> dict[str, Consequences]:
        """Return the consequences of each worst place by gas dynamics."""
        engine = final_engine(JUDGE, [scenario], self.cell_m, cells=self.cells)
        print_line(engine.describe([scenario]))
        charges = [each.charge for each in found.threats]
        print_cost((engine, scenario, each) for each in charges)
        result = {}
        with progress_bar(f"{len(charges)} blasts") as progress:
            for number, each in enumerate(found.threats):
                result[each.name] = consequences(scenario, layout, [each.charge], engine)
                progress((number + 1) / len(charges))
        return result


def _print_threats(
    title: str,
    found: Screening,
    required: Sequence[Requirement],
    beside: dict[str, Consequences],
) -> None:
    table = ResultTable(title, THREAT_HEADERS, text_columns=2)
    for each in found.threats:
        table.add_row(*found.threat_row(each, required))
        if each.name in beside:
            table.add_row("  by gas", *[""] * 4, *_gas_row(beside[each.name]))
    result_console().print(table)


def _gas_row(found: Consequences) -> Sequence[str]:
    facades = [each.facade for each in found.responses]
    condition = max(each.worst_condition for each in facades)
    return (
        min(each.level_of_protection for each in facades).label,
        f"{sum(each.broken_panes for each in facades):.1f}",
        condition.words,
        max(each.worst_damage for each in facades).name.lower(),
        "flagged" if found.is_flagged else "",
    )


def _print_stand_offs(found: Screening, threat: Screened) -> None:
    title = (
        f"stand-off (m) from which a component allows a level, {threat.name},"
        f" {threat.charge.tnt_kg:g} kg TNT (* on this site)"
    )
    table = ResultTable(title, STAND_OFF_HEADERS)
    for row in found.stand_off_rows(threat):
        table.add_row(*row)
    result_console().print(table)
