"""Reference layouts for the score of each problem: the rules', and the best one known."""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from blast_env.benchmark import Definition, Submission, make
from blast_env.benchmark.data import PublishedBlasts
from blast_env.benchmark.methods import find_method
from blast_env.evaluation import DiskCache
from blast_env.geometry import Layout
from blast_env.layout import Placement, load_layout
from blast_env.site import Charge, VehicleCharge

DATA = Path("docs/data")


def published_layouts(definition: Definition, published: PublishedBlasts) -> Iterator[Layout]:
    """Yield the published layouts with a blast for every charge of a problem.

    Problems with vehicle charges, which are not fixed, have none.
    """
    charges = [threat.charge for threat in definition.case.threats]
    if any(isinstance(charge, VehicleCharge) for charge in charges):
        return
    met: dict[str, set[tuple[float, float, float, float]]] = defaultdict(set)
    for _, scenario_hash, layout, charge in published.rows:
        if scenario_hash == definition.scenario.content_hash:
            met[layout].add(charge)
    wanted = {(*c.position_m, c.height_m, c.tnt_kg) for c in charges if isinstance(c, Charge)}
    catalogue = Placement.empty(definition.scenario).catalogue
    for layout, own in met.items():
        if wanted <= own and layout != "[]":
            yield tuple(catalogue.element_from(tuple(e), "layout") for e in json.loads(layout))


def known_layouts(definition: Definition, published: PublishedBlasts) -> dict[str, Layout]:
    """Return candidates for the best known layout of a problem, by their origin."""
    scenario = definition.scenario
    found: dict[str, Layout] = {}
    for number, layout in enumerate(published_layouts(definition, published)):
        found[f"published blasts {number}"] = layout
    path = DATA / "best_found" / f"{definition.site}.json"
    if definition.family != "told" and path.exists():
        found["study of the scenarios"] = load_layout(path, scenario)
    if scenario.zone.items:
        for name in ("package", "surrogate"):
            found[name] = find_method(name)(make(definition, 0), 0)
    return {name: tuple(sorted(layout)) for name, layout in found.items()}


def submitted_layouts(submissions: Iterable[Submission]) -> dict[str, dict[str, Layout]]:
    """Return the layouts of submissions, by problem and by their origin."""
    found: dict[str, dict[str, Layout]] = defaultdict(dict)
    for each in submissions:
        for run in each.runs:
            method = f"{each.method}, {run.budget:,} blasts, seed {run.seed}"
            found[run.problem][method] = run.layout
    return found


def published_before(folder: Path, definitions: Mapping[str, Definition]) -> PublishedBlasts:
    """Return the published blasts of these problems, with a folder for all others."""
    scenarios = {each.scenario.content_hash: each.scenario for each in definitions.values()}
    return PublishedBlasts(scenarios, DiskCache(folder))
