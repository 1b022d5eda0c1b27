"""Functions that evaluate layouts: `evaluate_layout`, and comparisons on many cases."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.blasts import NO_BARRIER
from blast_env.evaluation.campaign import Campaign, blasts_of
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, judged_threats
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.engines.contract import final_engine
from blast_env.evaluation.evaluator import BlastEvaluator, BlastStore, Evaluators
from blast_env.evaluation.questions.reduction import Evaluation
from blast_env.geometry import Element
from blast_env.layout import check_layout
from blast_env.site import AnyScenario, find_scenario
from blast_env.statistics import CVAR_LEVEL, check_cvar_level

_LAYOUT: Final = "layout"


def evaluate_layout(
    scenario: AnyScenario,
    layout: Sequence[Element],
    seeds: Iterable[int] = range(16),
    processes: int = 1,
    engine: str | Engine = JUDGE,
    *,
    threats: Iterable[LoadCase] | None = None,
    cvar_level: float = CVAR_LEVEL,
    cache: str | Path | BlastStore | None = None,
    progress: Callable[[float], None] | None = None,
    cell_m: float | None = None,
    cells: str | None = None,
) -> Evaluation:
    """Estimate the load reduction of a layout on the protected structures, with its uncertainty.

    Every seed draws a threat from the scenario; fixed charges come in turn, each once before any
    repeats, which are dropped by gas dynamics (`judged_threats`). The layout and the empty site are
    under the same threats. Use seeds other than those of the layout's search, on which it is
    overrated.

    Args:
        scenario: The scenario, or its bundled name or path; for the particle engines it must name
            a calibration.
        layout: (row, column) of the build-zone cells that hold a barrier module, in any order.
        seeds: At least one, without repetition; 16 or more for a useful interval.
        processes: Number of worker processes; it changes only the time.
        engine: Name of an engine, or an engine, which keeps its cells; gas dynamics by default.
            There, a seed only draws the charge, a charge has one realisation, and no calibration
            is needed. The worst threat runs on cells twice as large as well, for their error.
        threats: Used instead of threats drawn with `seeds`.
        cvar_level: The CVaR is the mean of the worst share 1 - `cvar_level` of the threats.
        cache: Folder or store of earlier blasts; see `BlastEvaluator`.
        progress: Called with the finished share of the blasts.
        cell_m: Side of the cells of gas dynamics, 0.25 m unless given.
        cells: Growth of these cells with the blast; see `GasSettings`. On sites wider than 40 m
            they grow from 0.25 m unless one of the two is given.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        CalibrationError: If the scenario names no calibration, or one that was made with other
            parameters or another engine.
        UnknownNameError: If there is no such engine.
        ScenarioError: If a threat's charge is not clear of a structure or the border.
        BlastEnvError: If there are no seeds or threats, one is repeated or a seed is negative, if
            `processes` or `cvar_level` is out of bounds, or if no load reaches the protected
            structures even without a barrier.
    """
    found = find_scenario(scenario)
    judge = final_engine(engine, [found], cell_m, cells=cells)
    evaluator = BlastEvaluator(found, judge, cache=cache)
    drawn = (
        judged_threats(found, seeds, has_noise=judge.has_noise)
        if threats is None
        else tuple(threats)
    )
    return compare(
        evaluator,
        [LoadCaseSet(found, drawn)],
        [sorted(check_layout(found, layout))],
        processes,
        with_error=True,
        cvar_level=cvar_level,
        progress=progress,
    )


def compare(
    evaluators: Evaluators | BlastEvaluator,
    cases: Sequence[LoadCaseSet],
    layouts: Sequence[Sequence[Element]],
    processes: int = 1,
    *,
    with_error: bool = False,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Compare layouts with no barrier, each on the threats of its case.

    Args:
        evaluators: Run and cache the blasts; a single one is for cases on its scenario.
        cases: At least one, all with the same number of threats.
        layouts: One per case: (row, column) of the cells that hold a module, in any order. For
            several layouts on the same threats, the empty site is simulated only once.
        processes: Number of worker processes; it changes only the time.
        with_error: Whether the worst threat runs on coarser cells too, for the grid error.
        cvar_level: The CVaR is the mean of the worst share 1 - `cvar_level`.
        progress: Called with the finished share of the blasts.

    Raises:
        BlastEnvError: Same as for `evaluate_layout`, and if there are no cases.
    """
    check_cvar_level(cvar_level)
    if not cases:
        raise BlastEnvError("cases: there are none, must be at least one")
    campaigns = [
        Campaign(
            case,
            {NO_BARRIER: (), _LAYOUT: tuple(check_layout(case.scenario, layout))},
            evaluators.of(case.scenario),
            processes=processes,
        )
        for case, layout in zip(cases, layouts, strict=True)
    ]
    found = blasts_of(campaigns, progress)
    coarser = evaluators.coarser() if with_error else None
    if coarser is not None:
        loads = [blast.loads(blast.judged).max() for blast in found]
        number = int(np.argmax(loads))
        campaign = replace(campaigns[number], coarser=coarser.of(cases[number].scenario))
        found[number] = campaign.with_coarse(found[number], found[number].worst())
    return Evaluation(tuple(found), cvar_level)
