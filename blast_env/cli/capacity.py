"""`blast-env assess --capacity`: the largest charge and least stand-off that keep each level."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from blast_env.cli.output import (
    print_answer,
    print_cost,
    print_line,
    print_written,
    progress_bar,
    save_figures,
)
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.capacity import MOST_BLASTS, capacity
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.probability import Uncertainty
from blast_env.geometry import Layout
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import AnyCharge, Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def print_capacity(
    scenario: Scenario,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    engine: Engine,
    target: LevelOfProtection,
    uncertainty: Uncertainty,
    picture: Path | None,
    cache: Path | None,
) -> None:
    """Print the largest masses and the least stand-offs, one row for each layout and place.

    Args:
        scenario: The scenario.
        layouts: The layouts by name.
        charges: The charges; their places count.
        engine: Gas dynamics.
        target: Level of protection of the picture.
        uncertainty: Of the probabilities in the picture.
        picture: Path of the picture of the probability over the mass, with and without the layout.
        cache: Folder of stored blasts.
    """
    print_line(engine.describe([scenario]))
    asked = [(engine, scenario, each) for each in charges for _ in layouts]
    print_cost(asked * MOST_BLASTS)
    evaluator = BlastEvaluator(scenario, engine, cache=cache)
    with progress_bar(f"{scenario.name}: masses and stand-offs") as progress:
        found = capacity(evaluator, layouts, charges, progress)
    print_answer(found.answer())

    def curves() -> "Figure":
        from blast_env.plots.capacity import capacity_figure

        least, shown = found.curves(target, uncertainty)
        title = f"{scenario.name}: charge at ({least.place}) m"
        return capacity_figure(shown, target.label, least.charge.tnt_kg, title)

    print_written(save_figures((picture, curves)))
