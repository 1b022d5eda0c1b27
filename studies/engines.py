"""The tables and figures of docs/studies/engines.md: where the engines agree, what they cost."""

from functools import partial
from pathlib import Path
from typing import Annotated, Final

import pandas as pd
import typer

from blast_env.arrays import FloatArray
from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder
from blast_env.rendering.figures import save_figure
from blast_env.runner import run_all
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import build_scene
from blast_env.simulation import simulate
from blast_env.studies.benchmark.engines import benchmark_scenes
from blast_env.tables import markdown_table
from studies.particles import blast_front, event_engine
from studies.particles.agreement import loads, modules

STEPS_RADII: Final = (0.5, 0.25, 0.1, 0.05)
STEP_SEEDS: Final = 4
COMPARED: Final = Path("out/compare_engines")

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def compare(
    seeds: Annotated[int, typer.Option(min=20, help="Blasts on pymunk at its default step.")] = 200,
    event_seeds: Annotated[int, typer.Option(help="Blasts on the event engine.")] = 1000,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    processes: int = 2,
    cluster: ClusterAddress = None,
    out: Annotated[Path, typer.Option(help="Folder of the finished blasts.")] = COMPARED,
    figure: Annotated[Path, typer.Option()] = COMPARED / "engine_convergence.png",
) -> None:
    """Hold the loads of pymunk, at ever shorter steps, against those of the event engine."""

    def collisions(blasts: loads.BlastSet) -> pd.DataFrame:
        with progress_bar(blasts.label) as progress:
            return loads.collisions_of(blasts, processes, out, progress)

    with user_errors(), running_on(cluster):
        if event_seeds < seeds:
            raise BlastEnvError(
                f"--event-seeds is {event_seeds}, must be at least --seeds, {seeds}: the engines "
                "share charge and air of each seed"
            )
        make_folder(out)
        make_folder(figure.parent)
        scenes = [each for each in loads.engine_scenes() if scene in (None, each.name)]
        found = list(loads.compare_scenes(scenes, (seeds, event_seeds), collisions))
        for headers, rows in (
            (loads.DIFFERENCE_HEADERS, loads.difference_rows(found)),
            (loads.DISTANCE_HEADERS, loads.distance_rows(found)),
            (loads.STEP_HEADERS, loads.step_rows(found)),
        ):
            print_line(markdown_table(headers, rows) + "\n")
        first = {each.name: each.structures[0] for each in scenes}
        drawn = [each for each in found if each.structure == first[each.scene]]
        print_line(f"wrote {save_figure(loads.convergence_figure(drawn, event_seeds), figure)}")


@app.command("modules")
def compare_modules(
    seeds: Annotated[int, typer.Option(min=20, help="Blasts on pymunk.")] = 60,
    event_seeds: Annotated[int, typer.Option(help="Blasts on the event engine.")] = 400,
    processes: int = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Hold single modules against those of the event engine, at two steps of pymunk."""

    def impulses(scenario: Scenario, engine: str, count: int) -> FloatArray:
        with progress_bar(f"{scenario.name}: {engine}") as progress:
            return modules.module_impulses(scenario, engine, count, processes, progress)

    rows = []
    with user_errors(), running_on(cluster):
        for scene in benchmark_scenes():
            event = impulses(scene.scenario, "event", event_seeds)
            for step_radii, scenario in modules.stepped(scene):
                pymunk = impulses(scenario, "pymunk", seeds)
                compared = (
                    modules.agreement(distance, pymunk[..., kind], event[..., kind])
                    for kind in range(2)
                    for distance in (modules.distribution_distance, modules.profile_distance)
                )
                rows.append((scene.name, f"{step_radii:g}", *compared))
    quantities = ("m|v|", "the transferred impulse")
    columns = [(f"distribution of {q} (chance)", "its profile (chance)") for q in quantities]
    print_line(markdown_table(("scene", "step (radii)", *sum(columns, ())), rows))


@app.command()
def steps(processes: int = 2, cluster: ClusterAddress = None) -> None:
    """Print how the load on a building depends on pymunk's step: m |v| (transferred impulse)."""
    with user_errors(), running_on(cluster):
        free_field = load_scenario("free_field")
        scenarios = {
            "courtyard": load_scenario("courtyard").with_simulation("ballistic"),
            "free_field, 15 m": free_field.at_stand_off(15.0),
            "free_field, 60 m": free_field.at_stand_off(60.0),
        }
        rows = []
        for name, scenario in scenarios.items():
            row = [name]
            for step_radii in STEPS_RADII:
                stepped = scenario.with_simulation(
                    overrides={"stepping": {"step_radii": step_radii}}
                )
                with progress_bar(f"{name}, {step_radii:g} radii") as progress:
                    found = run_all(partial(_load, stepped), range(STEP_SEEDS), processes, progress)
                impulse, transferred = (sum(each) / STEP_SEEDS for each in zip(*found, strict=True))
                row.append(f"{impulse:,.0f} ({transferred:,.0f})")
            rows.append(row)
        print_line(markdown_table(("scenario", *(f"{step:g} radii" for step in STEPS_RADII)), rows))


def _load(scenario: Scenario, seed: int) -> tuple[float, float]:
    building = simulate(scenario, seed=seed).obstacle("building")
    return building.impulse, building.transferred_impulse


@app.command()
def front(
    seeds: Annotated[int, typer.Option(min=1)] = 3,
    out: Path = Path("out/blast_front.png"),
) -> None:
    """Hold the front of a strong blast on the event engine against the laws of gas dynamics."""
    with user_errors():
        make_folder(out.parent)
        found = []
        with progress_bar("blasts") as progress:
            for study in blast_front.STUDIES:
                found.append(study.traces(seeds))
                progress(len(found) / len(blast_front.STUDIES))
        print_line(markdown_table(blast_front.HEADERS, blast_front.front_rows(found)))
        print_line(blast_front.size_note())
        print_line(f"wrote {save_figure(blast_front.front_figure(found), out)}")


@app.command()
def cost(
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each size; the least counts.")] = 5,
    least_balls: Annotated[int, typer.Option(help="The smallest size.")] = event_engine.BALLS[0],
    most_balls: Annotated[int, typer.Option(help="The largest size.")] = event_engine.BALLS[-1],
    out: Annotated[Path, typer.Option(help="The figure.")] = Path("out/engine_cost.png"),
) -> None:
    """Print and draw what an event costs the event engine, by the number of balls."""
    with user_errors():
        make_folder(out.parent)
        sizes = [count for count in event_engine.BALLS if least_balls <= count <= most_balls]
        if len(sizes) < 2:
            raise BlastEnvError(
                f"least_balls is {least_balls} and most_balls {most_balls}, must leave at least "
                f"two of {', '.join(map(str, event_engine.BALLS))} for a fit"
            )
        with progress_bar("gases") as progress:
            gases = [event_engine.gas(count) for count in sizes]
            costs = event_engine.measure(gases, repeats, progress)
        headers = ("balls", "MB", "events", "ns an event", "collisions", "ns a collision")
        print_line(
            markdown_table(
                headers,
                [
                    (
                        f"{each.balls:,}",
                        f"{each.megabytes:.1f}",
                        f"{each.events:,}",
                        f"{each.event_ns:.0f}",
                        f"{each.collisions:,}",
                        f"{each.collision_ns:.0f}",
                    )
                    for each in costs
                ],
            )
        )
        few = [each for each in costs if each.balls <= event_engine.MOST_FITTED]
        fit = event_engine.log_fit(few or costs)
        print_line(f"ns an event = {fit.at_one:.0f} + {fit.per_doubling:.1f} log2(balls)")
        print_line(f"wrote {save_figure(event_engine.cost_figure(costs, fit), out)}")


@app.command()
def profile(
    repeats: Annotated[int, typer.Option(min=1, help="Blasts of each; the least counts.")] = 30,
) -> None:
    """Print where the time of a blast goes on the event engine.

    What happens in a blast, the processor time of its parts, and the time of what the compiled
    loop does most, finding out what a ball touches next.
    """
    events, parts, looks = [], [], []
    for scene in benchmark_scenes():
        of = event_engine.profile(scene, repeats)
        counts = (f"{count:,}" for count in (of.collisions, of.crossings, of.outdated))
        events.append((scene.name, *counts, f"{of.event_ns:.0f}"))
        times_s = (of.scene_s, of.start_s, of.loop_s, of.result_s)
        parts.append((scene.name, *(f"{1e3 * time_s:.2f}" for time_s in times_s)))
        for look in event_engine.look_aheads(build_scene(scene.scenario), repeats):
            numbers = (1e3 * look.time_s, look.air, look.air_ns, look.explosive, look.explosive_ns)
            looks.append((scene.name, *(f"{number:.0f}" for number in numbers)))
    balls = ("moving air balls", "one takes (ns)", "explosive balls", "one takes (ns)")
    times = ("scene (ms)", "walls and arrays (ms)", "compiled loop (ms)", "result (ms)")
    happened = ("collisions", "moves between cells", "foreseen in vain", "ns an event")
    for headers, rows in ((happened, events), (times, parts), (("after (ms)", *balls), looks)):
        print_line(markdown_table(("scene", *headers), rows) + "\n")


if __name__ == "__main__":
    app()
