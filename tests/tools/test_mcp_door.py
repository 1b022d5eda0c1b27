"""The door by MCP, with the package's own client: in memory, by standard input, and by HTTP."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

# openenv brings an mcp below 2, which has no `mcp_types`.
pytest.importorskip("mcp_types", reason="needs the extra mcp: `make matrix-mcp`")

import anyio
import httpx2  # comes with mcp
import mcp
from mcp.client.stdio import StdioServerParameters
from mcp.client.streamable_http import streamable_http_client

from blast_env.tools import TOOLS, Episode, Sessions, played_in
from blast_env.tools.mcp_door import mcp_server
from blast_env.tools.scripts import rules_guesses_blasts
from blast_env.tools.sessions import MOST_SESSIONS
from tests.tools.row_session import BEST, HeldEngine, session, walls
from tests.tools.serving import ENVIRONMENT, served


def sessions() -> Sessions:
    return Sessions(lambda episode: session(episode.seed, episode.budget), Episode(budget=3))


async def values(client: Any, name: str, **arguments: Any) -> dict[str, Any]:
    """Call a tool, and check that text and structure agree."""
    result = await client.call_tool(name, arguments)
    assert not result.is_error, result.content
    found: dict[str, Any] = result.structured_content
    assert json.loads(result.content[0].text) == found
    return found


async def play(client: Any, **more: Any) -> float:
    script = rules_guesses_blasts()
    asked = next(script)
    while True:
        try:
            asked = script.send(await values(client, asked[0], **asked[1], **more))
        except StopIteration as end:
            return end.value


def within(work: Any) -> Any:
    """Run a coroutine, no longer than a client waits."""

    async def limited() -> Any:
        with anyio.fail_after(120.0):
            return await work()

    return anyio.run(limited)


def test_a_script_gets_the_score_that_python_gets() -> None:
    async def work() -> float:
        async with mcp.Client(mcp_server(sessions())) as client:
            listed = {tool.name: tool for tool in (await client.list_tools()).tools}
            assert [*listed] == ["begin", *TOOLS]
            assert listed["look"].output_schema == TOOLS["look"].result_schema
            return await play(client)

    assert within(work) == played_in(rules_guesses_blasts(), session()) > 0.0


def test_full_zero_malformed_and_reseeded() -> None:
    """The fixtures that others ask for, each in a session of its own."""

    async def work() -> None:
        async with mcp.Client(mcp_server(sessions())) as client:
            seen = []
            for seed, layout, score in ((0, walls(*BEST), 1.0), (0, [], 0.0), (1, [], 0.0)):
                own = (await values(client, "begin", seed=seed))["session"]
                seen.append((await values(client, "rules", session=own))["proposals"])
                found = await values(client, "submit", layout=layout, session=own)
                assert found["score"]["score"] == score
                ended = await client.call_tool("look", {"session": own})
                assert ended.is_error
                assert "begin another session" in ended.content[0].text
            assert seen[0] == seen[1] != seen[2]
            for name, wrong, words in (
                ("submit", {}, "layout is missing"),
                ("submit", {"layout": "all"}, "layout is 'all'"),
                ("look", {"session": "else"}, "no session 'else'"),
                ("dig", {}, "no tool 'dig'"),
            ):
                refused = await client.call_tool(name, wrong)
                assert refused.is_error
                assert words in refused.content[0].text
            picture = await client.call_tool("look", {"picture": True})
            assert [block.type for block in picture.content] == ["text", "image"]

    within(work)


def test_calls_that_wait_leave_room_for_others() -> None:
    """A client may have as many sessions as are kept, each with a blast that takes long."""
    engine = HeldEngine()
    many = Sessions(
        lambda episode: session(episode.seed, episode.budget, engine=engine), Episode(budget=3)
    )

    async def work() -> None:
        async with mcp.Client(mcp_server(many)) as client:
            names = [(await values(client, "begin"))["session"] for _ in range(MOST_SESSIONS - 1)]
            async with anyio.create_task_group() as waiting:
                for name in names:
                    blast = {"layout": walls(*BEST), "session": name}
                    waiting.start_soon(client.call_tool, "blast", blast)
                await anyio.sleep(0.5)
                try:
                    with anyio.fail_after(10.0):
                        await values(client, "look")
                finally:
                    engine.go.set()

    within(work)


def test_standard_input_and_output() -> None:
    async def work() -> str:
        server = StdioServerParameters(
            command=sys.executable,
            args=["-m", "blast_env", "serve", "--mcp", "--budget", "0"],
            env=ENVIRONMENT,
            cwd=str(Path.cwd()),
        )
        async with mcp.Client(server) as client:
            found = await values(client, "look")
            assert found["blasts_left"] == 0
            return found["problem"]

    assert within(work) == "control_room-known-v2"


def test_http_needs_the_token() -> None:
    with served("--mcp", "--http", "--budget", "0") as (port, line):
        token = line.split()[-1].rstrip(")")
        within(lambda: by_http(f"http://127.0.0.1:{port}/mcp", token))


async def by_http(url: str, token: str) -> None:
    async with httpx2.AsyncClient(timeout=30.0) as bare:
        refused = await bare.post(url, json={})
        assert refused.status_code == 403
        assert "with its token" in refused.text
    headers = {"Authorization": f"Bearer {token}"}
    for mode in ("auto", "legacy"):
        async with httpx2.AsyncClient(headers=headers, timeout=30.0) as known:
            transport = streamable_http_client(url, http_client=known)
            async with mcp.Client(transport, mode=mode) as client:
                assert (await values(client, "look"))["problem"] == "control_room-known-v2"
