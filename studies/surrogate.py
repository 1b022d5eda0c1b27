"""The surrogate of gas dynamics: training blasts, the fit, and a check for exploitation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import join
from statistics import fmean, median
from time import perf_counter
from typing import Annotated, Final, NamedTuple

import numpy as np
import pandas as pd
import torch
import typer
from blast_agents import packaged_agent

from blast_env.answers.terminal import print_line
from blast_env.arrays import BoolArray, FloatArray
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import Guesses, SurrogateSearch, improved
from blast_env.design.search.moves import Moves, random_walls
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet, SeedRange, draw_threats
from blast_env.evaluation.cases import in_turn
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import make_folder
from blast_env.geometry import Layout
from blast_env.parquet import read_frame
from blast_env.provenance import command, versions
from blast_env.rules import random_layout
from blast_env.runner import run_all
from blast_env.site import Scenario, load_scenario
from blast_env.sites import ITEM_SITES
from blast_env.statistics import mean_estimate, reductions
from blast_env.surrogate.ensemble import Surrogate
from blast_env.surrogate.fit_record import Check, Fit
from blast_env.surrogate.fitting import fit
from blast_env.surrogate.holdout import (
    Errors,
    Predictions,
    errors_of,
    folds,
    load_errors,
    predictions,
)
from blast_env.surrogate.intervals import (
    COVERAGE,
    IMPULSE_LEAST_SPREAD,
    PEAK_LEAST_SPREAD,
    covered,
    interval_factor,
    least_sites,
    widened,
)
from blast_env.surrogate.network import Networks
from blast_env.surrogate.points import CLOSE, WIDE, Spacing
from blast_env.surrogate.samples import Loads, Samples
from blast_env.surrogate.surrogate_file import load_surrogate, save_surrogate
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S
from studies.blast_table import COLUMNS
from studies.site_blasts import SiteBlasts, kept_rows
from studies.site_names import held_out_names, scenario_of, site_names

_TABLES: Final = "front close many kerb street liked module further later strong"
DATA: Final = tuple(Path(f"docs/data/{name}_site_blasts.parquet") for name in _TABLES.split())
"""Data of the packaged surrogate: blasts on generated sites."""

EVERY: Final = 8
"""One of so many sites is held out of the fits."""

_HALVES: Final = 2
"""Parts of the held-out sites: the factor of each is set on the other."""

_APART: Final = 10
"""Between the ranks of two favourites."""

Processes = Annotated[int, typer.Option(min=1)]
app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def blasts(
    sites: Annotated[int, typer.Option(min=1, help="Generated sites, of training's seeds.")] = 100,
    first: Annotated[int, typer.Option(min=0, help="How many of them are left out.")] = 0,
    kind: Annotated[
        str,
        typer.Option(
            help="sites, item_sites, kerb_sites, street_sites, court_sites, square_sites, "
            "low_sites, lane_sites, or with their side in m: close_sites/18, large_sites/60, "
            "front_sites/18 (only walls count that the blast comes from)."
        ),
    ] = ITEM_SITES,
    layouts: Annotated[int, typer.Option(min=0, help="Random ones, and changes of rules'.")] = 12,
    rules: Annotated[int, typer.Option(min=0, help="Most layouts by rules, drawn.")] = 20,
    surrogate: Annotated[Path | None, typer.Option(help="Whose favourites are tried.")] = None,
    favourites: Annotated[int, typer.Option(min=1, help="How many of those.")] = 3,
    changes: Annotated[int, typer.Option(min=1, help="Layouts that it looks at for them.")] = 300,
    draws: Annotated[int, typer.Option(min=0, help="Draws of the packaged agent.")] = 0,
    least: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help="Share that the first favourite takes off, else no blasts."
        ),
    ] = 0.0,
    threats: Annotated[int, typer.Option(min=1, help="Charges on each.")] = 1,
    cells: Annotated[str | None, typer.Option(help="uniform, coarse or fine.")] = None,
    cache: Annotated[Path, typer.Option(help="Folder in which they are kept.")] = Path(
        "out/surrogate/blasts"
    ),
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Run blasts on generated sites for the layouts of a recipe: rules, random, changed rules.

    Each site gets a table in the folder; blasts that it has are not repeated. `studies.blast_table`
    joins the tables.
    """
    with user_errors(), running_on(cluster):
        if least and surrogate is None:
            raise BlastEnvError(f"--least {least:g}: needs --surrogate, whose favourites it is of")
        make_folder(cache)
        liked = None if surrogate is None else load_surrogate(surrogate)
        recipe = Recipe(layouts, rules, liked, favourites, changes, draws, least)
        names = site_names([kind], first, sites)
        engine = GasEngine() if cells is None else GasEngine(cells=cells)
        run = partial(site_blasts, recipe=recipe, threats=threats, engine=engine, folder=cache)
        with progress_bar("sites") as progress:
            run_all(run, names, processes, progress)


@dataclass(frozen=True)
class Recipe:
    """The layouts to simulate for a charge on a generated site, besides the empty one.

    Attributes:
        layouts: Number of random layouts, random walls and changed rule layouts, in rotation.
        rules: Maximum number of rule layouts, drawn at random.
        surrogate: Surrogate whose best layouts are included; `None` for none.
        favourites: Number of these: every tenth layout of a search by the surrogate's predictions,
            from the best on, because neighbours in that ranking are much alike.
        changes: Layouts that this search evaluates, besides those of the rules.
        draws: Number of draws of the packaged agent.
        least: Least share of the load that the first of the surrogate's favourites takes off, by
            its prediction: a charge with a smaller one has no layouts. Most layouts of most sites
            take off little, and a fit learns little of those that take off much.
    """

    layouts: int = 12
    rules: int = 20
    surrogate: Surrogate | None = None
    favourites: int = 3
    changes: int = 300
    draws: int = 0
    least: float = 0.0

    def of(self, site: Scenario, threat: LoadCase, seed: int) -> list[Layout]:
        """Return the layouts for a threat, sorted and distinct, the empty one first.

        There are none if its favourites take off less than `least`.
        """
        rng, moves = np.random.default_rng(seed), Moves(site)
        ruled = list(dict.fromkeys(layouts_by_rule(site).values()))
        found: list[Layout] = [(), *ruled]
        if self.rules < len(ruled):
            found = [(), *(ruled[index] for index in rng.permutation(len(ruled))[: self.rules])]
        for number in range(self.layouts):
            if number % 4 == 0 or not ruled:
                found.append(random_layout(site, rng))
            elif number % 4 == 1:
                found.append(random_walls(site, rng))
            else:
                layout = ruled[int(rng.integers(len(ruled)))]
                for _ in range(int(rng.integers(1, 5))):
                    layout = moves.neighbour(layout, rng)
                found.append(layout)
        if self.surrogate is not None:
            guesses = Guesses.of(self.surrogate, LoadCaseSet(site, (threat,), charge=threat.charge))
            liked = improved(guesses, [(), *ruled], self.changes, rng)
            unprotected, first = guesses.loads([(), liked[0]])
            if first > (1.0 - self.least) * unprotected:
                return []
            found += liked[: _APART * self.favourites : _APART]
        if self.draws:
            found += packaged_agent().sample(site, threat.charge, self.draws, seed)
        return list(dict.fromkeys(tuple(sorted(layout)) for layout in found))


def site_blasts(name: str, recipe: Recipe, threats: int, engine: GasEngine, folder: Path) -> int:
    """Run the blasts of one site, but for those in the folder; return their number."""
    site, seed = scenario_of(name), int(name.rpartition("/")[-1])
    blasts = tuple(
        (layout, threat)
        for threat in draw_threats(site, range(threats))
        for layout in recipe.of(site, threat, seed)
    )
    if blasts:
        kept_rows(SiteBlasts(name, blasts), engine, folder)
    return len(blasts)


@app.command("fit")
def fit_it(
    data: Annotated[list[Path] | None, typer.Option(help="Tables of blasts.")] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="Scenarios of the tables that are left out.")
    ] = None,
    epochs: Annotated[int, typer.Option(min=1, help="Passes over all blasts.")] = 24,
    every: Annotated[int, typer.Option(min=2, help="One of so many sites is held out.")] = EVERY,
    seed: int = 0,
    device: Annotated[str, typer.Option(help="Device of torch.")] = "cpu",
    out: Annotated[Path, typer.Option(help="The surrogate, .json.")] = Path("out/surrogate.json"),
) -> None:
    """Fit the surrogate to most sites; print its errors and the coverage on the others.

    The surrogate's file gets both, and the factors of its intervals.
    """
    torch.set_num_threads(1)  # more threads block each other, for minutes on busy cores
    with user_errors():
        make_folder(out.parent)
        named = named_rows(data or DATA, without or ())
        _check_held_out(-(-named["scenario_hash"].nunique() // every), every)  # at most so many
        samples = samples_of(named)
        held_out = folds(samples.site, every, seed)[0]
        sites = len(np.unique(samples.site[held_out]))
        _check_held_out(sites, every)
        about = Fit(
            command=_command(),
            versions=versions(),
            engine="; ".join(named["engine"].unique()),
            blasts=int((~held_out).sum()),
            sites=len(np.unique(samples.site[~held_out])),
        )
        began_s = perf_counter()
        fitted = fit(samples, ~held_out, epochs, seed, about, device=device)
        seconds = round(perf_counter() - began_s, 1)
        # As guesses are made: those of impulses at points that are farther apart.
        guessed = samples_of(named[named["scenario"].isin(samples.scenario[held_out])], WIDE)
        every_one = np.ones(len(guessed), dtype=bool)
        impulse, peak = (
            Holdout.of(fitted, networks, asked, loads, chosen, least, seed)
            for networks, asked, loads, chosen, least in (
                (fitted.impulse, guessed, guessed.impulse, every_one, IMPULSE_LEAST_SPREAD),
                (fitted.peak, samples, samples.peak, held_out, PEAK_LEAST_SPREAD),
            )
        )
        off = impulse.errors, peak.errors
        print_line(_errors_table({f"{sites} held-out sites": off}))
        print_line(
            "\n" + _coverage_table(samples, held_out, (impulse.covered, peak.covered), _kind)
        )
        about = about.model_copy(
            update={"seconds": seconds, "impulse": impulse.check, "peak": peak.check}
        )
        path = save_surrogate(replace(fitted, fit=about), out)
        print_line(f"\n{about.blasts:,} loads of {about.sites:,} sites; wrote {path}")


def _check_held_out(sites: int, every: int) -> None:
    """Refuse a number of held-out sites that is too small for intervals."""
    least = _HALVES * least_sites()
    if sites < least:
        raise BlastEnvError(
            f"--every {every} holds out {sites} sites, must be at least {least} for the "
            "intervals: lower it, or give more sites"
        )


def named_rows(paths: Sequence[Path], without: Sequence[str] = ()) -> pd.DataFrame:
    """Return the rows of blast tables with a named scenario, except those in `without`."""
    table = pd.concat([read_frame(path, COLUMNS) for path in paths], ignore_index=True)
    return table[~table["scenario"].isin(["", *without])]


def samples_of(rows: pd.DataFrame, spacing: Spacing = CLOSE) -> Samples:
    """Return the samples of the rows of a blast table, by default those of a fit."""
    scenarios = [scenario_of(name) for name in rows["scenario"].unique()]
    return Samples.of(rows, {scenario.content_hash: scenario for scenario in scenarios}, spacing)


@dataclass(frozen=True, eq=False)
class Holdout:
    """Predictions of one kind of load on sites that are held out of the fit, and what they show.

    Attributes:
        errors: Errors of the predictions.
        covered: Which loads lie in their intervals, set on the other half of these sites.
        check: Record for the surrogate's file, whose intervals are set on all of them.
    """

    errors: Errors
    covered: "Covered"
    check: Check

    @classmethod
    def of(
        cls,
        surrogate: Surrogate,
        networks: Networks,
        samples: Samples,
        loads: Loads,
        held_out: BoolArray,
        least_spread: float,
        seed: int,
    ) -> "Holdout":
        """Compare the predictions of `networks` with the held-out loads."""
        found = predictions(surrogate, networks, samples, loads, held_out)
        target, sites = loads.target[held_out], samples.site[held_out]
        off = found.log_load - target
        errors = errors_of(found, target, samples.case[held_out])
        spread = widened(found.spread, least_spread)
        check = Check(
            rms=round(errors.rms, 4),
            rank=round(errors.rank, 4),
            lost=round(errors.lost, 4),
            spreads=round(interval_factor(off, spread, sites), 3),
            least_spread=least_spread,
        )
        halves = folds(sites, _HALVES, seed)
        inside = covered(off, spread, sites, halves)
        return cls(errors, Covered(inside, np.abs(off) / spread), check)


class Covered(NamedTuple):
    """Loads and their intervals.

    Attributes:
        inside: Whether each load lies in its interval (samples,).
        spreads: Magnitude of the error of its prediction, in spreads (samples,).
    """

    inside: BoolArray
    spreads: FloatArray


def _coverage_table(
    samples: Samples,
    chosen: BoolArray,
    loads: tuple[Covered, Covered],
    group: Callable[[str], str],
) -> str:
    """Return the coverage of intervals by group of sites, each site with the same weight."""
    groups = np.array([*map(group, samples.scenario[chosen])])
    sites, rows = samples.site[chosen], []
    for name in np.unique(groups):
        own = groups == name
        _, site, counts = np.unique(sites[own], return_inverse=True, return_counts=True)
        weights = 1.0 / (len(counts) * counts[site])
        inside = [f"{100.0 * (weights * item.inside[own]).sum():.1f} %" for item in loads]
        taken = [f"{_quantile(item.spreads[own], weights):.1f}" for item in loads]
        rows.append((str(name), str(len(counts)), str(own.sum()), *inside, *taken))
    headers = ("sites", "number", "loads", "impulses inside", "peaks inside")
    more = ("spreads for 95 % of impulses", "of peaks")
    return markdown_table((*headers, *more), rows)


def _quantile(values: FloatArray, weights: FloatArray) -> float:
    """Return the value up to which the weight is that of the intervals."""
    order = np.argsort(values)
    found = np.searchsorted(np.cumsum(weights[order]), COVERAGE)
    return float(values[order[min(int(found), len(order) - 1)]])


def _kind(scenario: str) -> str:
    return scenario.partition("/")[0].replace("_", " ")


def _command() -> str:
    return join(("python", "-m", "studies.surrogate", *command()[1:]))


@app.command()
def check(
    data: Annotated[list[Path], typer.Argument(help="Tables of blasts on other sites.")],
    surrogate: Annotated[Path, typer.Option(help="What `fit` wrote.")] = Path("out/surrogate.json"),
) -> None:
    """Print errors and coverage on the sites of other tables than the training data."""
    with user_errors():
        loaded, found, coverage = load_surrogate(surrogate), {}, []
        for path in data:
            rows = named_rows([path])
            wide, close = samples_of(rows, WIDE), samples_of(rows)
            sites = f"{len(np.unique(wide.site))} sites of {path.stem}"
            every = np.ones(len(wide), dtype=bool)
            told = (
                predictions(loaded, loaded.impulse, wide, wide.impulse, every),
                predictions(loaded, loaded.peak, close, close.peak, every),
            )
            of_both = wide.impulse, close.peak
            off = [
                errors_of(own, loads.target, wide.case)
                for own, loads in zip(told, of_both, strict=True)
            ]
            found[sites] = off[0], off[1]
            if loaded.fit.impulse is not None and loaded.fit.peak is not None:
                records = loaded.fit.impulse, loaded.fit.peak
                impulse, peak = map(_covered, told, of_both, records)
                coverage.append(_coverage_table(wide, every, (impulse, peak), str))
        print_line("\n\n".join((_errors_table(found), *coverage)))


@app.command()
def gap(
    surrogate: Annotated[Path, typer.Option(help="What `fit` wrote.")] = Path("out/surrogate.json"),
    data: Annotated[list[Path] | None, typer.Option(help="Tables of its fit.")] = None,
    sites: Annotated[int, typer.Option(min=1, help="How many of each, at most.")] = 600,
    every: Annotated[int, typer.Option(min=2, help="As for the fit.")] = EVERY,
    seed: Annotated[int, typer.Option(help="As for the fit.")] = 0,
) -> None:
    """Print the errors on sites that a fit held out, and on as many of its own.

    Data are missing where a surrogate errs less on its own sites; else it is too small, or is told
    too little.
    """
    with user_errors():
        loaded, named, found = load_surrogate(surrogate), named_rows(data or DATA), {}
        for what, names in zip(
            ("held-out sites", "of the fit"), _parts(named, every, seed), strict=True
        ):
            drawn = np.random.default_rng(seed).permutation(names)[:sites]
            rows = named[named["scenario_hash"].isin(drawn)]
            wide, close = samples_of(rows, WIDE), samples_of(rows)
            chosen = np.ones(len(wide), dtype=bool)
            found[f"{len(drawn)} {what}"] = (
                load_errors(loaded, loaded.impulse, wide, wide.impulse, chosen),
                load_errors(loaded, loaded.peak, close, close.peak, chosen),
            )
        print_line(_errors_table(found))


def _parts(named: pd.DataFrame, every: int, seed: int) -> tuple[list[str], list[str]]:
    """Return the hashes of the sites that a fit holds out, and of its own."""
    is_known = named["protected"] & (named["impulse_pa_s"] > 0.0) & (named["peak_pa"] > 0.0)
    hashes = np.unique(named.loc[is_known, "scenario_hash"].to_numpy(dtype=str))
    held_out = folds(np.arange(len(hashes)), every, seed)[0]
    return hashes[held_out].tolist(), hashes[~held_out].tolist()


def _covered(found: Predictions, loads: Loads, record: Check) -> Covered:
    """Return which loads lie in the intervals that a fit has set."""
    spread = widened(found.spread, record.least_spread)
    spreads = np.abs(found.log_load - loads.target) / spread
    return Covered(spreads <= record.spreads, spreads)


def _errors_table(found: Mapping[str, tuple[Errors, Errors]]) -> str:
    rows = [
        (
            f"{load} on {sites}",
            f"{quantity.rms:.3f}",
            f"{quantity.within:.3f}",
            str(quantity.cases),
            f"{quantity.rank:.2f}",
            f"{100.0 * quantity.lost:.1f} points",
        )
        for sites, both in found.items()
        for load, quantity in zip(("impulse", "peak"), both, strict=True)
    ]
    headers = (
        "",
        "error of ln(load), rms",
        "the same within a case",
        "cases of 4 layouts",
        "rank correlation in a case",
        "lost by choosing",
    )
    return markdown_table(headers, rows)


@dataclass(frozen=True)
class LayoutsJudged:
    """Reductions against one charge by gas dynamics, as shares of the load without a barrier.

    Attributes:
        reduction: Reduction by the surrogate's layout.
        promised: The surrogate's prediction of that reduction.
        rules: Reduction by each rule's layout.
        ms: Time of the proposal.
    """

    reduction: float
    promised: float
    rules: Mapping[str, float]
    ms: float


def verdict(
    surrogate: Surrogate, changes: int, evaluator: BlastEvaluator, threat: LoadCase
) -> LayoutsJudged:
    """Judge the surrogate's proposal after a number of changes, and the rules' layouts."""
    scenario, search = evaluator.scenario, SurrogateSearch(surrogate, changes=changes)
    began_s = perf_counter()
    proposed = search.at_once(scenario, threat.charge)
    ms = MS_PER_S * (perf_counter() - began_s)
    case = LoadCaseSet(scenario, (threat,), charge=threat.charge)
    rules = layouts_by_rule(scenario, threat.charge)
    reduction, *ruled = reductions_of(evaluator, case, [proposed, *rules.values()])
    return LayoutsJudged(
        reduction=reduction,
        promised=promise(surrogate, proposed, case),
        rules=dict(zip(rules, ruled, strict=True)),
        ms=ms,
    )


def _verdict_row(name: str, found: Sequence[LayoutsJudged]) -> tuple[str, ...]:
    names = set.intersection(*(set(judged.rules) for judged in found))
    single = max(names, key=lambda rule: fmean(judged.rules[rule] for judged in found))
    leads = [judged.reduction - max(judged.rules.values()) for judged in found]
    lead, low, high = mean_estimate(np.array(leads)).scaled(100.0)
    percent = (
        fmean(judged.reduction for judged in found),
        fmean(judged.promised for judged in found),
        fmean(max(judged.rules.values()) for judged in found),
    )
    return (
        name,
        str(len(found)),
        *(f"{100.0 * share:.1f} %" for share in percent),
        f"{lead:+.1f} ({low:.1f} to {high:.1f})" if len(found) > 1 else f"{lead:+.1f}",
        f"{100.0 * fmean(judged.rules[single] for judged in found):.1f} % ({single})",
        f"{median(judged.ms for judged in found):.0f}",
    )


@app.command()
def judge(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Bundled names or paths.")] = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="Generated sites, as for `blasts`: held-out ones.")
    ] = None,
    sites: Annotated[int, typer.Option(min=1, help="How many of each kind.")] = 40,
    surrogate: Annotated[Path, typer.Option(help="What `fit` wrote.")] = Path("out/surrogate.json"),
    charges: Annotated[int, typer.Option(min=1, help="Held-out charges of a scenario.")] = 6,
    changes: Annotated[int, typer.Option(min=0, help="Layouts that it looks at.")] = 1000,
    cache: Annotated[Path | None, typer.Option(help="Folder in which blasts are kept.")] = None,
    processes: Processes = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Compare the surrogate's proposals, by gas dynamics, with its predictions and every rule.

    An exploited surrogate predicts a larger reduction than gas dynamics gives. A row is a scenario,
    its charges the cases; or a kind of generated sites, with one charge on each.
    """
    with user_errors(), running_on(cluster):
        places = {load_scenario(name).name: ([name], charges) for name in scenarios or ()}
        for name in kind or ():
            places[name.replace("_", " ")] = (held_out_names(name, sites), 1)
        run = partial(_judged, load_surrogate(surrogate), changes, cache)
        rows = []
        for title, (names, count) in places.items():
            with progress_bar(title) as progress:
                found = run_all(partial(run, count), names, processes, progress)
            rows.append(_verdict_row(title, [judged for own in found for judged in own]))
    headers = ("on", "cases", "surrogate", "it promised", "best rule each")
    more = ("points beside that, 95 %", "best single rule", "ms")
    print_line(markdown_table((*headers, *more), rows))


def _judged(
    surrogate: Surrogate, changes: int, cache: Path | None, charges: int, name: str
) -> list[LayoutsJudged]:
    """Judge the proposals against the first held-out charges on a site."""
    scenario = scenario_of(name)
    evaluator = BlastEvaluator(scenario, "gas", cache=cache)
    threats = in_turn(scenario, draw_threats(scenario, SeedRange.TEST.seeds(0, charges)))
    return [verdict(surrogate, changes, evaluator, threat) for threat in threats]


def promise(surrogate: Surrogate, layout: Layout, case: LoadCaseSet) -> float:
    """Return the share by which a layout lowers the case's load, as a surrogate predicts it."""
    unprotected, guessed = Guesses.of(surrogate, case).loads([(), layout])
    return float(reductions(np.array([guessed]), np.array([unprotected]))[0])


def reductions_of(
    evaluator: BlastEvaluator, case: LoadCaseSet, layouts: Sequence[Layout]
) -> list[float]:
    """Return the share by which each layout lowers the case's load, by gas dynamics."""
    every = ((), *layouts)
    loads = evaluator.loads_of_many([(own, threat) for own in every for threat in case.threats])
    values = np.array([load.load(case.scenario.objective) for load in loads])
    of_layouts = zip(values.reshape(-1, len(case.threats)), every, strict=True)
    unprotected, *own = (case.objective_value(item, layout) for item, layout in of_layouts)
    return [
        float(reduction) for reduction in reductions(np.array(own), np.full(len(own), unprotected))
    ]


if __name__ == "__main__":
    app()
