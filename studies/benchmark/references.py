"""Reference layouts for the score of each problem: the rules', and the best one known."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from blast_env.benchmark import Definition, Submission, make
from blast_env.benchmark.data import remember_published
from blast_env.benchmark.methods import find_method
from blast_env.evaluation import BlastStore
from blast_env.geometry import Layout
from blast_env.layout import load_layout
from blast_env.site import Charge, VehicleCharge

DATA = Path("docs/data")
_MOST = 50_000  # blasts in memory


def published_layouts(definition: Definition, published: BlastStore) -> Iterator[Layout]:
    """Yield the published layouts with a blast for every charge of a problem.

    Problems with vehicle charges, which are not fixed, have none.
    """
    charges = [threat.charge for threat in definition.case.threats]
    if any(isinstance(charge, VehicleCharge) for charge in charges):
        return
    blasted: dict[Layout, set[Charge]] = defaultdict(set)
    for key, _ in published.items():  # noqa: PERF102  # is no dictionary
        if key.scenario_hash == definition.scenario.content_hash:
            blasted[key.layout].add(key.charge)
    for layout, own in blasted.items():
        if layout and own.issuperset(charges):
            yield layout


def known_layouts(definition: Definition, published: BlastStore) -> dict[str, Layout]:
    """Return candidates for the best known layout of a problem, by their origin."""
    scenario = definition.scenario
    found: dict[str, Layout] = {}
    for number, layout in enumerate(published_layouts(definition, published)):
        found[f"published blasts {number}"] = layout
    path = DATA / "best_found" / f"{definition.site}.json"
    if definition.family != "known" and path.exists():
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


def published_blasts(definitions: Mapping[str, Definition]) -> BlastStore:
    """Return the published blasts of these problems."""
    store = BlastStore(size=_MOST)
    sites = {each.scenario.content_hash: each.scenario for each in definitions.values()}
    remember_published(store, sites.values())
    return store


def with_published(folder: Path, published: BlastStore) -> BlastStore:
    """Return the store of a folder, with the published blasts in its memory alone."""
    store = BlastStore(folder, _MOST)
    for key, loads in published.items():
        store.remember(key, loads)
    return store
