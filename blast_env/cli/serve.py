"""`blast-env serve`: problems as tools for agents."""

import json
from functools import partial
from typing import TYPE_CHECKING, Final

import typer

from blast_env.answers.terminal import print_line
from blast_env.benchmark import BUDGETS, DEFINITIONS
from blast_env.benchmark.definitions import find_definition
from blast_env.cli.options import CacheOption
from blast_env.cli.output import message_console
from blast_env.errors import BlastEnvError
from blast_env.tools.records import BUDGET, SPLITS
from blast_env.values import MOST_SEED

if TYPE_CHECKING:  # the surrogate takes half a second to import
    from blast_env.tools import Sessions, Tasks

_HOST: Final = "127.0.0.1"


def serve(
    mcp: bool = typer.Option(
        False, "--mcp", help="By MCP: to one client, by standard input and output."
    ),
    http: bool = typer.Option(False, "--http", help="With --mcp: by HTTP on this computer."),
    openenv: bool = typer.Option(False, "--openenv", help="By OpenEnv, on this computer."),
    resets: int | None = typer.Option(
        None, help="Print the resets of this many problems as JSON, and serve nothing.", min=1
    ),
    problem: str | None = typer.Option(
        None, help="Problem of the benchmark, instead of a split and an index."
    ),
    split: str = typer.Option("benchmark", help=f"Kind of problems: {', '.join(SPLITS)}."),
    index: int = typer.Option(0, help="Number of the problem; of the first with --resets.", min=0),
    seed: int = typer.Option(0, help="Seed of what is drawn.", min=0, max=MOST_SEED),
    budget: int = typer.Option(BUDGET, help="Most blasts of a session.", min=0, max=BUDGETS[-1]),
    secret: str = typer.Option(
        "", envvar="BLAST_ENV_SECRET", help="Text that draws the sites of the split test."
    ),
    port: int = typer.Option(8081, help="Port of --http and --openenv.", min=1, max=65535),
    cache: CacheOption = None,
) -> None:
    """Serve problems to agents as tools, by MCP or OpenEnv.

    The tools are look, rules, check, guess, blast, poll and submit. A session has a budget of
    blasts, and one score at its end. By HTTP the server listens on this computer alone, and admits
    clients with the printed token: as bearer by MCP, as part of the address by OpenEnv. Ctrl-C ends
    it.
    """
    from blast_env.tools import Episode, Session, Sessions, Tasks

    tasks = Tasks(secret, partial(Session, cache=cache))
    if problem is not None:
        split, index = "benchmark", list(DEFINITIONS).index(find_definition(problem).name)
    if resets is not None:
        print_line(json.dumps(tasks.resets(split, resets, budget, index), indent=2))
        return
    if mcp == openenv:
        raise BlastEnvError("choose one door: --mcp or --openenv")
    if openenv:
        tasks.prepare()
        _serve_openenv(tasks, port)
    else:
        tasks.problem(split, index)  # refuses one that does not exist, before a client comes
        asked = {"split": split, "index": index, "seed": seed, "budget": budget}
        first = Episode.model_validate(asked)
        if http:
            tasks.prepare()  # a client on the standard input waits for its first answer from now on
        _serve_mcp(Sessions(tasks.begin, first), port if http else None)


def _serve_mcp(sessions: "Sessions", port: int | None) -> None:
    # Here, because the servers need extras.
    from blast_env.tools.mcp_door import mcp_server, run_stdio

    server = mcp_server(sessions)
    try:
        if port is None:
            run_stdio(server)
            return
        import uvicorn

        from blast_env.app.guard import METHODS, Entrance, Guard, check_port

        check_port(_HOST, port)
        entrance = Entrance(_HOST, port)
        _tell(f"{entrance.url}/mcp  (header: Authorization: Bearer {entrance.token})")
        guard = Guard(server.streamable_http_app(), entrance, methods=(*METHODS, "DELETE"))
        uvicorn.run(guard, host=_HOST, port=port, log_level="warning", server_header=False)
    finally:
        sessions.close()


def _serve_openenv(tasks: "Tasks", port: int) -> None:
    from blast_env.tools.openenv_door import openenv_app

    app = openenv_app(tasks)
    import uvicorn

    from blast_env.app.guard import Entrance, PathGuard, check_port

    check_port(_HOST, port)
    entrance = Entrance(_HOST, port)
    _tell(f"{entrance.url}/{entrance.token}")
    uvicorn.run(PathGuard(app, entrance), host=_HOST, port=port, log_level="warning")


def _tell(address: str) -> None:
    message_console().print(f"blast-env serve: {address}", soft_wrap=True, highlight=False)
