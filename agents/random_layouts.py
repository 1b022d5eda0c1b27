"""Layouts at random: what any method has to beat at equal cost."""

import numpy as np

from blast_env.scenario import Cell, Placement, Scenario


def random_layout(scenario: Scenario, rng: np.random.Generator) -> tuple[Cell, ...]:
    """Return a layout with every module on a random cell, as many as can be placed.

    One module after the other goes on a cell that is available then, all of them as likely. It
    ends when none is left: as a rule with the whole stock, earlier where the budget is used up or
    another module would close the access way.

    Args:
        scenario: The scenario.
        rng: Decides everything.

    Returns:
        (row, column) of the modules in the order of their placing; none without a build zone.
    """
    placement = Placement.empty(scenario)
    while not placement.is_full:
        cells = np.argwhere(placement.free)
        row, column = cells[rng.integers(len(cells))].tolist()
        placement = placement.place((row, column))
    return placement.cells
