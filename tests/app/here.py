"""The page's work without processes of its own, and the rows of its tables."""

import pickle
from types import SimpleNamespace

from blast_env.answers import Table
from blast_env.answers.document import TYPOGRAPHIC
from blast_env.app.jobs import Workers, do


def rows_of(table: Table) -> list[SimpleNamespace]:
    """Return the rows by headers without units: `its_probability`."""
    names = [
        header.partition(" (")[0].partition(":")[0].replace(" ", "_") for header in table.headers
    ]
    return [
        SimpleNamespace(**dict(zip(names, row, strict=True))) for row in table.cells(TYPOGRAPHIC)
    ]


class Here(Workers):
    """Does all work at once and in this process."""

    def tick(self) -> None:
        while self._waiting:
            folder, task = self._waiting.popleft()
            do(folder, pickle.loads(pickle.dumps(task)))
