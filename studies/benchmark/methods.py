"""Methods of the standings that are not of the package: other libraries, and trained agents.

`blast-env judge --method studies.benchmark.methods:NAME` plays one. Optuna and BoTorch are not
dependencies: `pip install optuna botorch`. The agents train on guesses of the packaged surrogate
alone, for the site and charges of the problem; the budget pays for layouts of the trained policy.
Without one they propose the draw with the best guess.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO

from blast_env.arrays import FloatArray
from blast_env.benchmark import BenchmarkProblem, Definition, make
from blast_env.benchmark.methods import method_of
from blast_env.design.search.by_rule import rule_layouts
from blast_env.design.search.learnt import Guesses, improved, packaged_search
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.evaluation import LoadCaseSet
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, AnySource, Scenario
from blast_env.site.sources import source_of
from blast_env.surrogate import SurrogateEngine, packaged_surrogate
from blast_env.values import generator
from studies.benchmark.family import SuggestionView, trained

_FIT_EVERY: Final = 5
"""Evaluations between fits of the model's length scales: a fit takes as long as a blast."""

_STEPS: Final = 4096
"""Steps of the environment in a training."""

_DRAWS: Final = 200
"""Layouts drawn from a trained policy."""

_FAMILY_DRAWS: Final = 64
"""The same from a policy for all sites: as many as of the packaged agent."""

_GUESSED: Final = 1000
"""Layouts of the search by guesses whose best ones are imitated."""

_IMITATED: Final = 32
_ORDERS: Final = 4
"""Random orders in which each of them is placed."""

_EPOCHS: Final = 30
_BATCH: Final = 64


def _share(problem: BenchmarkProblem, keys: FloatArray) -> float:
    return problem.evaluate(problem.space.from_keys(keys))


def optuna_tpe(problem: BenchmarkProblem, seed: int) -> Layout:
    """Optuna's tree-structured Parzen estimator, all keys together."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed, multivariate=True))
    names = [f"key_{index}" for index in range(problem.space.keys)]
    while True:
        trial = study.ask()
        keys = [trial.suggest_float(name, 0.0, 1.0) for name in names]
        study.tell(trial, _share(problem, np.array(keys)))


def botorch_turbo(problem: BenchmarkProblem, seed: int) -> Layout:
    """Trust-region Bayesian optimisation (TuRBO) with BoTorch: GP, Thompson sampling."""
    import torch
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from gpytorch.mlls import ExactMarginalLogLikelihood

    torch.manual_seed(seed)
    sobol: Any = torch.quasirandom.SobolEngine(problem.space.keys, scramble=True, seed=seed)  # type: ignore[no-untyped-call]
    first = max(problem.most_blasts // 5, 4)
    places = sobol.draw(first, dtype=torch.float64)
    values = torch.tensor(
        [[_share(problem, place.numpy())] for place in places], dtype=torch.float64
    )
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
        found = _share(problem, chosen.numpy())
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


def surrogate_alone(problem: BenchmarkProblem, seed: int) -> Layout:
    """The search `surrogate` without layouts of the packaged agent."""
    return method_of(packaged_search())(problem, seed)


def ppo(problem: BenchmarkProblem, seed: int) -> Layout:
    """PPO of Stable-Baselines3; its action is a row across the line of sight."""
    return _best_of(problem, _of_ppo(problem.definition, seed))


def maskable_ppo(problem: BenchmarkProblem, seed: int) -> Layout:
    """MaskablePPO of sb3-contrib, with the same actions."""
    env = _environment(problem, "row")
    return _of_masked(problem, env, MaskablePPO("MlpPolicy", env, seed=seed, **_SETTINGS), _STEPS)


def imitation(problem: BenchmarkProblem, seed: int) -> Layout:
    """A policy that learns to place the best layouts of a search by guesses, piece by piece."""
    return _best_of(problem, _of_imitation(problem.definition, seed))


def imitation_unranked(problem: BenchmarkProblem, seed: int) -> Layout:
    """The same, with blasts of the first draws instead of the best guesses among 200."""
    env, model = _imitating(problem, seed)
    return _best_of(problem, _draws(env, _masked(env, model), problem.most_blasts))


def imitation_then_ppo(problem: BenchmarkProblem, seed: int) -> Layout:
    """Imitation, then MaskablePPO on guesses."""
    env, model = _imitating(problem, seed)
    return _of_masked(problem, env, model, _STEPS)


def untrained(problem: BenchmarkProblem, seed: int) -> Layout:
    """Ranked draws of an untrained policy: imitation without its demonstrations."""
    env = _environment(problem, "place")
    return _of_masked(problem, env, MaskablePPO("MlpPolicy", env, seed=seed, **_SETTINGS), 0)


def family_ppo(problem: BenchmarkProblem, seed: int) -> Layout:
    """MaskablePPO trained once for all sites, on what rules suggest; see `family`."""
    site = SuggestionView(_environment(problem, "suggestion"))
    return _best_of(problem, _ranked(_draws(site, _masked(site, trained(seed)), _FAMILY_DRAWS)))


@lru_cache(maxsize=128)
def _of_ppo(definition: Definition, seed: int) -> tuple["Guessed", ...]:
    """Return the ranked draws of PPO: one training, whatever the budget."""
    env = _environment(make(definition, 0), "row")
    model = PPO("MlpPolicy", env, seed=seed, **_SETTINGS).learn(_STEPS)
    draws = _draws(env, lambda seen, steady: model.predict(seen, None, None, steady), _DRAWS)
    return tuple(_ranked(draws))


@lru_cache(maxsize=128)
def _of_imitation(definition: Definition, seed: int) -> tuple["Guessed", ...]:
    """Return the ranked draws of imitation: one training, whatever the budget."""
    env, model = _imitating(make(definition, 0), seed)
    return tuple(_ranked(_draws(env, _masked(env, model), _DRAWS)))


def _imitating(problem: BenchmarkProblem, seed: int) -> tuple[BlastBarrierEnv, MaskablePPO]:
    torch.manual_seed(seed)
    env, rng = _environment(problem, "place"), generator(seed)
    guesses = Guesses.of(packaged_surrogate(), problem.case)
    best = improved(guesses, [(), *rule_layouts(problem)], _GUESSED, rng)[:_IMITATED]
    model = MaskablePPO("MlpPolicy", env, seed=seed, **_SETTINGS)
    seen, masks, actions = _demonstrated(env, best * _ORDERS, rng)
    optimiser = torch.optim.Adam(model.policy.parameters(), 1e-3)
    for _ in range(_EPOCHS * len(seen) // _BATCH):
        batch = rng.integers(len(seen), size=_BATCH)
        given, taken = torch.as_tensor(seen[batch]), torch.as_tensor(actions[batch])
        _, log_likelihood, _ = model.policy.evaluate_actions(given, taken, masks[batch])
        optimiser.zero_grad()
        loss: torch.Tensor = -log_likelihood.mean()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    return env, model


_SETTINGS: Final[dict[str, Any]] = {
    "learning_rate": 1e-3,
    "n_steps": 512,
    "gamma": 1.0,
    "ent_coef": 0.01,
    "device": "cpu",
}

Predict = Callable[[Any, bool], tuple[Any, Any]]


@dataclass(frozen=True)
class _OfCase:
    """The charges of a case; a `ThreatModel`."""

    case: LoadCaseSet

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:  # noqa: ARG002
        return tuple(self.case.charges)

    def shown(self, scenario: Scenario, charges: tuple[AnyCharge, ...]) -> tuple[AnySource, ...]:
        return (source_of(charges[0]),) if len(charges) == 1 else scenario.charge


def _environment(problem: BenchmarkProblem, action: str) -> BlastBarrierEnv:
    """Return the environment of a problem, on the surrogate's guesses."""
    torch.set_num_threads(1)
    return BlastBarrierEnv(
        problem.scenario,
        reward="relative",
        observation="features",
        action=action,
        threat=_OfCase(problem.case),
        realisations=1,
        engine=SurrogateEngine(),
    )


def _of_masked(
    problem: BenchmarkProblem, env: BlastBarrierEnv, model: MaskablePPO, steps: int
) -> Layout:
    if steps:
        model.learn(steps)
    return _best_of(problem, _ranked(_draws(env, _masked(env, model), _DRAWS)))


def _masked(env: BlastBarrierEnv | SuggestionView, model: MaskablePPO) -> Predict:
    return lambda seen, steady: model.predict(
        seen, deterministic=steady, action_masks=env.action_masks()
    )


Guessed = tuple[Layout, float]
"""A layout and the share of the load that it takes off by the surrogate's guess."""


def _draws(env: BlastBarrierEnv | SuggestionView, predict: Predict, number: int) -> list[Guessed]:
    """Return the policy's proposal, then random draws."""
    site = env.site if isinstance(env, SuggestionView) else env

    def drawn(*, steady: bool) -> Guessed:
        seen, _ = env.reset(seed=0)
        ended = False
        while not ended:
            action, _ = predict(seen, steady)
            seen, _, ended, _, info = env.step(np.int64(action))
        return tuple(sorted(site.placement.layout)), info["reduction"]

    return [drawn(steady=index == 0) for index in range(number + 1)]


def _ranked(draws: Sequence[Guessed]) -> list[Guessed]:
    """Return the proposal, then the draws, the best guess first."""
    return [draws[0], *sorted(draws[1:], key=lambda draw: -draw[1])]


def _best_of(problem: BenchmarkProblem, draws: Sequence[Guessed]) -> Layout:
    """Blast layouts until the budget ends; return the best. Without a budget, the best guess."""
    if not problem.most_blasts:
        return max(draws, key=lambda draw: draw[1])[0]
    for layout in dict.fromkeys(layout for layout, _ in draws):
        problem.evaluate(layout)
    assert problem.best is not None
    return problem.best.layout


def _demonstrated(
    env: BlastBarrierEnv, layouts: Sequence[Layout], rng: np.random.Generator
) -> tuple[Any, Any, Any]:
    """Return observations, masks and actions of the placement of layouts in random order."""
    steps = []
    for layout in layouts:
        seen, _ = env.reset(seed=0)
        ended = False
        for index in (*rng.permutation(len(layout)).tolist(), None):
            if ended:
                break
            catalogue = env.placement.catalogue
            action = catalogue.finish if index is None else catalogue.action(layout[index])
            steps.append((seen, env.action_masks(), action))
            seen, _, ended, _, _ = env.step(np.int64(action))
    seen_all, masks, actions = map(np.array, zip(*steps, strict=True))
    return seen_all, masks, actions
