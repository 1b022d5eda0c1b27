"""Training, search and comparison of protective layouts."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_agents.packaged import PackagedAgent, packaged_agent
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = ["PackagedAgent", "packaged_agent"]
