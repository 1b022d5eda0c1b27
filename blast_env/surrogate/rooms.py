"""Room for arrays: new, or kept for what is needed for a moment and no longer.

The pages of new memory take longer than what is written to them.
"""

from collections.abc import Callable
from math import prod
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.uint8]

FLOAT: Final = np.dtype(np.float64)
SINGLE: Final = np.dtype(np.float32)
BYTE: Final = np.dtype(np.uint8)
BOOL: Final = np.dtype(np.bool_)

Room = Callable[[str, tuple[int, ...], np.dtype[Any]], NDArray[Any]]
"""Returns an array of a name, shape and type, with any content."""


def new_room(_name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return a new array."""
    return np.empty(shape, dtype)


class KeptRoom:
    """Gives arrays of its own, one of each name: a name asked for again takes the earlier one."""

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[Any]] = {}

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        return sum(array.nbytes for array in self._kept.values())

    def __call__(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array of a name, shape and type, with any content."""
        size = prod(shape)
        kept = self._kept.get(name)
        if kept is None or kept.size < size:
            kept = self._kept[name] = np.empty(size, dtype)
        return kept[:size].reshape(shape)
