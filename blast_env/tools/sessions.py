"""Sessions by name, for doors whose clients have no connection of their own."""

import secrets
from collections import OrderedDict
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Annotated, Any, Final

from pydantic import Field

from blast_env.errors import BlastEnvError
from blast_env.tools.records import Answer, Record
from blast_env.tools.session import Session
from blast_env.tools.table import call_tool
from blast_env.tools.tasks import Episode

MOST_SESSIONS: Final = 64
"""Most sessions that are kept; the one that was used longest ago is closed for another."""

_NAME_BYTES: Final = 8


class Begun(Record):
    """A new session."""

    session: Annotated[str, Field(description="Its name, for the other tools.")]
    problem: str
    budget: int


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

    def begin(self, episode: Episode) -> Begun:
        """Begin a session under a new name; errors as `Tasks.begin`."""
        name, session = secrets.token_hex(_NAME_BYTES), self._begin(episode)
        with self._lock:
            self._keep(name, session)
        return Begun(session=name, problem=session.problem_name, budget=episode.budget)

    def call(self, name: str, tool: str, arguments: Mapping[str, Any]) -> Answer:
        """Call a tool in a session, by its name; the first one's is empty.

        Raises:
            BlastEnvError: If there is no such session, or as `call_tool`.
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
        return call_tool(session, tool, arguments)

    def close(self) -> None:
        """Close all sessions."""
        while self._kept:
            self._kept.popitem()[1].close()

    def _keep(self, name: str, session: Session) -> None:
        self._kept[name] = session
        if len(self._kept) > self._most:
            self._kept.popitem(last=False)[1].close()
