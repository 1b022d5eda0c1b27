"""The packaged agent: one policy that places pieces on any site, without a blast.

It was trained on generated sites, and looks at candidate places by their relations to charge,
walls and pieces (`policies.candidates`). What it proposes is the best guess of the surrogate among
its layouts and those of the rules. `python -m studies.packaged_agent` trains and judges it. It
does without torch.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from blast_agents.policies.candidates import CHANGING, STATIC, WHOLE, Candidates, CandidateState
from blast_env.arrays import FloatArray, IntArray
from blast_env.design.search.learnt import Guesses, SurrogateSearch, case_for, improved
from blast_env.design.search.package import proposed
from blast_env.design.search.problem import Progress, Report, SearchResult
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem
from blast_env.files import read_regular, write_atomically
from blast_env.geometry import Layout
from blast_env.layout import LayoutState, kept_clear
from blast_env.layout.batch import LayoutBatch
from blast_env.rules import layouts_by_rule
from blast_env.site import AnyCharge, AnyScenario, find_scenario
from blast_env.surrogate import Surrogate, packaged_surrogate
from blast_env.values import generator, whole_number

Weights = Mapping[str, NDArray[np.float32]]
"""Arrays by name."""

WEIGHTS: Final = "packaged_agent.safetensors"
"""Name of the file of the weights, in this package."""

FEW_DRAWS: Final = 3
"""Layouts that the agent draws for one proposal."""

FEW_CHANGES: Final = 100
"""Changes of the best guesses that one proposal looks at after that."""

DRAWS: Final = 32
"""Layouts that the agent draws where guesses choose among them."""

CHANGES: Final = 2000
"""Changes of the best guesses that are looked at after that."""

SURE_GAIN: Final = 0.01
"""Least share of the load without a barrier that a layout promises beyond the rules' ones."""

MOST_DRAWS: Final = 10_000
"""Largest number of layouts of one call."""

_FEW_CANDIDATES: Final = 1_500
"""With more of them, one proposal looks at fewer draws and changes, in inverse proportion."""

_MOST_BYTES: Final = 5_000_000


def write_weights(weights: Weights, about: Mapping[str, str], path: Path) -> None:
    """Write weights as a file of safetensors, whole or not at all.

    Args:
        weights: The arrays, which are written in single precision.
        about: Text that goes with them.
        path: The file.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    # safetensors writes transposed arrays as they lie in memory, without an error.
    arrays = {name: np.ascontiguousarray(own, np.float32) for name, own in weights.items()}
    with write_atomically(path) as temporary:
        temporary.write_bytes(save(arrays, dict(about)))


def read_weights(content: bytes, place: str) -> Weights:
    """Return the arrays of a file of safetensors, which can run no code.

    Args:
        content: The bytes of the file.
        place: Name of the file, for the error.

    Raises:
        BlastEnvError: If it is damaged, or has arrays that are not finite or of another type.
    """
    try:
        found = load(content)
    except SafetensorError as error:
        raise BlastEnvError(f"{place}: is damaged, or no file of safetensors: {error}") from error
    for name, values in found.items():
        if values.dtype != np.float32 or not np.isfinite(values).all():
            raise BlastEnvError(
                f"{place}: {name} has values of {values.dtype}, must have finite ones of float32"
            )
    return found


@dataclass(frozen=True, eq=False)
class CandidateNetwork:
    """Scores of candidates and of finishing, by two small networks without a size of the site.

    Attributes:
        weights: Its arrays by name; `shapes` has their shapes.
    """

    weights: Weights

    @staticmethod
    def shapes(width: int) -> dict[str, tuple[int, ...]]:
        """Return the shape of each array, for a width of the hidden layers."""
        return {
            "static": (len(STATIC), width),
            "changing": (len(CHANGING), width),
            "whole": (len(WHOLE), width),
            "first_bias": (width,),
            "second": (width, width),
            "second_bias": (width,),
            "score": (width,),
            "finish_first": (len(WHOLE), width),
            "finish_first_bias": (width,),
            "finish": (width,),
            "finish_bias": (1,),
        }

    @classmethod
    def of(cls, weights: Weights, place: str) -> "CandidateNetwork":
        """Return a network of arrays from a file.

        Raises:
            BlastEnvError: If arrays are missing or have other shapes.
        """
        width = len(weights.get("score", ()))
        shapes = {name: values.shape for name, values in weights.items()}
        if shapes != cls.shapes(width):
            raise BlastEnvError(
                f"{place}: has arrays of the shapes {shapes}, must have {cls.shapes(width)}"
            )
        return cls(weights)

    def prepared(self, static: FloatArray) -> FloatArray:
        """Return the part of the first layer that does not change (candidates, width)."""
        found: FloatArray = static @ self.weights["static"] + self.weights["first_bias"]
        return found

    def scores(
        self, prepared: FloatArray, legal: IntArray, changing: FloatArray, whole: FloatArray
    ) -> FloatArray:
        """Return the score of each legal candidate and, last, of finishing (legal + 1,).

        Args:
            prepared: The part of the first layer of all candidates, as by `prepared`.
            legal: The candidates that are legal (legal,).
            changing: Their changing features.
            whole: Features of site and layout.
        """
        from blast_agents.policies.candidate_kernels import rectify  # Numba takes long to import

        own = self.weights
        first = changing @ own["changing"]
        rectify(first, prepared, legal, whole @ own["whole"])
        second = first @ own["second"]
        second += own["second_bias"]
        np.maximum(second, 0.0, out=second)
        finish = np.maximum(whole @ own["finish_first"] + own["finish_first_bias"], 0.0)
        return np.append(second @ own["score"], finish @ own["finish"] + own["finish_bias"])


class Decision(NamedTuple):
    """What layouts with the same pieces go on with.

    Attributes:
        legal: The candidates that are legal (legal,).
        changing: Their changing features (legal, CHANGING).
        whole: Features of site and layout (WHOLE,).
        scores: Their scores, and last that of finishing (legal + 1,).
        indices: The layouts.
        choices: What each goes on with: places in `scores`.
    """

    legal: IntArray
    changing: FloatArray
    whole: FloatArray
    scores: FloatArray
    indices: Sequence[int]
    choices: Sequence[int]


@dataclass(frozen=True, eq=False)
class PackagedAgent:
    """Places pieces one after the other by the scores of candidates; a `SamplingAgent`.

    It serves every site with a build zone and a protected structure, with modules or a catalogue,
    against a known charge, a hidden one or a vehicle. Layouts keep all conditions of the zone.
    Its methods take the scenario, or its bundled name or path, and the charge, if it is known;
    otherwise layouts are for some of the possible ones. The policy takes a vehicle to be at its
    worst place behind the rule's line of posts.

    Attributes:
        network: The network.
    """

    network: CandidateNetwork = field(repr=False)

    @cached_property
    def digest(self) -> str:
        """16 hexadecimal digits of a hash of the weights."""
        digest = sha256()
        for name, values in sorted(self.network.weights.items()):
            digest.update(name.encode() + values.tobytes())
        return digest.hexdigest()[:16]

    def propose(self, scenario: AnyScenario, charge: AnyCharge | None = None) -> Layout:
        """Return the first of the policy's layout, the rules' ones, none, few draws and changes.

        They are as `ranked` has them. There are fewer draws and changes where there are many
        candidates.

        Raises:
            BlastEnvError: If the scenario has no build zone, or no structure is protected.
        """
        found = find_scenario(scenario)
        candidates = int(LayoutState.empty(found).legal.sum())
        share = min(1.0, _FEW_CANDIDATES / max(candidates, 1))
        draws, changes = int(FEW_DRAWS * share), int(FEW_CHANGES * share)
        return self.ranked(found, charge, draws, changes=changes)[0]

    def likeliest(self, scenario: AnyScenario, charge: AnyCharge | None = None) -> Layout:
        """Return the policy's layout, of the candidates with the highest scores.

        Raises:
            BlastEnvError: As for `propose`.
        """
        return self.layouts(Candidates.of(find_scenario(scenario), charge), 1, None)[0]

    def sample(
        self,
        scenario: AnyScenario,
        charge: AnyCharge | None = None,
        count: int = 8,
        seed: int = 0,
    ) -> tuple[Layout, ...]:
        """Return `count` layouts by draws from the softmax of the scores; some may be equal.

        Raises:
            BlastEnvError: As for `propose`, or if `count` is not a whole number from 1 to 10,000.
        """
        checked = whole_number("count", count, 1, MOST_DRAWS)
        candidates = Candidates.of(find_scenario(scenario), charge)
        return self.layouts(candidates, checked, generator(seed))

    def ranked(
        self,
        scenario: AnyScenario,
        charge: AnyCharge | None = None,
        count: int = DRAWS,
        seed: int = 0,
        changes: int = CHANGES,
    ) -> tuple[Layout, ...]:
        """Return the layouts of policy and rules, draws, none and changes, the best guess first.

        Changes are of the best guesses so far, as `searched` has them. The more layouts are looked
        at, the more the best guess owes to its error. So the best of the rules' layouts and none
        stays in front of another one that does not promise `SURE_GAIN` of the load without a
        barrier more. Each layout is sorted, and there once.

        Args:
            scenario: The scenario.
            charge: The charge, if it is known.
            count: Number of draws, 0 to 10,000.
            seed: Seed of draws and changes.
            changes: Number of changes, 0 to 10,000.

        Raises:
            BlastEnvError: As for `propose`, or if a number is out of bounds.
        """
        found = kept_clear(find_scenario(scenario), charge)
        guesses = Guesses.of(packaged_surrogate(), case_for(found, charge))
        rules = layouts_by_rule(found, charge)
        known = [(), *(tuple(sorted(layout)) for layout in rules.values())]
        ranked = self.searched(guesses, charge, rules, count, changes, seed)
        surest = known[int(guesses.loads(known).argmin())]
        unprotected, sure, best = guesses.loads([(), surest, ranked[0]]).tolist()
        if best > sure - SURE_GAIN * unprotected:
            ranked.remove(surest)
            ranked.insert(0, surest)
        return tuple(ranked)

    def searched(
        self,
        guesses: Guesses,
        charge: AnyCharge | None,
        rules: Mapping[str, Layout],
        count: int,
        changes: int,
        seed: int = 0,
    ) -> list[Layout]:
        """Return all layouts of a search by guesses, the best first, each sorted.

        It begins with none, the rules' layouts, the policy's and draws, and then changes the best.

        Args:
            guesses: The guesses, which it extends.
            charge: The charge, if it is known.
            rules: The layouts of all rules by title.
            count: Number of draws, 0 to 10,000.
            changes: Number of changes, 0 to 10,000.
            seed: Seed of draws and changes.

        Raises:
            BlastEnvError: As for `propose`, or if a number is out of bounds.
        """
        most = whole_number("changes", changes, 0, MOST_DRAWS)
        checked = whole_number("count", count, 0, MOST_DRAWS)
        candidates = Candidates.of(guesses.case.scenario, charge, rules)
        layouts = [(), *rules.values(), *self.layouts(candidates, 1, None)]
        if checked:
            layouts += self.layouts(candidates, checked, generator(seed))
        return improved(guesses, layouts, most, generator(seed))

    def layouts(
        self,
        candidates: Candidates,
        count: int,
        rng: np.random.Generator | None,
        tell: Callable[[Decision], None] = lambda _: None,
    ) -> tuple[Layout, ...]:
        """Return layouts, drawn or, without a generator, of the highest scores.

        Args:
            candidates: The candidates.
            count: Number of layouts.
            rng: The generator.
            tell: Called with each decision.
        """
        prepared = _prepared(self.network, candidates)
        batch = LayoutBatch(candidates.empty, candidates.rules, count)
        batch.begin(range(count), candidates.rules, candidates.empty)
        placed = [frozenset[int]()] * count
        standing = {placed[0]: CandidateState(candidates)}
        open_ones = np.flatnonzero(~batch.is_full).tolist()
        while open_ones:
            # Many layouts have the same pieces: the network looks at them once.
            sharing: dict[frozenset[int], list[int]] = {}
            for index in open_ones:
                sharing.setdefault(placed[index], []).append(index)
            chosen: dict[int, tuple[CandidateState, int]] = {}
            for pieces, indices in sharing.items():
                state = standing[pieces]
                legal = np.flatnonzero(batch.legal[indices[0]].ravel()[candidates.numbers])
                changing = state.features(legal)
                whole = state.whole(legal, changing, int(batch.left[indices[0], 0]))
                scores = self.network.scores(prepared, legal, changing, whole)
                choices = _choices(scores, len(indices), rng)
                tell(Decision(legal, changing, whole, scores, indices, choices))
                for index, choice in zip(indices, choices, strict=True):
                    if choice < len(legal):
                        chosen[index] = state, int(legal[choice])
            batch.place([*chosen], [int(candidates.numbers[own]) for _, own in chosen.values()])
            open_ones, standing = [], {}
            for index, (state, candidate) in chosen.items():
                placed[index] |= {candidate}
                if not batch.is_full[index]:
                    open_ones.append(index)
                    if placed[index] not in standing:
                        standing[placed[index]] = state.grown(candidate)
        return tuple(batch.elements(index) for index in range(count))


@lru_cache(maxsize=1)
def _prepared(network: CandidateNetwork, candidates: Candidates) -> FloatArray:
    """Return the part of the first layer that does not change, of all calls for one site."""
    return network.prepared(candidates.static)


def _choices(scores: FloatArray, count: int, rng: np.random.Generator | None) -> Sequence[int]:
    """Return the place of the highest score or, with a generator, `count` draws by the softmax."""
    if rng is None:
        return [int(scores.argmax())] * count
    up_to = np.cumsum(np.exp(scores.astype(np.float64) - float(scores.max())))
    drawn: IntArray = np.searchsorted(up_to, rng.random(count) * up_to[-1], side="right")
    choices: list[int] = np.minimum(drawn, len(scores) - 1).tolist()
    return choices


def load_packaged(path: Path) -> PackagedAgent:
    """Return the agent of a file of weights.

    Raises:
        BlastEnvError: If it does not exist, is too large or damaged, or has other arrays.
    """
    content = read_regular(path, _MOST_BYTES)
    return PackagedAgent(CandidateNetwork.of(read_weights(content, str(path)), str(path)))


@cache
def packaged_agent() -> PackagedAgent:
    """Return the agent that comes with the package."""
    content = files(__package__).joinpath(WEIGHTS).read_bytes()
    return PackagedAgent(CandidateNetwork.of(read_weights(content, WEIGHTS), WEIGHTS))


@dataclass(frozen=True)
class AgentProposer:
    """Proposes the best guess of `PackagedAgent.ranked`, without a blast.

    Attributes:
        draws: Number of draws.
        name: Name in tables.
    """

    draws: int = DRAWS
    name: str = "agent"

    def propose(
        self,
        problem: DesignProblem,
        budget: int = 0,
        seed: int = 0,
        report: Report | None = None,
    ) -> SearchResult:
        """Return the layout as `proposed` has it; the arguments are those of a `Proposer`.

        Raises:
            BlastEnvError: If the site has no build zone, or no structure is protected.
        """
        charge = problem.known_charge
        layout = packaged_agent().ranked(problem.scenario, charge, self.draws, seed)[0]
        if report is not None:
            report(Progress(0, 0, guessed=1.0))
        by = (
            "the packaged agent, the best guess of the rules' layouts, "
            f"{self.draws} draws and changes of them"
        )
        return replace(proposed(problem, layout, by), method=self.name, budget=budget, seed=seed)


def search_from_agent(surrogate: Surrogate | None = None) -> SurrogateSearch:
    """Return the search `surrogate`, begun with the packaged agent's layouts.

    With blasts, the first goes to the agent's proposal, and the search by guesses that chooses the
    next ones starts from its draws, too. Without, it proposes the best guess among them.

    Args:
        surrogate: The surrogate; the packaged one unless given.
    """
    found, agent = surrogate or packaged_surrogate(), packaged_agent()
    return SurrogateSearch(found, agent, digest=f"{found.digest} {agent.digest}")
