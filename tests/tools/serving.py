"""Servers in processes and threads of their own, on loopback."""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

from blast_env.tools.scripts import Script

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}


@contextmanager
def served(*options: str) -> Iterator[tuple[int, str]]:
    """Run `blast-env serve` with a port; yield the port and the line that it prints."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "blast_env", "serve", *options, "--port", str(port)]
    with subprocess.Popen(command, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr is not None
        try:
            line = next(line for line in server.stderr if "://" in line)
            wait_for(port)
            yield port, line
        finally:
            server.terminate()
            server.stderr.close()


def wait_for(port: int) -> None:
    """Wait until a server listens."""
    for _ in range(600):
        try:
            socket.create_connection(("127.0.0.1", port)).close()
        except ConnectionRefusedError:
            time.sleep(0.1)
        else:
            return
    raise AssertionError("no server listens")


@contextmanager
def scripted_model(script: Callable[[], Script]) -> Iterator[str]:
    """Serve chat completions whose model is a script; yield the base URL.

    The model keeps nothing: it plays the script again through all results of a conversation.
    """

    class Completions(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            reply = {"role": "assistant", "content": next_call(script(), asked["messages"])}
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.end_headers()
            for part in parts(reply):
                self.wfile.write(f"data: {part}\n\n".encode())

        def log_message(self, *_: Any) -> None:
            """Print nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Completions) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/v1"
        server.shutdown()


def next_call(script: Script, messages: list[dict[str, Any]]) -> str:
    """Return the call of a tool that follows on the results of those before, as JSON.

    A call with an error is repeated: a guess may ask for it while the surrogate is compiled.
    """
    texts = [message["content"] for message in messages if message["role"] == "user"]
    asked = next(script)
    for text in texts[1:]:  # the first has the result of the reset
        observation = json.loads(text)["observation"]
        if not observation["error"]:
            asked = script.send(observation["result"])
    return json.dumps({"tool": asked[0], "arguments": asked[1]})


def parts(reply: dict[str, str]) -> Iterator[str]:
    """Yield a reply as the parts of a stream of chat completions."""
    common = {"id": "1", "object": "chat.completion.chunk", "created": 0, "model": "script"}
    usage = {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2}
    for delta, reason in ((reply, None), ({}, "stop")):
        choice = {"index": 0, "delta": delta, "finish_reason": reason}
        yield json.dumps({**common, "choices": [choice]})
    yield json.dumps({**common, "choices": [], "usage": usage})
    yield "[DONE]"
