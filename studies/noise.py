"""Signal and noise of the reward of `BlastBarrier-v0`.

The basis for the defaults of `realisations` and `threats` and for the deposit of the reward.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import astuple, dataclass
from itertools import product
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.arrays import FloatArray
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.design.rules import random_layout
from blast_env.envs.strategies import DEPOSIT
from blast_env.evaluation.cases import Threat
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.geometry import Cell, Layout
from blast_env.layout import Placement
from blast_env.site import Scenario, load_scenario
from blast_env.tables import markdown_table

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
        paired_noise: Standard deviation of the impulse without the effect of a draw common to all
            layouts: the noise of a comparison of layouts on the same draws.
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
        # The means over the draws also scatter by chance, which is not signal.
        signal = max(float(between.var(ddof=1)) - interaction / draws, 0.0)
        noise = float(impulses.var(axis=1, ddof=1).mean())
        of_reduction = float(reductions.var(axis=1, ddof=1).mean())
        return cls(signal**0.5, noise**0.5, of_reduction**0.5, interaction**0.5)

    @classmethod
    def mean_of(cls, noises: list["Noise"]) -> "Noise":
        """Return the root mean squares."""
        squares = np.array([astuple(each) for each in noises]) ** 2
        return cls(*np.sqrt(squares.mean(axis=0)).tolist())

    def cells(self) -> list[str]:
        """Return the four as shares, then signal over noise for each number in `AVERAGED`."""
        ratio, paired = self.signal / self.noise, self.signal / self.paired_noise
        ratios = (f"{n**0.5 * ratio:.2f} ({n**0.5 * paired:.2f})" for n in AVERAGED)
        shares = (f"{100.0 * each:.1f} %" for each in astuple(self))
        return [*shares, *ratios]


app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def reward(
    layouts: Annotated[int, typer.Option(min=2, help="Random layouts of each kind.")] = 16,
    charges: Annotated[int, typer.Option(min=2, help="Charges drawn from the scenario.")] = 16,
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of fan and air a charge.")] = 4,
    processes: int = 2,
    cluster: ClusterAddress = None,
    engine: str = "event",
) -> None:
    """Print the signal and noise of the reward of `BlastBarrier-v0`.

    The spread of the impulse between layouts (the signal), its scatter between seeds and between
    charges (the noise), and their ratio by the number of blasts averaged (in brackets for
    comparisons). This is the basis for the defaults of `realisations` and `threats`.
    """
    with user_errors(), running_on(cluster):
        rows = []
        for name in SCENARIOS:
            scenario = load_scenario(name)
            for kind, draw in LAYOUTS.items():
                rng = np.random.default_rng(0)
                drawn = [draw(scenario, rng) for _ in range(layouts)]
                evaluator = BlastEvaluator(scenario, engine)
                impulses = _impulses(evaluator, [(), *drawn], (charges, seeds), processes)
                unprotected, impulses = impulses[0], impulses[1:]
                visible = [Noise.of(impulses[:, c], unprotected[c]) for c in range(charges)]
                hidden = Noise.of(impulses.reshape(layouts, -1), unprotected.ravel())
                rows.append((f"{name}, {kind}, seeds", *Noise.mean_of(visible).cells()))
                rows.append((f"{name}, {kind}, charges and seeds", *hidden.cells()))
        columns = ("scenario, layouts, draws", "signal", "noise", "of reduction", "in comparisons")
        print_line(markdown_table((*columns, *(f"{n} averaged" for n in AVERAGED)), rows))


def _impulses(
    evaluator: BlastEvaluator, layouts: list[Layout], draws: tuple[int, int], processes: int
) -> FloatArray:
    """Return the impulse on the protected structures, Pa*s (layouts, charges, seeds)."""
    charge_rng = np.random.default_rng(1)
    charges = [evaluator.scenario.sample_charge(charge_rng) for _ in range(draws[0])]
    threats = [
        Threat(charge, number * draws[1] + seed)
        for number, charge in enumerate(charges)
        for seed in range(draws[1])
    ]
    with progress_bar(evaluator.scenario.name) as progress:
        loads = evaluator.loads_of_many(product(layouts, threats), processes, progress)
    impulses = np.array([each.protected_impulse_pa_s for each in loads])
    return impulses.reshape(len(layouts), *draws)


@app.command()
def deposit(
    layouts: Annotated[int, typer.Option(min=1, help="Random layouts of each kind.")] = 24,
    charges: Annotated[int, typer.Option(min=1, help="Charges drawn from the scenario.")] = 12,
    realisations: Annotated[int, typer.Option(min=1, help="Blasts averaged.")] = 1,
    processes: int = 2,
    engine: str = "event",
) -> None:
    """Print the largest increase of the impulse by a layout, which the reward's deposit must cover.

    For complete and incomplete layouts: the ratio of the impulse to that without a barrier, on the
    same draws.
    """
    rows = []
    for name in SCENARIOS:
        scenario = load_scenario(name)
        rng = np.random.default_rng(0)
        whole = layouts_in_turn(scenario, tuple(LAYOUTS), 2 * layouts, rng)
        drawn = [layout[: rng.integers(1, len(layout) + 1)] for layout in whole]
        evaluator = BlastEvaluator(scenario, engine)
        impulses = _impulses(evaluator, [(), *drawn], (charges, realisations), processes)
        means = impulses.mean(axis=2)
        ratios = means[1:] / means[0]
        rows.append((name, f"{np.median(ratios):.2f}", f"{ratios.max():.2f}"))
    columns = ("scenario", "impulse with a layout / without: median", "largest")
    print_line(markdown_table(columns, rows))
    print_line(f"the deposit is {DEPOSIT:g} times the impulse without a barrier")


def layouts_in_turn(
    scenario: Scenario, kinds: tuple[str, ...], count: int, rng: np.random.Generator
) -> Iterator[Layout]:
    """Yield layouts of the whole stock, with the kinds in rotation."""
    for number in range(count):
        yield LAYOUTS[kinds[number % len(kinds)]](scenario, rng)


def walled_layout(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return a layout of straight walls, each as long as space and stock allow."""
    placement = Placement.empty(scenario)
    while not placement.is_full:
        row, column = _any_free(placement, rng)
        down, right = _STEPS[rng.integers(len(_STEPS))]
        while placement.explain((row, column)) is None:
            placement = placement.place((row, column))
            row, column = row + down, column + right
    return placement.layout


def _any_free(placement: Placement, rng: np.random.Generator) -> Cell:
    row, column = rng.choice(np.argwhere(placement.free)).tolist()
    return row, column


LAYOUTS: Final[Mapping[str, Callable[[Scenario, np.random.Generator], Layout]]] = {
    "scattered": random_layout,
    "walls": walled_layout,
}


if __name__ == "__main__":
    app()
