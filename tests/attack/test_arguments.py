"""Wrong types and enormous numbers in Python, markup and escapes on a command line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import blast_env
from blast_env import Charge, load_scenario, simulate
from blast_env.calibration import fit_power_law, kingery_bulmash, load_calibration
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation import evaluate_layout
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import write_atomically
from blast_env.site import Scenario, ScenarioError, save_scenario
from tests.scenarios import BALLISTIC_COURTYARD

ENORMOUS = 10**400
LONG = "x" * 100_000
FIVE: Any = 5
SOON: Any = "soon"
COURTYARD, FAR = load_scenario("courtyard"), Charge((ENORMOUS, 1), 1.0)
"""Arguments of types that the checker of types would refuse."""


def blast(**changes: Any) -> Callable[[], Any]:
    arguments = {"scenario": "courtyard", "engine": "event"} | changes
    return lambda: simulate(**arguments)


def evaluation(**changes: Any) -> Callable[[], Any]:
    arguments = {"scenario": "courtyard", "layout": (), "seeds": (0, 1), "engine": "event"}
    return lambda: evaluate_layout(**arguments | changes)


def kb(**changes: Any) -> Callable[[], Any]:
    arguments: dict[str, Any] = {"quantity": "reflected_impulse", "distance_m": 10.0}
    return lambda: kingery_bulmash(**{"charge_kg": 1.0} | arguments | changes)


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "seed 1.5": (blast(seed=1.5), r"^seed is 1.5, must be an integer from 0 to 922337203"),
    "seed none": (blast(seed=None), "^seed is nothing"),
    "seed 2**63": (blast(seed=2**63), "^seed is 9223372036854775808, must be an integer from 0"),
    "seed enormous": (blast(seed=ENORMOUS), "^seed is an integer of about 400 digits"),
    "engine 5": (blast(engine=5), "^engine is 5, must be a name or an engine"),
    "engine long": (blast(engine=LONG), "^no engine 'xxx"),
    "engine escape": (blast(engine="\x1b[31m"), r"^no engine '\\x1b\[31m'"),
    "layout 5": (blast(layout=5), "^layout is 5, must be a list"),
    "layout floats": (blast(layout=[(1.0, 2)]), "layout"),
    "layout enormous": (blast(layout=[(ENORMOUS, 0)]), "an integer of about 400 digits"),
    "scenario 5": (blast(scenario=5), "^scenario is 5, must be a name"),
    "scenario keys": (blast(scenario={1: 2}), "has the key 1: Keys should be strings"),
    "scenario null": (blast(scenario="\0"), r"null characters"),
    "scenario long": (blast(scenario=f"{LONG}.toml"), r"path is .* of 100005 characters"),
    "cells tiny": (blast(engine="gas", cell_m=1e-9), "^cell_m is 1e-09, .* at least 0.001 m"),
    "settled text": (lambda: GasEngine(settled_s=SOON), "^settled_s is 'soon', must be a number"),
    "settled nan": (lambda: GasEngine(settled_s=float("nan")), "^settled_s is nan, must be a fini"),
    "settled 0": (lambda: GasEngine(settled_s=0.0), "^settled_s is 0, must be above 0"),
    "cells enormous": (blast(engine="gas", cell_m=ENORMOUS), "^cell_m is an integer of about 400"),
    "cells of balls": (blast(cell_m="a"), "'event' has no cells"),
    "seeds 5": (evaluation(seeds=5), "^seeds is 5, must be integers"),
    "seeds 2**63": (evaluation(seeds=[0, 2**63]), r"^seeds\[1\] is 9223372036854775808, must be"),
    "processes a": (evaluation(processes="a"), "^processes is 'a'"),
    "cache 5": (evaluation(cache=5), "^cache is 5"),
    "calibration 5": (lambda: load_calibration(FIVE), "^path is 5, must be a path"),
    "quantity 5": (kb(quantity=5), "5"),
    "distance": (kb(distance_m=ENORMOUS), "must be made of numbers"),
    "fit": (lambda: fit_power_law([1, 2], [ENORMOUS, 1]), "must be made of numbers"),
    "charge 5": (lambda: COURTYARD.with_charge(FIVE), "^charge is 5, must be a Charge"),
    "charge enormous": (lambda: COURTYARD.with_charge(FAR), "an integer of about 400 digits"),
    "file 5": (lambda: save_scenario("courtyard", FIVE), "^path is 5, must be a path"),
    "file null": (lambda: save_scenario("courtyard", "a\0.toml"), "null characters"),
    "layout file 5": (lambda: blast_env.load_layout(FIVE), "^path is 5, must be a path"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_its_value(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises(BlastEnvError, match=words) as caught:
        call()
    assert len(str(caught.value)) < 1000


def test_a_path_that_is_none_is_refused_by_every_writer() -> None:
    result = simulate(BALLISTIC_COURTYARD, engine="event")
    for write in (
        result.to_excel,
        result.to_parquet,
        lambda path: write_atomically(path).__enter__(),
    ):
        with pytest.raises(BlastEnvError, match=r"^path is 5, must be a path"):
            write(FIVE)
    with pytest.raises(BlastEnvError, match=r"^calibration is 5, must be a Calibration"):
        result.impulse("building", FIVE)
    with pytest.raises(BlastEnvError, match=r"^no structure 5; known: building"):
        result.impulse(FIVE)


@pytest.mark.parametrize("text", ["\x1b[31mred", "a\0b", "a\u202eb", "a\x85b", "a\ud800b"])
def test_texts_of_a_scenario_do_not_steer_what_shows_them(text: str) -> None:
    document = BALLISTIC_COURTYARD.model_dump(mode="json", exclude_none=True)
    keep_out = {"corner_m": [20.0, 20.0], "size_m": [1.0, 1.0], "reason": text}
    document["build_zone"]["keep_outs"] = [keep_out]
    with pytest.raises(ScenarioError, match=r"keep_outs\[0\].reason: is '?a?") as caught:
        Scenario.from_document(document, "mine")
    assert str(caught.value).isprintable()


def invoke(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(map(str, arguments)), catch_exceptions=False)
    return result.exit_code, result.output


def test_what_looks_like_markup_is_shown_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    save_scenario(BALLISTIC_COURTYARD, "[red]a.toml")
    assert invoke("draw", "[/x]") == (1, "[/x]: must be a .toml file\n")
    code, output = invoke(
        "simulate", "[red]a.toml", "--engine", "event", "--excel", "[b]:smile:.xlsx"
    )
    assert code == 0
    assert "[b]:smile:.xlsx" in output
    assert (tmp_path / "[b]:smile:.xlsx").exists()
    for command in (("simulate", "[/x].toml"), ("train", "--resume", "[/x]")):
        code, output = invoke(*command)
        assert code == 2
        assert output.strip().startswith("error: [/x]")


def test_nothing_on_a_command_line_steers_the_terminal() -> None:
    code, output = invoke("simulate", "\x1b[31m\x9b\u202e.toml")
    assert code == 2
    assert output == "error: \\x1b[31m\\x9b\\u202e.toml: there is no such file\n"
