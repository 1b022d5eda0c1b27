"""Episodes of the tools by reset and step, for doors whose clients expect an environment.

A step knows no truncation, so that an episode ends by `submit` alone. The score is the only reward,
so that the rewards of an episode sum to it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from blast_env.documents import checked_as
from blast_env.errors import BlastEnvError
from blast_env.tools.records import SPLITS, Record
from blast_env.tools.session import Session
from blast_env.tools.table import TOOLS, call_tool
from blast_env.tools.tasks import Episode, Tasks

NAME: Final = "blast-env"
"""Name of the environment for its clients."""

ABOUT: Final = "Barriers against blasts: tools, a budget of blasts, and one score at the end."
"""What the environment is, for its clients."""

MOST_EPISODES: Final = 64
"""Most episodes at the same time."""

_MOST_LISTED: Final = 100
"""Most problems of a list of a whole split."""


class Turn(Record):
    """What a reset or a step returns.

    Attributes:
        result: The result of the tool as plain JSON values; `None` with an error.
        error: Why there is no result, and the way out.
        done: Whether the episode has ended.
        reward: The score where it was given, else 0.
        tools: At a reset, the description of each tool and the schema of its arguments.
    """

    result: dict[str, Any] | None = None
    error: str = ""
    done: bool = False
    reward: float = 0.0
    tools: dict[str, Any] | None = None


class Episodes:
    """Episodes one after the other; each is a session.

    Args:
        tasks: The problems.
    """

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks
        self._session: Session | None = None
        self.steps = 0

    def reset(self, asked: Mapping[str, Any]) -> Turn:
        """Begin an episode of the split `train`, unless others of `Episode`'s fields are given."""
        self.close()
        try:
            episode = checked_as(Episode, {"split": "train", **asked})
            self._session = self._tasks.begin(episode)
            site = call_tool(self._session, "look", {}).model_dump(mode="json")
        except BlastEnvError as error:
            return Turn(error=str(error), done=True)
        tools = {
            name: {"description": tool.description, "arguments": tool.argument_schema}
            for name, tool in TOOLS.items()
        }
        return Turn(result=site, tools=tools)

    def step(self, tool: str, arguments: Mapping[str, Any]) -> Turn:
        """Call a tool."""
        if self._session is None:
            return Turn(error="no episode has begun: call reset", done=True)
        self.steps += 1
        try:
            found = call_tool(self._session, tool, arguments)
        except BlastEnvError as error:
            return Turn(error=str(error), done=self._session.score is not None)
        score = getattr(found, "score", None)
        reward = 0.0 if score is None else score.score
        return Turn(result=found.model_dump(mode="json"), done=score is not None, reward=reward)

    def close(self) -> None:
        """End the episode."""
        if self._session is not None:
            self._session.close()
        self._session, self.steps = None, 0


class TaskLists:
    """Lists of problems by the names of OpenEnv's task provider.

    Args:
        tasks: The problems.
    """

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks

    def list_splits(self) -> list[str]:
        """Return the splits that have problems."""
        return [split for split in SPLITS if self._tasks.count(split)]

    def num_tasks(self, split: str) -> int:
        """Return the number of problems of a split; errors as `Tasks.count`."""
        return self._tasks.count(split)

    def list_tasks(self, split: str) -> list[dict[str, Any]]:
        """Return the first problems of a split; errors as `Tasks.count`."""
        return self.get_task_range(split, 0, _MOST_LISTED)

    def get_task(self, split: str, index: int) -> dict[str, Any]:
        """Return one problem's split and index, which do not tell its site.

        Raises:
            UnknownNameError: If there is no such split.
            IndexError: If the split has no such problem.
        """
        numbers: Sequence[int] = range(self._tasks.count(split))
        if index not in numbers:
            raise IndexError(f"split {split!r} has no problem {index}")
        return {"id": f"{split}-{index}", "split": split, "index": index}

    def get_task_range(
        self, split: str, start: int | None = None, stop: int | None = None
    ) -> list[dict[str, Any]]:
        """Return several of them, by the bounds of a slice; errors as `Tasks.count`."""
        numbers = range(self._tasks.count(split))[slice(start, stop)]
        return [self.get_task(split, index) for index in numbers]
