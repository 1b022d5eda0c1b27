"""Sessions: what is charged, what is scored, and what a lost call may do."""

import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from math import prod
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.benchmark import Definition, ReferenceLayout, stored_references
from blast_env.errors import BlastEnvError
from blast_env.geometry import Piece
from blast_env.tools import TOOLS, Session, call_tool
from tests.benchmark.row import RowEngine
from tests.tools.row_session import (
    BEST,
    NAME,
    REFERENCE,
    HeldEngine,
    said,
    session,
    submitted,
    walls,
)

WALL = walls(BEST[0])


@pytest.fixture
def own() -> Iterator[Session]:
    found = session()
    yield found
    found.close()


def test_nothing_scores_0_and_the_best_known_1() -> None:
    """Linear in the share taken off: one wall leaves 0.9, the best known three 0.9 ** 3."""
    scores = [submitted(session(), *pieces) for pieces in ((), BEST, BEST[:1])]
    assert scores == pytest.approx([0.0, 1.0, 0.1 / (1.0 - 0.9**3)])


def test_a_score_ends_at_1() -> None:
    assert submitted(session(), *BEST, Piece(12, 3, "low_wall", True)) == 1.0


def test_random_layouts_stay_a_tenth_below_the_oracle() -> None:
    """The floor of agents that do not look: nothing, and random layouts of five seeds."""
    scores = []
    for seed in range(5):
        own = session(seed)
        drawn = call_tool(own, "rules", {}).model_dump()["proposals"][-1]
        assert drawn["rule"] == "random"
        scores.append(call_tool(own, "submit", {"layout": drawn["layout"]}))
    found = [score.model_dump()["score"]["score"] for score in scores]
    assert sum(found) / len(found) < 0.9


def test_the_seed_draws_the_random_layout_alone() -> None:
    """Equal seeds give equal results of all tools, others another random layout."""

    def played(seed: int) -> list[object]:
        own = session(seed)
        calls = [call_tool(own, name, {}) for name in ("look", "rules")]
        calls += [call_tool(own, name, {"layout": WALL}) for name in ("check", "blast", "submit")]
        return [said(answer) for answer in calls]

    first, again, other = played(4), played(4), played(5)
    assert first == again
    assert first[2:] == other[2:]
    assert first[1] != other[1]
    with pytest.raises(BlastEnvError, match="seed"):
        session(-1)


def test_a_blast_is_charged_once_for_each_layout(own: Session) -> None:
    first = call_tool(own, "blast", {"layout": WALL})
    again = call_tool(own, "blast", {"layout": WALL})
    assert said(first) == said(again)
    assert first.blasts_left == 2
    two = walls(*BEST[:2])
    turned_round = [call_tool(own, "blast", {"layout": order}) for order in (two, two[::-1])]
    assert said(turned_round[0]) == said(turned_round[1])
    assert turned_round[0].blasts_left == 1
    call_tool(own, "blast", {"layout": walls(*BEST)})
    with pytest.raises(BlastEnvError, match="of which 0 are left: `guess` is free"):
        call_tool(own, "blast", {"layout": walls(BEST[1])})
    assert said(call_tool(own, "blast", {"layout": WALL}))["blast"] == said(first)["blast"]


def test_what_is_refused_costs_nothing(own: Session) -> None:
    for wrong in (walls(Piece(99, 0, "low_wall")), walls(BEST[0], BEST[0]), [{"row": 1}]):
        with pytest.raises(BlastEnvError):
            call_tool(own, "blast", {"layout": wrong})
    assert call_tool(own, "look", {}).blasts_left == 3


def test_a_failed_blast_costs_nothing_and_may_be_repeated() -> None:
    engine = HeldEngine()
    engine.go.set()
    own = session(budget=1, engine=engine)
    engine.fails.set()
    with pytest.raises(BlastEnvError, match="nothing was charged: the air ran out; try again"):
        call_tool(own, "blast", {"layout": WALL})
    with pytest.raises(BlastEnvError, match="nothing was charged"):
        call_tool(own, "submit", {"layout": WALL})
    engine.fails.clear()
    assert call_tool(own, "blast", {"layout": WALL}).blasts_left == 0
    assert submitted(own, *BEST) == 1.0


def test_a_long_blast_gives_a_ticket_and_a_lost_call_may_be_repeated() -> None:
    engine = HeldEngine()
    own = session(budget=2, engine=engine, wait_s=0.01)
    lost, again = (call_tool(own, "blast", {"layout": WALL}).model_dump() for _ in range(2))
    assert lost["running"]
    assert lost["ticket"] == again["ticket"]
    call_tool(own, "blast", {"layout": walls(BEST[1])})
    with pytest.raises(BlastEnvError, match="2 of them for blasts that are running"):
        call_tool(own, "blast", {"layout": walls(BEST[2])})
    engine.go.set()
    found = polled(own, lost["ticket"])
    assert found["blast"]["share"] == pytest.approx(0.9)
    assert found["blast"]["charged"] == 1


def test_a_submission_that_takes_long_is_scored_once() -> None:
    """Another layout is refused meanwhile, and so is everything once the score was given."""
    engine = HeldEngine()
    own = session(engine=engine, wait_s=0.01)
    layout = walls(*BEST)
    ticket = call_tool(own, "submit", {"layout": layout}).model_dump()["ticket"]
    assert call_tool(own, "submit", {"layout": layout}).model_dump()["running"]
    for name, arguments in (("submit", {"layout": WALL}), ("look", {}), ("guess", {"layout": []})):
        with pytest.raises(BlastEnvError, match=f"being judged: call `poll` with .*{ticket}"):
            call_tool(own, name, arguments)
    engine.go.set()
    assert polled(own, ticket)["score"]["score"] == 1.0
    calls = {"look": {}, "rules": {}, "poll": {"ticket": ticket}}
    for name in TOOLS:
        with pytest.raises(BlastEnvError, match=r"ended with the score 1\.0000.*another session"):
            call_tool(own, name, calls.get(name, {"layout": layout}))


def polled(own: Session, ticket: str) -> dict:
    for _ in range(3000):
        found = call_tool(own, "poll", {"ticket": ticket}).model_dump()
        if not found["running"]:
            return found
    raise AssertionError("still running")


def test_one_of_many_threads_is_given_the_score() -> None:
    own = session()

    def submits(_: int) -> bool:
        try:
            return call_tool(own, "submit", {"layout": WALL}).model_dump()["score"] is not None
        except BlastEnvError:
            return False

    with ThreadPoolExecutor(8) as threads:
        assert sum(threads.map(submits, range(8))) == 1


def test_sessions_share_nothing(own: Session) -> None:
    other = session()
    call_tool(own, "blast", {"layout": WALL})
    submitted(own, *BEST)
    assert call_tool(other, "look", {}).blasts_left == 3
    assert call_tool(other, "blast", {"layout": WALL}).model_dump()["blast"]["charged"] == 1
    with pytest.raises(BlastEnvError, match="no ticket"):
        call_tool(other, "poll", {"ticket": "submit-0"})


@pytest.mark.parametrize("name", [NAME, "guard_post-response-v2"])
def test_no_observation_has_the_best_known_layout(name: str) -> None:
    """Neither whole among the proposals, nor any piece of it or its share in the site."""
    own = Session(name, engine="surrogate", judge_cell_m=None, wait_s=300.0)
    best = stored_references()[name].best
    proposals = call_tool(own, "rules", {}).model_dump()["proposals"]
    for proposal in proposals:
        assert sorted(map(str, proposal["layout"])) != sorted(map(str, walls(*best.layout)))  # type: ignore[arg-type]
    seen = call_tool(own, "look", {}).model_dump_json()
    assert "turned" not in seen
    for share in best.shares.values():
        assert f"{share:.4f}" not in seen


def test_a_guess_is_free_and_has_an_interval() -> None:
    own = Session(NAME, engine="surrogate", judge_cell_m=None, wait_s=300.0)
    found = call_tool(own, "guess", {"layout": WALL}).model_dump()
    assert found["low"] < found["share"] < found["high"]
    assert found["share"] == pytest.approx(
        call_tool(own, "blast", {"layout": WALL}).model_dump()["blast"]["share"]
    )
    assert found["blasts_left"] == 10
    assert re.search(r"loads by gas \d+, with", found["validity"])
    nothing = call_tool(own, "guess", {"layout": []}).model_dump()
    assert (nothing["low"], nothing["share"], nothing["high"]) == (1.0, 1.0, 1.0)


@pytest.mark.slow
def test_a_problem_without_a_stored_reference_is_scored_by_the_best_proposal() -> None:
    """The best of the rules is at most a little worse than the package's proposal."""
    own = Session(
        Definition("site_3", "known"), engine=RowEngine(), judge_cell_m=None, wait_s=300.0
    )
    rules = call_tool(own, "rules", {}).model_dump()["proposals"][:-1]

    def left(layout: list[dict]) -> float:
        return prod(1.0 - 0.1 / (1.0 + abs(piece["row"] - RowEngine().row)) for piece in layout)

    best = min((proposal["layout"] for proposal in rules), key=left)
    score = call_tool(own, "submit", {"layout": best}).model_dump()["score"]
    assert score["share"] == pytest.approx(left(best))
    assert score["best_share"] <= score["share"]
    assert 0.0 < score["score"] <= 1.0


def test_what_is_better_than_a_best_known_layout_that_takes_nothing_off_scores_1() -> None:
    """It had scored 0, as nothing placed does: on a generated site no rule may help."""
    known = replace(REFERENCE, best=ReferenceLayout("nothing", ()))
    assert submitted(session(reference=known)) == 0.0
    assert submitted(session(reference=known), *BEST[:1]) == 1.0


def test_ten_thousand_calls() -> None:
    own = session(wait_s=0.01)
    ticket = call_tool(own, "blast", {"layout": WALL}).model_dump()["ticket"]
    for _ in range(10_000):
        assert call_tool(own, "poll", {"ticket": ticket}).blasts_left == 2
    assert submitted(own, *BEST) == 1.0


words = st.text(max_size=8) | st.integers() | st.none() | st.booleans() | st.floats(allow_nan=False)
values = st.recursive(words, lambda inner: st.lists(inner) | st.dictionaries(words.map(str), inner))


def test_malformed_arguments_are_refused_in_words() -> None:
    own = session()

    @given(st.sampled_from([*TOOLS]), st.dictionaries(st.sampled_from(("layout", "x")), values))
    def calls(name: str, arguments: dict) -> None:
        with suppress(BlastEnvError):  # no other error
            call_tool(own, name, arguments)

    calls()


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("shoot", {}, "no tool 'shoot'.*known: blast, check"),
        ("look", {"path": "/etc"}, "path is '/etc'.*its arguments: picture"),
        ("blast", {}, "layout is missing; its arguments: layout"),
        ("blast", {"layout": [{"row": -1, "column": 0}]}, r"layout\[0\].row is -1"),
        ("blast", {"layout": [{"row": 1, "column": 0, "item": "wal"}]}, "`check` has all reasons"),
        ("blast", {"layout": [{"row": 1, "column": 0}]}, "row 1, column 0 has no `item`.*low_wall"),
        ("check", None, "check was not called: Input should be an object; its arguments: layout"),
        ("poll", {"ticket": "lottery"}, "there is no ticket 'lottery': `blast` and `submit` give"),
    ],
)
def test_errors_name_the_way_out(own: Session, name: str, arguments: Any, message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        call_tool(own, name, arguments)


def test_layouts_of_the_package_are_taken_as_they_are(own: Session) -> None:
    """As searches, rules and agents return them, or written by hand."""
    by_hand: Any = [(12, 0, "low_wall", True)]
    assert own.check(BEST[:1]).legal
    assert own.check(by_hand).legal
    assert said(own.blast(BEST[:1]))["blast"] == said(own.blast(by_hand))["blast"]
    assert own.check([(12, 0)]).reasons[0].startswith("a piece: has 2 values, must be (row, column")
    with pytest.raises(BlastEnvError, match="nothing was charged: a piece: is 'w'"):
        own.guess("wall")  # type: ignore[arg-type]


def test_check_has_a_reason_for_each_piece(own: Session) -> None:
    wrong = Piece(99, 0, "low_wall"), Piece(0, 0, "lowwall")
    found = call_tool(own, "check", {"layout": walls(BEST[0], *wrong)}).model_dump()
    assert not found["legal"]
    assert len(found["reasons"]) == 2
    unnamed = call_tool(own, "check", {"layout": [{"row": 1, "column": 0}]}).model_dump()
    assert unnamed["reasons"] == (
        "the piece at row 1, column 0 has no `item`, which must be one of high_wall, low_wall",
    )
    assert found["cost"] == call_tool(own, "check", {"layout": WALL}).model_dump()["cost"] == 9.0


def test_look_has_the_plan_and_a_picture(own: Session) -> None:
    found = call_tool(own, "look", {"picture": True}).model_dump()
    assert found["picture"]["base64"].startswith("iVBOR")  # PNG
    assert len(found["plan"]) == found["rows"]
    assert {len(row) for row in found["plan"]} == {found["columns"]}
    assert {item["item"] for item in found["items"]} == {"high_wall", "low_wall"}
    assert found["score_1"].endswith("surrogate, 50 blasts, seed 1") is False


def test_no_tool_takes_a_path_or_code() -> None:
    """All arguments are numbers, truth values, names of items, and tickets."""
    known = {"layout", "row", "column", "item", "turned", "picture", "ticket"}
    for tool in TOOLS.values():
        properties = json.dumps(tool.argument_schema)
        named = {*tool.arguments.model_fields}
        assert named <= known, tool.name
        assert "format" not in properties
        assert tool.result_schema["type"] == "object"
