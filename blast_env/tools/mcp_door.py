"""The door by the Model Context Protocol: the table of tools as a server, for any client.

The protocol of 2026 has no sessions, so that each tool takes the name of one, which `begin` gives.
Without it, a tool takes the session that the server began with.
"""

from functools import partial
from typing import Any, Final

from blast_env.documents import checked_as
from blast_env.errors import BlastEnvError, import_extra
from blast_env.provenance import package_version
from blast_env.tools.sessions import Begun, Sessions
from blast_env.tools.table import TOOLS, Tool
from blast_env.tools.tasks import Episode

with import_extra("mcp", "tools by MCP"):
    import anyio
    import mcp_types as types
    from mcp.server.context import ServerRequestContext
    from mcp.server.lowlevel import Server
    from mcp.server.stdio import stdio_server

_SESSION: Final = {"type": "string", "description": "As `begin` gave it; else the first session."}
_BEGIN: Final = types.Tool(
    name="begin",
    description="Begins another session, on another problem or the same, with a budget of its own.",
    input_schema=Episode.model_json_schema(),
    output_schema=Begun.model_json_schema(mode="serialization"),
)


def mcp_server(sessions: Sessions) -> Server[Any]:
    """Return the server of some sessions."""
    return Server(
        "blast-env",
        version=package_version(),
        instructions="Call `look` first: it has the task.",
        on_list_tools=_list_tools,
        on_call_tool=partial(_call_tool, sessions),
    )


def run_stdio(server: Server[Any]) -> None:
    """Serve one client by standard input and output, until it hangs up."""

    async def run() -> None:
        async with stdio_server() as (incoming, outgoing):
            await server.run(incoming, outgoing, server.create_initialization_options())

    anyio.run(run)


async def _list_tools(
    _: ServerRequestContext, __: types.PaginatedRequestParams | None
) -> types.ListToolsResult:
    return types.ListToolsResult(tools=[_BEGIN, *map(_described, TOOLS.values())])


def _described(tool: Tool) -> types.Tool:
    schema = tool.argument_schema
    schema["properties"] = {**schema.get("properties", {}), "session": _SESSION}
    return types.Tool(
        name=tool.name,
        description=tool.description,
        input_schema=schema,
        output_schema=tool.result_schema,
    )


async def _call_tool(
    sessions: Sessions, _: ServerRequestContext, params: types.CallToolRequestParams
) -> types.CallToolResult:
    work = partial(_result_of, sessions, params.name, dict(params.arguments or {}))
    # Work of a call that is given up goes on: its result is free when it is asked for again.
    return await anyio.to_thread.run_sync(work, abandon_on_cancel=True)


def _result_of(sessions: Sessions, name: str, given: dict[str, Any]) -> types.CallToolResult:
    pictures: list[types.ContentBlock] = []
    try:
        if name == "begin":
            found: Any = sessions.begin(checked_as(Episode, given))
        else:
            found = sessions.call(str(given.pop("session", "")), name, given)
    except BlastEnvError as error:
        words: list[types.ContentBlock] = [types.TextContent(text=str(error))]
        return types.CallToolResult(content=words, is_error=True)
    picture = getattr(found, "picture", None)
    if picture is not None:  # as a picture, not as text
        found = found.model_copy(update={"picture": None})
        pictures = [types.ImageContent(data=picture.base64, mime_type=picture.media_type)]
    text = types.TextContent(text=found.model_dump_json())
    return types.CallToolResult(
        content=[text, *pictures], structured_content=found.model_dump(mode="json")
    )
