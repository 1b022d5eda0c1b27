"""A layout against no barrier, on the same threats."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cache import BlastCache
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.layout_evaluation import LayoutEvaluation
from blast_env.evaluation.statistics import check_cvar_level
from blast_env.evaluation.threats import Threat, draw_threats
from blast_env.physics.engine import Engine
from blast_env.scenario import Cell, Scenario, check_layout

CVAR_LEVEL: Final = 0.8
"""The mean of the worst 20 % of the threats."""


def evaluate_layout(
    scenario: Scenario,
    layout: Sequence[Cell],
    seeds: Iterable[int] = range(16),
    processes: int = 1,
    engine: str | Engine = "event",
    *,
    threats: Iterable[Threat] | None = None,
    cvar_level: float = CVAR_LEVEL,
    cache: str | Path | BlastCache | None = None,
    progress: Callable[[float], None] | None = None,
) -> LayoutEvaluation:
    """Return how much a layout takes off the protected structures, and how sure that is.

    Every seed draws a threat from the scenario; the layout and the empty site meet the same
    threats. Use seeds that the layout was not chosen on: on the others it looks better than it is.

    Args:
        scenario: The scenario; it must name a calibration.
        layout: (row, column) of the build-zone cells that hold a barrier module, in any order.
        seeds: At least one, none twice; 16 or more for an interval worth having.
        processes: Worker processes; they change nothing but the time.
        engine: Name of an engine, or an engine.
        threats: Used instead of threats drawn with `seeds`.
        cvar_level: The worst share 1 - `cvar_level` of the threats makes the CVaR.
        cache: Folder or cache of blasts that were run before; see `BlastEvaluator`.
        progress: Called with the share of the blasts that is done.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        CalibrationError: If the scenario names no calibration, or one that was made with other
            parameters or another engine.
        UnknownNameError: If there is no such engine.
        ScenarioError: If a threat's charge is not clear of a structure or the border.
        BlastEnvError: If there are no seeds or threats, one is repeated or a seed is negative, if
            `processes` or `cvar_level` is out of bounds, or if nothing arrives at the protected
            structures even without a barrier.
    """
    evaluator = BlastEvaluator(scenario, engine, cache=cache)
    drawn = draw_threats(scenario, seeds) if threats is None else tuple(threats)
    return evaluate_against(
        evaluator, layout, drawn, processes, cvar_level=cvar_level, progress=progress
    )


def evaluate_against(
    evaluator: BlastEvaluator,
    layout: Sequence[Cell],
    threats: Sequence[Threat],
    processes: int = 1,
    *,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] | None = None,
) -> LayoutEvaluation:
    """Return what `evaluate_layout` returns, with blasts that an evaluator may remember.

    For several layouts on the same threats: the empty site is simulated only once.

    Args:
        evaluator: Runs the blasts.
        layout: As for `evaluate_layout`.
        threats: At least one, none twice.
        processes: As for `evaluate_layout`.
        cvar_level: As for `evaluate_layout`.
        progress: As for `evaluate_layout`.

    Raises:
        BlastEnvError: As for `evaluate_layout`.
    """
    check_cvar_level(cvar_level)
    _check_threats(threats)
    cells = tuple(sorted(check_layout(evaluator.scenario, layout)))
    pairs = [(each, threat) for threat in threats for each in (cells, ())]
    loads = evaluator.loads_of_many(pairs, processes, progress)
    evaluation = LayoutEvaluation(
        scenario=evaluator.scenario,
        layout=cells,
        threats=tuple(threats),
        loads=tuple(loads[0::2]),
        unprotected=tuple(loads[1::2]),
        calibration=evaluator.calibration,
        engine_name=evaluator.engine.name,
        engine_version=evaluator.engine.version,
        cvar_level=cvar_level,
    )
    if not evaluation.unprotected_impulse_psi_s.value > 0.0:
        raise BlastEnvError(
            f"{evaluator.scenario.name}: nothing arrives at the protected structures without a "
            f"barrier ({len(threats)} threats): there is nothing to reduce"
        )
    return evaluation


def _check_threats(threats: Sequence[Threat]) -> None:
    """Refuse no threats, and the same one twice: it would count as evidence twice."""
    if not threats:
        raise BlastEnvError("threats: there are none, must be at least one")
    for index, threat in enumerate(threats):
        if threat in threats[:index]:
            raise BlastEnvError(
                f"threats[{index}] is {threat}, is there already: must be none twice"
            )
