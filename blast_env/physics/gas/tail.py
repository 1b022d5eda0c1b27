"""The tail of a blast: when its loads are complete, and about how much is still to come.

A charge sends several waves, and solids throw them to and fro. So the impulses are looked at again
and again. What came in the last two windows is held against what came in the two before: the
same ratio again and again makes a geometric series, whose sum is still to come. A pause between two
echoes says nothing, so that at least as much counts as came last; where pauses are longer, so is
what is looked back on. `python -m studies.gas until` holds it against blasts of twice the time.
"""

from collections import deque
from collections.abc import Sequence
from math import ceil, floor
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.physics.gas.probes import LoadTable

_WINDOWS: Final = 2


class Tail:
    """What came last on the points of some tables of loads.

    Args:
        tables: The tables.
        window_s: How far two looks are apart.
        on_s: A time at which one of them is.
        pause_s: The longest pause between echoes.
    """

    def __init__(
        self, tables: Sequence[LoadTable], window_s: float, on_s: float, pause_s: float = 0.0
    ) -> None:
        self._tables = tuple(tables)
        self._window_s = window_s
        self._windows = max(_WINDOWS, ceil(pause_s / window_s))
        self._next_s = on_s - window_s * floor(on_s / window_s)
        start = tuple(np.zeros(len(table.arrival_s)) for table in tables)
        looks = 2 * self._windows + 1
        self._looks = deque([(0.0, start)] * looks, maxlen=looks)

    @property
    def since_s(self) -> tuple[float, float]:
        """Where the last windows begin, and those before them; 0 before there are as many."""
        return self._looks[self._windows][0], self._looks[0][0]

    def look(self, time_s: float) -> bool:
        """Look at the impulses if a window has ended; return whether it has."""
        if time_s < self._next_s:
            return False
        self._looks.append((time_s, tuple(each.positive_impulse_pa_s for each in self._tables)))
        self._next_s += self._window_s
        return True

    def came_pa_s(self, table: int) -> tuple[FloatArray, FloatArray]:
        """Return what came on the points of a table last, and before that, Pa s (n,)."""
        now = self._tables[table].positive_impulse_pa_s
        middle, first = self._looks[self._windows][1][table], self._looks[0][1][table]
        return now - middle, middle - first
