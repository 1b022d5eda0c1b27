"""`python -m studies.benchmark`: references of the problems, and runs of strong methods."""

from collections.abc import Mapping
from pathlib import Path
from time import monotonic
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from blast_env.answers.terminal import print_line
from blast_env.benchmark import (
    BUDGETS,
    DEFINITIONS,
    JUDGE_CELL_M,
    BenchmarkProblem,
    Definition,
    ScoreReference,
    SubmissionJudgement,
    make,
    shipped_standings,
)
from blast_env.benchmark.methods import reference_of, references_of
from blast_env.benchmark.references import cell_key, engine_key, stored_references
from blast_env.bundled import ITEM_SITES, KERB_SITES
from blast_env.cli.output import user_errors
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.files import write_atomically
from blast_env.plots.figures import save_figure
from blast_env.tables import markdown_table
from studies.benchmark.choice import FIRST_SEED, METHODS, Candidate, candidates, looked_at
from studies.benchmark.references import (
    WITHOUT_GUESSES,
    entered,
    finders,
    known_layouts,
    mean_curve,
    named_definition,
    published_blasts,
    rescaled,
    seen_rule,
    with_fine_shares,
    with_judged,
    with_published,
)

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)
_STORED = Path("blast_env/benchmark/data/references.json")
_STANDINGS = _STORED.parent / "standings"
_CELL, _FINE = cell_key(0.5), cell_key(JUDGE_CELL_M)
_REFERENCES = TypeAdapter(dict[str, ScoreReference])


@app.command()
def references(
    cache: Annotated[Path, typer.Option(help="Folder in which blasts are kept.")],
    out: Annotated[Path, typer.Option(help="The file.")] = _STORED,
    judged: Annotated[
        list[Path] | None,
        typer.Option(help="Judged submission whose better layouts become the best known ones."),
    ] = None,
    most_s: Annotated[float, typer.Option(help="Stop before a problem after so many s.")] = 1e9,
) -> None:
    """Evaluate the rules and all known layouts on every problem without a reference.

    References of problems that are no longer there go.

    A better layout of a judged submission becomes the best known one, which changes the scale of
    the score: give all judged submissions, whose files are then written with the new scale.
    """
    with user_errors():
        stored = _REFERENCES.validate_json(out.read_bytes()) if out.exists() else {}
        known = {name: own for name, own in stored.items() if name in DEFINITIONS}
        submissions = {path: SubmissionJudgement.load(path) for path in judged or ()}
        published, began = published_blasts(DEFINITIONS), monotonic()
        store = with_published(cache, published)
        engine = find_engine(JUDGE, 0.5)
        for name, definition in DEFINITIONS.items():
            before = known.get(name)
            made_by = (definition.digest, engine_key(engine))
            if before and (before.digest, before.engine) == made_by:
                continue
            if monotonic() - began > most_s:
                break
            evaluator = BlastEvaluator(definition.scenario, engine, cache=store)
            more = known_layouts(definition, published)
            if before:
                more = {before.best.method: before.best.layout} | more
            known[name] = reference_of(definition, evaluator, more, _CELL)
            best, rule = known[name].best, known[name].rule
            print_line(
                f"{name}: {rule.method} {rule.shares[_CELL]:.3f}, {best.method} "
                f"{best.shares[_CELL]:.3f}, {evaluator.counts.blasts} blasts"
            )
            _write(known, out)
        fine = find_engine(JUDGE, JUDGE_CELL_M)
        for name in DEFINITIONS:
            if _FINE in known[name].best.shares or monotonic() - began > most_s:
                continue
            evaluator = BlastEvaluator(DEFINITIONS[name].scenario, fine, cache=store)
            known[name] = with_fine_shares(DEFINITIONS[name], known[name], evaluator)
            print_line(f"{name}, {_FINE} m: {evaluator.counts.blasts} blasts")
            _write(known, out)
        better = with_judged(known, submissions.values(), store)
        _write(better, out)
        for path, submission in submissions.items():
            rescaled(submission, better).save(path)
        for name in DEFINITIONS:
            if better[name] != known[name]:
                print_line(f"{name}: best known by {better[name].best.method}")


@app.command()
def enter(
    judged: Annotated[list[Path], typer.Argument(help="Judged submissions.")],
    out: Annotated[Path, typer.Option(help="Folder of the standings.")] = _STANDINGS,
) -> None:
    """Put the runs of judged submissions into the standings, beside the runs that are there.

    Runs of problems that are no longer in the benchmark go from all of them.
    """
    with user_errors():
        kept = {
            own.method: own for own in map(SubmissionJudgement.load, sorted(out.glob("*.json")))
        }
        for path in judged:
            new = SubmissionJudgement.load(path)
            kept[new.method] = entered(kept.get(new.method), new)
        for method, own in kept.items():
            print_line(str(entered(None, own).save(out / f"{method}.json")))


def _write(known: dict[str, ScoreReference], out: Path) -> None:
    with write_atomically(out) as temporary:
        temporary.write_bytes(_REFERENCES.dump_json(dict(sorted(known.items()))) + b"\n")


@app.command()
def headroom(
    candidate: Annotated[
        list[str] | None,
        typer.Argument(help="Possible further problem, such as site_6108-known, by a search."),
    ] = None,
    blasts: Annotated[int, typer.Option(help="Blasts of the search.")] = BUDGETS[1],
    cache: Annotated[Path | None, typer.Option(help="Folder in which blasts are kept.")] = None,
) -> None:
    """Print the lead of the best known layout over the best of all rules, by problem.

    It is a lower bound of the possible gain over the rules. For candidates the best known layout is
    that of the search `surrogate`, or of a rule, on cells of 0.5 m. The last two columns count the
    methods of the standings that find 5 points, and those among them that use no guesses.
    """
    with user_errors():
        known: Mapping[str, ScoreReference] = stored_references()
        cells: tuple[str, ...] = (_CELL, _FINE)
        if candidate:
            store = BlastStore(cache)
            asked = {entry.name: entry for entry in map(named_definition, candidate)}

            def searched(definition: Definition, _: int) -> BenchmarkProblem:
                return make(definition, blasts, 0.5, cache=store)

            known, cells = references_of(asked, (), 0.5, store, searched), (_CELL,)
    submissions, rows = shipped_standings(), []
    for name, item in known.items():
        row = [f"`{name}`", item.rule.method]
        for cell in cells:
            rule, best = (100.0 * (1.0 - end.shares[cell]) for end in (item.rule, item.best))
            row += [f"{rule:.1f}", f"{best:.1f}", f"{best - rule:.1f}"]
        found_by = finders(name, submissions)
        rows.append([*row, f"{len(found_by)}", f"{len({*found_by} & {*WITHOUT_GUESSES})}"])
    of_cell = "takes off ({} m, %)", "best known", "points more"
    headers = (
        *("problem", "best rule", *(name.format(cell) for cell in cells for name in of_cell)),
        *("methods that find 5 points", "of them without guesses"),
    )
    print_line(markdown_table(headers, rows))


@app.command()
def choose(
    kind: Annotated[
        list[str] | None, typer.Option(help="Kind of the sites; may be given again.")
    ] = None,
    first: Annotated[int, typer.Option(min=0, help="First seed.")] = FIRST_SEED,
    sites: Annotated[int, typer.Option(min=1, help="Sites of each kind.")] = 20,
    blasts: Annotated[int, typer.Option(min=1, help="Blasts of each method.")] = BUDGETS[1],
    cache: Annotated[Path, typer.Option(help="Folder in which blasts and runs are kept.")] = Path(
        "out/choice"
    ),
) -> None:
    """Choose generated sites on which several methods find room above the rules, by blasts.

    After an interruption the same line goes on.
    """
    with user_errors():
        store = BlastStore(cache / "blasts")
        print_line(markdown_table(("problem", "best rule", *METHODS, "chosen"), ()))
        for definition in candidates(kind or [ITEM_SITES, KERB_SITES], first, sites):
            seen = looked_at(definition, blasts, cache, store)
            print_line(f"| {' | '.join(_choice_row(seen))} |")


def _choice_row(seen: Candidate) -> tuple[str, ...]:
    """Return the points beside the best rule by method: of a search's cells, then the judge's."""
    cells = []
    for method in METHODS:
        leads = [of[method] for of in (seen.leads, seen.fine_leads) if method in of]
        cells.append(", ".join(f"{100.0 * lead:+.1f}" for lead in leads))
    return (f"`{seen.name}`", seen.rule, *cells, "yes" if seen.has_room else "")


@app.command()
def picture(
    out: Annotated[Path, typer.Argument(help="The file.")] = Path("docs/pictures/scores.png"),
    cache: Annotated[Path | None, typer.Option(help="Folder in which blasts are kept.")] = None,
) -> None:
    """Draw the points beside the best rule over the blasts spent, as the searches see them."""
    with user_errors():
        methods = [
            shipped_standing
            for shipped_standing in shipped_standings()
            if set(shipped_standing.problems) == set(DEFINITIONS)
        ]
        rules = {name: seen_rule(name, cache) for name in DEFINITIONS}
        figure = Figure(figsize=(8.0, 4.5), layout="constrained")
        axes = figure.add_subplot(
            xlabel="blasts", ylabel="points beside the best rule, as the search sees it"
        )
        budget, curves = BUDGETS[1], {}
        blasts = np.arange(budget + 1)
        for method in methods:
            runs = [run for run in method.runs if run.budget == budget]
            if runs:
                curves[method.method] = mean_curve(runs, rules, blasts)
        for index, name in enumerate(sorted(curves, key=lambda curve: -curves[curve][-1])):
            line = "-" if index < 10 else "--"  # the colours repeat after ten
            axes.step(blasts, curves[name], where="post", label=name, linestyle=line)
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
        save_figure(figure, out)


if __name__ == "__main__":
    app()
