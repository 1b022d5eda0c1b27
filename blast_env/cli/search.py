"""`blast-env search`: the layout with the least load, for a budget of blasts, or for none."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import numpy as np
import typer

from blast_env.answers.document import percent
from blast_env.answers.search import SearchRun, judged_answer, proposal_words, search_answer
from blast_env.answers.terminal import print_line, print_parts
from blast_env.cli.agents import AGENT, SURROGATE, Digests, agent_without_blasts, surrogate_search
from blast_env.cli.command import writes
from blast_env.cli.options import (
    SCENARIO_HELP,
    CacheOption,
    CellOption,
    CellsOption,
    ChargeInput,
    ChargeOption,
    ClusterAddress,
    EngineChoice,
    ProcessesOption,
    TntOption,
    refuse_given,
    resume_words,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_NAME,
    LAYOUT_PICTURE,
    InterruptedCommandError,
    blasts_running,
    layout_picture,
    print_outcome,
    print_written,
    progress_bar,
    resumable,
    save_pictures,
)
from blast_env.design.by_atlas import word_on
from blast_env.design.proposal import problem_of, search_problem
from blast_env.design.search import (
    DesignProblem,
    Progress,
    Proposer,
    find_proposer,
    layouts_by_rule,
    proposers,
    widened,
)
from blast_env.design.search.by_rule import DEFAULT_BUDGET, ProposerKind
from blast_env.design.search.package import PackageProposer
from blast_env.design.search.registry import check_suits, proposer_row
from blast_env.envs.strategies import find_risk
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    Evaluation,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    SeedRange,
    compare,
    draw_threats,
)
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.cases import one_per_charge
from blast_env.evaluation.engines import JUDGE, final_engine, find_engine
from blast_env.files import make_folder
from blast_env.geometry import Layout
from blast_env.layout import load_layout, write_layout
from blast_env.provenance import command, versions
from blast_env.rules import expected_charge
from blast_env.runner import share_of
from blast_env.site import AnyCharge, Scenario, load_scenario
from blast_env.site.zone import source_bounds_m
from blast_env.statistics import CVAR_LEVEL
from blast_env.tables import number_or_none, write_csv
from blast_env.units import MS_PER_S

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ThreatName = Literal["visible", "hidden"]

PACKAGE: Final = PackageProposer().name
_WITHOUT_BLASTS: Final = (PACKAGE, AGENT)
_ROUGH_RESPONSE: Final = (
    "the response of facades comes in steps, which guesses hardly tell apart, and a rule may be far"
    " better: --verify the proposal"
)
_METHOD_HELP: Final = f"{', '.join((*proposers(), AGENT))}. package and agent run no blast."
_NOT_OF_THE_SEARCH: Final = ("processes", "cluster", "cache", "out", "held_out", "verify")
"""Options that do not affect the layout."""

_WITH_BLASTS: Final = (
    *("budget", "seed", "threat", "threats", "risk", "engine"),
    *("cell_m", "start_from", "surrogate", "held_out", "cluster", "width", "cache"),
)
"""Options of the searches by blasts alone."""

_OF_OTHER_THREAT: Final = MappingProxyType(
    {
        "hidden": (("charge", "tnt_kg"), "is for a visible threat: a hidden one is drawn"),
        "visible": (("threats",), "is for a hidden threat: a visible one is known"),
    }
)
"""Options that do not apply to a threat, and why."""

_BudgetOption = Annotated[
    int | None,
    typer.Option(help="Most blasts that may be spent.", show_default=f"{DEFAULT_BUDGET}", min=1),
]
_ThreatOption = Annotated[
    ThreatName,
    typer.Option(help="visible: one known charge; hidden: a layout for all possible charges."),
]
_RiskOption = Annotated[
    str | None,
    typer.Option(
        help="mean, cvar or worst, over the charges.", show_default="as in the scenario's objective"
    ),
]
_SurrogateOption = Annotated[
    Path | None,
    typer.Option(
        help="File of the surrogate for --method surrogate (studies.surrogate fit).",
        show_default="the package's",
    ),
]
_HeldOutOption = Annotated[
    int, typer.Option(help="Number of threats for the final check of the result.", min=1)
]
_VerifyOption = Annotated[
    bool,
    typer.Option(
        "--verify",
        help="With --method package or agent: compare the proposal by gas dynamics with no barrier "
        "and the rules.",
    ),
]
_WidthOption = Annotated[
    int | None,
    typer.Option(
        help="Blasts that run at the same time, for the walkers of population_annealing and the "
        "children of genetic and nsga2. The layout depends on it.",
        show_default="the threads of the cluster, else 1",
        min=1,
    ),
]


def search(
    context: typer.Context,
    method: str = typer.Option("genetic", help=_METHOD_HELP),
    scenario: str = typer.Option("courtyard", help=SCENARIO_HELP),
    budget: _BudgetOption = None,
    seed: int = typer.Option(0, help="Decides threats and search.", min=0),
    threat: _ThreatOption = "visible",
    threats: int = typer.Option(16, help="Charges of a hidden threat.", min=1),
    risk: _RiskOption = None,
    engine: EngineChoice = JUDGE,
    cell_m: CellOption = None,
    cells: CellsOption = None,
    start_from: list[Path] = typer.Option([], help="Initial layout file; may be given again."),
    surrogate: _SurrogateOption = None,
    held_out: _HeldOutOption = 32,
    verify: _VerifyOption = False,
    out: Path | None = writes("Folder for layout, its plan, history, front and figure"),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    processes: ProcessesOption = 1,
    cluster: ClusterAddress = None,
    width: _WidthOption = None,
    cache: CacheOption = None,
) -> None:
    """Search for the layout with the least load on the protected structures.

    Ctrl-C ends the search and keeps the best layout so far. The result is checked on threats
    outside the search; those blasts do not count.

    --method package proposes a layout in seconds without a blast, by the surrogate of gas dynamics;
    nothing is proposed if the expected reduction is below 3 %. --method agent does so by a policy
    that was trained on other sites. Without --charge, such a layout is for all possible places of
    the charge.
    """
    given = ChargeInput.of(charge, tnt_kg)
    _refuse_of_other_methods(context, method, threat, verify=verify)
    if method in _WITHOUT_BLASTS:
        site = load_scenario(scenario)
        proposed = _proposal_without_blasts(method, site, given, cells, processes, out)
        if verify:
            _verify(*proposed, cells)
        return
    with running_on(cluster) as threads_now, resumable(resume_words(cache)):
        site, used = load_scenario(scenario), find_engine(engine, cell_m, cells=cells)
        if out is not None:
            make_folder(out)
        proposer, digests = _method(method, site, start_from, surrogate)
        own_width = threads_now if width is None else width
        known = None if threat == "hidden" else _known_charge(site, given, seed)
        own_risk = find_risk(risk, CVAR_LEVEL)
        problem = search_problem(
            *(site, known, used, cache),
            threats=threats,
            seed=seed,
            risk=own_risk,
            processes=processes,
        )
        proposer = widened(proposer, own_width)
        run = _run(proposer, problem, DEFAULT_BUDGET if budget is None else budget, seed)
        checked = _check(run, held_out, is_hidden=threat == "hidden")
        print_parts(search_answer(run, checked))
        if out is not None:
            options = _options(context, run, digests) | {"width": own_width}
            _write_search(run, options, checked, out)
    if run.result.interrupted:
        raise InterruptedCommandError(
            "the best layout so far was kept",
            "" if out is None else f"--start-from {out / LAYOUT_NAME} begins with it",
            resume_words(cache),
        )


def _refuse_of_other_methods(
    context: typer.Context, method: str, threat: ThreatName, *, verify: bool
) -> None:
    """Refuse options that do not apply to the method, or to the threat of a search by blasts."""
    if method in _WITHOUT_BLASTS:
        refuse_given(context, _WITH_BLASTS, f"does not apply to --method {method}")
        return
    if verify:
        raise BlastEnvError(
            f"--verify is for --method {' or '.join(_WITHOUT_BLASTS)}, not {method}"
        )
    refuse_given(context, *_OF_OTHER_THREAT[threat])


def _known_charge(scenario: Scenario, given: ChargeInput, seed: int) -> AnyCharge:
    """Return the known charge, always drawn by the seed of the search."""
    return given.fixed(scenario, scenario.sample_charge(np.random.default_rng(seed)))


def _options(context: typer.Context, run: SearchRun, digests: Digests) -> dict[str, Any]:
    """Return the options that the layout follows from."""
    options = {
        name: [*map(str, parameter)] if name == "start_from" else parameter
        for name, parameter in context.params.items()
        if name not in _NOT_OF_THE_SEARCH
    }
    return options | {"budget": run.result.budget, SURROGATE: None, **digests}


def _method(
    name: str, scenario: Scenario, start_from: Sequence[Path], surrogate: Path | None
) -> tuple[Proposer, Digests]:
    """Return the method, and the digests of what it goes by."""
    if surrogate is not None and name != SURROGATE:
        raise BlastEnvError(f"--surrogate is for --method {SURROGATE}, not {name}")
    proposer_row(name)  # refuses an unknown one
    check_suits(name, scenario)
    initial = tuple(load_layout(path, scenario) for path in start_from)
    if name != SURROGATE or initial:
        return find_proposer(name, initial), {}
    # Here, because it takes half a second to import.
    from blast_env.surrogate import load_surrogate, packaged_surrogate

    return surrogate_search(
        packaged_surrogate() if surrogate is None else load_surrogate(surrogate)
    )


def _run(method: Proposer, problem: DesignProblem, budget: int, seed: int) -> SearchRun:
    scenario, evaluator = problem.scenario, problem.evaluator
    is_rule = proposer_row(method.name).kind is ProposerKind.RULE  # which spends no blast
    engine, turns = evaluator.engine, islice(cycle(problem.threats), 0 if is_rule else budget)
    costs = (engine.cost(scenario, turn.charge) for turn in turns)
    label = f"{method.name} search in {scenario.name}"
    with blasts_running(label, engine.describe([scenario]), costs) as progress:
        problem.unprotected  # noqa: B018  # refuses a case in which nothing arrives
        hits, begun_s = evaluator.counts.cache_hits, perf_counter()

        def report(state: Progress) -> None:
            best = "" if state.best is None else percent(state.best.reduction(problem))
            progress(state.share, f"{state.blasts} of {budget} blasts{best and f', best {best}'}")

        result = method.propose(problem, budget, seed, report)
    if result.interrupted and not result.history:
        raise KeyboardInterrupt  # there is no layout to keep
    return SearchRun(problem, result, perf_counter() - begun_s, evaluator.counts.cache_hits - hits)


def _check(run: SearchRun, held_out: int, *, is_hidden: bool) -> Evaluation | None:
    """Evaluate the layout on threats of judgement; `None` if the search used all of them.

    Without noise a charge is one blast: a charge used by the search is not held out.
    """
    problem, seeds = run.problem, SeedRange.TEST.seeds(0, held_out)
    if is_hidden:
        threats = draw_threats(problem.scenario, seeds)
    else:
        threats = tuple(LoadCase(problem.threats[0].charge, seed) for seed in seeds)
    if not problem.evaluator.engine.has_noise:  # each charge is one blast
        used = {threat.charge for threat in problem.threats}
        threats = tuple(
            load_case for load_case in one_per_charge(threats) if load_case.charge not in used
        )
    if not threats:
        return None
    # By the risk measure of the search. Those of a known charge are its realisations.
    realisations = 1 if is_hidden else len(threats)
    case = LoadCaseSet(problem.scenario, threats, realisations, problem.case.risk)
    with progress_bar(f"check on {len(threats)} other threats") as progress:
        return compare(
            problem.evaluator,
            [case],
            [run.result.layout],
            problem.processes,
            progress=progress,
        )


_FIGURE, _HISTORY, _FRONT = "search.png", "history.csv", "front.csv"
"""Files in the folder of `--out` that not every search has."""


def _write_search(
    run: SearchRun, options: Mapping[str, Any], checked: Evaluation | None, out: Path
) -> None:
    """Write the layout and its picture; the history, its figure and the front, if there are any."""
    result = run.result
    scenario = run.problem.scenario
    provenance = _provenance(run, options, checked)
    written = _write_layout(scenario, result.layout, provenance, out)
    if result.history:
        written += save_pictures((out / _FIGURE, partial(_figure, run)))
        written.append(write_csv(result.history_table(), out / _HISTORY))
    if result.front:
        written.append(write_csv(result.front_table(), out / _FRONT))
    print_written(written)
    _note_older(out, written)


def _note_older(out: Path, written: Collection[Path]) -> None:
    """Say which files in a folder of results are of an earlier search: they stay there."""
    for name in (_FIGURE, _HISTORY, _FRONT):
        if out / name not in written and (out / name).exists():
            print_line(f"note: {out / name} is of an earlier search")


def _write_layout(
    scenario: Scenario, layout: Layout, provenance: Mapping[str, Any], out: Path
) -> list[Path]:
    file = write_layout(out / LAYOUT_NAME, scenario, layout, provenance)
    picture = partial(layout_picture, scenario, layout)
    return [file, *save_pictures((out / LAYOUT_PICTURE, picture))]


def _figure(run: SearchRun) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.design.search.figure import search_figure

    return search_figure(run.result, run.problem)


def _provenance(
    run: SearchRun, options: Mapping[str, Any], checked: Evaluation | None
) -> dict[str, Any]:
    result, problem = run.result, run.problem
    ends = () if checked is None else checked.ci95
    return {
        "command": command(),
        "options": options,
        "threats": [
            {
                "charge_position_m": charge.position_m,
                "charge_height_m": charge.height_m,
                "tnt_kg": charge.tnt_kg,
                "seed": threat.seed,
            }
            for threat in problem.threats
            for charge in [threat.charge_against(problem.scenario, result.layout)]
        ],
        "versions": versions(problem.evaluator.engine.version),
        "result": {
            "blasts": result.blasts,
            "interrupted": result.interrupted,
            "load": result.load,
            "unit": problem.scenario.objective.unit,
            "threats_met": result.threats,
            "held_out_threats": 0 if checked is None else len(checked.threats),
            "held_out_reduction": None
            if checked is None
            else number_or_none(checked.mean_reduction),
            "held_out_reduction_ci95": [number_or_none(float(end)) for end in ends],
        },
    }


def _proposal_without_blasts(
    method: str,
    scenario: Scenario,
    given: ChargeInput,
    cells: str | None,
    processes: int,
    out: Path | None,
) -> tuple[DesignProblem, Layout]:
    """Propose a layout without a blast, print it, and write it; return it with its problem."""
    scenario.zone  # noqa: B018  # refuses a scenario without one
    engine = find_engine(JUDGE, cells=cells)
    problem = problem_of(scenario, _given_charge(scenario, given), processes, engine)
    proposer, digests = _without_blasts(method)
    began_s = perf_counter()
    with progress_bar(f"proposal for {scenario.name}") as progress:

        def report(state: Progress) -> None:
            progress(state.share)

        result = proposer.propose(problem, 0, report=report)
    ms = MS_PER_S * (perf_counter() - began_s)
    print_line(
        f"{scenario.name}: {proposal_words(scenario, result)}, by {result.by}, in {ms:,.0f} ms"
    )
    word = word_on(problem, result.layout)
    if word:
        print_line(f"note: {word}")
    if scenario.objective.is_response:
        print_line(f"note: {_ROUGH_RESPONSE}")
    if out is not None:
        make_folder(out)
        provenance = {**digests, "command": command(), "versions": versions()}
        print_written(_write_layout(scenario, result.layout, provenance, out))
        _note_older(out, ())
    return problem, result.layout


def _without_blasts(method: str) -> tuple[Proposer, Digests]:
    """Return a method that runs no blast, and the digests of what it goes by."""
    from blast_env.surrogate import packaged_surrogate  # takes half a second to import

    if method == PACKAGE:
        return PackageProposer(), {SURROGATE: packaged_surrogate().digest}
    return agent_without_blasts()


def _given_charge(scenario: Scenario, given: ChargeInput) -> AnyCharge | None:
    """Return the charge at the user's place; `None` without one."""
    if given.place_m is None:
        if given.mass_kg is not None:
            raise BlastEnvError("--tnt-kg is given without --charge, the place of the charge")
        return None
    charge = given.fixed(scenario, expected_charge(scenario.charge))
    bounds = [source_bounds_m(source) for source in scenario.charge]
    x_m, y_m = given.place_m
    if not any(
        bound.left <= x_m <= bound.right and bound.bottom <= y_m <= bound.top for bound in bounds
    ):
        print_line(
            f"note: {scenario.name} never has a charge at ({x_m:g}, {y_m:g}) m: --verify the "
            "proposal"
        )
    return charge


def _verify(problem: DesignProblem, layout: Layout, cells: str | None) -> None:
    """Print one row per layout by gas dynamics: no barrier, the rules by load, the proposal."""
    case, scenario = problem.case, problem.scenario
    engine = final_engine(JUDGE, [scenario], cells=cells)
    rules = layouts_by_rule(scenario, problem.known_charge)
    layouts: dict[str, Layout] = {"no barrier": (), "this proposal": layout, **rules}
    distinct = list(dict.fromkeys(layouts.values()))
    named = {str(number): layout for number, layout in enumerate(distinct)}
    costs = Campaign.on(scenario, named, case.threats, engine, engine.coarser).cost()
    label = f"{len(distinct) * len(case.threats)} blasts of gas dynamics"
    evaluators, found = Evaluators(engine), dict[Layout, Evaluation]()
    with blasts_running(label, engine.describe(), costs) as progress:
        for number, item in enumerate(distinct):
            share = share_of(progress, number, len(distinct))
            found[item] = compare(
                evaluators, [case], [item], problem.processes, with_error=True, progress=share
            )
    print_outcome(judged_answer(scenario, layouts, found))
