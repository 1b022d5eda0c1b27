"""A search in a file of its own, as a user would add one."""

from dataclasses import dataclass

from blast_env.design.search import Search, SearchSession
from blast_env.rules import random_layout


@dataclass(frozen=True)
class OneAfterAnother(Search):
    """Tries random layouts one at a time."""

    name: str = "one_after_another"

    def explore(self, session: SearchSession) -> None:
        """Try them until the session ends it."""
        while True:
            session.assess([random_layout(session.problem.scenario, session.rng)])
