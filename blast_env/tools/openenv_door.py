"""The door by OpenEnv: an episode of the tools as an environment, by HTTP and websockets."""

from functools import partial
from os import environ
from typing import Any

from pydantic import Field

from blast_env.errors import import_extra
from blast_env.provenance import package_version
from blast_env.tools.episodes import ABOUT, MOST_EPISODES, NAME, Episodes, TaskLists
from blast_env.tools.table import TOOLS
from blast_env.tools.tasks import Tasks

with import_extra("openenv", "tools by OpenEnv"):
    from fastapi import FastAPI
    from openenv.core.env_server import Action, Environment, Observation, State, create_app
    from openenv.core.env_server.types import EnvironmentMetadata


class ToolCall(Action):
    """A call of a tool."""

    tool: str = Field(description=f"Its name: {', '.join(TOOLS)}.", max_length=80)
    arguments: dict[str, Any] = Field(default_factory=dict, description="Its arguments by name.")


class ToolAnswer(Observation):
    """The result of a call, or the reason why there is none."""

    result: dict[str, Any] | None = Field(default=None, description="The result of the tool.")
    error: str = Field(default="", description="Why there is no result, and the way out.")
    tools: dict[str, Any] | None = Field(default=None, description="At a reset: all tools.")


class ToolEnvironment(TaskLists, Environment[ToolCall, ToolAnswer, State]):
    """An environment whose actions are calls of tools; only the score is a reward."""

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, tasks: Tasks | None = None) -> None:
        TaskLists.__init__(self, tasks or Tasks(environ.get("BLAST_ENV_SECRET", "")))
        Environment.__init__(self)
        self._episodes = Episodes(self._tasks)
        self._episode_id: str | None = None

    def reset(
        self, seed: int | None = None, episode_id: str | None = None, **asked: Any
    ) -> ToolAnswer:
        """Begin an episode; `asked` has the fields of `Episode`."""
        self._episode_id = episode_id
        turn = self._episodes.reset({"seed": seed or 0, **asked})
        return ToolAnswer(**turn.model_dump())

    def step(self, action: ToolCall, timeout_s: float | None = None, **_: Any) -> ToolAnswer:  # noqa: ARG002
        """Call a tool."""
        return ToolAnswer(**self._episodes.step(action.tool, action.arguments).model_dump())

    def get_metadata(self) -> EnvironmentMetadata:
        """Return the name of the package and its version."""
        return EnvironmentMetadata(name=NAME, description=ABOUT, version=package_version())

    @property
    def state(self) -> State:
        """The episode's id and its number of steps."""
        return State(episode_id=self._episode_id, step_count=self._episodes.steps)

    def close(self) -> None:
        """End the episode."""
        self._episodes.close()


def openenv_app(tasks: Tasks) -> FastAPI:
    """Return the server of some problems, without a guard."""
    make = partial(ToolEnvironment, tasks)
    app: FastAPI = create_app(
        make, ToolCall, ToolAnswer, env_name=NAME, max_concurrent_envs=MOST_EPISODES
    )
    return app
