"""`blast-env assess`: does the building pass, and what would better glass bring?"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from blast_env.cli.command import argument, option
from blast_env.cli.options import CELL_HELP, SCENARIO_HELP, ChargeOptions
from blast_env.cli.output import make_table, print_line, progress_bar, result_console
from blast_env.cli.targets import PICTURES
from blast_env.engines import JUDGE, find_engine
from blast_env.errors import UnknownNameError
from blast_env.evaluation import draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import Consequences, consequences, other_glazing
from blast_env.geometry import Layout, layout_counts
from blast_env.response.buildings import LevelOfProtection
from blast_env.scenario import AnyCharge, Scenario, load_layout, load_scenario

_HEADERS: Final = (
    "layout",
    "building",
    "level of protection",
    "panes broken",
    "worst pane (GSA)",
    "worst panel",
)
_LEVELS: Final = {level.label: level for level in LevelOfProtection}


@dataclass(frozen=True, kw_only=True)
class AssessCommand(ChargeOptions):
    """Say what charges do to the buildings: panes, panels, level of protection.

    By gas dynamics, a blast a charge, with and without the layout. Structures need a facade in the
    scenario file. What better glass would bring needs no further blast, and is printed as well.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    target: str = option("low", "Level of protection to reach: very low, low, medium or high.")
    charges: int = option(16, "Draws of the charge; each place counts once.", min=1)
    cell_m: float | None = option(None, CELL_HELP)
    picture: Path | None = option(
        None, "Picture of the facades under the worst charge: .png, .svg, .pdf.", writes=PICTURES
    )

    def __call__(self) -> None:
        """Run the blasts, and print the verdict."""
        if self.target not in _LEVELS:
            raise UnknownNameError("level of protection", self.target, _LEVELS)
        target = _LEVELS[self.target]
        scenario = load_scenario(self.scenario)
        layouts: dict[str, Layout] = {"no barrier": ()}
        if self.layout is not None:
            layout = tuple(load_layout(self.layout, scenario))
            layouts[layout_counts(layout, "barrier")] = layout
        charges = self._charges(scenario)
        engine = find_engine(JUDGE, self.cell_m)
        found = {}
        for name, layout in layouts.items():
            with progress_bar(f"{len(charges)} blasts, {name}") as progress:
                found[name] = consequences(scenario, layout, charges, engine, progress)
        last, judged = list(found.items())[-1]
        passes = judged.passes(target)
        print_line(
            f"{scenario.name}, {last}: {'PASSES' if passes else 'FAILS'} level {target.label!r} "
            f"under {len(charges)} charges"
        )
        self._print(scenario, found)
        self._print_glazing(scenario, judged, target)
        print_line(engine.describe([scenario]))
        if self.picture is not None:
            self._draw(self.picture, found)

    def _charges(self, scenario: Scenario) -> list[AnyCharge]:
        threats = one_of_each_charge(draw_threats(scenario, range(self.charges)))
        fixed = [self.fixed(scenario, threat.charge) for threat in threats]
        return list(dict.fromkeys(fixed))

    def _print(self, scenario: Scenario, found: dict[str, Consequences]) -> None:
        table = make_table(f"{scenario.name}: the worst of all charges", _HEADERS, text_columns=3)
        for name, each in found.items():
            for building in each.buildings:
                table.add_row(name, building, *_row(each, building))
        result_console().print(table)

    def _print_glazing(
        self, scenario: Scenario, judged: Consequences, target: LevelOfProtection
    ) -> None:
        headers = ("glass in all windows", *_HEADERS[1:], "passes")
        table = make_table("the same loads, other glass", headers, text_columns=3)
        for name, glazing in other_glazing(scenario).items():
            other = judged.with_glazing(glazing)
            for building in other.buildings:
                passes = "yes" if other.level(building) >= target else "no"
                table.add_row(name, building, *_row(other, building), passes)
        result_console().print(table)

    def _draw(self, picture: Path, found: dict[str, Consequences]) -> None:
        # Here, because pictures need the extra `render`.
        from blast_env.rendering.facade import facade_picture
        from blast_env.rendering.figures import save_figure

        first = next(iter(found.values()))
        building = min(first.buildings, key=first.level)
        responses = {name: each.of(building) for name, each in found.items()}
        bare = next(iter(responses.values()))
        worst = max(range(len(bare)), key=lambda k: bare[k].facade.broken_panes)
        rows = [(name, each[worst]) for name, each in responses.items()]
        x_m, y_m = rows[0][1].charge.position_m
        title = f"{building}: {rows[0][1].charge.tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m, the worst"
        print_line(f"wrote {save_figure(facade_picture(rows, title), picture)}")


def _row(found: Consequences, building: str) -> tuple[str, str, str, str]:
    facades = [each.facade for each in found.of(building)]
    worst = max(facades, key=lambda facade: facade.broken_panes)
    return (
        found.level(building).label,
        f"{worst.broken_panes:.1f} of {worst.panes}",
        max(facade.worst_condition for facade in facades).label,
        max(facade.worst_damage for facade in facades).name.lower(),
    )
