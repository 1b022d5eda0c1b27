"""How far the best layout of a search is ahead of the best rule of each site, by gas dynamics.

    python -m studies.headroom --kind item_sites --kind kerb_sites --sites 40 --blasts 50

Agents can lead the rules by no more than that. The seeds are held out: no training has them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import packaged_search
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCaseSet, SeedRange, draw_threats
from blast_env.evaluation.cases import in_turn
from blast_env.runner import run_all
from blast_env.sites import ITEM_SITES
from blast_env.statistics import mean_estimate, reductions
from blast_env.tables import markdown_table
from studies.site_names import scenario_of

FIRST_SEED: Final = 7_000
"""First of the held-out seeds that are for this study."""

_WORTH_IT: Final = 0.05
"""Share of the load: a site with less headroom leaves an agent little to win."""


@dataclass(frozen=True)
class Headroom:
    """Shares of the load that layouts take off on one site, against one known charge.

    Attributes:
        rule: Share of the best rule.
        search: Share of the layout that the search found.
    """

    rule: float
    search: float

    @property
    def lead(self) -> float:
        """Headroom that the search found; below 0 where it is behind a rule."""
        return self.search - self.rule


def headroom_of(name: str, blasts: int, cache: Path | None) -> Headroom:
    """Return the headroom of a site against its first held-out charge, on cells of 0.5 m.

    Args:
        name: Name of the site, as in `studies.site_names`.
        blasts: Blasts of the search; the rules have theirs beside.
        cache: Folder of stored blasts, from which an interrupted study goes on.
    """
    scenario = scenario_of(name)
    evaluator = BlastEvaluator(scenario, "gas", cache=cache)
    (threat,) = in_turn(scenario, draw_threats(scenario, SeedRange.TEST.seeds(0, 1)))
    problem = DesignProblem(evaluator, LoadCaseSet(scenario, (threat,), charge=threat.charge))
    rules = [(), *dict.fromkeys(layouts_by_rule(scenario, threat.charge).values())]
    unprotected, *ruled = (problem.load(layout) for layout in rules)
    found = problem.load(packaged_search().propose(problem, blasts).layout)
    loads = np.array([min(ruled, default=unprotected), found])
    rule, search = reductions(loads, np.full(2, unprotected)).tolist()
    return Headroom(rule, search)


def main(
    kind: Annotated[
        list[str] | None, typer.Option(help="item_sites, kerb_sites, close_sites/SIDE.")
    ] = None,
    sites: Annotated[int, typer.Option(min=2, help="Sites of each kind.")] = 40,
    blasts: Annotated[int, typer.Option(min=1, help="Blasts of the search on each.")] = 50,
    first: Annotated[int, typer.Option(min=0, help="Seed of the first site.")] = FIRST_SEED,
    cache: Annotated[Path, typer.Option(help="Folder in which blasts are kept.")] = Path(
        "out/headroom/blasts"
    ),
    processes: Annotated[int, typer.Option(min=1)] = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Print the lead of a search `surrogate` over the best rule of each site.

    Stored blasts do not run again: after an interruption the same line goes on.
    """
    rows = []
    with user_errors(), running_on(cluster):
        run = partial(headroom_of, blasts=blasts, cache=cache)
        for family in kind or [ITEM_SITES]:
            names = [f"{family}/{seed}" for seed in range(first, first + sites)]
            with progress_bar(family) as progress:
                rows.append(_row(family, run_all(run, names, processes, progress)))
    print_line(
        markdown_table(
            (
                *("sites", "number", "best rule of each", f"search, {blasts} blasts"),
                *("points ahead, mean (95 %)", "median", "sites above 5 points"),
            ),
            rows,
        )
    )


def _row(family: str, found: Sequence[Headroom]) -> tuple[str, ...]:
    leads = np.array([own.lead for own in found])
    mean, low, high = mean_estimate(leads).scaled(100.0)
    return (
        family.replace("_", " ").replace("/", ", side in m "),
        str(len(found)),
        f"{100.0 * np.mean([own.rule for own in found]):.1f} %",
        f"{100.0 * np.mean([own.search for own in found]):.1f} %",
        f"{mean:+.1f} ({low:.1f} to {high:.1f})",
        f"{100.0 * np.median(leads):+.1f}",
        f"{100.0 * np.mean(leads > _WORTH_IT):.0f} %",
    )


if __name__ == "__main__":
    typer.run(main)
