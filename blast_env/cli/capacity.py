"""`blast-env capacity`: the largest charge and the least stand-off that keep each level."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from blast_env.cli.command import argument, option
from blast_env.cli.options import (
    CELLS_HELP,
    FINAL_CELL_HELP,
    FINAL_CELLS,
    MASS_ERROR_HELP,
    SCENARIO_HELP,
    TARGET_HELP,
    ChargeOptions,
    wanted_level,
)
from blast_env.cli.output import print_cost, print_line, print_table, progress_bar
from blast_env.cli.targets import PICTURES
from blast_env.evaluation.capacity import RUNGS, Edge, Ladder
from blast_env.evaluation.engines import JUDGE
from blast_env.evaluation.grid_error import final_engine
from blast_env.evaluation.probability import Uncertainty
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.layout.build_scene import charge_against
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import load_scenario
from blast_env.site.worst_places import stand_off_m

_LEVELS: Final = tuple(LevelOfProtection)[1:]


@dataclass(frozen=True, kw_only=True)
class CapacityCommand(ChargeOptions):
    """Find the largest charge at each place, and the least stand-off, that keep each level.

    Gas dynamics runs a few blasts at each place, with and without the layout, each with 1.69 times
    the mass of the one before; between them, histories are scaled by Hopkinson and Cranz's law. The
    stand-off changes along the line from the nearest protected wall to the charge.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    target: str | None = option(None, TARGET_HELP.format("low"))
    charges: int = option(16, "Draws of the charge; each place counts once.", min=1)
    cell_m: float | None = option(None, FINAL_CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default=FINAL_CELLS)
    mass_error: float = option(0.1, MASS_ERROR_HELP, min=0.0, max=0.3)
    picture: Path | None = option(
        None,
        "Picture of the probability over the mass: .png, .svg, .pdf.",
        writes=PICTURES,
    )

    def __call__(self) -> None:
        """Run the blasts, and print the tables."""
        scenario = load_scenario(self.scenario)
        target = wanted_level(self.target, scenario, LevelOfProtection.LOW)
        layouts: dict[str, Layout] = {"no barrier": ()}
        if self.layout is not None:
            layout = tuple(load_layout(self.layout, scenario))
            layouts[layout_counts(layout, "barrier")] = layout
        charges = self.fixed_charges(scenario, self.charges)
        engine = final_engine(JUDGE, [scenario], self.cell_m, cells=self.cells)
        print_line(engine.describe([scenario]))
        asked = [(engine, scenario, each) for each in charges for _ in layouts]
        print_cost(asked * (4 * RUNGS + 1))
        ladders = {
            name: [
                Ladder(scenario, layout, charge_against(scenario, layout, each), engine)
                for each in charges
            ]
            for name, layout in layouts.items()
        }
        every = [(name, each) for name, own in ladders.items() for each in own]
        found: dict[bool, list[list[Edge]]] = {False: [], True: []}
        with progress_bar(f"{scenario.name}: masses and stand-offs") as progress:
            for number, (_, ladder) in enumerate(every, start=1):
                for nearer, edges in found.items():
                    edges.append([ladder.edge(level, nearer) for level in _LEVELS])
                progress(number / len(every))
        blasts = sum(each.blasts for _, each in every)
        print_line(f"{blasts} blasts; between them, histories are scaled by at most 1.3 in mass")
        for nearer, edges in found.items():
            self._print(scenario.name, every, edges, nearer)
        if self.picture is not None:
            least = _LEVELS.index(target)
            masses = [own[least].charge.tnt_kg for own in found[False][-len(charges) :]]
            number = masses.index(min(masses))
            self._draw(self.picture, target, {name: own[number] for name, own in ladders.items()})

    def _print(
        self,
        site: str,
        ladders: list[tuple[str, Ladder]],
        edges: list[list[Edge]],
        nearer: bool,
    ) -> None:
        """Print the largest masses, or the least stand-offs, one row for each layout and place."""
        rows = []
        for (name, ladder), own in zip(ladders, edges, strict=True):
            x_m, y_m = ladder.charge.position_m
            off_m = stand_off_m(ladder.scenario.structures, ladder.charge.position_m)
            asked = f"{ladder.charge.tnt_kg:g} kg" if nearer else f"{off_m:.1f} m"
            texts = (each.stand_off_text if nearer else each.mass_text for each in own)
            rows.append((name, f"{x_m:.1f}, {y_m:.1f}", asked, *texts))
        what = "least stand-off (m)" if nearer else "largest charge (kg TNT)"
        headers = ("layout", "place (m)", "charge" if nearer else "stand-off")
        levels = tuple(each.label for each in _LEVELS)
        title = f"{site}: {what} that keeps each level of protection"
        print_table(title, (*headers, *levels), rows, text_columns=2)

    def _draw(self, path: Path, target: LevelOfProtection, ladders: dict[str, Ladder]) -> None:
        """Draw the probability of the level over the mass, with and without the layout."""
        # Here, because pictures need the extra `render`.
        from blast_env.plots.capacity import capacity_figure
        from blast_env.plots.figures import save_figure

        uncertainty = Uncertainty(mass=self.mass_error)
        curves = {name: each.curve(target, uncertainty) for name, each in ladders.items()}
        ladder = list(ladders.values())[-1]
        x_m, y_m = ladder.charge.position_m
        title = f"{ladder.scenario.name}: charge at ({x_m:.1f}, {y_m:.1f}) m"
        figure = capacity_figure(curves, target.label, ladder.charge.tnt_kg, title)
        print_line(f"wrote {save_figure(figure, path)}")
