"""`python -m studies.benchmark`: references of the problems, and runs of strong methods."""

from pathlib import Path
from time import monotonic
from typing import Annotated

import typer
from pydantic import TypeAdapter

from blast_env.benchmark import (
    DEFINITIONS,
    SMALL,
    Asked,
    Run,
    ScoreReference,
    Submission,
    make,
    play,
)
from blast_env.benchmark.methods import find_method, reference_of
from blast_env.benchmark.references import cell_key, engine_key, stored_references
from blast_env.cli.output import print_line, user_errors
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.files import make_folder, write_atomically
from blast_env.tables import markdown_table
from studies.benchmark.methods import OUTSIDE
from studies.benchmark.references import (
    known_layouts,
    published_blasts,
    submitted_layouts,
    with_published,
)

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)
_STORED = Path("blast_env/benchmark/data/references.json")
_CELL = cell_key(0.5)
_REFERENCES = TypeAdapter(dict[str, ScoreReference])


@app.command()
def references(
    cache: Annotated[Path, typer.Option(help="Folder in which blasts are kept.")],
    out: Annotated[Path, typer.Option(help="The file.")] = _STORED,
    submission: Annotated[
        list[Path] | None, typer.Option(help="Submission with layouts of its problems.")
    ] = None,
    most_s: Annotated[float, typer.Option(help="Stop before a problem after so many s.")] = 1e9,
) -> None:
    """Evaluate the rules and all known layouts on every problem without a reference.

    Problems with layouts in the submissions get new references that include those layouts. Use
    submissions only for a version without entries, since new references change the scale.
    """
    with user_errors():
        known = _REFERENCES.validate_json(out.read_bytes()) if out.exists() else {}
        found = submitted_layouts([Submission.load(path) for path in submission or ()])
        published, began = published_blasts(DEFINITIONS), monotonic()
        store = with_published(cache, published)
        engine = find_engine(JUDGE, 0.5)
        for name, definition in DEFINITIONS.items():
            stored = known.get(name)
            made_by = (definition.digest, engine_key(engine))
            if stored and (stored.digest, stored.engine) == made_by and name not in found:
                continue
            if monotonic() - began > most_s:
                break
            evaluator = BlastEvaluator(definition.scenario, engine, cache=store)
            more = known_layouts(definition, published) | found.get(name, {})
            if stored:
                more = {stored.best.method: stored.best.layout} | more
            known[name] = reference_of(definition, evaluator, more, _CELL)
            best, rule = known[name].best, known[name].rule
            print_line(
                f"{name}: {rule.method} {rule.shares[_CELL]:.3f}, {best.method} "
                f"{best.shares[_CELL]:.3f}, {evaluator.counts.blasts} blasts"
            )
            with write_atomically(out) as temporary:
                temporary.write_bytes(_REFERENCES.dump_json(dict(sorted(known.items()))) + b"\n")


@app.command()
def headroom() -> None:
    """Print the lead of the best known layout over the best of all rules, by problem.

    It is a lower bound of the possible gain over the rules.
    """
    rows = []
    for name, each in stored_references().items():
        rule, best = (100.0 * (1.0 - of.shares[_CELL]) for of in (each.rule, each.best))
        shown = each.rule.method, f"{rule:.1f}", f"{best:.1f}", f"{best - rule:.1f}"
        rows.append((f"`{name}`", *shown))
    headers = ("problem", "best rule", "takes off (%)", "best known (%)", "points more")
    print_line(markdown_table(headers, rows))


@app.command("play")
def play_methods(
    out: Annotated[Path, typer.Option(help="Folder for submissions; goes on with what it has.")],
    cache: Annotated[Path | None, typer.Option(help="Folder in which blasts are kept.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Method, again and again.")] = None,
    problem: Annotated[list[str] | None, typer.Option(help="Problem, again and again.")] = None,
    budget: Annotated[list[int] | None, typer.Option(help="Blasts.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each.")] = 10,
    first_seed: Annotated[int, typer.Option(min=0)] = 0,
    cell: Annotated[float, typer.Option(help="Side of the cells, m.")] = 0.5,
    most_s: Annotated[float, typer.Option(help="Stop before a run after so many s.")] = 1e9,
) -> None:
    """Run methods on problems, one seed of all before the next, and write their submissions."""
    with user_errors():
        make_folder(out)
        began = monotonic()
        names = method or list(OUTSIDE)
        found = {each: OUTSIDE.get(each) or find_method(each) for each in names}
        made = [
            lambda budget, name=name: make(name, budget, cell, cache=cache)
            for name in problem or SMALL
        ]
        runs: dict[str, list[Run]] = {each: [] for each in names}
        for seed in range(first_seed, first_seed + seeds):
            for each in names:
                if monotonic() - began > most_s:
                    raise BlastEnvError("the time is over; the same command goes on")
                asked = Asked(made, budget or (50,), (seed,))
                runs[each] += play(found[each], asked, out / f"{each}.sqlite")
                print_line(f"seed {seed}, {each}: {monotonic() - began:.0f} s")
        for each, own in runs.items():
            Submission(each, tuple(own)).save(out / f"{each}.json")


if __name__ == "__main__":
    app()
