"""What a league has found out, kept in a folder so that an interrupted one goes on.

A change of the code, the versions, the scenario or the case makes it another result.
"""

import json
import re
from functools import cache
from hashlib import sha256
from inspect import getfile
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, TypeAdapter

import blast_agents
from blast_agents.league.entries import LeagueEntry
from blast_agents.league.tracks import practice_of
from blast_agents.search import Proposal
from blast_env.documents import checked_as, parse_json
from blast_env.engines import Engine, find_engine
from blast_env.evaluation import Case, Threat
from blast_env.evaluation.store import calibration_digest, engine_text
from blast_env.files import FolderStore
from blast_env.geometry import Layout
from blast_env.provenance import code_version, versions
from blast_env.scenario import AnyCharge, AnyScenario, VehicleCharge, check_layout

_PACKAGES: Final = ("numpy", "pymoo")
"""What a search draws its numbers with."""
_NO_INFLUENCE: Final = ("figure.py",)
_ADDRESS: Final = re.compile(r" at 0x[0-9a-f]+")


def search_key(case: Case, entry: LeagueEntry, engine: str | Engine) -> str:
    """Return all that a search's proposal for a case depends on, as a text.

    Raises:
        CalibrationError: If the scenario has no calibration for the engine.
        UnknownNameError: If there is no such engine.
    """
    method = repr(entry.proposer)
    if entry.first_engine is not None:
        method += f" by {engine_text(find_engine(entry.first_engine))}, {entry.finalists} judged"
    # Functions among the settings: their names, and not where this process has them.
    method = _ADDRESS.sub("", method)
    code = _search_code(Path(getfile(type(entry.proposer))).parent)
    threats = practice_of(case).threats
    return _key("search", case, engine, threats, method, entry.budget, case.seed, code)


def evaluation_key(case: Case, layout: Layout, engine: str | Engine) -> str:
    """Return all that the loads with a layout on a case's held-out threats depend on.

    Raises:
        CalibrationError: If the scenario has no calibration for the engine.
        UnknownNameError: If there is no such engine.
    """
    return _key("loads", case, engine, case.threats, tuple(sorted(layout)))


_PROPOSAL: Final = TypeAdapter(Proposal)
Load = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_LOADS: Final = TypeAdapter(tuple[Load, ...])


class ResultStore:
    """Keeps results in the files of a folder; see `FolderStore`.

    Args:
        folder: The folder; it is made if need be.

    Raises:
        BlastEnvError: If the folder cannot be made.
    """

    def __init__(self, folder: str | Path) -> None:
        self._store = FolderStore(folder, ".result")

    @property
    def folder(self) -> Path:
        """The folder, as an absolute path."""
        return self._store.folder

    def proposal(self, key: str, scenario: AnyScenario) -> Proposal | None:
        """Return what a search proposed for a scenario, or `None` if that is not known.

        Args:
            key: Of `search_key`.
            scenario: The scenario; a layout that does not fit it counts as not known.
        """

        def decode(content: bytes) -> Proposal:
            proposal = checked_as(Proposal, parse_json(content.decode()))
            check_layout(scenario, proposal.layout)
            return proposal

        return self._store.read(key, decode)

    def keep_proposal(self, key: str, proposal: Proposal) -> None:
        """Keep what a search proposed.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        self._store.put(key, _PROPOSAL.dump_json(proposal))

    def loads(self, key: str, threats: int) -> tuple[float, ...] | None:
        """Return the loads under the threats, in the objective's unit; `None`: not known.

        Args:
            key: Of `evaluation_key`.
            threats: How many there are.
        """

        def decode(content: bytes) -> tuple[float, ...]:
            loads = checked_as(tuple[Load, ...], parse_json(content.decode()))
            if len(loads) != threats:
                raise ValueError(f"{len(loads)} loads of {threats} threats")
            return loads

        return self._store.read(key, decode)

    def keep_loads(self, key: str, loads: tuple[float, ...]) -> None:
        """Keep the loads under the threats, in the unit of the objective.

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
    """Return a charge as what JSON knows."""
    if isinstance(charge, VehicleCharge):
        return charge.source.model_dump(mode="json"), charge.rank
    return charge


@cache
def _search_code(own: Path) -> str:
    """Return a digest of the code that a search depends on, with versions.

    Args:
        own: The folder of its method, for those that are not with all the others.
    """
    folder = Path(blast_agents.__file__).parent
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
