"""The door by the Model Context Protocol: the table of tools as a server, for any client.

The protocol of 2026 has no sessions, so that each tool takes the name of one, which `begin` gives.
Without it, a tool takes the session that the server began with.
"""

from functools import partial
from typing import Any

from blast_env.errors import BlastEnvError, import_extra
from blast_env.provenance import package_version
from blast_env.tools.sessions import MOST_SESSIONS, SESSION_TOOLS, Sessions
from blast_env.tools.table import call_tool

with import_extra("mcp", "tools by MCP"):
    import anyio
    import mcp_types as types
    from mcp.server.context import ServerRequestContext
    from mcp.server.lowlevel import Server
    from mcp.server.stdio import stdio_server


def mcp_server(sessions: Sessions) -> Server[Any]:
    """Return the server of some sessions."""
    limiter = anyio.CapacityLimiter(2 * MOST_SESSIONS)  # many calls may wait for blasts
    return Server(
        "blast-env",
        version=package_version(),
        instructions="Call `look` first: it has the task.",
        on_list_tools=_list_tools,
        on_call_tool=partial(_call_tool, sessions, limiter),
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
    tools = [
        types.Tool(
            name=tool.name,
            description=tool.description,
            input_schema=tool.argument_schema,
            output_schema=tool.result_schema,
        )
        for tool in SESSION_TOOLS.values()
    ]
    return types.ListToolsResult(tools=tools)


async def _call_tool(
    sessions: Sessions,
    limiter: anyio.CapacityLimiter,
    _: ServerRequestContext,
    params: types.CallToolRequestParams,
) -> types.CallToolResult:
    work = partial(call_tool, sessions, params.name, params.arguments or {}, SESSION_TOOLS)
    try:
        # Work of a call that is given up goes on: its result is free when it is asked for again.
        found = await anyio.to_thread.run_sync(work, abandon_on_cancel=True, limiter=limiter)
    except BlastEnvError as error:
        return types.CallToolResult(content=[types.TextContent(text=str(error))], is_error=True)
    pictures = []
    picture = getattr(found, "picture", None)
    if picture is not None:  # as a picture, not as text
        found = found.model_copy(update={"picture": None})
        pictures = [types.ImageContent(data=picture.base64, mime_type=picture.media_type)]
    content = [types.TextContent(text=found.model_dump_json()), *pictures]
    return types.CallToolResult(content=content, structured_content=found.model_dump(mode="json"))
