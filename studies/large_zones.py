"""Cost of placing on large build zones, without blasts: masks, rules, lines of sight, proposals.

python -m studies.large_zones
"""

from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from time import process_time
from typing import Annotated, Final

import typer

from blast_env.bundled import REAL_SIZE
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.design.proposal import propose
from blast_env.design.search import layouts_by_rule
from blast_env.evaluation.speed import own_memory_mb, street
from blast_env.layout import Placement
from blast_env.site import Scenario, load_scenario
from blast_env.sites import Visibility, visibility_layout
from blast_env.tables import markdown_table

STREET: Final = "street_100_m"
"""The street of `blast-env bench --site large` with a catalogue, on a zone of 112 x 43 cells."""

_SMALL: Final = "visitor_entrance"
"""Site of the first call of each function, to exclude the time of imports and compilation."""

_CATALOGUE: Final = (
    ("bollard", 30),
    ("concrete_road_barrier", 20),
    ("planter", 20),
    ("t_wall_3_6", 12),
)


@dataclass(frozen=True)
class ZoneCost:
    """Processor seconds and memory of placing on a site.

    Attributes:
        actions: Number of actions: places times ways to place an item, plus the end.
        mask_s: Time of the mask of the empty site.
        rules_s: Time of the layouts of all rules.
        sight_s: Time of the layout that cuts most lines of sight.
        proposal_s: Time of a proposal, as by `blast-env propose`.
        memory_mb: Peak memory of the process.
    """

    actions: int
    mask_s: float
    rules_s: float
    sight_s: float
    proposal_s: float
    memory_mb: float


def site_of(name: str) -> Scenario:
    """Return a site by name: the street, a bundled site, or a scenario file."""
    if name != STREET:
        return load_scenario(name)
    document = street(100.0).model_dump(mode="json", exclude_none=True)
    zone = document["build_zone"]
    del zone["height_m"], zone["stock"], zone["module_cost"]
    items = [{"from_catalogue": item, "stock": stock} for item, stock in _CATALOGUE]
    document["build_zone"] = zone | {"rows": 43, "items": items, "budget": 120.0}
    return Scenario.from_document(document, name)


def zone_cost(name: str) -> ZoneCost:
    """Measure the cost of placing on a site, in this process."""
    calls: tuple[Callable[[Scenario], object], ...] = (
        lambda site: Placement.empty(site).legal.ravel(),
        layouts_by_rule,
        lambda site: visibility_layout(site, Visibility.of(site)),
        propose,
    )
    small, site = load_scenario(_SMALL), site_of(name)
    seconds = []
    for call in calls:
        call(small)
        began_s = process_time()
        call(site)
        seconds.append(process_time() - began_s)
    actions = Placement.empty(site).legal.size + 1
    mask_s, rules_s, sight_s, proposal_s = seconds
    return ZoneCost(actions, mask_s, rules_s, sight_s, proposal_s, own_memory_mb())


def main(
    sites: Annotated[
        list[str] | None, typer.Argument(help="The street and bundled sites unless given.")
    ] = None,
) -> None:
    """Print the cost of placing on large sites, each in a separate process."""
    headers = ("site", "actions", "mask (s)", "rules (s)", "sight lines (s)", "propose (s)", "MB")
    every = sites or [STREET, *sorted(REAL_SIZE)]
    rows = []
    with user_errors(), progress_bar("sites") as progress:
        for number, name in enumerate(every, start=1):
            with get_context("spawn").Pool(1) as pool:
                cost = pool.apply(zone_cost, (name,))
            times_s = (cost.mask_s, cost.rules_s, cost.sight_s, cost.proposal_s)
            words = [f"{each:.2f}" for each in times_s]
            rows.append((f"`{name}`", f"{cost.actions:,}", *words, f"{cost.memory_mb:.0f}"))
            progress(number / len(every))
        print_line(markdown_table(headers, rows))


if __name__ == "__main__":
    typer.run(main)
