"""The cost of a cluster: what a blast costs beside its simulation, and how wide searches are.

`python -m studies.cluster` starts workers on this machine. Times are of the wall clock, so that the
machine must have nothing else to do.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Annotated, Any, Final

import joblib
import typer

from blast_env.answers.terminal import print_line, print_table
from blast_env.cli.output import user_errors
from blast_env.cluster import ClusterBackend, on_cluster
from blast_env.design.search.registry import find_proposer, widened
from blast_env.errors import import_extra
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCase
from blast_env.evaluation.cases import search_set
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.evaluation.record import BlastLoads
from blast_env.geometry import Element
from blast_env.layout import draw_charge
from blast_env.runner import run_all
from blast_env.site import AnyScenario, find_scenario
from blast_env.surrogate import SurrogateEngine
from blast_env.units import MS_PER_S
from studies.bench import hardware

METHODS: Final = ("genetic", "population_annealing")
WORKERS: Final = (2, 4, 8, 16, 32)
"""Numbers of workers of the ideal shares."""

GUESSES: Final = SurrogateEngine()
"""The engine by which the widths are counted."""

_PIECES: Final = 400


@dataclass(frozen=True)
class Overhead:
    """What a piece of work that takes no time costs.

    Attributes:
        blast_s: Time of one of many.
        cpu_s: Processor time of one in the submitting process.
        blast_bytes: Bytes of a blast on its way to a worker.
        site_bytes: Bytes of its site, which travels once.
    """

    blast_s: float
    cpu_s: float
    blast_bytes: int
    site_bytes: int


@dataclass(frozen=True)
class SearchCost:
    """A search.

    Attributes:
        layout: The best layout.
        widths: Number of new blasts of each batch.
        elapsed_s: Its duration.
        cpu_s: Processor time of this process.
    """

    layout: tuple[Element, ...]
    widths: tuple[int, ...]
    elapsed_s: float
    cpu_s: float

    @property
    def cpu_of_blast_s(self) -> float:
        """Processor time of this process per blast."""
        return self.cpu_s / sum(self.widths)

    def share(self, workers: int) -> float:
        """Return the share of the ideal that the widths allow, if all blasts take equal time."""
        rounds = sum(-(-width // workers) for width in self.widths)
        return sum(self.widths) / (workers * rounds)


class _Widths(BlastEvaluator):
    """Notes how many blasts of each batch are new."""

    def __init__(self, scenario: AnyScenario, engine: Engine) -> None:
        super().__init__(scenario, engine)
        self.found: list[int] = []

    def loads_of_many(
        self,
        pairs: Iterable[tuple[Sequence[Element], LoadCase]],
        processes: int = 1,
        progress: Callable[[float], None] | None = None,
    ) -> list[BlastLoads]:
        """Return the loads; see `BlastEvaluator`."""
        before = self.counts.blasts
        loads = super().loads_of_many(pairs, processes, progress)
        if self.counts.blasts > before:
            self.found.append(self.counts.blasts - before)
        return loads


def search_cost(
    scenario: AnyScenario, engine: Engine, method: str, budget: int, width: int
) -> SearchCost:
    """Run a search of a width against one known charge, where the runner does its work."""
    site = find_scenario(scenario)
    evaluator = _Widths(site, engine)
    problem = DesignProblem(evaluator, search_set(site, draw_charge(site, 0)))
    began, began_cpu = perf_counter(), process_time()
    found = widened(find_proposer(method), width).propose(problem, budget)
    spent_s = perf_counter() - began, process_time() - began_cpu
    return SearchCost(found.layout, tuple(evaluator.found), *spent_s)


_QUIET: Final = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "200ms",
}
"""What docs/howto/cluster.md sets: else an idle worker takes 3 % of a core, with it 1 %."""


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """Start a scheduler and workers with one thread each; give the scheduler's address."""
    with import_extra("cluster", "a cluster"):
        import dask
        from distributed import LocalCluster
    options: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None}
    with dask.config.set(_QUIET), LocalCluster(n_workers=workers, **options) as cluster:
        yield cluster.scheduler_address


def overhead(scenario: AnyScenario, address: str, pieces: int = _PIECES) -> Overhead:
    """Send blasts to workers that do nothing with them."""
    from distributed import Client

    site = find_scenario(scenario)
    charge = draw_charge(site, 0)
    blasts = [EngineBlast(site, (), charge, seed) for seed in range(pieces)]
    with Client(address, set_as_default=False) as client:
        backend = ClusterBackend(client)
        with joblib.parallel_config(backend=backend, n_jobs=-1):
            run_all(_nothing, blasts)  # the site is there, and everything imported
            began, began_cpu = perf_counter(), process_time()
            run_all(_nothing, blasts)
            blast_s = (perf_counter() - began) / pieces
            cpu_s = (process_time() - began_cpu) / pieces
    return Overhead(blast_s, cpu_s, backend.work_bytes // (2 * pieces), sum(backend.section_bytes))


def _nothing(blast: EngineBlast) -> int:
    return blast.seed


def _print_overhead(found: Overhead) -> None:
    print_line(
        f"a blast without a simulation: {MS_PER_S * found.blast_s:.1f} ms, of them"
        f" {MS_PER_S * found.cpu_s:.1f} ms of the submitting process's processor"
    )
    print_line(
        f"a blast travels in {found.blast_bytes} bytes; its site, of {found.site_bytes:,} bytes,"
        " travels once"
    )


def main(
    scenario: Annotated[str, typer.Option(help="The scenario.")] = "visitor_entrance",
    engine: Annotated[str, typer.Option(help="The engine of the searches.")] = "gas",
    budget: Annotated[int, typer.Option(help="Blasts of a search.", min=1)] = 200,
    workers: Annotated[int, typer.Option(help="Workers to start.", min=1)] = 2,
) -> None:
    """Measure what a cluster costs, with workers on this machine."""
    with user_errors(), local_cluster(workers) as address:
        print_line(hardware())
        _print_overhead(overhead(scenario, address))
        chosen = find_engine(engine)
        rows = [_measured(address, scenario, chosen, method, budget, workers) for method in METHODS]
        headers = (
            *("method", "batches", "widest", "alone (s)", f"{workers} processes (s)", "share"),
            *(f"{workers} workers (s)", "share", "CPU alone (ms a blast)", "CPU here (ms a blast)"),
            "same result",
        )
        title = f"{budget} blasts on {scenario}: shares of the ideal, and processor times"
        print_table(title, headers, rows, 1)
        rows = []
        for method in METHODS:
            found = [search_cost(scenario, GUESSES, method, budget, number) for number in WORKERS]
            shares = (item.share(number) for item, number in zip(found, WORKERS, strict=True))
            rows.append((method, *(f"{share:.2f}" for share in shares)))
        title = "shares of the ideal that the widths allow"
        print_table(title, ("method", *(f"{number} workers" for number in WORKERS)), rows, 1)


def _measured(
    address: str, scenario: str, engine: Engine, method: str, budget: int, workers: int
) -> tuple[str, ...]:
    """Return the row of a method: alone, on processes of this machine, and on a cluster.

    Plain processes are the bound: blasts side by side share the memory of a machine.
    """
    alone = search_cost(scenario, engine, method, budget, workers)
    with joblib.parallel_config(backend="loky", n_jobs=workers):
        run_all(abs, range(workers))  # the processes are there
        beside = search_cost(scenario, engine, method, budget, workers)
    with on_cluster(address):
        shared = search_cost(scenario, engine, method, budget, workers)
    reached = (alone.elapsed_s / (workers * item.elapsed_s) for item in (beside, shared))
    return (
        *(method, str(len(alone.widths)), str(max(alone.widths)), f"{alone.elapsed_s:.1f}"),
        *(f"{beside.elapsed_s:.1f}", f"{next(reached):.2f}"),
        *(f"{shared.elapsed_s:.1f}", f"{next(reached):.2f}"),
        *(f"{MS_PER_S * item.cpu_of_blast_s:.1f}" for item in (alone, shared)),
        "yes" if alone.layout == beside.layout == shared.layout else "NO",
    )


if __name__ == "__main__":
    typer.run(main)
