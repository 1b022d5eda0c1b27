"""Whether pymunk and the event engine agree, for docs/engines.md.

Runs the same scenes on both, pymunk at ever shorter steps. Prints Markdown tables and draws a
figure. Finished sets of blasts are kept, so that an interrupted run goes on where it was.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Final

import joblib
import pandas as pd
import typer

from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.rendering.figures import save_figure
from scripts.engine_comparison import QUANTITIES, Comparison, compare, longest_close_step
from scripts.engine_figure import convergence_figure
from scripts.engine_scenes import BlastSet, EngineScene, engine_scenes, write_collisions

OUT: Final = Path("out/compare_engines")
_SHARES: Final = {0.5: 1.0, 0.25: 0.8, 0.1: 0.4, 0.05: 0.25, 0.02: 0.25}
"""Of the seeds, by the step: short steps take long."""


def main(
    seeds: Annotated[int, typer.Option(min=20, help="Blasts on pymunk at its default step.")] = 200,
    event_seeds: Annotated[int, typer.Option(help="Blasts on the event engine.")] = 1000,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    processes: int = 2,
    out: Annotated[Path, typer.Option(help="Folder of the finished blasts.")] = OUT,
    figure: Annotated[Path, typer.Option()] = OUT / "engine_convergence.png",
) -> None:
    """Run the study."""
    with user_errors():
        for folder in (out, figure.parent):
            folder.mkdir(parents=True, exist_ok=True)
        scenes = [each for each in engine_scenes() if scene in (None, each.name)]
        comparisons = list(run(scenes, (seeds, event_seeds), processes, out))
        for table in (difference_table, distance_table, step_table):
            print_line("\n".join(table(comparisons)) + "\n")
        first = {each.name: each.structures[0] for each in scenes}
        drawn = [each for each in comparisons if each.structure == first[each.scene]]
        print_line(f"wrote {save_figure(convergence_figure(drawn, event_seeds), figure)}")


def run(
    scenes: Iterable[EngineScene], seeds: tuple[int, int], processes: int, folder: Path
) -> Iterable[Comparison]:
    """Run the blasts that are missing and compare them.

    Args:
        scenes: The scenes.
        seeds: Blasts on pymunk at its default step, and on the event engine.
        processes: Worker processes.
        folder: Where finished sets of blasts are kept.
    """
    for scene in scenes:
        event = collisions_of(BlastSet(scene, "event", seeds[1]), processes, folder)
        for step_radii in scene.steps_radii:
            count = round(_SHARES[step_radii] * seeds[0])
            pymunk = collisions_of(BlastSet(scene, "pymunk", count, step_radii), processes, folder)
            for structure in scene.structures:
                yield compare(pymunk, event, (count, seeds[1]), scene.name, structure, step_radii)


def collisions_of(blasts: BlastSet, processes: int, folder: Path) -> pd.DataFrame:
    """Return the collisions of a set of blasts, from its file if it has one already.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    path = blasts.path(folder)
    if not path.exists():
        jobs = (joblib.delayed(blasts.collisions)(seed) for seed in range(blasts.seeds))
        parallel = joblib.Parallel(n_jobs=processes, return_as="generator")
        tables: list[pd.DataFrame] = []
        step = "" if blasts.step_radii is None else f", {blasts.step_radii:g} radii"
        with progress_bar(f"{blasts.scene.name}: {blasts.engine}{step}") as progress:
            for table in parallel(jobs):
                tables.append(table)
                progress(len(tables) / blasts.seeds)
        write_collisions(tables, path)
    return pd.read_parquet(path)


def difference_table(comparisons: Sequence[Comparison]) -> Iterable[str]:
    """Yield the lines of the table of differences in percent, with 95 % intervals."""
    yield from _header(("load on", "step (radii)", "seeds", *QUANTITIES.values()))
    for each in comparisons:
        differences = (str(each.differences[name]) for name in QUANTITIES)
        yield _row(_load(each), f"{each.step_radii:g}", f"{each.seeds}", *differences)


def distance_table(comparisons: Sequence[Comparison]) -> Iterable[str]:
    """Yield the lines of the table of Kolmogorov-Smirnov distances."""
    columns = ("m|v| (p)", "transferred (p)", "time of the impulse (chance)", "its angle (chance)")
    yield from _header(("load on", "step (radii)", *columns))
    for each in comparisons:
        yield _row(
            _load(each),
            f"{each.step_radii:g}",
            *(
                f"{each.distances[n]:.2f} ({each.p_values[n]:.2g})"
                for n in ("impulse", "transferred")
            ),
            *(f"{each.pooled[n]:.3f} ({each.pooled_floor[n]:.3f})" for n in each.pooled),
        )


def step_table(comparisons: Sequence[Comparison]) -> Iterable[str]:
    """Yield the lines of the table of steps at which pymunk is within 5 %."""
    yield from _header(("load on", "step within 5 % (radii)"))
    for load in dict.fromkeys(map(_load, comparisons)):
        step = longest_close_step([each for each in comparisons if _load(each) == load])
        yield _row(load, "none of them" if step is None else f"{step:g}")


def _load(comparison: Comparison) -> str:
    return f"{comparison.scene}: {comparison.structure}"


def _header(columns: Sequence[str]) -> Iterable[str]:
    yield _row(*columns)
    yield "|---" * len(columns) + "|"


def _row(*cells: str) -> str:
    escaped = (cell.replace("|", r"\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


if __name__ == "__main__":
    typer.run(main)
