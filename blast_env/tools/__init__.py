"""Tools for agents: a session on a problem, with a budget of blasts and one score at its end.

The core needs no further package. The doors do: `mcp_door`, `openenv_door`.
"""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.tools.episodes import Episodes, TaskLists, Turn
    from blast_env.tools.records import BUDGET, SPLITS
    from blast_env.tools.scripts import SCRIPTS, played, played_in
    from blast_env.tools.session import WAIT_S, Session
    from blast_env.tools.sessions import SESSION_TOOLS, Begun, Sessions
    from blast_env.tools.table import TOOLS, Tool, call_tool
    from blast_env.tools.tasks import Episode, Tasks
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "BUDGET",
    "SCRIPTS",
    "SESSION_TOOLS",
    "SPLITS",
    "TOOLS",
    "WAIT_S",
    "Begun",
    "Episode",
    "Episodes",
    "Session",
    "Sessions",
    "TaskLists",
    "Tasks",
    "Tool",
    "Turn",
    "call_tool",
    "played",
    "played_in",
]
