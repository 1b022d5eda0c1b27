"""The door by OpenEnv: an episode of the tools as an environment, by HTTP and websockets.

An observation knows no truncation, so that an episode ends by `submit` alone.
"""

from typing import Any, Final

from pydantic import Field

from blast_env.documents import checked_as
from blast_env.errors import BlastEnvError, import_extra
from blast_env.tools.records import SPLITS
from blast_env.tools.session import Session
from blast_env.tools.table import TOOLS, call_tool
from blast_env.tools.tasks import Episode, Tasks

with import_extra("openenv", "tools by OpenEnv"):
    from fastapi import FastAPI
    from openenv.core.env_server import Action, Environment, Observation, State, create_app

MOST_EPISODES: Final = 64
"""Most episodes at the same time."""


class ToolCall(Action):
    """A call of a tool."""

    tool: str = Field(description=f"Its name: {', '.join(TOOLS)}.", max_length=80)
    arguments: dict[str, Any] = Field(default_factory=dict, description="Its arguments by name.")


class ToolAnswer(Observation):
    """The result of a call, or the reason why there is none."""

    result: dict[str, Any] | None = Field(default=None, description="The result of the tool.")
    error: str = Field(default="", description="Why there is no result, and the way out.")
    tools: dict[str, Any] | None = Field(default=None, description="At a reset: all tools.")


class ToolEnvironment(Environment[ToolCall, ToolAnswer, State]):
    """An environment whose actions are calls of tools; only the score is a reward.

    Args:
        tasks: The problems.
    """

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, tasks: Tasks) -> None:
        super().__init__()
        self._tasks = tasks
        self._session: Session | None = None
        self._state = State()

    def reset(
        self, seed: int | None = None, episode_id: str | None = None, **asked: Any
    ) -> ToolAnswer:
        """Begin an episode; `asked` has the fields of `Episode`."""
        self.close()
        self._state = State(episode_id=episode_id)
        try:
            episode = checked_as(Episode, {"seed": seed or 0, "split": "train", **asked})
            self._session = self._tasks.begin(episode)
            site = call_tool(self._session, "look", {}).model_dump(mode="json")
        except BlastEnvError as error:
            return ToolAnswer(error=str(error), done=True, reward=0.0)
        tools = {
            name: {"description": tool.description, "arguments": tool.argument_schema}
            for name, tool in TOOLS.items()
        }
        return ToolAnswer(result=site, tools=tools, reward=0.0)

    def step(self, action: ToolCall, timeout_s: float | None = None, **_: Any) -> ToolAnswer:  # noqa: ARG002
        """Call a tool."""
        if self._session is None:
            return ToolAnswer(error="no episode has begun: call reset", done=True, reward=0.0)
        self._state.step_count += 1
        try:
            found = call_tool(self._session, action.tool, action.arguments)
        except BlastEnvError as error:
            done = self._session.score is not None
            return ToolAnswer(error=str(error), done=done, reward=0.0)
        score = getattr(found, "score", None)
        reward = 0.0 if score is None else score.score
        result = found.model_dump(mode="json")
        return ToolAnswer(result=result, done=score is not None, reward=reward)

    @property
    def state(self) -> State:
        """The episode's id and its number of steps."""
        return self._state

    def close(self) -> None:
        """End the episode."""
        if self._session is not None:
            self._session.close()
        self._session = None

    def list_splits(self) -> list[str]:
        """Return the splits that have problems."""
        return [split for split in SPLITS if self._tasks.count(split)]

    def num_tasks(self, split: str) -> int:
        """Return the number of problems of a split."""
        return self._tasks.count(split)

    def list_tasks(self, split: str) -> list[dict[str, Any]]:
        """Return the first problems of a split."""
        return self.get_task_range(split, 0, 100)

    def get_task(self, split: str, index: int) -> dict[str, Any]:
        """Return one problem's split and index."""
        if not 0 <= index < self._tasks.count(split):
            raise IndexError(f"split {split!r} has no problem {index}")
        return self._tasks.spec(split, index)

    def get_task_range(
        self, split: str, start: int | None = None, stop: int | None = None
    ) -> list[dict[str, Any]]:
        """Return several of them."""
        own = range(self._tasks.count(split))[slice(start, stop)]
        return [self._tasks.spec(split, index) for index in own]


def openenv_app(tasks: Tasks) -> FastAPI:
    """Return the server of some problems, without a guard."""
    app: FastAPI = create_app(
        lambda: ToolEnvironment(tasks),
        ToolCall,
        ToolAnswer,
        env_name="blast-env",
        max_concurrent_envs=MOST_EPISODES,
    )
    return app
