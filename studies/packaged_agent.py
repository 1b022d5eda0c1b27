"""The packaged agent: what it imitates, its training, and its judgement by gas dynamics.

    python -m studies.packaged_agent show --out out/packaged/shown.jsonl
    python -m studies.packaged_agent train out/packaged/shown.jsonl
    python -m studies.packaged_agent judge --kind item_sites --kind kerb_sites --sites 20

The first line searches by guesses on generated sites of the seeds of training; the second fits the
policy to the layouts that it found; the third compares proposals and rules on held-out sites.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean, median
from time import process_time
from typing import Annotated, Any, Final

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
from blast_agents.policies.candidates import CHANGING, STATIC, Candidates, Standing
from numpy.typing import NDArray
from torch import Tensor

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import Guesses, case_for, improved
from blast_env.design.search.package import PackageProposer
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCaseSet, SeedRange, draw_threats
from blast_env.evaluation.cases import in_turn
from blast_env.files import make_folder
from blast_env.geometry import Layout, Piece
from blast_env.layout import LayoutState
from blast_env.runner import run_all
from blast_env.site import AnyCharge, Scenario
from blast_env.statistics import mean_estimate, reductions
from blast_env.surrogate import Surrogate, packaged_surrogate
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S
from studies.site_names import scenario_of
from studies.surrogate import promise, reductions_of

SHOWN_KINDS: Final = {
    "item_sites": (3, 10_079),
    "kerb_sites": (3, 10_400),
    "close_sites/16": (1, 10_000),
    "front_sites/18": (1, 10_075),
    "close_sites/20": (1, 10_000),
    "front_sites/16": (1, 10_107),
    "sites": (1, 10_000),
}
"""Sites of each kind in a round of the training, and the seed of the first one.

Many of them are sites of the surrogate's fit, where its guesses are best.
"""

FIRST_JUDGED: Final = 8_000
"""First of the held-out seeds that judge the agent and nothing else."""

_HIDDEN_EVERY: Final = 3
"""One of so many cases has a hidden charge."""

_BEST: Final = 8
"""Layouts kept of each search."""

PARTS: Final = 20
"""Decisions of each case that the policy imitates."""

TEMPERATURE: Final = 0.01
"""Difference of two shares of the load by which a layout is 2.7 times likelier to be imitated."""

SEEN: Final = 256
"""Candidates of a decision that the training looks at: the wanted ones, and others at random."""

BATCH: Final = 64
RATE: Final = 3e-3

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


def shown_cases(rounds: int) -> list[tuple[str, bool]]:
    """Return the name of the site of each case, and whether its charge is known."""
    cases: list[tuple[str, bool]] = []
    for number in range(rounds):
        for kind, (count, first) in SHOWN_KINDS.items():
            names = [f"{kind}/{first + number * count + k}" for k in range(count)]
            cases += [(name, (len(cases) + k) % _HIDDEN_EVERY > 0) for k, name in enumerate(names)]
    return cases


def best_by_guesses(
    surrogate: Surrogate,
    name: str,
    known: bool,
    changes: int,
    agent_layouts: tuple[Layout, ...] = (),
) -> dict[str, Any]:
    """Return the best layouts of a search by guesses alone, and by how much they lower the load.

    Args:
        surrogate: The surrogate.
        name: Name of the site, as in `studies.site_names`.
        known: Whether the charge is known: the first one of training.
        changes: Number of changed layouts.
        agent_layouts: Layouts that the search begins with, besides those of the rules.
    """
    scenario = scenario_of(name)
    charge = draw_threats(scenario, [0])[0].charge if known else None
    guesses = Guesses.of(surrogate, case_for(scenario, charge))
    rules = layouts_by_rule(scenario, charge)
    begin_with = [(), *rules.values(), *agent_layouts]
    seed = int(name.rpartition("/")[-1])
    found = improved(guesses, begin_with, changes, np.random.default_rng([seed, int(known)]))
    best = found[:_BEST]
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
    rounds: Annotated[int, typer.Option(min=1, help="Rounds of eleven sites.")] = 40,
    changes: Annotated[int, typer.Option(min=0, help="Changed layouts of a search.")] = 300,
) -> None:
    """Search by guesses on the sites of training; keep the best layouts of each case."""
    with user_errors(), progress_bar("searches") as progress:
        make_folder(out.parent)
        done = {(case["site"], case["known"]) for case in read_shown(out)}
        cases, surrogate = shown_cases(rounds), packaged_surrogate()
        for number, (name, known) in enumerate(cases, start=1):
            if (name, known) not in done:
                line = json.dumps(best_by_guesses(surrogate, name, known, changes))
                with out.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
            progress(number / len(cases))


def read_shown(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the cases of a file of shown layouts; none if there is no file."""
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            yield json.loads(line)


@dataclass(frozen=True, eq=False)
class Examples:
    """Decisions to imitate: candidates after a random part of a good layout.

    Attributes:
        inputs: Features of candidates, static ones first (examples, seen, features).
        wanted: Share of the target on each, and on finishing (examples, seen + 1).
        log_weight: Logarithm of the number of candidates that each stands for; -inf for none
            (examples, seen).
        whole: Features of site and layout (examples, features).
    """

    inputs: NDArray[np.float16]
    wanted: NDArray[np.float32]
    log_weight: NDArray[np.float32]
    whole: NDArray[np.float32]

    @classmethod
    def of(cls, cases: Sequence[Mapping[str, Any]], seed: int, parts: int = PARTS) -> "Examples":
        """Return the decisions on the way to the layouts of some cases.

        A layout has no order: after any part of it, all remaining pieces are equally good next
        ones, as in `blast_agents.training.imitation`. Only posts against vehicles come first.

        Args:
            cases: The cases, as `best_by_guesses` has them.
            seed: Seed of the draws.
            parts: Decisions of each case.
        """
        rng = np.random.default_rng(seed)
        found: list[tuple[NDArray[Any], ...]] = []
        for case in cases:
            found += _decisions(case, rng, parts)
        return cls(*(np.stack(part) for part in zip(*found, strict=True)))


def layouts_of(case: Mapping[str, Any]) -> list[Layout]:
    """Return the layouts of a case, the best first."""
    return [
        tuple(Piece(*element) if len(element) == 4 else (element[0], element[1]) for element in own)
        for own in case["layouts"]
    ]


def _charge_of(scenario: Scenario, case: Mapping[str, Any]) -> AnyCharge | None:
    return draw_threats(scenario, [0])[0].charge if case["known"] else None


def _decisions(
    case: Mapping[str, Any], rng: np.random.Generator, parts: int
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield the arrays of an example for random parts of a case's layouts."""
    scenario = scenario_of(case["site"])
    candidates = Candidates.of(scenario, _charge_of(scenario, case))
    catalogue = candidates.empty.catalogue
    index_of = {number: index for index, number in enumerate(candidates.numbers.tolist())}
    numbers = [[*map(catalogue.action, catalogue.layout_from(own))] for own in layouts_of(case)]
    are_legal = np.array([all(number in index_of for number in own) for own in numbers])
    if not are_legal.all():
        print_line(f"{case['site']}: {sum(~are_legal)} of {len(numbers)} layouts are not legal")
        return
    layouts = [[index_of[number] for number in own] for own in numbers]
    likely = np.exp((np.array(case["shares"]) - max(case["shares"])) / TEMPERATURE)
    likely /= likely.sum()
    is_post = candidates.is_post
    for _ in range(parts):
        layout = layouts[int(rng.choice(len(layouts), p=likely))]
        # Posts come first: where a wall has taken their share of the budget, a way stays open.
        order = sorted(rng.permutation(layout).tolist(), key=lambda own: not is_post[own])
        count = int(rng.integers(len(layout) + 1))
        state, rest = Standing(candidates), order[count:]
        first = [own for own in rest if is_post[own]] or rest
        wanted = np.array(first, dtype=np.int64)
        for index in order[:count]:
            state.add(index)
        standing = [catalogue.element(int(candidates.numbers[index])) for index in order[:count]]
        placement = LayoutState(scenario, tuple(standing))
        if placement.is_full:
            continue
        is_legal = placement.legal.ravel()[candidates.numbers]
        legal = np.flatnonzero(is_legal)
        changing = state.features(legal)
        whole = state.whole(legal, changing, placement.stock_left)
        others = np.setdiff1d(legal, wanted)
        shown = min(len(others), SEEN - len(wanted))
        drawn = rng.choice(others, shown, replace=False)
        chosen = np.concatenate((wanted, drawn)).astype(np.int64)
        inputs = np.zeros((SEEN, len(STATIC) + len(CHANGING)), dtype=np.float16)
        inputs[: len(chosen), : len(STATIC)] = candidates.static[chosen]
        inputs[: len(chosen), len(STATIC) :] = changing[np.searchsorted(legal, chosen)]
        targets = np.zeros(SEEN + 1, dtype=np.float32)
        targets[: len(wanted)] = 1.0 / max(len(wanted), 1)
        targets[SEEN] = len(wanted) == 0
        log_weight = np.full(SEEN, -np.inf, dtype=np.float32)
        log_weight[: len(wanted)] = 0.0
        log_weight[len(wanted) : len(chosen)] = np.log(len(others) / max(shown, 1))
        yield inputs, targets, log_weight, whole


def fitted(examples: Examples, width: int, epochs: int, seed: int) -> Weights:
    """Return the weights that imitate examples: the cross-entropy to the wanted candidates."""
    torch.manual_seed(seed)
    weights = {
        name: torch.randn(shape) * (1.0 / np.sqrt(shape[0]) if len(shape) > 1 else 0.1)
        if not name.endswith("bias")
        else torch.zeros(shape)
        for name, shape in CandidateNetwork.shapes(width).items()
    }
    for values in weights.values():
        values.requires_grad_()
    count = len(examples.whole)
    updates = epochs * (count // BATCH)
    optimiser = torch.optim.Adam(weights.values(), lr=RATE)
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, updates)
    inputs, wanted, log_weight, whole = (
        torch.as_tensor(part)
        for part in (examples.inputs, examples.wanted, examples.log_weight, examples.whole)
    )
    drawn = torch.Generator().manual_seed(seed)
    for _ in range(epochs):
        order = torch.randperm(count, generator=drawn)
        for start in range(0, count // BATCH * BATCH, BATCH):
            own = order[start : start + BATCH]
            logits = _logits(weights, inputs[own].float(), log_weight[own], whole[own])
            likely = logits.log_softmax(dim=1).clamp(min=-50.0)
            loss = -(likely * wanted[own]).sum(dim=1).mean()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            rate.step()
    return {name: values.detach().numpy() for name, values in weights.items()}


def _logits(
    weights: Mapping[str, Tensor], inputs: Tensor, log_weight: Tensor, whole: Tensor
) -> Tensor:
    """Return the scores of `CandidateNetwork`, with the candidates that each stands for."""
    joined = torch.cat((weights["static"], weights["changing"]))
    first = inputs @ joined + (whole @ weights["whole"] + weights["first_bias"])[:, None]
    second = torch.relu(torch.relu(first) @ weights["second"] + weights["second_bias"])
    hidden = torch.relu(whole @ weights["finish_first"] + weights["finish_first_bias"])
    finish = hidden @ weights["finish"] + weights["finish_bias"]
    return torch.cat((second @ weights["score"] + log_weight, finish[:, None]), dim=1)


@app.command()
def train(
    shown: Annotated[list[Path], typer.Argument(help="Files of `show`.")],
    out: Annotated[Path, typer.Option(help="The weights.")] = Path(
        "out/packaged/packaged_agent.safetensors"
    ),
    width: Annotated[int, typer.Option(min=1, help="Width of the hidden layers.")] = 64,
    epochs: Annotated[int, typer.Option(min=1)] = 15,
    held_out: Annotated[int, typer.Option(min=1, help="Last cases, that only check it.")] = 24,
    seed: int = 0,
) -> None:
    """Fit the policy to the layouts of `show`; print what it has by guesses on further cases."""
    torch.set_num_threads(1)  # more threads block each other, for minutes on busy cores
    with user_errors():
        cases = [case for path in shown for case in read_shown(path) if case["shares"][0] > 0.0]
        sites = list(dict.fromkeys(case["site"] for case in cases))[-held_out:]
        learnt = [case for case in cases if case["site"] not in sites]
        if not learnt:
            raise BlastEnvError(f"there are {len(cases)} cases, must be more than {held_out}")
        weights = fitted(Examples.of(learnt, seed), width, epochs, seed)
        about = {"cases": str(len(learnt)), "surrogate": packaged_surrogate().digest}
        write_weights(weights, about, out)
        agent = load_packaged(out)
        rows = [_guessed(agent, case) for case in cases if case["site"] in sites]
        print_line(_guessed_table(rows))
        print_line(f"\n{len(learnt)} cases; wrote {out}")


def _guessed(agent: PackagedAgent, case: Mapping[str, Any]) -> tuple[float, ...]:
    """Return shares of the load by guesses: policy, mean and best draw, best rule, search."""
    scenario = scenario_of(case["site"])
    charge = _charge_of(scenario, case)
    guesses = Guesses.of(packaged_surrogate(), case_for(scenario, charge))
    drawn = agent.sample(scenario, charge, DRAWS)
    likeliest = agent.likeliest(scenario, charge)
    asked = [tuple(sorted(layout)) for layout in ((), likeliest, *drawn)]
    unprotected, one, *rest = guesses.loads(asked).tolist()
    shares = reductions(np.array([one, np.mean(rest), min(one, *rest)]), np.full(3, unprotected))
    return (*shares.tolist(), case["rule"], case["shares"][0])


def _guessed_table(rows: Sequence[tuple[float, ...]]) -> str:
    mean = 100.0 * np.mean(np.array(rows), axis=0)
    headers = ("cases", "the policy", "mean draw", f"best of it and {DRAWS}", "best rule", "search")
    return markdown_table(headers, [(str(len(rows)), *(f"{value:.1f} %" for value in mean))])


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
    for threat in in_turn(scenario, draw_threats(scenario, SeedRange.TEST.seeds(0, charges))):
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
