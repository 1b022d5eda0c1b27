"""Questions on the page: screening, and the answers of `assess`, its capacity and `advise`."""

from functools import partial
from pathlib import Path

import pytest
from nicegui import ui
from nicegui.testing import User

from blast_env.answers import Document, Line, Table, assess
from blast_env.answers.assess import assessment, governing
from blast_env.app.jobs import Workers
from blast_env.app.kept import write_kept
from blast_env.app.placing import plain
from blast_env.app.session import Session, Sessions
from blast_env.app.work import ANSWER, Answer, Question, read_status
from blast_env.design.search import advised
from blast_env.errors import BlastEnvError
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.questions.probability import level_probability
from blast_env.evaluation.questions.verdict import consequences_by_layout
from blast_env.response import LevelOfProtection
from blast_env.site import Scenario
from tests.app.test_page import opened, play
from tests.app.test_work import session_on
from tests.gas_sites import WALL, glazed_hut, hut
from tests.site.test_hardening import glazed_yard

LOW = LevelOfProtection.LOW


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (advised, assess):
        monkeypatch.setattr(module, "level_probability", partial(level_probability, draws=50))


def hut_with_wall(folder: Path) -> Session:
    session = session_on(folder, glazed_hut())
    session.put("wall", session.design.with_layout(WALL))
    return session


def test_the_page_assesses_as_the_command_does(tmp_path: Path) -> None:
    session = hut_with_wall(tmp_path)
    status = read_status(session.ask(Question.ASSESS, LOW, 0.2, 1))
    ((answer, is_present),) = session.answers()
    campaign = Campaign.on(
        *(session.scenario, {"no barrier": (), "layout A": WALL}, session.chosen_threats()),
        *(session.engine, session.engine.coarser, session.work.cache),  # no blast runs again
    )
    blasts = campaign.run(worst=governing)
    assert campaign.evaluator.counts.blasts == 0
    parts = assessment(blasts, consequences_by_layout(blasts), LOW, 0.2)
    assert repr(answer.document) == repr(Document.of(parts))  # NaN differ
    assert status.text == answer.document.first
    assert status.text.startswith("hut, layout A: DOES NOT COMPLY")
    assert is_present
    session.put("no wall", session.design.with_layout(()))
    assert [case for _, case in session.answers()] == [False]


def test_advice_can_be_used(tmp_path: Path) -> None:
    session = session_on(tmp_path, glazed_yard(charges="mean"))
    status = read_status(session.ask(Question.ADVISE, LOW, 0.1, 1))
    assert (status.state, status.text[:5]) == ("done", "Walls")
    ((answer, _),) = session.answers()
    (table,) = (part for part in answer.document.parts if isinstance(part, Table))
    assert [row[0] for row in table.rows] == ["nothing", "shield", "harden", "together"]
    session.take(status, 0)
    assert plain(session.design.layout) == status.layout


@pytest.mark.parametrize(
    ("site", "question", "mass_error", "reason"),
    [
        (hut(), Question.ASSESS, 0.1, "Give structures windows"),
        (glazed_hut(), Question.CAPACITY, 0.5, "mass is 0.5, must be at most 0.3"),
        (glazed_hut(), Question.ADVISE, 0.1, "the build zone has no budget"),
    ],
)
def test_a_question_without_an_answer_says_why(
    tmp_path: Path,
    site: Scenario,
    question: Question,
    mass_error: float,
    reason: str,
) -> None:
    session = session_on(tmp_path, site)
    with pytest.raises(BlastEnvError, match=reason):
        session.ask(question, LOW, mass_error, 5)
    assert session.jobs() == []


def test_the_answer_is_on_the_page_until_the_layout_changes(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        sessions.workers = Workers(most=0)  # nothing is done but what is written here
        session = await opened(user, sessions, glazed_hut())
        user.find("Verdict").click()
        user.find(marker="assess").click()
        await user.should_see("up to 2 blasts of gas")
        (folder, _), *_ = session.jobs()
        table = Table.of("largest", ("layout", "low"), [("A", "12")])
        document = Document.of([Line.of("complies"), table])
        answer = Answer(question=Question.CAPACITY, subject=session.subject, document=document)
        write_kept(answer, folder / ANSWER)
        await user.should_see("Up to which charge?")
        await user.should_see("complies")
        rows = [row for element in user.find(kind=ui.table).elements for row in element.rows]
        assert {"id": 0, "0": "A", "1": "12"} in rows
        await user.should_not_see("have changed since")
        session.put("wall", session.design.with_layout(WALL))
        await user.should_see("have changed since")

    play(tmp_path, story)


def test_the_answer_stands_on_the_page_at_once(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, glazed_hut())
        user.find("Screening").click()
        await user.should_see("worst place by damage")
        await user.should_see(kind=ui.table)
        session.put_site("no facade", hut())
        await user.should_see("Give structures windows or wall panels first")

    play(tmp_path, story)
