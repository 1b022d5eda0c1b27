"""What commands have of the agents, which the package knows by the command line alone."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from blast_env.design.search import Proposer
from blast_env.errors import MissingExtraError, import_extra

if TYPE_CHECKING:  # compiled code, which takes half a second to import
    from blast_env.design.search import SurrogateSearch
    from blast_env.surrogate import Surrogate

AGENT: Final = "agent"
"""The packaged agent as a method."""

SURROGATE: Final = "surrogate"
"""The search that the packaged agent begins, where it is installed."""

FROM_AGENT: Final = "surrogate_from_agent"
"""Its name in a submission that the agent has begun."""

Digests = Mapping[str, str]
"""Digests of what a method goes by, by its name."""


def agent_without_blasts() -> tuple[Proposer, Digests]:
    """Return the packaged agent as a proposer."""
    from blast_env.surrogate import packaged_surrogate  # takes half a second to import

    with import_extra("agents", "packaged agent"):
        from blast_agents.packaged import AgentProposer, packaged_agent
    return AgentProposer(), {
        SURROGATE: packaged_surrogate().digest,
        AGENT: packaged_agent().digest,
    }


def surrogate_search(surrogate: "Surrogate") -> "tuple[SurrogateSearch, Digests]":
    """Return the search by a surrogate, from the layouts of the packaged agent.

    Without the extra `agents` it begins with the rules' layouts alone, as in Python.
    """
    from blast_env.design.search.learnt import search_by

    digests = {SURROGATE: surrogate.digest}
    try:
        with import_extra("agents", "packaged agent"):
            from blast_agents.packaged import packaged_agent, search_from_agent
    except MissingExtraError:
        return search_by(surrogate), digests
    return search_from_agent(surrogate), {**digests, AGENT: packaged_agent().digest}
