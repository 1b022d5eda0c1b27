"""The screening of the page: at once, and again after an edit."""

from pathlib import Path

from nicegui import ui
from nicegui.testing import User

from blast_env.app.session import Sessions
from tests.app.test_page import opened, play
from tests.gas_sites import glazed_hut, hut


def test_the_answer_stands_on_the_page_at_once(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, glazed_hut())
        user.find("Screening").click()
        await user.should_see("worst place by damage", retries=100)
        await user.should_see(kind=ui.table)
        session.put_site("no facade", hut())
        await user.should_see("Give structures windows or wall panels first", retries=50)

    play(tmp_path, story)
