"""The tasks of agents by split: problems for training, for testing, and of the benchmark."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from blast_env.benchmark import BUDGETS, DEFINITIONS, Definition, secret_sites
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.sites import HELD_OUT_SITES
from blast_env.tools.records import BUDGET, SPLITS, Record
from blast_env.tools.session import Session
from blast_env.values import MOST_SEED, whole_number

_TRAINING: Final = 100_000
_SECRET: Final = 1_000


class Episode(Record):
    """What a session is begun with."""

    split: Annotated[Literal["train", "test", "benchmark"], Field(description="Kind of site.")] = (
        "benchmark"
    )
    index: Annotated[
        int | None, Field(ge=0, description="Number of the problem; from the seed unless given.")
    ] = None
    seed: Annotated[int, Field(ge=0, le=MOST_SEED, description="Seed of all that is drawn.")] = 0
    budget: Annotated[int, Field(ge=0, le=BUDGETS[-1], description="Most blasts.")] = BUDGET


@dataclass(frozen=True)
class Tasks:
    """Problems by split and index, each with one charge at a known place.

    - `train`: generated sites, from the seeds that the packaged surrogate was not judged on.
    - `test`: generated sites of the same kind that nobody can draw without the secret.
    - `benchmark`: the problems of the benchmark, also those with several charges.

    Attributes:
        secret: Text that draws the sites of `test`; without one, the split is empty.
        session: Makes a session of a definition, a seed and a budget.

    Raises:
        BlastEnvError: If the secret is too short.
    """

    secret: str = field(default="", repr=False)
    session: Callable[[Definition, int, int], Session] = Session

    def __post_init__(self) -> None:
        """Check the secret."""
        if self.secret:
            secret_sites(self.secret, 1)

    def count(self, split: str) -> int:
        """Return the number of problems of a split.

        Raises:
            UnknownNameError: If there is no such split.
        """
        if split not in SPLITS:
            raise UnknownNameError("split", split, SPLITS)
        own = {"train": _TRAINING, "test": _SECRET if self.secret else 0}
        return own.get(split, len(DEFINITIONS))

    def problem(self, split: str, index: int) -> Definition:
        """Return a problem.

        Raises:
            UnknownNameError: If there is no such split.
            BlastEnvError: If the split is empty, or the index is out of bounds.
        """
        count = self.count(split)
        if not count:
            raise BlastEnvError(
                f"split {split!r} has no problem: start the server with a secret of at least 8 "
                "characters, which draws its sites"
            )
        number = whole_number("index", index, 0, count - 1)
        if split == "benchmark":
            return tuple(DEFINITIONS.values())[number]
        if split == "train":
            return Definition(f"site_{HELD_OUT_SITES + number}", "known")
        return replace(secret_sites(self.secret, _SECRET)[number], family="known")

    def begin(self, episode: Episode) -> Session:
        """Return a new session; errors as `problem` and `Session`."""
        index = episode.index
        if index is None:
            index = episode.seed % max(self.count(episode.split), 1)
        definition = self.problem(episode.split, index)
        return self.session(definition, episode.seed, episode.budget)

    def prepare(self) -> None:
        """Compile what `look` needs where a vehicle comes in, once per installation.

        Clients give up after half a minute. All that takes longer has tickets, but `look` has none.
        """
        families = [definition.family for definition in DEFINITIONS.values()]
        session = self.begin(Episode(index=families.index("vehicle")))
        session.look()
        session.close()

    def resets(
        self, split: str, count: int, budget: int = BUDGET, first: int = 0
    ) -> list[dict[str, Any]]:
        """Return the arguments of resets of a split, for trainers that want a list.

        Args:
            budget: Most blasts of each.
            first: Index of the first; the others follow.

        Raises:
            BlastEnvError: As `problem`, or if the split has fewer problems.
        """
        self.problem(split, first + count - 1)
        return [
            {"split": split, "index": index, "seed": index, "budget": budget}
            for index in range(first, first + count)
        ]
