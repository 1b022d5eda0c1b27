"""The door by OpenEnv: the environment itself, and a server with the package's own client."""

import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

openenv = pytest.importorskip("openenv", reason="needs the extra openenv: `make matrix-openenv`")

from openenv import GenericEnvClient  # noqa: E402

from blast_env.provenance import package_version  # noqa: E402
from blast_env.tools import TOOLS, Tasks, played, played_in  # noqa: E402
from blast_env.tools.openenv_door import ToolCall, ToolEnvironment  # noqa: E402
from blast_env.tools.scripts import rules_guesses_blasts  # noqa: E402
from tests.tools.row_session import BEST, session, walls  # noqa: E402
from tests.tools.serving import served  # noqa: E402

SECRET = "correct horse"


@pytest.fixture
def environment() -> Iterator[ToolEnvironment]:
    found = ToolEnvironment(Tasks(SECRET, lambda _, seed, budget: session(seed, budget)))
    yield found
    found.close()


def call(environment: ToolEnvironment, tool: str, **arguments: Any) -> Any:
    return environment.step(ToolCall(tool=tool, arguments=arguments))


def test_a_script_gets_the_score_that_python_gets(environment: ToolEnvironment) -> None:
    """Rewards of all steps sum to the score, which trainers take for the return."""
    rewards = []

    def step(tool: str, arguments: dict[str, Any]) -> dict[str, Any]:
        found = call(environment, tool, **arguments)
        rewards.append(found.reward)
        return found.result

    environment.reset(budget=3)
    score = played(rules_guesses_blasts(), step)
    assert score == played_in(rules_guesses_blasts(), session())
    assert sum(rewards) == score > 0.0


def test_full_zero_malformed_and_reseeded(environment: ToolEnvironment) -> None:
    seen = []
    for seed, layout, score in ((0, walls(*BEST), 1.0), (0, [], 0.0), (1, [], 0.0)):
        first = environment.reset(seed=seed, episode_id="one")
        assert set(first.tools or ()) == set(TOOLS)
        seen.append(call(environment, "rules").result["proposals"])
        found = call(environment, "submit", layout=layout)
        assert (found.reward, found.done) == (score, True)
        again = call(environment, "submit", layout=layout)
        assert (again.reward, again.done) == (0.0, True)
        assert "begin another session" in again.error
        assert (environment.state.episode_id, environment.state.step_count) == ("one", 3)
    assert seen[0] == seen[1] != seen[2]
    environment.reset()
    for tool, arguments in (("submit", {}), ("submit", {"layout": "all"}), ("dig", {})):
        refused = call(environment, tool, **arguments)
        assert (refused.reward, refused.done, refused.result) == (0.0, False, None)
        assert refused.error


def test_an_environment_is_made_of_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As trainers make it that are given the name of its class alone, such as NeMo Gym."""
    assert ToolEnvironment().list_splits() == ["train", "benchmark"]
    monkeypatch.setenv("BLAST_ENV_SECRET", SECRET)
    assert ToolEnvironment().list_splits() == ["train", "test", "benchmark"]


def test_a_step_before_a_reset_ends_at_once(environment: ToolEnvironment) -> None:
    for _ in range(2):
        found = call(environment, "look")
        assert (found.done, found.reward) == (True, 0.0)
        assert found.error == "no episode has begun: call reset"
        wrong = environment.reset(split="trial")
        assert wrong.done
        assert "split" in wrong.error


def test_a_server_needs_its_address_and_keeps_clients_apart() -> None:
    with served("--openenv") as (port, line):
        address = line.split()[-1]
        with pytest.raises(urllib.error.HTTPError, match="403"):
            answered(f"http://127.0.0.1:{port}/schema")
        assert b"ToolCall" in answered(f"{address}/schema")
        assert package_version() in answered(f"{address}/metadata").decode()
        validate = [str(Path(sys.executable).with_name("openenv")), "validate", "--url", address]
        report = subprocess.run(validate, capture_output=True, text=True, check=False).stdout
        assert "Verdict: PASS" in report, report
        by_clients(address)


def answered(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=10.0) as answer:
        return bytes(answer.read())


def by_clients(address: str) -> None:
    with GenericEnvClient(base_url=address).sync() as one:
        assert "call reset" in one.step({"tool": "look"}).observation["error"]
        first = one.reset(split="benchmark", index=0, budget=0, seed=3)
        with GenericEnvClient(base_url=address).sync() as two:
            other = two.reset(split="benchmark", index=1, budget=2)
            assert other.observation["result"]["problem"] != first.observation["result"]["problem"]
            found = one.step({"tool": "look"})
            assert found.observation["result"]["problem"] == "control_room-known-v2"
            refused = one.step({"tool": "blast", "arguments": {"layout": []}})
            assert not refused.done
