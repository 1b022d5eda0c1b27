"""Lines of sight as bits, in compiled code; see `SightBits`."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled


@compiled(nogil=True)
def put_cuts(
    cut: BoolArray,
    height_m: FloatArray,
    place: IntArray,
    tall_m: FloatArray,
    found: NDArray[np.uint64],
) -> None:
    """Put the lines that modules of some heights would cut (heights, cells, words)."""
    for line in range(len(cut)):
        word, bit = place[line] // 64, np.uint64(1) << np.uint64(place[line] % 64)
        for cell in range(cut.shape[1]):
            if cut[line, cell]:
                for number in range(len(tall_m)):
                    if height_m[line, cell] < tall_m[number]:
                        found[number, cell, word] |= bit


@compiled(nogil=True)
def weights_of(bits: NDArray[np.uint64], weights: FloatArray, ends: IntArray) -> FloatArray:
    """Return the weight of the lines in each set (sets,).

    Args:
        bits: The sets (sets, words).
        weights: The distinct weights (weights,).
        ends: The word after the last one of each weight (weights,).
    """
    found = np.zeros(len(bits))
    for number in range(len(bits)):
        first = 0
        for group in range(len(weights)):
            count = 0
            for word in range(first, ends[group]):
                count += _bits_in(bits[number, word])
            found[number] += count * weights[group]
            first = ends[group]
    return found


@compiled(nogil=True)
def counts_of(bits: NDArray[np.uint64]) -> IntArray:
    """Return in how many sets each line is (bits of all words,).

    A word at a time, its 64 counts are the columns of some words: of ones, twos, fours and so on.

    Args:
        bits: The sets (sets, words).
    """
    sets, words = bits.shape
    found = np.zeros(64 * words, dtype=np.int64)
    digits = np.zeros(64, dtype=np.uint64)
    for word in range(words):
        digits[:] = 0
        for number in range(sets):
            carry, digit = bits[number, word], 0
            while carry != 0:
                digits[digit], carry = digits[digit] ^ carry, digits[digit] & carry
                digit += 1
        for digit in range(64):
            for line in range(64):
                if (digits[digit] >> np.uint64(line)) & np.uint64(1):
                    found[64 * word + line] += 1 << digit
    return found


@njit(error_model="numpy")
def _bits_in(word: Any) -> Any:
    """Return the number of bits in a word that are set (Warren 2013, Hacker's Delight)."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    twos = np.uint64(0x3333333333333333)
    word = (word & twos) + ((word >> np.uint64(2)) & twos)
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
