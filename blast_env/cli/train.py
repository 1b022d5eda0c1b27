"""`blast-env train`: an agent that proposes layouts."""

from collections.abc import Mapping, Sequence
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import typer

from blast_env.answers.document import Number
from blast_env.answers.terminal import print_line
from blast_env.bundled import GENERATED
from blast_env.cli.command import writes
from blast_env.cli.interruptions import Interruptions
from blast_env.cli.options import (
    BY_SITE,
    ENGINE_HELP,
    CellOption,
    CellsOption,
    ClusterAddress,
    refuse_given,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    layout_picture,
    print_written,
    progress_bar,
    resumable,
    save_figures,
)
from blast_env.envs.strategies import scenario_source
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation.cases import has_few_places
from blast_env.evaluation.engines import default_engine
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge

if TYPE_CHECKING:
    from blast_agents.training.run_folder import RunFolder
    from blast_agents.training.train import TrainingResult
    from matplotlib.figure import Figure

_DEFAULT_ALGORITHM: Final = "maskable_ppo"
_POLICIES: Final = {"features": "MlpPolicy", "image": "CnnPolicy"}
"""Policies of the observations other than planes, for which the YAML files hold policies."""
_DEFAULT_SCENARIO: Final = "courtyard"
_ENGINE_HELP: Final = f"{ENGINE_HELP} surrogate guesses them."
_SETTINGS: Final = ("steps", "seed", "threat", "engine", "observation", "cell_m", "cells")
"""Options that are settings of a run."""
_WITH_RESUME: Final = ("resume", "scenario", "cluster")
"""Options allowed with `--resume`; the run folder fixes the others."""

_AlgoOption = Annotated[
    str | None, typer.Option(help="ppo or maskable_ppo.", show_default=_DEFAULT_ALGORITHM)
]
_ScenarioOption = Annotated[
    str | None,
    typer.Option(
        help="Bundled name, a scenario file, or 'sites' for generated ones.",
        show_default=_DEFAULT_SCENARIO,
    ),
]
_StepsOption = Annotated[
    int | None, typer.Option(help="Steps, a module or piece each; else as in the YAML file.", min=1)
]
_EnvsOption = Annotated[
    int | None, typer.Option(help="Parallel environments; else as in the YAML file.", min=1)
]
_ThreatOption = Annotated[
    str | None,
    typer.Option(
        help="visible or hidden: whether the agent sees the charge.", show_default="visible"
    ),
]
_ObservationOption = Annotated[
    str | None,
    typer.Option(
        help="Observation: grid, image (with a CnnPolicy), or features (with an MlpPolicy).",
        show_default="grid",
    ),
]
_StartFromOption = Annotated[
    Path | None,
    typer.Option(
        help="Run folder with the initial weights (its best), for a scenario of this size."
    ),
]
_ResumeOption = Annotated[
    Path | None, typer.Option(help="Resume the run of this folder; no other option but --cluster.")
]


def train(
    context: typer.Context,
    algo: _AlgoOption = None,
    scenario: _ScenarioOption = None,
    steps: _StepsOption = None,
    seed: int | None = typer.Option(None, help="Decides everything.", min=0, show_default="0"),
    envs: _EnvsOption = None,
    run: Path | None = writes("Folder for the run; new or empty"),
    threat: _ThreatOption = None,
    engine: str | None = typer.Option(None, help=_ENGINE_HELP, show_default=BY_SITE),
    cell_m: CellOption = None,
    cells: CellsOption = None,
    observation: _ObservationOption = None,
    changes: list[str] = typer.Option(
        [], "--set", help="key=value, e.g. ent_coef=0.01; may be given again."
    ),
    start_from: _StartFromOption = None,
    resume: _ResumeOption = None,
    cluster: ClusterAddress = None,
) -> None:
    """Train an agent that proposes layouts, or resume an interrupted training."""
    folder = resume or run
    if folder is None:
        raise BlastEnvError("--run is missing: the folder for the run (or --resume)")
    if resume is not None:
        fixed = {parameter.name or "" for parameter in context.command.params} - {*_WITH_RESUME}
        refuse_given(context, fixed, "cannot be changed with --resume: the run folder fixes it")
    else:
        site = scenario_source(scenario or _DEFAULT_SCENARIO).representative
    # Here, because torch takes seconds to start, and is an extra; not above, because a site that is
    # no site is refused at once; not below, because before it there is nothing to resume.
    with import_extra("agents,render", "training"), Interruptions.current().at_once():
        import blast_agents.training  # noqa: F401
    with running_on(cluster), resumable(partial(_how_to_resume, folder)):
        if resume is not None:
            result = _go_on(resume, scenario)
        else:
            values = {name: context.params[name] for name in _SETTINGS}
            known: dict[str, Any] = {
                name: value for name, value in values.items() if value is not None
            }
            known["start_from"] = None if start_from is None else str(start_from)
            result = _train(
                folder,
                algo or _DEFAULT_ALGORITHM,
                scenario or _DEFAULT_SCENARIO,
                site,
                known,
                changes,
                envs,
            )
    _print_result(result)


def _how_to_resume(folder: Path) -> str:
    """Return the way to resume an interrupted training."""
    from blast_agents.training.run_folder import RunFolder

    if RunFolder(folder).is_run:
        return f"blast-env train --resume {folder} continues the run"
    return "the run had not begun: the same command starts it again"


def _go_on(folder: Path, scenario: str | None) -> "TrainingResult":
    from blast_agents.training import resume

    with progress_bar(f"training {folder}") as progress:
        return resume(folder, scenario, progress)


def _train(
    run: Path,
    algorithm: str,
    scenario: str,
    site: Scenario,
    given: Mapping[str, Any],
    set_to: Sequence[str],
    envs: int | None,
) -> "TrainingResult":
    """Train in a new run folder, with settings and changes other than the defaults.

    Args:
        scenario: Name or path of the scenario, or the name of generated sites.
        site: The scenario, or one of the generated sites.
        given: The settings given as options of their own.
        set_to: The changes given as `key=value`.
        envs: Number of parallel environments, if given.
    """
    from blast_agents.training import load_hyperparameters, train
    from blast_agents.training.hyperparameters import hyperparameter_keys, parse_options
    from blast_agents.training.run_folder import SETTING_KEYS, environment_id, settings_from

    changes = parse_options(set_to, [*hyperparameter_keys(), *SETTING_KEYS])
    if given.get("observation") in _POLICIES:
        changes.setdefault("policy", _POLICIES[given["observation"]])
    values = {"engine": default_engine("train", site), **given}
    values |= {name: changes.pop(name) for name in SETTING_KEYS if name in changes}
    hyperparameters = load_hyperparameters(algorithm, environment_id(scenario), changes, envs)
    fixed = {"steps": hyperparameters.n_timesteps, "algorithm": algorithm, "scenario": scenario}
    settings = settings_from(fixed | values)
    with progress_bar(f"training {run}") as progress:
        return train(settings, hyperparameters, run, progress)


def _print_result(result: "TrainingResult") -> None:
    from blast_agents.training.evaluations import best_of

    folder, last, best = result.folder, result.evaluations[-1], best_of(result.evaluations)
    settings = result.configuration.settings
    blasts = "guesses" if settings.guesses else "blasts"
    scenario = folder.scenario(result.configuration)
    print_line(settings.blast_engine.describe([scenario]))
    if settings.judge.name != settings.blast_engine.name:
        print_line(f"weights chosen by {settings.judge.describe([scenario])}")
    print_line(
        f"{last.timesteps:,} steps, {last.episodes:,} episodes, {last.blasts:,} {blasts} "
        f"in {last.seconds:,.0f} s"
    )
    if best is not None:
        is_one = settings.scenario not in GENERATED and has_few_places(scenario)
        what = "the site's charges" if is_one else "held-out threats"
        reduction, low, high = (
            Number.share(share).text() for share in (best.reduction, best.low, best.high)
        )
        interval = "" if isnan(best.low) else f" (95 % interval {low} to {high})"
        print_line(
            f"best on {what}, after {best.timesteps:,} steps: reduction {reduction}{interval}"
        )
    print_written((folder.best_model, folder.evaluations, folder.learning_curve))
    draw = partial(_proposal, folder, scenario, settings.threat)
    print_written(save_figures((folder.path / LAYOUT_PICTURE, draw)))


def _proposal(folder: "RunFolder", scenario: Scenario, threat: str) -> "Figure":
    """Draw the agent's proposal for the run's scenario, with a charge if known."""
    from blast_agents.training import load_agent

    agent = load_agent(folder.path)
    charge = None if threat == "hidden" else scenario.sample_charge(np.random.default_rng(0))
    shown = scenario.with_charge(charge) if isinstance(charge, Charge) else scenario
    return layout_picture(shown, agent.propose(scenario, charge))
