"""Random layouts: how far noise, the engine and the size of the balls hide which is better."""

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations, product
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from blast_agents.rules import random_layout

from blast_env.arrays import FloatArray
from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.envs.strategies import DEPOSIT
from blast_env.evaluation.cases import Threat
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.files import make_folder
from blast_env.geometry import Cell, Layout
from blast_env.scenario import Placement, Scenario, load_scenario
from blast_env.scenario.build_scene import charge_against
from blast_env.tables import markdown_table, write_csv
from studies.particles.agreement import layouts as study
from studies.particles.agreement.layouts import AVERAGED, Noise

SCENARIOS: Final = ("courtyard", "perimeter_gate", "street_junction")
_STEPS: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def noise(
    layouts: Annotated[int, typer.Option(min=2, help="Random layouts of each kind.")] = 16,
    charges: Annotated[int, typer.Option(min=2, help="Charges drawn from the scenario.")] = 16,
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of fan and air a charge.")] = 4,
    processes: int = 2,
    cluster: ClusterAddress = None,
    engine: str = "event",
) -> None:
    """Print how much of what an episode of `BlastBarrier-v0` pays is the layout, and how much luck.

    The spread of the impulse between layouts (the signal), its scatter between seeds and between
    charges (the noise), and their ratio by how many blasts are averaged (in brackets for
    comparisons). The defaults of `realisations` and `threats` rest on it.
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


@app.command()
def deposit(
    layouts: Annotated[int, typer.Option(min=1, help="Random layouts of each kind.")] = 24,
    charges: Annotated[int, typer.Option(min=1, help="Charges drawn from the scenario.")] = 12,
    realisations: Annotated[int, typer.Option(min=1, help="Blasts averaged.")] = 1,
    processes: int = 2,
    engine: str = "event",
) -> None:
    """Print by how much a layout can make it worse, which the deposit of the reward must cover.

    Whole and unfinished layouts, and the largest impulse with one over that without a barrier, on
    the same blasts.
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


@app.command()
def engines(
    layouts: Annotated[int, typer.Option(min=10)] = 200,
    charges: Annotated[int, typer.Option(min=1, help="Charges drawn from the scenario.")] = 8,
    processes: int = 2,
    cluster: ClusterAddress = None,
    out: Annotated[Path, typer.Option(help="File for the mean loads.")] = Path(
        "out/rank_layouts.csv"
    ),
) -> None:
    """Print whether both engines put layouts of the courtyard into the same order.

    Each layout gets the same charges on both. Two lots of seeds of fan and air on each engine say
    how well an engine agrees with itself, which bounds how well it can agree with the other one.
    """
    with user_errors(), running_on(cluster):
        make_folder(out.parent)
        scenario = load_scenario("courtyard").with_simulation("ballistic")
        rng = np.random.default_rng(0)
        whole = layouts_in_turn(scenario, ("scattered", "walls"), layouts, rng)
        drawn = [layout[: rng.integers(1, len(layout) + 1)] for layout in whole]
        drawn_charges = [scenario.sample_charge(rng) for _ in range(charges)]
        threats = [charge_against(scenario, (), charge) for charge in drawn_charges]
        with progress_bar("blasts") as progress:
            loads = study.measured_loads(scenario, drawn, threats, processes, progress)
        write_csv(study.mean_loads(drawn, loads), out)
    averaged = loads.mean(axis=-1, keepdims=True)
    rows = [
        (name, *(study.correlation(each, statistic, rng) for each in (loads, averaged)))
        for name, statistic in study.STATISTICS.items()
    ]
    print_line(markdown_table(("compared", "1 seed a layout", f"{charges} seeds a layout"), rows))
    print_line(f"wrote {out}")


@app.command()
def resolutions(
    scenario: str = "courtyard",
    layouts: Annotated[int, typer.Option(min=3)] = 30,
    seeds: Annotated[int, typer.Option(min=2)] = 4,
    first_seed: int = 2000,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("out/resolution_convergence"),
) -> None:
    """Print whether finer balls would rank layouts differently, on the same seeds.

    With `collisional`, `collisional_fine` and still finer balls: what each layout leaves of the
    impulse, the rank correlations, the mean differences, and the time of a blast.
    """
    with user_errors(), running_on(cluster):
        make_folder(out)
        loaded = load_scenario(scenario)
        rng = np.random.default_rng(0)
        tried = [(), *layouts_in_turn(loaded, ("walls", "scattered"), layouts, rng)]
        numbers = range(first_seed, first_seed + seeds)
        found = []
        for name, parameters in study.resolutions().items():
            changed = study.with_parameters(loaded, parameters)
            with progress_bar(name) as progress:
                found.append(study.blasts_of(name, changed, tried, numbers, processes, progress))
        write_csv(study.share_table(tried[1:], found), out / f"{scenario}.csv")
        for each in found:
            print_line(
                f"{each.name}: {each.blast_s:.3f} s a blast, leaves {each.shares.mean():.3f}; "
                f"rank correlation between halves of the seeds {study.own_correlation(each):.2f}"
            )
        for one, other in combinations(found, 2):
            print_line(study.compared(one, other))


def layouts_in_turn(
    scenario: Scenario, kinds: tuple[str, ...], count: int, rng: np.random.Generator
) -> Iterator[Layout]:
    """Yield layouts of the whole stock, of the kinds in turn."""
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
