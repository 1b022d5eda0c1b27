"""Methods of other libraries on the benchmark: each proposes a layout and receives its share.

The libraries are not dependencies: install them with `pip install optuna nevergrad botorch smac`.
MCBO needs a separate environment, with its folder from huawei-noah/HEBO on the path and `pip
install "gpytorch<1.9" "pandas<3" disjoint_set`.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.benchmark import BenchmarkProblem, Method
from blast_env.benchmark.adapters import mcbo_task
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BudgetError
from blast_env.geometry import Layout

_REPEATS: Final = 200
"""Evaluations in a row without a new blast after which a method ends."""

_FIT_EVERY: Final = 5
"""Evaluations between fits of the model's length scales: a fit takes as long as a blast."""

Value = Callable[[FloatArray], float]


def by_keys(search: Callable[[BenchmarkProblem, int, Value], None]) -> Method:
    """Return a method in which a library chooses random keys until the budget is spent."""

    def method(problem: BenchmarkProblem, seed: int) -> Layout:
        repeats = 0

        def value(keys: FloatArray) -> float:
            nonlocal repeats
            before = problem.blasts
            share = problem.evaluate(problem.space.from_keys(keys))
            repeats = repeats + 1 if problem.blasts == before else 0
            if repeats > _REPEATS:
                raise BudgetError("nothing new")
            return share

        with suppress(BudgetError):
            search(problem, seed, value)
        if problem.best is None:
            raise BlastEnvError(f"{problem.name}: the method asked for nothing")
        return problem.best.layout

    return method


def optuna_tpe(problem: BenchmarkProblem, seed: int, value: Value) -> None:
    """Optuna's tree-structured Parzen estimator, all keys together."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed, multivariate=True))
    names = [f"key_{index}" for index in range(problem.space.keys)]
    while True:
        trial = study.ask()
        keys = [trial.suggest_float(name, 0.0, 1.0) for name in names]
        study.tell(trial, value(np.array(keys)))


def nevergrad_ngopt(problem: BenchmarkProblem, seed: int, value: Value) -> None:
    """Nevergrad's NGOpt, which chooses a method by dimension and budget."""
    import nevergrad as ng

    keys = ng.p.Array(shape=(problem.space.keys,), lower=0.0, upper=1.0)
    keys.random_state.seed(seed)
    optimizer = ng.optimizers.NGOpt(parametrization=keys, budget=problem.budget)
    while True:
        asked = optimizer.ask()
        optimizer.tell(asked, value(np.asarray(asked.value)))


def _never_run(config: object, seed: int = 0) -> float:
    """Serve as the target function that SMAC requires; its ask-and-tell interface needs none."""
    raise BlastEnvError(f"{config}, {seed}: nothing is run by SMAC itself")


def smac_forest(problem: BenchmarkProblem, seed: int, value: Value) -> None:
    """SMAC's Bayesian optimisation with a random forest, at its default settings."""
    from ConfigSpace import ConfigurationSpace, Float
    from smac import HyperparameterOptimizationFacade, Scenario
    from smac.runhistory.dataclasses import TrialValue

    names = [f"key_{index:03}" for index in range(problem.space.keys)]
    space = ConfigurationSpace(seed=seed)
    space.add([Float(name, (0.0, 1.0)) for name in names])
    with TemporaryDirectory() as folder:
        settings = Scenario(
            space,
            n_trials=problem.budget,
            deterministic=True,
            seed=seed,
            output_directory=Path(folder),
        )
        smac = HyperparameterOptimizationFacade(settings, _never_run, logging_level=False)
        while True:
            trial = smac.ask()
            keys = np.array([trial.config[name] for name in names])
            smac.tell(trial, TrialValue(cost=value(keys)))


def botorch_turbo(problem: BenchmarkProblem, seed: int, value: Value) -> None:
    """Trust-region Bayesian optimisation (TuRBO) with BoTorch: GP, Thompson sampling."""
    import torch
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from gpytorch.mlls import ExactMarginalLogLikelihood

    torch.manual_seed(seed)
    sobol: Any = torch.quasirandom.SobolEngine(problem.space.keys, scramble=True, seed=seed)  # type: ignore[no-untyped-call]
    first = max(problem.most_blasts // 5, 4)
    places = sobol.draw(first, dtype=torch.float64)
    values = torch.tensor([[value(each.numpy())] for each in places], dtype=torch.float64)
    side, won, lost = 0.8, 0, 0
    fitted: dict[str, Any] = {}
    while True:
        scaled = (values - values.mean()) / values.std().clamp_min(1e-9)
        model = SingleTaskGP(places, -scaled)
        if len(places) % _FIT_EVERY == 0 or not fitted:
            fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
            fitted = model.state_dict()
        model.load_state_dict(fitted)
        centre = places[values.argmin()]
        lengths = model.covar_module.lengthscale.detach().reshape(-1)
        weights = lengths / lengths.log().mean().exp()
        low = (centre - 0.5 * side * weights).clamp(0.0, 1.0)
        high = (centre + 0.5 * side * weights).clamp(0.0, 1.0)
        drawn = low + (high - low) * sobol.draw(400, dtype=torch.float64)
        moved = torch.rand(drawn.shape, dtype=torch.float64) < min(1.0, 20.0 / drawn.shape[1])
        drawn = torch.where(moved, drawn, centre)
        with torch.no_grad():
            sample = model.posterior(drawn).sample().reshape(-1)
        chosen = drawn[sample.argmax()]
        found = value(chosen.numpy())
        better = found < float(values.min()) - 1e-3 * abs(float(values.min()))
        won, lost = (won + 1, 0) if better else (0, lost + 1)
        if won == 3:
            side, won = min(2.0 * side, 1.6), 0
        if lost == max(4, problem.space.keys // 4):
            side, lost = 0.5 * side, 0
        if side < 0.5**7:
            side = 0.8
        places = torch.cat([places, chosen[None]])
        values = torch.cat([values, torch.tensor([[found]], dtype=torch.float64)])


def mcbo_casmopolitan(problem: BenchmarkProblem, seed: int, value: Value) -> None:
    """MCBO's Casmopolitan, in a trust region: items are nominal, places are integers."""
    from mcbo.optimizers.bo_builder import BO_ALGOS
    from mcbo.utils.general_utils import set_random_seed

    set_random_seed(seed)
    task = mcbo_task(problem)
    first = max(problem.most_blasts // 5, 4)
    bo = BO_ALGOS["Casmopolitan"].build_bo(task.get_search_space(), n_init=first)
    while True:
        asked = bo.suggest(1)
        bo.observe(asked, np.array([[value(task.keys(asked.iloc[0]))]]))


_SEARCHES: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "optuna_tpe": optuna_tpe,
        "nevergrad_ngopt": nevergrad_ngopt,
        "smac_forest": smac_forest,
        "botorch_turbo": botorch_turbo,
        "mcbo_casmopolitan": mcbo_casmopolitan,
    }
)

OUTSIDE: Final[Mapping[str, Method]] = MappingProxyType(
    {name: by_keys(search) for name, search in _SEARCHES.items()}
)
"""Methods of other libraries, by name."""
