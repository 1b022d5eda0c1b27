"""The training of the packaged agent: it imitates good layouts, then learns from its own draws.

`studies.packaged_agent` has the commands.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from blast_agents.packaged import CandidateNetwork, Decision, PackagedAgent, Weights
from blast_agents.policies.candidates import CHANGING, STATIC, Candidates, CandidateState
from numpy.typing import NDArray
from torch import Tensor

from blast_env.answers.terminal import print_line
from blast_env.design.search.learnt import Guesses, case_for
from blast_env.evaluation import draw_threats
from blast_env.geometry import Layout, Piece
from blast_env.layout import LayoutState
from blast_env.site import AnyCharge, Scenario
from blast_env.surrogate import Surrogate
from studies.site_names import scenario_of

PARTS: Final = 20
"""Decisions of each case that the policy imitates."""

TEMPERATURE: Final = 0.01
"""Difference of two shares of the load by which a layout is 2.7 times likelier to be imitated."""

SEEN: Final = 256
"""Candidates of a decision that the training looks at: the wanted ones, and others at random."""

EPOCHS: Final = 15
BATCH: Final = 64
RATE: Final = 3e-3

VISITS: Final = 1_000
"""Cases on which it learns from its own draws."""

DRAWN: Final = 16
"""Layouts that the policy draws on a case when it learns from its own ones."""

BEST_DRAWN: Final = 4
"""The best of these, which become likelier."""

CASES_A_STEP: Final = 4
"""Cases whose draws change the policy at once."""

REINFORCED_RATE: Final = 2e-3
"""Rate of learning from own draws."""

LEAST_SPREAD: Final = 0.02
"""Least standard deviation of the shares of draws that counts."""

LIKELY: Final = 96
"""Candidates of a decision that count as they are: the chosen and the likeliest ones."""

OTHERS: Final = 32
"""Candidates that stand for all others."""


@dataclass(frozen=True, eq=False)
class Examples:
    """Decisions to imitate: candidates after a random part of a good layout.

    Attributes:
        inputs: Features of candidates, static ones first (examples, seen, features).
        wanted: Share of the target on each, and on finishing (examples, seen + 1).
        log_weight: Logarithm of the number of candidates that each stands for; -inf for none
            (examples, seen).
        whole: Features of site and layout (examples, features).
    """

    inputs: NDArray[np.float16]
    wanted: NDArray[np.float32]
    log_weight: NDArray[np.float32]
    whole: NDArray[np.float32]

    @classmethod
    def of(cls, cases: Sequence[Mapping[str, Any]], seed: int, parts: int = PARTS) -> "Examples":
        """Return the decisions on the way to the layouts of some cases.

        A layout has no order: after any part of it, all remaining pieces are equally good next
        ones, as in `blast_agents.training.imitation`. Only posts against vehicles come first.

        Args:
            cases: The cases, as `best_by_guesses` has them.
            seed: Seed of the draws.
            parts: Decisions of each case.
        """
        rng = np.random.default_rng(seed)
        found: list[tuple[NDArray[Any], ...]] = []
        for case in cases:
            found += _decisions(case, rng, parts)
        return cls(*(np.stack(part) for part in zip(*found, strict=True)))


def layouts_of(case: Mapping[str, Any]) -> list[Layout]:
    """Return the layouts of a case, the best first."""
    return [
        tuple(Piece(*element) if len(element) == 4 else (element[0], element[1]) for element in own)
        for own in case["layouts"]
    ]


def charge_of(scenario: Scenario, known: bool) -> AnyCharge | None:
    """Return the first charge of training, if it is known."""
    return draw_threats(scenario, [0])[0].charge if known else None


def _decisions(
    case: Mapping[str, Any], rng: np.random.Generator, parts: int
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield the arrays of an example for random parts of a case's layouts."""
    scenario = scenario_of(case["site"])
    candidates = Candidates.of(scenario, charge_of(scenario, case["known"]))
    catalogue = candidates.empty.catalogue
    index_of = {number: index for index, number in enumerate(candidates.numbers.tolist())}
    numbers = [[*map(catalogue.action, catalogue.layout_from(own))] for own in layouts_of(case)]
    are_legal = np.array([all(number in index_of for number in own) for own in numbers])
    if not are_legal.all():
        print_line(f"{case['site']}: {sum(~are_legal)} of {len(numbers)} layouts are not legal")
        return
    layouts = [[index_of[number] for number in own] for own in numbers]
    likely = np.exp((np.array(case["shares"]) - max(case["shares"])) / TEMPERATURE)
    likely /= likely.sum()
    is_post = candidates.is_post
    for _ in range(parts):
        layout = layouts[int(rng.choice(len(layouts), p=likely))]
        # Posts come first: where a wall has taken their share of the budget, a way stays open.
        order = sorted(rng.permutation(layout).tolist(), key=lambda own: not is_post[own])
        count = int(rng.integers(len(layout) + 1))
        state, rest = CandidateState(candidates), order[count:]
        first = [own for own in rest if is_post[own]] or rest
        wanted = np.array(first, dtype=np.int64)
        for index in order[:count]:
            state.add(index)
        standing = [catalogue.element(int(candidates.numbers[index])) for index in order[:count]]
        placement = LayoutState(scenario, tuple(standing))
        if placement.is_full:
            continue
        is_legal = placement.legal.ravel()[candidates.numbers]
        legal = np.flatnonzero(is_legal)
        changing = state.features(legal)
        whole = state.whole(legal, changing, placement.stock_left)
        others = np.setdiff1d(legal, wanted)
        shown = min(len(others), SEEN - len(wanted))
        drawn = rng.choice(others, shown, replace=False)
        chosen = np.concatenate((wanted, drawn)).astype(np.int64)
        inputs = np.zeros((SEEN, len(STATIC) + len(CHANGING)), dtype=np.float16)
        inputs[: len(chosen), : len(STATIC)] = candidates.static[chosen]
        inputs[: len(chosen), len(STATIC) :] = changing[np.searchsorted(legal, chosen)]
        targets = np.zeros(SEEN + 1, dtype=np.float32)
        targets[: len(wanted)] = 1.0 / max(len(wanted), 1)
        targets[SEEN] = len(wanted) == 0
        log_weight = np.full(SEEN, -np.inf, dtype=np.float32)
        log_weight[: len(wanted)] = 0.0
        log_weight[len(wanted) : len(chosen)] = np.log(len(others) / max(shown, 1))
        yield inputs, targets, log_weight, whole


def fitted(examples: Examples, width: int, seed: int, epochs: int = EPOCHS) -> Weights:
    """Return the weights that imitate examples: the cross-entropy to the wanted candidates."""
    torch.manual_seed(seed)
    weights = {
        name: torch.randn(shape) * (1.0 / np.sqrt(shape[0]) if len(shape) > 1 else 0.1)
        if not name.endswith("bias")
        else torch.zeros(shape)
        for name, shape in CandidateNetwork.shapes(width).items()
    }
    for values in weights.values():
        values.requires_grad_()
    count = len(examples.whole)
    updates = epochs * (count // BATCH)
    optimiser = torch.optim.Adam(weights.values(), lr=RATE)
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, updates)
    inputs, wanted, log_weight, whole = (
        torch.as_tensor(part)
        for part in (examples.inputs, examples.wanted, examples.log_weight, examples.whole)
    )
    drawn = torch.Generator().manual_seed(seed)
    for _ in range(epochs):
        order = torch.randperm(count, generator=drawn)
        for start in range(0, count // BATCH * BATCH, BATCH):
            own = order[start : start + BATCH]
            logits = _logits(weights, inputs[own].float(), log_weight[own], whole[own])
            likely = logits.log_softmax(dim=1).clamp(min=-50.0)
            loss = -(likely * wanted[own]).sum(dim=1).mean()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            rate.step()
    return {name: values.detach().numpy() for name, values in weights.items()}


def _logits(
    weights: Mapping[str, Tensor], inputs: Tensor, log_weight: Tensor, whole: Tensor
) -> Tensor:
    """Return the scores of `CandidateNetwork`, with the candidates that each stands for."""
    joined = torch.cat((weights["static"], weights["changing"]))
    first = inputs @ joined + (whole @ weights["whole"] + weights["first_bias"])[:, None]
    second = torch.relu(torch.relu(first) @ weights["second"] + weights["second_bias"])
    hidden = torch.relu(whole @ weights["finish_first"] + weights["finish_first_bias"])
    finish = hidden @ weights["finish"] + weights["finish_bias"]
    return torch.cat((second @ weights["score"] + log_weight, finish[:, None]), dim=1)


def reinforced(
    weights: Weights, cases: Sequence[tuple[str, bool]], surrogate: Surrogate, seed: int
) -> Weights:
    """Return weights that have learnt from guesses of their own draws on some cases.

    1. On each case the policy draws layouts. What the best few take off more than the next one,
       in standard deviations of all, is their advantage. The others have none: to lower them makes
       the draws alike, and then the best of many is worse.
    2. After a few cases, the choices of draws become likelier by that.

    Args:
        weights: The weights to begin with.
        cases: Name of the site of each case, and whether its charge is known.
        surrogate: The surrogate.
        seed: Seed of all draws.
    """
    own = {name: torch.tensor(values, requires_grad=True) for name, values in weights.items()}
    rng = np.random.default_rng(seed)
    optimiser = torch.optim.Adam(own.values(), lr=REINFORCED_RATE)
    steps = -(-len(cases) // CASES_A_STEP)
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for numbers in np.array_split(rng.permutation(len(cases)), steps):
        arrays = {name: values.detach().numpy() for name, values in own.items()}
        agent = PackagedAgent(CandidateNetwork(arrays))
        drawn = [
            decision
            for number in numbers.tolist()
            for decision in _with_advantages(agent, cases[number], surrogate, rng)
        ]
        inputs, wanted, log_weight, whole = (
            torch.as_tensor(np.stack(column)) for column in zip(*drawn, strict=True)
        )
        logits = _logits(own, inputs.float(), log_weight, whole)
        likely = logits.log_softmax(dim=1).clamp(min=-50.0)
        loss = -(likely * wanted).sum() / (DRAWN * len(numbers))
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(own.values(), 1.0)
        optimiser.step()
        rate.step()
    return {name: values.detach().numpy() for name, values in own.items()}


def _with_advantages(
    agent: PackagedAgent, case: tuple[str, bool], surrogate: Surrogate, rng: np.random.Generator
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield the decisions of draws on a case, with the advantages of the choices."""
    scenario = scenario_of(case[0])
    charge = charge_of(scenario, case[1])
    candidates = Candidates.of(scenario, charge)
    decisions: list[Decision] = []
    drawn = agent.layouts(candidates, DRAWN, rng, tell=decisions.append)
    guesses = Guesses.of(surrogate, case_for(scenario, charge))
    loads = guesses.loads([tuple(sorted(layout)) for layout in drawn])
    shares = 1.0 - loads / max(guesses.loads([()]).item(), 1e-9)
    least = float(np.sort(shares)[-BEST_DRAWN - 1])
    ahead = np.maximum(shares - least, 0.0) / max(float(shares.std()), LEAST_SPREAD)
    advantages = ahead * (DRAWN / (2.0 * BEST_DRAWN))
    for decision in decisions:
        yield _chosen_among(candidates, decision, advantages, rng)


def _chosen_among(
    candidates: Candidates,
    decision: Decision,
    advantages: NDArray[np.float64],
    rng: np.random.Generator,
) -> tuple[NDArray[Any], ...]:
    """Return the arrays of a decision: chosen and likely candidates, and some of the others."""
    legal = decision.legal
    count = len(legal)
    wanted = np.zeros(count + 1)
    np.add.at(wanted, decision.choices, advantages[list(decision.indices)])
    scores = decision.scores[:count].copy()
    scores[[choice for choice in decision.choices if choice < count]] = np.inf
    # The chosen and likely ones count as they are, further ones for all others.
    split = min(count, LIKELY)
    order = np.argpartition(-scores, split - 1) if 0 < split < count else np.arange(count)
    others = order[split:]
    further = rng.choice(others, min(len(others), OTHERS), replace=False)
    seen = np.concatenate((order[:split], further)).astype(np.int64)
    inputs = np.zeros((LIKELY + OTHERS, len(STATIC) + len(CHANGING)), dtype=np.float16)
    inputs[: len(seen), : len(STATIC)] = candidates.static[legal[seen]]
    inputs[: len(seen), len(STATIC) :] = decision.changing[seen]
    log_weight = np.full(LIKELY + OTHERS, -np.inf, dtype=np.float32)
    log_weight[:split] = 0.0
    log_weight[split : len(seen)] = np.log(max(len(others), 1) / max(len(further), 1))
    targets = np.zeros(LIKELY + OTHERS + 1, dtype=np.float32)
    targets[: len(seen)] = wanted[seen]
    targets[-1] = wanted[count]
    return inputs, targets, log_weight, decision.whole
