"""How much of what an episode of `BlastBarrier-v0` pays is the layout, and how much is luck.

For random layouts, charges and seeds: the spread of the impulse between layouts (the signal), its
scatter between seeds and between charges (the noise), and their ratio by how many blasts are
averaged. The defaults of `realisations` and `threats` rest on it.
"""

from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from itertools import product
from typing import Annotated, Final

import numpy as np
import typer
from blast_agents.rules import random_layout

from blast_env import load_scenario
from blast_env.arrays import FloatArray
from blast_env.cli.output import print_line, progress_bar
from blast_env.evaluation.cases import Threat
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.geometry import Cell
from blast_env.scenario import Placement, Scenario

Layout = tuple[Cell, ...]


SCENARIOS: Final = ("courtyard", "perimeter_gate", "street_junction")


AVERAGED: Final = (1, 2, 4, 8, 16)


_STEPS: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True)
class Noise:
    """Signal and noise of the impulse, as shares of the impulse without a barrier.

    Attributes:
        signal: Standard deviation between layouts.
        noise: Standard deviation of one layout's impulse between draws.
        reduction_noise: Standard deviation of one layout's reduction between draws, each against
            no barrier on the same draw.
        paired_noise: That of the impulse after what a draw does to all layouts alike is taken off:
            the noise of a comparison of layouts on the same draws.
    """

    signal: float
    noise: float
    reduction_noise: float
    paired_noise: float

    @classmethod
    def of(cls, impulses: FloatArray, unprotected: FloatArray) -> "Noise":
        """Return the estimates.

        Args:
            impulses: Impulses with layouts (layouts, draws).
            unprotected: Impulses without a barrier (draws,).
        """
        reductions = 1.0 - impulses[:, unprotected > 0.0] / unprotected[unprotected > 0.0]
        impulses = impulses / unprotected.mean()
        layouts, draws = impulses.shape
        between = impulses.mean(axis=1, keepdims=True)
        residual = impulses - between - impulses.mean(axis=0) + impulses.mean()
        interaction = float((residual**2).sum() / ((layouts - 1) * (draws - 1)))
        # The means over the draws scatter by chance as well, which is no signal.
        signal = max(float(between.var(ddof=1)) - interaction / draws, 0.0)
        noise = float(impulses.var(axis=1, ddof=1).mean())
        of_reduction = float(reductions.var(axis=1, ddof=1).mean())
        return cls(signal**0.5, noise**0.5, of_reduction**0.5, interaction**0.5)

    @classmethod
    def mean_of(cls, noises: list["Noise"]) -> "Noise":
        """Return the root mean squares."""
        squares = np.array([astuple(each) for each in noises]) ** 2
        return cls(*np.sqrt(squares.mean(axis=0)).tolist())

    def row(self, name: str) -> str:
        """Return a row of the Markdown table."""
        ratio, paired = self.signal / self.noise, self.signal / self.paired_noise
        ratios = (f"{n**0.5 * ratio:.2f} ({n**0.5 * paired:.2f})" for n in AVERAGED)
        shares = (f"{100.0 * each:.1f} %" for each in astuple(self))
        return f"| {' | '.join([name, *shares, *ratios])} |"


def main(
    layouts: Annotated[int, typer.Option(min=2, help="Random layouts of each kind.")] = 16,
    charges: Annotated[int, typer.Option(min=2, help="Charges drawn from the scenario.")] = 16,
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of fan and air a charge.")] = 4,
    processes: int = 2,
    engine: str = "event",
) -> None:
    """Print a table: signal, noise, and their ratio (in brackets for comparisons)."""
    columns = ["scenario, layouts, draws", "signal", "noise", "of reduction", "in comparisons"]
    print_line(f"| {' | '.join([*columns, *(f'{n} averaged' for n in AVERAGED)])} |")
    print_line("|---" * (len(columns) + len(AVERAGED)) + "|")
    for name in SCENARIOS:
        scenario = load_scenario(name)
        for kind, draw in LAYOUTS.items():
            rng = np.random.default_rng(0)
            drawn = [draw(scenario, rng) for _ in range(layouts)]
            evaluator = BlastEvaluator(scenario, engine)
            impulses = measured_impulses(evaluator, [(), *drawn], (charges, seeds), processes)
            unprotected, impulses = impulses[0], impulses[1:]
            visible = [
                Noise.of(impulses[:, charge], unprotected[charge]) for charge in range(charges)
            ]
            hidden = Noise.of(impulses.reshape(layouts, -1), unprotected.ravel())
            print_line(Noise.mean_of(visible).row(f"{name}, {kind}, seeds"))
            print_line(hidden.row(f"{name}, {kind}, charges and seeds"))


def measured_impulses(
    evaluator: BlastEvaluator, layouts: list[Layout], draws: tuple[int, int], processes: int
) -> FloatArray:
    """Return the impulse on the protected structures, psi*s (layouts, charges, seeds)."""
    charge_rng = np.random.default_rng(1)
    charges = [evaluator.scenario.sample_charge(charge_rng) for _ in range(draws[0])]
    threats = [
        Threat(charge, number * draws[1] + seed)
        for number, charge in enumerate(charges)
        for seed in range(draws[1])
    ]
    with progress_bar(evaluator.scenario.name) as progress:
        loads = evaluator.loads_of_many(product(layouts, threats), processes, progress)
    impulses = np.array([each.protected_impulse_psi_s for each in loads])
    return impulses.reshape(len(layouts), *draws)


def walled_layout(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return a layout of straight walls, each as long as space and stock allow."""
    placement = Placement.empty(scenario)
    while not placement.is_full:
        row, column = _any_free(placement, rng)
        down, right = _STEPS[rng.integers(len(_STEPS))]
        while placement.explain((row, column)) is None:
            placement = placement.place((row, column))
            row, column = row + down, column + right
    return placement.cells


def _any_free(placement: Placement, rng: np.random.Generator) -> Cell:
    row, column = rng.choice(np.argwhere(placement.free)).tolist()
    return row, column


LAYOUTS: Final[Mapping[str, Callable[[Scenario, np.random.Generator], Layout]]] = {
    "scattered": random_layout,
    "walls": walled_layout,
}


if __name__ == "__main__":
    typer.run(main)
