"""The attacks on the page, one of each kind, and whether they would notice."""

from collections.abc import Iterator
from itertools import islice

import pytest

from tests.attack.web import ATTACKS, SCRIPTS, Victim, runs, scenarios_with_scripts, victim


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Victim]:
    with victim(tmp_path_factory.mktemp("attacked") / "work") as found:
        yield found


@pytest.mark.parametrize("name", ["host", "frame", "token"])
def test_a_real_server_holds(server: Victim, name: str) -> None:
    """Every seventh: all of them take `make attack`."""
    for attack, attempt in [*ATTACKS[name](server)][::7]:
        assert not attempt(), attack
    assert not server.is_well()


def test_scripts_are_stored_and_would_be_noticed() -> None:
    assert len([*islice(scenarios_with_scripts(), len(SCRIPTS))]) == len(SCRIPTS)
    for each in SCRIPTS[:5]:
        assert runs(f"<div>{each}\n</div>") or "script" in each
