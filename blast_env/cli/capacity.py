"""`blast-env assess --capacity`: the largest charge and least stand-off that keep each level."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.cli.output import (
    print_cost,
    print_line,
    print_table,
    print_written,
    progress_bar,
    save_figures,
)
from blast_env.evaluation.capacity import RUNGS, Edge, Ladder
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.probability import Uncertainty
from blast_env.geometry import Layout
from blast_env.layout.build_scene import charge_against
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import AnyCharge, Scenario
from blast_env.site.worst_places import stand_off_m

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEVELS: Final = tuple(LevelOfProtection)[1:]


def print_capacity(
    scenario: Scenario,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    engine: Engine,
    target: LevelOfProtection,
    uncertainty: Uncertainty,
    picture: Path | None,
) -> None:
    """Print the largest masses and the least stand-offs, one row for each layout and place.

    Gas dynamics runs a few blasts at each place, each with 1.69 times the mass of the one before;
    between them, histories are scaled by Hopkinson and Cranz's law. The stand-off changes along the
    line from the nearest protected wall to the charge.

    Args:
        scenario: The scenario.
        layouts: The layouts by name.
        charges: The charges; their places count.
        engine: Gas dynamics.
        target: Level of protection of the picture.
        uncertainty: Of the probabilities in the picture.
        picture: Path of the picture of the probability over the mass, with and without the layout.
    """
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
    masses: list[list[Edge]] = []
    stand_offs: list[list[Edge]] = []
    with progress_bar(f"{scenario.name}: masses and stand-offs") as progress:
        for number, (_, ladder) in enumerate(every, start=1):
            masses.append([ladder.edge(level) for level in _LEVELS])
            stand_offs.append([ladder.edge(level, nearer=True) for level in _LEVELS])
            progress(number / len(every))
    blasts = sum(each.blasts for _, each in every)
    print_line(f"{blasts} blasts; between them, histories are scaled by at most 1.3 in mass")
    levels = tuple(each.label for each in _LEVELS)
    rows = [
        (name, _place(each), f"{_off_m(each):.1f} m", *(edge.mass_text for edge in edges))
        for (name, each), edges in zip(every, masses, strict=True)
    ]
    title = f"{scenario.name}: largest charge (kg TNT) that keeps each level of protection"
    print_table(title, ("layout", "place (m)", "stand-off", *levels), rows, text_columns=2)
    rows = [
        (name, _place(each), f"{each.charge.tnt_kg:g} kg", *(e.stand_off_text for e in edges))
        for (name, each), edges in zip(every, stand_offs, strict=True)
    ]
    title = f"{scenario.name}: least stand-off (m) that keeps each level of protection"
    print_table(title, ("layout", "place (m)", "charge", *levels), rows, text_columns=2)

    def curves() -> "Figure":
        from blast_env.plots.capacity import capacity_figure

        of_target = [own[_LEVELS.index(target)].charge.tnt_kg for own in masses[-len(charges) :]]
        number = of_target.index(min(of_target))
        shown = {name: own[number].curve(target, uncertainty) for name, own in ladders.items()}
        least = every[number - len(charges)][1]
        title = f"{scenario.name}: charge at ({_place(least)}) m"
        return capacity_figure(shown, target.label, least.charge.tnt_kg, title)

    print_written(save_figures((picture, curves)))


def _place(ladder: Ladder) -> str:
    x_m, y_m = ladder.charge.position_m
    return f"{x_m:.1f}, {y_m:.1f}"


def _off_m(ladder: Ladder) -> float:
    return stand_off_m(ladder.scenario.structures, ladder.charge.position_m)
