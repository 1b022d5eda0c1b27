"""Stored results of a league, in a folder, so that an interrupted league continues.

A change of the code, the versions, the scenario or the case invalidates a stored result.
"""

import json
import re
from functools import cache
from hashlib import sha256
from inspect import getfile
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, TypeAdapter

from blast_agents.league.entries import LeagueEntry
from blast_agents.league.tracks import practice_of
from blast_env import design
from blast_env.design.search import Proposal
from blast_env.documents import checked_as, parse_json
from blast_env.evaluation import Case, Threat
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.store import calibration_digest, engine_text
from blast_env.files import FolderStore
from blast_env.geometry import Layout
from blast_env.layout import check_layout
from blast_env.provenance import code_version, versions
from blast_env.site import AnyCharge, AnyScenario, VehicleCharge

_PACKAGES: Final = ("numpy", "pymoo")
"""Packages of the random numbers of searches."""
_NO_INFLUENCE: Final = ("figure.py",)
_ADDRESS: Final = re.compile(r" at 0x[0-9a-f]+")


def search_key(case: Case, entry: LeagueEntry, engine: str | Engine) -> str:
    """Return the key of a search's proposal for a case: its dependencies as a text.

    Raises:
        CalibrationError: If the scenario has no calibration for the engine.
        UnknownNameError: If the engine is unknown.
    """
    method = repr(entry.proposer)
    if entry.first_engine is not None:
        method += f" by {engine_text(find_engine(entry.first_engine))}, {entry.finalists} judged"
    # Functions among the settings: their names, without their addresses in this process.
    method = _ADDRESS.sub("", method)
    code = _search_code(Path(getfile(type(entry.proposer))).parent)
    threats = practice_of(case).threats
    return _key("search", case, engine, threats, method, entry.budget, case.seed, code)


def evaluation_key(case: Case, layout: Layout, engine: str | Engine) -> str:
    """Return the key of the loads of a layout on a case's held-out threats.

    Raises:
        CalibrationError: If the scenario has no calibration for the engine.
        UnknownNameError: If the engine is unknown.
    """
    return _key("loads", case, engine, case.threats, tuple(sorted(layout)))


_PROPOSAL: Final = TypeAdapter(Proposal)
Load = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_LOADS: Final = TypeAdapter(tuple[Load, ...])


class ResultStore:
    """Stores results in the files of a folder; see `FolderStore`.

    Args:
        folder: The folder; it is created if necessary.

    Raises:
        BlastEnvError: If the folder cannot be created.
    """

    def __init__(self, folder: str | Path) -> None:
        self._store = FolderStore(folder, ".result")

    @property
    def folder(self) -> Path:
        """The folder, as an absolute path."""
        return self._store.folder

    def proposal(self, key: str, scenario: AnyScenario) -> Proposal | None:
        """Return the stored proposal of a search for a scenario, or `None` if there is none.

        Args:
            key: Key from `search_key`.
            scenario: The scenario; a layout that does not fit it is ignored.
        """

        def decode(content: bytes) -> Proposal:
            proposal = checked_as(Proposal, parse_json(content.decode()))
            check_layout(scenario, proposal.layout)
            return proposal

        return self._store.read(key, decode)

    def keep_proposal(self, key: str, proposal: Proposal) -> None:
        """Store the proposal of a search.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        self._store.put(key, _PROPOSAL.dump_json(proposal))

    def loads(self, key: str, threats: int) -> tuple[float, ...] | None:
        """Return the stored loads, one per threat in the objective's unit, or `None`.

        Args:
            key: Key from `evaluation_key`.
            threats: Number of threats.
        """

        def decode(content: bytes) -> tuple[float, ...]:
            loads = checked_as(tuple[Load, ...], parse_json(content.decode()))
            if len(loads) != threats:
                raise ValueError(f"{len(loads)} loads of {threats} threats")
            return loads

        return self._store.read(key, decode)

    def keep_loads(self, key: str, loads: tuple[float, ...]) -> None:
        """Store the loads, one per threat, in the unit of the objective.

        Raises:
            BlastEnvError: If they cannot be written.
        """
        self._store.put(key, _LOADS.dump_json(loads))


def _key(
    what: str, case: Case, engine: str | Engine, threats: tuple[Threat, ...], *others: object
) -> str:
    found = find_engine(engine)
    law = found.calibration(case.scenario)
    digest = "" if law is None else calibration_digest(law)
    model = (case.scenario.content_hash, engine_text(found), digest, code_version())
    met = [(_plain(each.charge), each.seed) for each in threats]
    return json.dumps([what, model, met, others])


def _plain(charge: AnyCharge) -> object:
    """Return a charge as JSON-compatible data."""
    if isinstance(charge, VehicleCharge):
        return charge.source.model_dump(mode="json"), charge.rank
    return charge


@cache
def _search_code(own: Path) -> str:
    """Return a digest of the code of a search, with versions.

    Args:
        own: The folder of its method, for methods outside `blast_env.design.search`.
    """
    folder = Path(design.__file__).parent
    paths = sorted((folder / "search").glob("*.py"))
    if own != folder / "search":
        paths += sorted(own.glob("*.py"))
    digest = sha256()
    for path in (*paths, folder / "rules.py", folder / "posts.py"):
        if path.name not in _NO_INFLUENCE:
            digest.update(f"{path.name}\n".encode() + path.read_bytes())
    known = versions(packages=_PACKAGES)
    drawn_with = " ".join(f"{name} {known[name]}" for name in _PACKAGES)
    return f"{digest.hexdigest()[:16]} {drawn_with}"
