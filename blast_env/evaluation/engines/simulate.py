"""Functions that run blasts; results depend only on scenario, layout, seed, charge and engine."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from typing import TYPE_CHECKING, Any, Literal, overload

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.contract import BlastOutcome, Engine, default_engine, find_engine
from blast_env.evaluation.engines.particles import Blast, BlastResult
from blast_env.geometry import Element
from blast_env.runner import check_workers
from blast_env.site import AnyCharge, AnyScenario, find_scenario

if TYPE_CHECKING:  # Numba takes a third of a second to import
    from blast_env.evaluation.engines.gas import GasEngine, GasResult


@overload
def simulate(  # type: ignore[overload-overlap]  # "gas" is a name too
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    *,
    engine: "Literal['gas'] | GasEngine",
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
    cell_m: float | None = ...,
    until: str | float | None = ...,
    cells: str | None = ...,
) -> "GasResult": ...


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    engine: None = ...,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
    cell_m: float | None = ...,
    until: str | float | None = ...,
    cells: str | None = ...,
) -> Any: ...  # depends on the site


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    engine: str | Engine = ...,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
) -> BlastResult: ...


def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    engine: str | Engine | None = None,
    charge: AnyCharge | None = None,
    progress: Callable[[float], None] | None = None,
    cell_m: float | None = None,
    until: str | float | None = None,
    cells: str | None = None,
) -> BlastOutcome:
    """Run a blast to its end.

    The result is a pure function of the arguments, to the last bit and in any process.

    Args:
        scenario: The scenario, or its bundled name or path; see `load_scenario`.
        layout: (row, column) of the build-zone cells that hold a barrier module.
        seed: Draws the charge, where the scenario leaves it open, the fan and the air.
        engine: Name of an engine, or an engine: the particle engines `"pymunk"` and `"event"`, or
            gas dynamics, `"gas"`, for which the seed only draws the charge. The default depends
            on the site; see `default_engine`.
        charge: The charge, instead of one drawn from the scenario.
        progress: Called periodically with the elapsed share of the time limit.
        cell_m: Side of the cells of gas dynamics, 0.5 m unless given.
        until: Loads that a blast of gas dynamics waits for: protected `"structures"` (the
            default), all `"walls"` or the `"gauges"`; or its duration in seconds.
        cells: Growth of the cells of gas dynamics with the blast: `"uniform"` (the default, no
            growth), `"coarse"` or `"fine"`; for large sites, see `GasSettings`.

    Returns:
        A `BlastResult` of the particle engines, a `GasResult` of gas dynamics.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        UnknownNameError: If there is no such engine.
        ScenarioError: If the charge is not clear of a structure or the border.
        BlastEnvError: If `cell_m` does not divide the side of a module, or a setting is given for
            an engine that does not have it.
        BlastEnvError: If the seed is no integer, negative or too large.
    """
    # Values that are not iterable are refused by the reader of the layout.
    elements = tuple(layout) if isinstance(layout, Iterable) else layout
    site = find_scenario(scenario)
    found = find_engine(default_engine(site) if engine is None else engine, cell_m, until, cells)
    return found.blast(site, elements, seed, charge).run(progress)


def simulate_many(
    blasts: Sequence[Blast],
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> list[BlastResult]:
    """Run blasts to their ends, several at a time in threads of this process.

    The results are those of `Blast.run`, to the last bit, in the order of the blasts. Threads
    shorten the work of compiled engines only: the preparation of a blast and its result are Python
    code, which one thread at a time executes. Progress is called in the caller's thread.

    Raises:
        BlastEnvError: If `threads` is not a whole number of at least 1, or if a blast cannot run;
            the message names the first such blast.
    """
    check_workers("threads", threads)
    results: list[BlastResult] = []
    # Not joblib's threads: of several errors those raise the one that came first in time.
    with ThreadPoolExecutor(threads) as pool:
        for result in pool.map(_run_numbered, count(), blasts):
            results.append(result)
            if progress is not None:
                progress(len(results) / len(blasts))
    return results


def _run_numbered(number: int, blast: Blast) -> BlastResult:
    """Run a blast; errors in its arguments name its number."""
    try:
        return blast.run()
    except ValueError as error:  # from unusable arguments; includes `BlastEnvError`
        raise BlastEnvError(f"blasts[{number}]: {error}") from error
