"""Sessions by name, for doors whose clients have no connection of their own."""

import secrets
from collections import OrderedDict
from collections.abc import Callable, Mapping
from threading import Lock
from types import MappingProxyType
from typing import Annotated, Any, Final

from pydantic import Field, create_model

from blast_env.errors import BlastEnvError
from blast_env.tools.records import Answer
from blast_env.tools.session import Session
from blast_env.tools.table import TOOLS, Tool
from blast_env.tools.tasks import Episode

MOST_SESSIONS: Final = 64
"""Most sessions that are kept; the one that was used longest ago is closed for another."""

_NAME_BYTES: Final = 8


class Begun(Answer):
    """A new session."""

    session: Annotated[str, Field(description="Its name, for the other tools.")]
    problem: str


class Sessions:
    """Sessions by name.

    Args:
        begin: Begins a session.
        first: What the first session is begun with, when it is first used.
        most: Most sessions that are kept.
    """

    def __init__(
        self,
        begin: Callable[[Episode], Session],
        first: Episode,
        most: int = MOST_SESSIONS,
    ) -> None:
        self._begin, self._first, self._most = begin, first, most
        self._kept: OrderedDict[str, Session] = OrderedDict()
        self._lock = Lock()

    def begin(self, **episode: Any) -> Begun:
        """Begin a session under a new name.

        Args:
            episode: The fields of `Episode`.

        Raises:
            BlastEnvError: As `Tasks.begin`.
        """
        asked = Episode(**episode)
        name, session = secrets.token_hex(_NAME_BYTES), self._begin(asked)
        with self._lock:
            self._keep(name, session)
        return Begun(
            session=name,
            problem=session.problem_name,
            blasts_left=asked.budget,
            seconds=0.0,
            validity="no number yet",
        )

    def named(self, name: str) -> Session:
        """Return a session by its name; the first one's is empty.

        Raises:
            BlastEnvError: If there is no such session.
        """
        with self._lock:
            if name == "" and name not in self._kept:
                self._keep(name, self._begin(self._first))
            session = self._kept.get(name)
            if session is None:
                raise BlastEnvError(
                    f"there is no session {name!r}, or it was closed for others: call `begin`"
                )
            self._kept.move_to_end(name)
        return session

    def close(self) -> None:
        """Close all sessions."""
        while self._kept:
            self._kept.popitem()[1].close()

    def _keep(self, name: str, session: Session) -> None:
        self._kept[name] = session
        if len(self._kept) > self._most:
            self._kept.popitem(last=False)[1].close()


def _in_session(tool: Tool) -> Tool:
    """Return a tool that takes the name of a session as well."""
    name = Annotated[str, Field(description="As `begin` gave it; else the first session.")]

    def function(sessions: Sessions, session: str, **given: Any) -> Answer:
        return tool.function(sessions.named(session), **given)

    return Tool(
        tool.name,
        tool.description,
        create_model(tool.arguments.__name__, __base__=tool.arguments, session=(name, "")),
        tool.result,
        function,
    )


_BEGIN: Final = Tool(
    "begin",
    "Begins another session, on another problem or the same, with a budget of its own.",
    Episode,
    Begun,
    Sessions.begin,
)

SESSION_TOOLS: Final[Mapping[str, Tool]] = MappingProxyType(
    {tool.name: tool for tool in (_BEGIN, *map(_in_session, TOOLS.values()))}
)
"""The tools of `Sessions` by name: `begin`, and those of a session with its name."""
