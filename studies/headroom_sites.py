"""Which generated sites leave an agent room above the rules: the seeds of `headroom_sites`.

    python -m studies.headroom_sites --first 0 --sites 40
    python -m studies.headroom_sites --first 10000 --sites 40

The first line is for held-out seeds, the second for those of training. Guesses find sites where a
search is ahead of all rules; a few blasts confirm it.
"""

from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer
from blast_agents.packaged import packaged_agent

from blast_env.answers.terminal import print_line
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import Guesses
from blast_env.evaluation import BlastEvaluator, LoadCaseSet, draw_threats
from blast_env.runner import run_all
from blast_env.sites import ITEM_SITES
from blast_env.surrogate import packaged_surrogate
from studies.site_names import scenario_of
from studies.surrogate import reductions_of

LEAST_LEAD: Final = 0.03
"""Least share of the load by which a layout is ahead of the rules, by guesses and by gas.

It is found by guesses alone: a search with blasts finds more."""

DRAWS: Final = 64
"""Draws of the packaged agent that the search begins with."""

_RULES: Final = 4
"""Rules that get a blast, those with the best guesses."""

_FOUND: Final = 3
"""Layouts of the search that get one."""

_EVERY: Final = 10
"""Neighbours in the ranking of a search are much alike: it takes one in so many."""


def lead_of(name: str, changes: int, cache: Path | None) -> float:
    """Return by how much layouts found by guesses are ahead of the rules on a site, as a share.

    By gas dynamics on cells of 0.5 m, against the first charge of training, which judges nothing;
    0 where the guesses promise less than `LEAST_LEAD`, and no blast is spent.

    Args:
        name: Name of the site, as in `studies.site_names`.
        changes: Changed layouts of the search by guesses.
        cache: Folder of stored blasts.
    """
    scenario = scenario_of(name)
    (threat,) = draw_threats(scenario, [0])
    case = LoadCaseSet(scenario, (threat,), charge=threat.charge)
    guesses = Guesses.of(packaged_surrogate(), case)
    ruled = layouts_by_rule(scenario, threat.charge).values()
    rules = list(dict.fromkeys(tuple(sorted(layout)) for layout in ruled))
    ranked = packaged_agent().ranked(scenario, threat.charge, DRAWS, changes=changes)
    found = [layout for layout in ranked if layout not in rules][: _EVERY * _FOUND : _EVERY]
    rules = sorted(rules, key=lambda layout: guesses.loads([layout]).item())[:_RULES]
    unprotected, best, *of_rules = guesses.loads([(), found[0], *rules]).tolist()
    if min([unprotected, *of_rules]) - best < LEAST_LEAD * unprotected:
        return 0.0
    evaluator = BlastEvaluator(scenario, "gas", cache=cache)
    shares = reductions_of(evaluator, case, [*found, *rules])
    return max(shares[: len(found)]) - max([0.0, *shares[len(found) :]])


def main(
    kind: Annotated[str, typer.Option(help="Kind of the sites that are looked at.")] = ITEM_SITES,
    first: Annotated[int, typer.Option(min=0, help="Seed of the first one.")] = 0,
    sites: Annotated[int, typer.Option(min=1, help="How many of them.")] = 40,
    changes: Annotated[int, typer.Option(min=1, help="Changes that a search looks at.")] = 240,
    cache: Annotated[Path, typer.Option(help="Folder in which blasts are kept.")] = Path(
        "out/headroom/blasts"
    ),
    processes: Annotated[int, typer.Option(min=1)] = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Print the seeds of sites with room above the rules, and how many were looked at."""
    with user_errors(), running_on(cluster):
        run = partial(lead_of, changes=changes, cache=cache)
        seeds = range(first, first + sites)
        with progress_bar(kind) as progress:
            leads = run_all(run, [f"{kind}/{seed}" for seed in seeds], processes, progress)
        kept = [seed for seed, lead in zip(seeds, leads, strict=True) if lead >= LEAST_LEAD]
        print_line(f"{len(kept)} of {sites} {kind}: {', '.join(map(str, kept))}")
        promised = sum(lead != 0.0 for lead in leads)
        print_line(f"guesses promised {promised}; blasts confirmed {len(kept)}")


if __name__ == "__main__":
    typer.run(main)
