"""The packaged agent: what it imitates, its training, and its judgement by gas dynamics.

    python -m studies.packaged_agent show --out out/packaged/shown.jsonl
    python -m studies.packaged_agent train out/packaged/shown.jsonl
    python -m studies.packaged_agent train --visits 1500
    python -m studies.packaged_agent judge --kind item_sites --kind kerb_sites --sites 20

The first line searches by guesses on generated sites of the seeds of training. The second has a
policy imitate the layouts, and then learn from its own draws. The third goes on so from the
package's weights. The last one compares proposals and rules on held-out sites.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean, median
from time import process_time
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
import torch
import typer
from blast_agents.packaged import (
    DRAWS,
    CandidateNetwork,
    PackagedAgent,
    Weights,
    load_packaged,
    packaged_agent,
    write_weights,
)

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import Guesses, case_for, improved
from blast_env.design.search.package import PackageProposer
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCaseSet, SeedRange
from blast_env.evaluation.cases import judged_threats
from blast_env.files import make_folder
from blast_env.runner import run_all
from blast_env.statistics import mean_estimate, reductions
from blast_env.surrogate import Surrogate, packaged_surrogate
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S
from studies.packaged_training import VISITS, Examples, charge_of, fitted, reinforced
from studies.site_names import scenario_of
from studies.surrogate import promise, reductions_of

SHOWN_KINDS: Final = {
    "item_sites": (4, 10_079),
    "kerb_sites": (3, 10_400),
    "close_sites/16": (1, 10_000),
    "front_sites/18": (1, 10_075),
    "close_sites/20": (1, 10_000),
    "front_sites/16": (1, 10_107),
    "street_sites": (1, 10_000),
    "court_sites": (1, 10_000),
    "square_sites": (1, 10_000),
    "sites": (1, 10_000),
}
"""Sites of each kind in a round of the training, and the seed of the first one.

Many of them are sites of the surrogate's fit, where its guesses are best.
"""

FIRST_JUDGED: Final = 8_000
"""First of the held-out seeds that judge the agent and nothing else."""

CHECKED_ROUND: Final = 1_000
"""Round of the first case that checks a training."""

WIDTH: Final = 32
"""Width of the hidden layers."""

_HIDDEN_EVERY: Final = 5
"""One of so many cases has a hidden charge."""

_BEST: Final = 8
"""Layouts kept of each search."""

_FEW: Final = 8
"""Draws of which the best is compared with the best of all."""

SHOWN_DRAWS: Final = 16
"""Draws of the agent that a search begins with."""

_PART: Final = 28
"""Cases that are written at once."""

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


def shown_cases(count: int, first: int = 0) -> list[tuple[str, bool]]:
    """Return the name of the site of each case, and whether its charge is known.

    Args:
        count: Number of cases.
        first: Number of rounds that are left out.
    """
    cases: list[tuple[str, bool]] = []
    number = first
    while len(cases) < count:
        for kind, (own, begin) in SHOWN_KINDS.items():
            names = [f"{kind}/{begin + number * own + k}" for k in range(own)]
            cases += [(name, (len(cases) + k) % _HIDDEN_EVERY > 0) for k, name in enumerate(names)]
        number += 1
    return cases[:count]


def best_by_guesses(
    surrogate: Surrogate, changes: int, agent: PackagedAgent | None, case: tuple[str, bool]
) -> dict[str, Any]:
    """Return the best layouts of a search by guesses alone, and by how much they lower the load.

    Args:
        surrogate: The surrogate.
        changes: Number of changed layouts.
        agent: An agent whose draws it begins with, and which changes layouts, too. Without one it
            begins with the rules' layouts alone.
        case: Name of the site, as in `studies.site_names`, and whether its charge is known: the
            first one of training.
    """
    name, known = case
    scenario = scenario_of(name)
    charge = charge_of(scenario, known)
    guesses, rules = (
        Guesses.of(surrogate, case_for(scenario, charge)),
        layouts_by_rule(scenario, charge),
    )
    seed = int(name.rpartition("/")[-1])
    if agent is None:
        rng = np.random.default_rng([seed, int(known)])
        best = improved(guesses, [(), *rules.values()], changes, rng)[:_BEST]
    else:
        best = agent.searched(guesses, charge, rules, SHOWN_DRAWS, changes, seed)[:_BEST]
    unprotected, *loads = guesses.loads([(), *best]).tolist()
    shares = reductions(np.array(loads), np.full(len(loads), unprotected))
    ruled = guesses.loads([tuple(sorted(rule)) for rule in rules.values()])
    rule = float(reductions(ruled, np.full(len(ruled), unprotected)).max(initial=0.0))
    return {
        "site": name,
        "known": known,
        "rule": round(rule, 5),
        "layouts": [[list(element) for element in layout] for layout in best],
        "shares": [round(float(share), 5) for share in shares],
    }


@app.command()
def show(
    out: Annotated[Path, typer.Option(help="File of the layouts; it goes on with it.")] = Path(
        "out/packaged/shown.jsonl"
    ),
    count: Annotated[int, typer.Option(min=1, help="Number of cases.")] = 840,
    changes: Annotated[int, typer.Option(min=0, help="Changed layouts of a search.")] = 200,
    agent: Annotated[Path | None, typer.Option(help="Weights in place of the package's.")] = None,
    from_rules: Annotated[
        bool, typer.Option("--from-rules", help="Search without an agent, by moves alone.")
    ] = False,
    processes: Annotated[int, typer.Option(min=1)] = 1,
) -> None:
    """Search by guesses on the sites of training; keep the best layouts of each case."""
    with user_errors(), progress_bar("searches") as progress:
        make_folder(out.parent)
        done = {(case["site"], case["known"]) for case in read_shown(out)}
        cases = [case for case in shown_cases(count) if case not in done]
        found = None if from_rules else packaged_agent() if agent is None else load_packaged(agent)
        search = partial(best_by_guesses, packaged_surrogate(), changes, found)
        # Parts in their order: an interruption loses one, and the file is the same for any number.
        for start in range(0, len(cases), _PART):
            part = cases[start : start + _PART]
            lines = [json.dumps(case) + "\n" for case in run_all(search, part, processes)]
            with out.open("a", encoding="utf-8") as file:
                file.write("".join(lines))
            progress((start + len(part)) / len(cases))


def read_shown(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the cases of a file of shown layouts; none if there is no file."""
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            yield json.loads(line)


@app.command()
def train(
    shown: Annotated[
        list[Path] | None, typer.Argument(help="Files of `show`, which it imitates first.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The weights.")] = Path(
        "out/packaged/packaged_agent.safetensors"
    ),
    weights: Annotated[
        Path | None, typer.Option(help="Weights in place of the package's, to begin with.")
    ] = None,
    width: Annotated[int, typer.Option(min=1, help="Width of the hidden layers.")] = WIDTH,
    visits: Annotated[
        int, typer.Option(min=0, help="Cases on which it learns from its own draws.")
    ] = VISITS,
    first: Annotated[int, typer.Option(min=0, help="Round of the first of these cases.")] = 0,
    checked: Annotated[int, typer.Option(min=1, help="Further cases, that only check it.")] = 56,
    seeds: Annotated[int, typer.Option(min=1, help="Trainings; the best policy is kept.")] = 1,
    processes: Annotated[int, typer.Option(min=1)] = 1,
) -> None:
    """Fit the policy to the layouts of `show`, or begin with the package's; learn from own draws.

    It prints what the policy has by guesses on further cases.
    """
    with user_errors():
        examples = [case for path in shown or () for case in read_shown(path)]
        begin_with: list[Mapping[str, Any]] | Weights = [
            case for case in examples if case["shares"][0] > 0.0
        ]
        if not begin_with:
            agent = packaged_agent() if weights is None else load_packaged(weights)
            begin_with = agent.network.weights
        one = partial(
            _trained, begin_with, shown_cases(checked, CHECKED_ROUND), width, visits, first
        )
        with progress_bar("trainings") as progress:
            found = run_all(one, range(seeds), processes, progress)
        print_line(_guessed_table([part for parts in found for part in parts]))
        best = max((parts[-1] for parts in found), key=lambda part: part.few)
        about = {"surrogate": packaged_surrogate().digest, "seed": str(best.seed)}
        write_weights(best.weights, about, out)
        print_line(f"\nwrote {out}, of the seed {best.seed}")


class Trained(NamedTuple):
    """A part of a training, and the mean shares of the load by guesses on cases that check it.

    Attributes:
        seed: Its seed.
        after: What it has learnt from so far.
        weights: The weights.
        cases: Number of the cases.
        one: Share of the policy's layout.
        mean: Mean share of draws.
        few: Best share of the policy's layout and a few draws.
        best: Best share of it and many draws.
        rule: Share of the best rule.
    """

    seed: int
    after: str
    weights: Weights
    cases: int
    one: float
    mean: float
    few: float
    best: float
    rule: float


def _trained(
    begin_with: Sequence[Mapping[str, Any]] | Weights,
    checked: Sequence[tuple[str, bool]],
    width: int,
    visits: int,
    first: int,
    seed: int,
) -> list[Trained]:
    """Return the parts of a training: by imitation or from weights, then by own draws."""
    torch.set_num_threads(1)  # more threads block each other, for minutes on busy cores
    after, weights = "nothing new", begin_with
    if not isinstance(weights, Mapping):
        after, weights = "imitation", fitted(Examples.of(weights, seed), width, seed)
    found = [_part(seed, after, weights, checked)]
    if visits:
        cases = shown_cases(visits, first)
        weights = reinforced(weights, cases, packaged_surrogate(), seed)
        found.append(_part(seed, f"draws on {visits} cases", weights, checked))
    return found


def _part(seed: int, after: str, weights: Weights, checked: Sequence[tuple[str, bool]]) -> Trained:
    agent = PackagedAgent(CandidateNetwork(weights))
    shares = np.mean([_guessed(agent, *case) for case in checked], axis=0).tolist()
    return Trained(seed, after, weights, len(checked), *shares)


def _guessed(agent: PackagedAgent, name: str, known: bool) -> tuple[float, ...]:
    """Return shares of the load by guesses: policy, mean draw, the best of few and all, rule."""
    scenario = scenario_of(name)
    charge = charge_of(scenario, known)
    guesses = Guesses.of(packaged_surrogate(), case_for(scenario, charge))
    layouts = agent.likeliest(scenario, charge), *agent.sample(scenario, charge, DRAWS)
    one, *drawn = guesses.loads([tuple(sorted(layout)) for layout in layouts]).tolist()
    rules = layouts_by_rule(scenario, charge).values()
    unprotected, *ruled = guesses.loads([(), *rules]).tolist()
    best = min(one, *drawn[:_FEW]), min(one, *drawn), min(unprotected, *ruled)
    loads = np.array([one, np.mean(drawn), *best])
    return tuple(reductions(loads, np.full(len(loads), unprotected)).tolist())


def _guessed_table(parts: Sequence[Trained]) -> str:
    best = (f"best of it and {_FEW}", f"best of it and {DRAWS}", "best rule")
    headers = ("seed", "after", "cases", "the policy", "mean draw", *best)
    rows = [
        (
            *(str(part.seed), part.after, str(part.cases)),
            *(f"{100.0 * value:.1f} %" for value in part[4:]),
        )
        for part in parts
    ]
    return markdown_table(headers, rows)


@dataclass(frozen=True)
class Judged:
    """Shares of the load that layouts take off in one case, by gas dynamics.

    Attributes:
        site: Name of the site.
        policy: Share of the policy's layout.
        one: Share of the best guess among it and the rules' layouts.
        ranked: Share of the best guess among these, the policy's draws and changes.
        package: Share of the package's proposal.
        rule: Share of the best rule, which takes blasts of all rules to know.
        one_promised: What the surrogate guesses for `one`.
        promised: What it guesses for `ranked`.
        one_ms: CPU time of `one`.
        ranked_ms: CPU time of `ranked`.
    """

    site: str
    policy: float
    one: float
    ranked: float
    package: float
    rule: float
    one_promised: float
    promised: float
    one_ms: float
    ranked_ms: float


def judged(agent: PackagedAgent, cache: Path | None, charges: int, name: str) -> list[Judged]:
    """Judge proposals against the first held-out charges on a site, on cells of 0.5 m."""
    scenario, found = scenario_of(name), []
    evaluator = BlastEvaluator(scenario, "gas", cache=cache)
    seeds = SeedRange.TEST.seeds(0, charges)
    for threat in judged_threats(scenario, seeds, has_noise=False):
        charge = threat.charge
        problem = DesignProblem(evaluator, LoadCaseSet(scenario, (threat,), charge=charge))
        agent.propose(scenario, charge)  # what a first call loads and compiles is not counted
        agent.ranked(scenario, charge, 1)
        begun_s = process_time()
        one = agent.propose(scenario, charge)
        one_ms = MS_PER_S * (process_time() - begun_s)
        begun_s = process_time()
        ranked = agent.ranked(scenario, charge)[0]
        ranked_ms = MS_PER_S * (process_time() - begun_s)
        package = PackageProposer().propose(problem).layout
        rules = [*layouts_by_rule(scenario, charge).values()]
        likeliest = agent.likeliest(scenario, charge)
        tried = (one, ranked, likeliest, package, *rules)
        layouts = [tuple(sorted(layout)) for layout in tried]
        shares = reductions_of(evaluator, problem.case, layouts)
        one_promised, promised = (
            promise(packaged_surrogate(), own, problem.case) for own in layouts[:2]
        )
        found.append(
            Judged(
                site=name,
                one=shares[0],
                ranked=shares[1],
                policy=shares[2],
                package=shares[3],
                rule=max(shares[4:], default=0.0),
                one_promised=one_promised,
                promised=promised,
                one_ms=one_ms,
                ranked_ms=ranked_ms,
            )
        )
    return found


@app.command()
def judge(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Bundled names or paths.")] = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="Kinds of held-out generated sites.")
    ] = None,
    sites: Annotated[int, typer.Option(min=2, help="How many of each kind.")] = 20,
    first: Annotated[int, typer.Option(min=0, help="Seed of the first one.")] = FIRST_JUDGED,
    charges: Annotated[int, typer.Option(min=1, help="Held-out charges of a scenario.")] = 3,
    weights: Annotated[Path | None, typer.Option(help="Weights in place of the package's.")] = None,
    by_site: Annotated[bool, typer.Option("--by-site", help="Print each case, too.")] = False,
    cache: Annotated[Path, typer.Option(help="Folder in which blasts are kept.")] = Path(
        "out/packaged/blasts"
    ),
    processes: Annotated[int, typer.Option(min=1)] = 1,
) -> None:
    """Compare the agent, by gas dynamics, with the package's proposal and the best rule of each."""
    with user_errors():
        agent = packaged_agent() if weights is None else load_packaged(weights)
        places = {name: ([name], charges) for name in scenarios or ()}
        for family in kind or ():
            names = [f"{family}/{seed}" for seed in range(first, first + sites)]
            places[family.replace("_", " ")] = (names, 1)
        every: list[Judged] = []
        rows = []
        for title, (names, count) in places.items():
            run = partial(judged, agent, cache, count)
            with progress_bar(title) as progress:
                found = [own for part in run_all(run, names, processes, progress) for own in part]
            rows.append(_judged_row(title, found))
            every += found
    headers = ("on", "cases", "policy alone", "one proposal", "draws and changes", "package")
    leads = ("best rule of each", "one beside it, points (95 %)", "draws beside it")
    print_line(markdown_table((*headers, *leads, "one, draws promised", "CPU ms"), rows))
    if by_site:
        print_line("\n" + _by_site(every))


def _judged_row(title: str, found: Sequence[Judged]) -> tuple[str, ...]:
    def share(name: str) -> float:
        return 100.0 * fmean(getattr(own, name) for own in found)

    def lead(name: str, over: str) -> str:
        points = np.array([100.0 * (getattr(own, name) - getattr(own, over)) for own in found])
        mean, low, high = mean_estimate(points)
        return f"{mean:+.1f} ({low:.1f} to {high:.1f})" if len(found) > 1 else f"{mean:+.1f}"

    return (
        title,
        str(len(found)),
        *(f"{share(name):.1f} %" for name in ("policy", "one", "ranked", "package", "rule")),
        *(lead(name, "rule") for name in ("one", "ranked")),
        f"{share('one_promised'):.1f}, {share('promised'):.1f} %",
        f"{median(own.one_ms for own in found):.0f}, {median(own.ranked_ms for own in found):.0f}",
    )


def _by_site(found: Sequence[Judged]) -> str:
    names = ("policy", "one", "one_promised", "ranked", "promised", "package", "rule")
    rows = [(own.site, *(f"{100.0 * getattr(own, name):.1f}" for name in names)) for own in found]
    return markdown_table(("site", *(name.replace("_", " ") for name in names)), rows)


if __name__ == "__main__":
    app()
