"""`blast-env bench`: the speed of blasts and of the environment on this machine."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from blast_env.cli.command import Command, option
from blast_env.cli.output import ResultTable, print_line, print_table, progress_bar, result_console
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import ENGINE_NAMES, find_engine
from blast_env.evaluation.speed import (
    BlastCost,
    blast_cost,
    crowd,
    environment_cost,
    hardware,
    site_cost,
    street,
)
from blast_env.gas.settings import CELLS, UNIFORM
from blast_env.site import Scenario, load_scenario
from blast_env.units import MS_PER_S

_BLAST_HEADERS: Final = (
    "scenario",
    "engine",
    "simulated (ms)",
    "steps",
    "CPU (ms)",
    "blasts per CPU s",
    "million cell updates per CPU s",
    "memory (MB)",
)
_CROWD_HEADERS: Final = ("scenario", "engine", "1 process", "processes", "ratio")
_ENVIRONMENT_HEADERS: Final = (
    "scenario",
    "engine",
    "steps",
    "episode (ms)",
    "placing (ms)",
    "blast and reward (ms)",
    "steps/s in processes",
)

_SITE_HEADERS: Final = (
    "site",
    "cells",
    "smallest",
    "steps estimated",
    "steps",
    "CPU estimated (s)",
    "CPU (s)",
    "million cell updates per CPU s",
    "memory estimated (MB)",
    "memory (MB)",
)
_LARGE: Final = "large"
_LENGTHS_M: Final = (20.0, 50.0, 100.0)
_LONGEST_M: Final = 200.0
_LONGEST_UNIFORM_M: Final = 100.0
_ELSEWHERE: Final = (
    "elsewhere, million cell updates per s: rhoCentralFoam 1.3 (a core), MFC 59 (96 cores) and 222 "
    "(an H100), AthenaK above 1,000 (a Grace Hopper)"
)


@dataclass(frozen=True, kw_only=True)
class BenchCommand(Command):
    """Time blasts and the environment on this machine, and measure the memory.

    Processor times are medians on one core; wall-clock times need idle cores.
    """

    scenario: tuple[str, ...] = option(
        (), "Bundled name, or a scenario file; may be given several times; else courtyard."
    )
    engine: tuple[str, ...] = option((), "Engine; may be given several times; else all of them.")
    repeats: int = option(5, "Blasts or episodes of each; medians are shown.", min=1)
    processes: int = option(2, "Processes that run blasts at once; 1: do not time them.", min=1)
    memory: bool = option(True, "Also measure the memory of a process that runs a blast.")
    environment: bool = option(True, "Also time `BlastBarrier-v0`.")
    site: tuple[str, ...] = option(
        (),
        "Only the cost of a blast by gas dynamics there, with its estimate before the run: a "
        "scenario, or `large` for streets; may be given several times.",
    )
    cells: tuple[str, ...] = option(
        (), "With --site: how cells grow; may be given several times; else each way."
    )
    length_m: tuple[float, ...] = option(
        (),
        "With --site large: length, m; 20 to 200, may be given several times; else 20, 50 and 100.",
    )

    def __call__(self) -> None:
        """Print the tables."""
        if self.length_m and _LARGE not in self.site:
            raise BlastEnvError("--length needs --site large")
        if self.site:
            self._print_sites()
            return
        if self.cells:
            raise BlastEnvError("--cells needs --site")
        scenarios = [load_scenario(each) for each in self.scenario or ("courtyard",)]
        engines = [find_engine(each).name for each in self.engine or ENGINE_NAMES]
        print_line(hardware())
        pairs = [(scenario, engine) for scenario in scenarios for engine in engines]
        costs = []
        with progress_bar("blasts") as progress:
            for scenario, engine in pairs:
                costs.append(blast_cost(scenario, engine, self.repeats, memory=self.memory))
                progress(len(costs) / len(pairs))
        self._print_blasts(costs)
        if self.processes > 1:
            self._print_crowds(pairs, costs)
        if self.environment:
            self._print_environments(pairs)

    def _sites(self) -> Iterator[Scenario]:
        for name in self.site:
            if name != _LARGE:
                yield load_scenario(name)
                continue
            for length_m in self.length_m or _LENGTHS_M:
                if not _LENGTHS_M[0] <= length_m <= _LONGEST_M:
                    bounds = f"{_LENGTHS_M[0]:g} to {_LONGEST_M:g}"
                    raise BlastEnvError(f"--length is {length_m:g}, must be {bounds}")
                yield street(length_m)

    def _print_sites(self) -> None:
        from blast_env.evaluation.engines.gas import (
            GasEngine,  # Numba takes half a second to import
        )

        pairs = [
            (scenario, GasEngine(cells=cells))
            for scenario in self._sites()
            for cells in self.cells or CELLS
            if cells != UNIFORM or scenario.site.width_m <= _LONGEST_UNIFORM_M
        ]
        print_line(hardware())
        table = ResultTable("a blast by gas dynamics, without a barrier", _SITE_HEADERS, 2)
        with progress_bar("blasts") as progress:
            for done, (scenario, engine) in enumerate(pairs):
                each = site_cost(scenario, engine)
                table.add_row(
                    each.site,
                    each.cells,
                    f"{each.told.cells:,}",
                    f"{each.told.steps:,}",
                    f"{each.steps:,}",
                    f"{each.told.seconds:.1f}",
                    f"{each.cpu_s:.1f}",
                    f"{1e-6 * each.cell_updates / each.cpu_s:.1f}",
                    f"{1e-6 * each.told.memory_bytes:.0f}",
                    f"{each.memory_mb:.0f}",
                )
                progress((done + 1) / len(pairs))
        result_console().print(table)
        print_line(_ELSEWHERE)

    def _print_blasts(self, costs: Sequence[BlastCost]) -> None:
        table = ResultTable(f"a blast: medians of {self.repeats} seeds", _BLAST_HEADERS, 2)
        for each in costs:
            updates = each.cell_updates
            table.add_row(
                each.scenario,
                each.engine,
                f"{MS_PER_S * each.simulated_s:.0f}",
                f"{each.steps:,}",
                f"{MS_PER_S * each.cpu_s:.1f}",
                f"{1.0 / each.cpu_s:.2f}",
                "-" if updates is None else f"{1e-6 * updates / each.cpu_s:.1f}",
                "-" if each.memory_mb is None else f"{each.memory_mb:.0f}",
            )
        result_console().print(table)

    def _print_crowds(
        self, pairs: Sequence[tuple[Scenario, str]], costs: Sequence[BlastCost]
    ) -> None:
        title = f"blasts a second by the clock, in one process and in {self.processes}"
        rows = []
        for (scenario, engine), cost in zip(pairs, costs, strict=True):
            found = crowd(scenario, engine, cost.cpu_s, self.processes)
            rates = (f"{each:.2f}" for each in (found.alone_per_s, found.together_per_s))
            rows.append((scenario.name, engine, *rates, f"{found.ratio:.2f}"))
        print_table(title, _CROWD_HEADERS, rows, 2)

    def _print_environments(self, pairs: Sequence[tuple[Scenario, str]]) -> None:
        title = f"BlastBarrier-v0: random placements, medians of {self.repeats} episodes"
        table, left_out = ResultTable(title, _ENVIRONMENT_HEADERS, 2), []
        for scenario, engine in pairs:
            try:
                cost = environment_cost(scenario, engine, self.repeats, self.processes)
            except BlastEnvError as error:
                left_out.append(f"{scenario.name}, {engine}: no environment: {error}")
                continue
            times_s = (cost.episode_s, cost.placing_s, cost.blast_s)
            table.add_row(
                scenario.name,
                engine,
                str(cost.steps),
                *(f"{MS_PER_S * each:.1f}" for each in times_s),
                f"{cost.vector_steps_per_s:,.0f}",
            )
        result_console().print(table)
        for line in left_out:
            print_line(line)
