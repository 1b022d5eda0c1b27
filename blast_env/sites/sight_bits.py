"""Lines of sight as bits, 64 in a word: what each piece would cut, and by how much that counts.

Lines of equal weight are beside each other, and a word has lines of one weight only. So the weight
of some lines is a sum of whole numbers times weights, in which no order of additions shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray

Words = NDArray[np.uint64]
"""Bits of lines, in the last axis."""


@dataclass(frozen=True, eq=False)
class SightBits:
    """The order of lines of sight as bits.

    Attributes:
        place: Number of the bit of each line (lines,).
        weights: The distinct weights (weights,).
        firsts: The first word of each weight (weights,).
    """

    place: IntArray
    weights: FloatArray
    firsts: IntArray
    words: int

    @classmethod
    def of(cls, weight: FloatArray) -> "SightBits":
        """Return the order of lines of some weights (lines,)."""
        weights, group, counts = np.unique(weight, return_inverse=True, return_counts=True)
        words = -(-counts // 64)
        firsts = np.cumsum(words) - words
        within = np.empty(len(weight), dtype=np.int64)
        order = np.argsort(group, kind="stable")
        within[order] = np.arange(len(weight)) - np.repeat(np.cumsum(counts) - counts, counts)
        return cls(64 * firsts[group] + within, weights, firsts, int(words.sum()))

    def cut_by(
        self, cut: BoolArray, height_m: FloatArray, heights_m: Sequence[float | None]
    ) -> Words:
        """Return the lines that a module on each cell would cut (heights, rows, columns, words).

        Args:
            cut: See `Visibility`.
            height_m: See `Visibility`.
            heights_m: Heights of modules; `None` is the height of the air.
        """
        from blast_env.sites.sight_kernels import put_cuts  # Numba takes long to import

        tall_m = np.array([np.inf if one_m is None else one_m for one_m in heights_m])
        lines, rows, columns = cut.shape
        found = np.zeros((len(tall_m), rows * columns, self.words), dtype=np.uint64)
        flat = cut.reshape(lines, rows * columns), height_m.reshape(lines, rows * columns)
        put_cuts(*flat, self.place, tall_m, found)
        return found.reshape(len(tall_m), rows, columns, self.words)

    def weight_of(self, bits: Words) -> FloatArray:
        """Return the weight of lines (...,)."""
        from blast_env.sites.sight_kernels import weights_of  # as above

        *shape, words = bits.shape
        ends = np.append(self.firsts[1:], self.words)
        sets = np.ascontiguousarray(bits).reshape(prod(shape), words)
        found: FloatArray = weights_of(sets, self.weights, ends)
        return found.reshape(shape)

    def counts(self, bits: Words) -> IntArray:
        """Return in how many of some sets (sets, words) each line is (lines,)."""
        from blast_env.sites.sight_kernels import counts_of  # as above

        found: IntArray = counts_of(np.ascontiguousarray(bits))
        return found[self.place]


def take_next(bits: Words | BoolArray, axis: int, length: int) -> None:
    """Add to the lines of each cell those of the next ones along an axis, `length` in all."""
    cells: Any = bits.swapaxes(0, axis)
    taken = 1
    while taken < length:
        step = min(taken, length - taken)
        cells[:-step] |= cells[step:]
        taken += step
