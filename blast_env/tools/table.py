"""The table of the tools, from which every door is made."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from blast_env.documents import checked_as
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.tools.records import (
    Answer,
    LayoutArguments,
    Legality,
    Look,
    LookArguments,
    NoArguments,
    Outcome,
    Proposals,
    Record,
    ShareByGuess,
    TicketArguments,
)
from blast_env.tools.session import Session


@dataclass(frozen=True)
class Tool:
    """A tool.

    Attributes:
        description: What it does, for a model.
        result: Record of its result.
        function: Method of its owner, a session.
    """

    name: str
    description: str
    arguments: type[Record]
    result: type[Answer]
    function: Callable[..., Answer]

    @property
    def argument_schema(self) -> dict[str, Any]:
        """JSON schema of the arguments."""
        return self.arguments.model_json_schema()

    @property
    def result_schema(self) -> dict[str, Any]:
        """JSON schema of the result."""
        return self.result.model_json_schema(mode="serialization")


_WAITS: Final = (
    " Takes up to 25 s; if `running` is true in the result, call `poll` with its ticket."
)

_TABLE: Final = (
    Tool(
        "look",
        "The site, its buildings, threats, items, build zone and limits, and how you are scored.",
        LookArguments,
        Look,
        Session.look,
    ),
    Tool(
        "rules",
        "What each rule of thumb proposes for this site and costs, and a random layout. Free.",
        NoArguments,
        Proposals,
        Session.rules,
    ),
    Tool(
        "check",
        "Whether a layout is legal, with a reason for each piece that is not, and its cost. Free.",
        LayoutArguments,
        Legality,
        Session.check,
    ),
    Tool(
        "guess",
        "Predicts the share of the load that a layout leaves, with a 95 % interval. Free, never "
        "scored, and sometimes wrong.",
        LayoutArguments,
        ShareByGuess,
        Session.guess,
    ),
    Tool(
        "blast",
        "Runs a blast by gas dynamics: the share of the load that a layout leaves. Costs "
        "`blasts_per_layout` of the budget, once for each layout; failures cost nothing." + _WAITS,
        LayoutArguments,
        Outcome,
        Session.blast,
    ),
    Tool(
        "poll",
        "Waits up to 25 s for the result of a ticket. Free.",
        TicketArguments,
        Outcome,
        Session.poll,
    ),
    Tool(
        "submit",
        "Submits a layout, once: the judge blasts it anew, gives the score, and the session ends."
        + _WAITS,
        LayoutArguments,
        Outcome,
        Session.submit,
    ),
)

TOOLS: Final[Mapping[str, Tool]] = MappingProxyType({tool.name: tool for tool in _TABLE})
"""The tools by name."""


def call_tool(
    owner: Any, name: str, arguments: Mapping[str, Any], tools: Mapping[str, Tool] = TOOLS
) -> Answer:
    """Call a tool with plain JSON values.

    Args:
        owner: The session, or else the owner of the tools.
        name: The tool's name.

    Raises:
        UnknownNameError: If there is no such tool.
        BlastEnvError: If the arguments have another form, or the tool refuses.
    """
    if name not in tools:
        raise UnknownNameError("tool", name, tools)
    tool = tools[name]
    try:
        given = checked_as(tool.arguments, arguments)
    except BlastEnvError as error:
        known = ", ".join(tool.arguments.model_fields) or "none"
        message = f"{name} was not called: {error}; its arguments: {known}"
        raise BlastEnvError(message) from error
    return tool.function(owner, **{key: getattr(given, key) for key in type(given).model_fields})
