"""`blast-env train`: an agent that proposes layouts."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
import typer

from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.options import CellSide
from blast_env.cli.output import engine_text, print_line, progress_bar, user_errors
from blast_env.cli.pictures import LAYOUT_PICTURE, save_layout_picture
from blast_env.cli.targets import checked_targets
from blast_env.errors import BlastEnvError, import_extra
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario

if TYPE_CHECKING:
    from blast_agents.training.run_folder import RunFolder
    from blast_agents.training.train import TrainingResult

_DEFAULT_ALGORITHM: Final = "maskable_ppo"
_DEFAULT_SCENARIO: Final = "courtyard"


def train(
    algo: Annotated[
        str | None,
        typer.Option(help="ppo, maskable_ppo or self_labelling.", show_default=_DEFAULT_ALGORITHM),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            help="Bundled name, a scenario file, or 'sites' for generated ones.",
            show_default=_DEFAULT_SCENARIO,
        ),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Steps, a module each (of self_labelling, a layout that meets a threat each); "
            "else as the YAML file says.",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Decides everything.", show_default="0")
    ] = None,
    envs: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Parallel environments (of self_labelling, worker processes); "
            "else as the YAML file says.",
        ),
    ] = None,
    run: Annotated[Path | None, typer.Option(help="Folder for the run; new or empty.")] = None,
    threat: Annotated[
        str | None,
        typer.Option(
            help="visible or hidden: whether the agent sees the charge.", show_default="visible"
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="Engine that runs the blasts; surrogate: guesses instead.", show_default="event"
        ),
    ] = None,
    cell: CellSide = None,
    observation: Annotated[
        str | None,
        typer.Option(
            help="What the agent sees: grid, grid_with_load, image (with a CnnPolicy), or features"
            " (with an MlpPolicy).",
            show_default="grid",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="key=value, e.g. ent_coef=0.01; may be given again."),
    ] = None,
    start_from: Annotated[
        Path | None,
        typer.Option(
            help="Run folder whose best weights to begin with, of a scenario of this size."
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(help="Go on with the run of this folder; no other option but --cluster."),
    ] = None,
    cluster: ClusterAddress = None,
) -> None:
    """Train an agent that proposes layouts, or go on with a training that was interrupted."""
    fresh = {
        "algo": algo,
        "steps": steps,
        "seed": seed,
        "envs": envs,
        "run": run,
        "threat": threat,
        "engine": engine,
        "cell": cell,
        "observation": observation,
        "set": set_ or None,
        "start-from": None if start_from is None else str(start_from),
    }
    given = {name: value for name, value in fresh.items() if value is not None}
    with (
        user_errors(lambda: _how_to_resume(resume or run)),
        checked_targets(folders={"--run": run}),
        running_on(cluster),
    ):
        if resume is not None:
            result = _resume(resume, scenario, given)
        elif run is None:
            raise BlastEnvError("--run is missing: the folder for the run (or --resume)")
        else:
            result = _train(run, scenario or _DEFAULT_SCENARIO, given, set_ or [], envs)
    _print_result(result)


def _how_to_resume(folder: Path | None) -> str:
    """Return how an interrupted training goes on."""
    if folder is None:
        return ""
    # Here, because torch takes seconds to start, and is an extra.
    from blast_agents.training.run_folder import RunFolder

    if RunFolder(folder).is_run:
        return f"blast-env train --resume {folder} goes on"
    return "the run had not begun: the same command begins anew"


def _resume(folder: Path, scenario: str | None, given: Mapping[str, object]) -> "TrainingResult":
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents,render", "training"):
        from blast_agents.training import resume

    if given:
        raise BlastEnvError(
            f"--{next(iter(given))} cannot be changed with --resume: the run folder says it"
        )
    with progress_bar(f"training {folder}") as progress:
        return resume(folder, scenario, progress)


def _train(
    run: Path, scenario: str, given: Mapping[str, object], options: list[str], envs: int | None
) -> "TrainingResult":
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents,render", "training"):
        from blast_agents.training import load_hyperparameters, train
        from blast_agents.training.environments import environment_id
        from blast_agents.training.hyperparameters import hyperparameter_keys, parse_options
        from blast_agents.training.run_folder import SETTING_KEYS, settings_from

    algorithm = str(given.get("algo", _DEFAULT_ALGORITHM))
    changes = parse_options(options, [*hyperparameter_keys(algorithm), *SETTING_KEYS])
    names = ("steps", "seed", "threat", "engine", "observation")
    values = {name: given[name] for name in names if name in given}
    if "cell" in given:
        values["cell_m"] = given["cell"]
    values["start_from"] = given.get("start-from")
    if given.get("observation") == "features":  # no planes, which the YAML file's policy looks at
        changes.setdefault("policy", "MlpPolicy")
    values |= {name: changes.pop(name) for name in SETTING_KEYS if name in changes}
    hyperparameters = load_hyperparameters(algorithm, environment_id(scenario), changes, envs)
    settings = settings_from(
        {"steps": hyperparameters.n_timesteps, "algorithm": algorithm, "scenario": scenario}
        | values
    )
    with progress_bar(f"training {run}") as progress:
        return train(settings, hyperparameters, run, progress)


def _print_result(result: "TrainingResult") -> None:
    counters, folder = result.progress.counters, result.folder
    settings = result.configuration.settings
    blasts = "guesses" if settings.guesses else "blasts"
    print_line(
        f"{counters.steps:,} steps, {counters.episodes:,} episodes, {counters.blasts:,} {blasts} "
        f"in {counters.seconds:,.0f} s"
    )
    scenario = folder.scenario(result.configuration)
    print_line(engine_text(settings.blast_engine, [scenario]))
    if settings.judge.name != settings.blast_engine.name:
        print_line(f"weights chosen by {engine_text(settings.judge, [scenario])}")
    for row in result.progress.evaluations:
        if row.steps == counters.best_steps:
            print_line(
                f"best on held-out threats, after {row.steps:,} steps: reduction "
                f"{row.reduction:.1%} (95 % interval {row.low:.1%} to {row.high:.1%})"
            )
    for path in (folder.checkpoint, folder.evaluations, folder.learning_curve):
        print_line(f"wrote {path}")
    print_line(f"wrote {_draw_proposal(folder, scenario, settings.threat)}")


def _draw_proposal(folder: "RunFolder", scenario: Scenario, threat: str) -> Path:
    """Draw what the agent proposes on the run's scenario, a known charge drawn; return the file."""
    from blast_agents.training import load_agent, newest_weights

    agent = load_agent(folder.path, newest_weights(folder.path))
    charge = None if threat == "hidden" else scenario.sample_charge(np.random.default_rng(0))
    shown = scenario.with_charge(charge) if isinstance(charge, Charge) else scenario
    return save_layout_picture(shown, agent.propose(scenario, charge), folder.path / LAYOUT_PICTURE)
