"""`blast-env train`: an agent that proposes layouts."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.cli.command import FOLDER, option, options_of
from blast_env.cli.options import (
    BY_SITE,
    CELL_HELP,
    CELLS_HELP,
    ENGINE_HELP,
    ClusterOptions,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    print_line,
    print_written,
    progress_bar,
    save_layout_picture,
)
from blast_env.envs.strategies import scenario_source
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation.engines import default_engine
from blast_env.site import Scenario
from blast_env.site.scene import Charge

if TYPE_CHECKING:
    from blast_agents.training.run_folder import RunFolder
    from blast_agents.training.train import TrainingResult

_DEFAULT_ALGORITHM: Final = "maskable_ppo"
_POLICIES: Final = {"features": "MlpPolicy", "image": "CnnPolicy"}
"""Policies of the observations other than planes, for which the YAML files hold policies."""
_DEFAULT_SCENARIO: Final = "courtyard"
_WITH_RESUME: Final = ("resume", "scenario", "cluster")
"""Options allowed with `--resume`; the run folder fixes the others."""


@dataclass(frozen=True, kw_only=True)
class TrainCommand(ClusterOptions):
    """Train an agent that proposes layouts, or resume an interrupted training."""

    algo: str | None = option(
        None, "ppo, maskable_ppo or self_labelling.", show_default=_DEFAULT_ALGORITHM
    )
    scenario: str | None = option(
        None,
        "Bundled name, a scenario file, or 'sites' for generated ones.",
        show_default=_DEFAULT_SCENARIO,
    )
    steps: int | None = option(
        None,
        "Steps: one module each (self_labelling: one threat and its layout each); else as in the "
        "YAML file.",
        min=1,
    )
    seed: int | None = option(None, "Decides everything.", min=0, show_default="0")
    envs: int | None = option(
        None,
        "Parallel environments (self_labelling: worker processes); else as in the YAML file.",
        min=1,
    )
    run: Path | None = option(None, "Folder for the run; new or empty.", writes=FOLDER)
    threat: str | None = option(
        None, "visible or hidden: whether the agent sees the charge.", show_default="visible"
    )
    engine: str | None = option(
        None, f"{ENGINE_HELP} surrogate guesses them.", show_default=BY_SITE
    )
    cell_m: float | None = option(None, CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default="uniform")
    observation: str | None = option(
        None,
        "Observation: grid, grid_with_load, image (with a CnnPolicy), or features (with an "
        "MlpPolicy).",
        show_default="grid",
    )
    changes: tuple[str, ...] = option(
        (), "key=value, e.g. ent_coef=0.01; may be given again.", flag="--set"
    )
    start_from: Path | None = option(
        None, "Run folder with the initial weights (its best), for a scenario of this size."
    )
    resume: Path | None = option(
        None, "Resume the run of this folder; no other option but --cluster."
    )

    def how_to_resume(self) -> str:
        """Return the way to resume an interrupted training."""
        folder = self.resume or self.run
        if folder is None:
            return ""
        # Here, because torch takes seconds to start, and is an extra.
        from blast_agents.training.run_folder import RunFolder

        if RunFolder(folder).is_run:
            return f"blast-env train --resume {folder} continues the run"
        return "the run had not begun: the same command starts it again"

    def __call__(self) -> None:
        """Train, and print the result."""
        with running_on(self.cluster):
            if self.resume is not None:
                result = self._go_on(self.resume)
            elif self.run is None:
                raise BlastEnvError("--run is missing: the folder for the run (or --resume)")
            else:
                result = self._train(self.run)
        _print_result(result)

    def _go_on(self, folder: Path) -> "TrainingResult":
        # Here, because torch takes seconds to start, and is an extra.
        with import_extra("agents,render", "training"):
            from blast_agents.training import resume

        for each in options_of(type(self)):
            if each.name not in _WITH_RESUME and getattr(self, each.name) != each.default:
                raise BlastEnvError(
                    f"{each.flag} cannot be changed with --resume: the run folder fixes it"
                )
        with progress_bar(f"training {folder}") as progress:
            return resume(folder, self.scenario, progress)

    def _train(self, run: Path) -> "TrainingResult":
        # Here, because torch takes seconds to start, and is an extra.
        with import_extra("agents,render", "training"):
            from blast_agents.training import load_hyperparameters, train
            from blast_agents.training.environments import environment_id
            from blast_agents.training.hyperparameters import hyperparameter_keys, parse_options
            from blast_agents.training.run_folder import SETTING_KEYS, settings_from

        algorithm = self.algo or _DEFAULT_ALGORITHM
        scenario = self.scenario or _DEFAULT_SCENARIO
        changes = parse_options(self.changes, [*hyperparameter_keys(algorithm), *SETTING_KEYS])
        if self.observation in _POLICIES:
            changes.setdefault("policy", _POLICIES[self.observation])
        names = ("steps", "seed", "threat", "engine", "observation", "cell_m", "cells")
        given = {name: getattr(self, name) for name in names}
        values = {name: value for name, value in given.items() if value is not None}
        site = scenario_source(scenario).representative
        values.setdefault("engine", default_engine(site, particles="event"))
        values["start_from"] = None if self.start_from is None else str(self.start_from)
        values |= {name: changes.pop(name) for name in SETTING_KEYS if name in changes}
        hyperparameters = load_hyperparameters(
            algorithm, environment_id(scenario), changes, self.envs
        )
        fixed = {"steps": hyperparameters.n_timesteps, "algorithm": algorithm, "scenario": scenario}
        settings = settings_from(fixed | values)
        with progress_bar(f"training {run}") as progress:
            return train(settings, hyperparameters, run, progress)


def _print_result(result: "TrainingResult") -> None:
    counters, folder = result.progress.counters, result.folder
    settings = result.configuration.settings
    blasts = "guesses" if settings.guesses else "blasts"
    scenario = folder.scenario(result.configuration)
    print_line(settings.blast_engine.describe([scenario]))
    if settings.judge.name != settings.blast_engine.name:
        print_line(f"weights chosen by {settings.judge.describe([scenario])}")
    print_line(
        f"{counters.steps:,} steps, {counters.episodes:,} episodes, {counters.blasts:,} {blasts} "
        f"in {counters.seconds:,.0f} s"
    )
    for row in result.progress.evaluations:
        if row.steps == counters.best_steps:
            print_line(
                f"best on held-out threats, after {row.steps:,} steps: reduction "
                f"{row.reduction:.1%} (95 % interval {row.low:.1%} to {row.high:.1%})"
            )
    print_written((folder.checkpoint, folder.evaluations, folder.learning_curve))
    print_line(f"wrote {_draw_proposal(folder, scenario, settings.threat)}")


def _draw_proposal(folder: "RunFolder", scenario: Scenario, threat: str) -> Path:
    """Draw the agent's proposal for the run's scenario, with a charge if known; return the file."""
    from blast_agents.training import load_agent, newest_weights

    agent = load_agent(folder.path, newest_weights(folder.path))
    charge = None if threat == "hidden" else scenario.sample_charge(np.random.default_rng(0))
    shown = scenario.with_charge(charge) if isinstance(charge, Charge) else scenario
    return save_layout_picture(shown, agent.propose(scenario, charge), folder.path / LAYOUT_PICTURE)
