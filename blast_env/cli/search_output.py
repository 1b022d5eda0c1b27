"""What `blast-env search` prints and writes."""

import platform
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from blast_env.atomic import write_atomically
from blast_env.cli.output import make_table, print_line, result_console
from blast_env.evaluation import LayoutEvaluation
from blast_env.scenario import write_layout

if TYPE_CHECKING:
    from agents.search import SearchResult
    from agents.search.unprotected import Unprotected

ThreatName = Literal["visible", "hidden"]


@dataclass(frozen=True)
class SearchOptions:
    """What the command was called with; see `search`."""

    method: str
    scenario: str
    budget: int
    seed: int
    threat: ThreatName
    threats: int | None
    realisations: int | None
    charge_position_m: tuple[float, float] | None
    risk: str
    cvar_level: float
    engine: str
    start_from: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SearchRun:
    """A search that has ended.

    Attributes:
        result: What it found.
        unprotected: The impulse without a barrier under its threats.
        seconds: How long it took.
        cache_hits: Loads that it asked for and that were known already.
    """

    result: "SearchResult"
    unprotected: "Unprotected"
    seconds: float
    cache_hits: int


def print_search(run: SearchRun, options: SearchOptions, checked: LayoutEvaluation) -> None:
    """Print what the layout does against the search's threats and against others, and the cost."""
    result, problem = run.result, run.unprotected.problem
    table = make_table(
        f"{problem.scenario.name}: {result.method} search, {_risk_text(options)}",
        ("threats", "number", "without (Pa s)", "with (Pa s)", "reduction", "95 % interval"),
    )
    bare_pa_s, impulse_pa_s = run.unprotected.impulse_pa_s, problem.impulse_pa_s(result.layout)
    table.add_row(
        "of the search",
        str(len(problem.threats)),
        f"{bare_pa_s:,.0f}",
        f"{impulse_pa_s:,.0f}",
        percent(1.0 - impulse_pa_s / bare_pa_s),
        "-",
    )
    low, high = checked.ci95
    table.add_row(
        "held out, mean",
        str(len(checked.threats)),
        f"{checked.unprotected_impulse_pa_s.value:,.0f}",
        f"{checked.impulse_pa_s.value:,.0f}",
        percent(checked.mean_reduction),
        "-" if np.isnan(low) else f"{percent(low)} to {percent(high)}",
    )
    result_console().print(table)
    print_line(
        f"{len(result.layout)} of {problem.stock} modules; {result.blasts} of {result.budget} "
        f"blasts spent, {run.cache_hits} of the loads asked for known already; "
        f"{run.seconds:.1f} s"
    )


def write_search(
    run: SearchRun, options: SearchOptions, checked: LayoutEvaluation, out: Path
) -> None:
    """Write the layout, the history, the front and a figure, as far as there are such."""
    result = run.result
    scenario = run.unprotected.problem.scenario
    provenance = _provenance(run, options, checked)
    written = [write_layout(out / "layout.json", scenario, result.layout, provenance)]
    if result.history:
        from agents.search.figure import search_figure
        from blast_env.rendering.figures import save_figure

        written.append(_write_table(result.history_table(), out / "history.csv"))
        written.append(save_figure(search_figure(result, run.unprotected), out / "search.png"))
    if result.front:
        written.append(_write_table(result.front_table(), out / "front.csv"))
    for path in written:
        print_line(f"wrote {path}")


def _provenance(
    run: SearchRun, options: SearchOptions, checked: LayoutEvaluation
) -> dict[str, Any]:
    """Return what repeats the search, and what came out."""
    result, problem = run.result, run.unprotected.problem
    low, high = (None if np.isnan(end) else float(end) for end in checked.ci95)
    return {
        "command": ["blast-env", *sys.argv[1:]],
        "options": asdict(options),
        "threats": [
            {"charge_position_m": t.charge.position_m, "tnt_kg": t.charge.tnt_kg, "seed": t.seed}
            for t in problem.threats
        ],
        "versions": {
            "blast_env": version("blast-env"),
            "engine": problem.evaluator.engine.version,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "result": {
            "blasts": result.blasts,
            "interrupted": result.interrupted,
            "impulse_pa_s": result.impulse_pa_s,
            "threats_met": result.threats,
            "held_out_threats": len(checked.threats),
            "held_out_reduction": checked.mean_reduction,
            "held_out_reduction_ci95": [low, high],
        },
    }


def _write_table(table: pd.DataFrame, path: Path) -> Path:
    with write_atomically(path) as temporary:
        table.to_csv(temporary, index=False)
    return path


def _risk_text(options: SearchOptions) -> str:
    """Return what the impulses under the search's threats are."""
    if options.risk == "mean":
        return "mean impulse on the protected structures"
    share = f"{100.0 * (1.0 - options.cvar_level):.3g} %"
    return f"impulse on the protected structures, mean of the worst {share}"


def percent(share: float) -> str:
    """Return a share for people."""
    return f"{100.0 * share:.1f} %"
