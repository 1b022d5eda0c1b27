"""Room for arrays: new, or kept for what is needed for a moment and no longer.

The pages of new memory take longer than what is written to them.
"""

from collections.abc import Callable, Hashable
from math import prod
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.uint8]
Numbers = NDArray[np.int32]
Made = TypeVar("Made")

FLOAT: Final = np.dtype(np.float64)
SINGLE: Final = np.dtype(np.float32)
INTEGER: Final = np.dtype(np.int32)
BYTE: Final = np.dtype(np.uint8)
BOOL: Final = np.dtype(np.bool_)

_MOST_SETS: Final = 1024


_LINE_BYTES: Final = 64
"""Size of a line of a processor's cache, and of its largest vectors."""


def in_lines(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array with any content that begins with a line of the cache.

    NumPy's begin anywhere, and a vector that lies in two lines is loaded twice.
    """
    size = prod(shape) * dtype.itemsize
    memory = np.empty(size + _LINE_BYTES, BYTE)
    first = -memory.ctypes.data % _LINE_BYTES
    return memory[first : first + size].view(dtype).reshape(shape)


class Room:
    """Gives new arrays, with any content."""

    def __call__(self, _name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array of a name, shape and type."""
        return in_lines(shape, dtype)

    def together(self, _key: Hashable, make: Callable[["Room"], Made]) -> Made:
        """Return a set of arrays from this room; the key has its kind and all sizes."""
        return make(self)


class KeptRoom(Room):
    """Gives arrays of its own, one of each name: a name asked for again takes the earlier one.

    Attributes:
        nbytes: Size in memory.
    """

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[Any]] = {}
        self._sets: dict[Hashable, Any] = {}
        self.nbytes = 0

    def __call__(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array of a name, shape and type, with any content."""
        size = prod(shape)
        kept = self._kept.get(name)
        if kept is None or kept.size < size:
            self.nbytes -= 0 if kept is None else kept.nbytes
            kept = self._kept[name] = in_lines((size,), dtype)
            self.nbytes += kept.nbytes
            self._sets.clear()  # they have the smaller one
        return kept[:size].reshape(shape)

    def together(self, key: Hashable, make: Callable[[Room], Made]) -> Made:
        """Return the same set for the same key: to shape arrays takes longer than to find it."""
        found: Made | None = self._sets.get(key)
        if found is None:
            found = make(self)
            if len(self._sets) >= _MOST_SETS:
                self._sets.clear()
            self._sets[key] = found
        return found
