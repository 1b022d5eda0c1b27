"""`simulate` runs a blast; its result depends only on scenario, layout, seed, charge and engine."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from blast_env.evaluation.engines.contract import JUDGE, BlastOutcome, Engine, find_engine
from blast_env.evaluation.engines.particles import BlastResult, ParticleEngine
from blast_env.geometry import Element
from blast_env.layout import check_layout
from blast_env.site import AnyCharge, AnyScenario, find_scenario

if TYPE_CHECKING:  # Numba takes a third of a second to import
    from blast_env.evaluation.engines.gas import GasEngine, GasResult


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    *,
    engine: "Literal['gas'] | GasEngine" = ...,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
    **settings: Any,
) -> "GasResult": ...


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    *,
    engine: Literal["event", "pymunk"] | ParticleEngine,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
) -> BlastResult: ...


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    engine: str | Engine = ...,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
    **settings: Any,
) -> Any: ...  # depends on the engine of that name


def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    engine: str | Engine = JUDGE,
    charge: AnyCharge | None = None,
    progress: Callable[[float], None] | None = None,
    **settings: Any,
) -> BlastOutcome:
    """Run a blast to its end.

    The result is a pure function of the arguments, to the last bit and in any process.

    Args:
        scenario: The scenario, or its bundled name or path; see `load_scenario`.
        layout: (row, column) of the build-zone cells that hold a barrier module.
        seed: Draws the charge, where the scenario leaves it open, the fan and the air.
        engine: Name of an engine, or an engine: gas dynamics, `"gas"`, for which the seed only
            draws the charge, or the particle engines `"pymunk"` and `"event"`.
        charge: The charge, instead of one drawn from the scenario.
        progress: Called periodically with the elapsed share of the time limit.
        settings: Settings of the engine, those of gas dynamics: `cell_m`, the side of its cells,
            0.5 m unless given; `until`, the loads that a blast waits for, protected
            `"structures"` (the default), all `"walls"` or the `"gauges"`, or its duration in
            seconds; `cells`, their growth with the blast, `"uniform"` (the default, no growth),
            `"coarse"` or `"fine"`, for large sites; see `GasSettings`.

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
    site = find_scenario(scenario)
    # Values that are not iterable are refused by the reader of the layout.
    elements = tuple(layout) if isinstance(layout, Iterable) else layout
    if isinstance(layout, np.ndarray):
        elements = check_layout(site, layout)
    found = find_engine(engine, **settings)
    return found.blast(site, elements, seed, charge).run(progress)
