"""Layers of the surrogate's networks in compiled code: a row alone is a row among others.

The sum of each output runs over the inputs in their order, in a register. So a row has the same
result to the last bit whichever rows are beside it, and a batch is one layout after the other. The
kernels of BLAS differ between the middle and the end of a matrix, on some processors.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.gas.simd import fill, get, lanes_at, load, place, store
from blast_env.gas.state import FUSED

SingleArray = NDArray[np.float32]

ROWS_AT_ONCE: Final = 4
"""Rows that pass through a layer together; numbers of rows are multiples of it."""

_RUN: Final = 128
"""Rows that pass through all layers together: so few stay in a processor's cache."""


def padded(count: int) -> int:
    """Return the least multiple of `ROWS_AT_ONCE` that is not below a number of rows."""
    return -(-count // ROWS_AT_ONCE) * ROWS_AT_ONCE


def runs(count: int) -> list[slice]:
    """Return the slices of rows that pass through all layers together; `count` is padded."""
    return [slice(start, min(start + _RUN, count)) for start in range(0, count, _RUN)]


def active_layer(
    rows: SingleArray, weights: SingleArray, bias: SingleArray, few: slice | None = None
) -> SingleArray:
    """Return the outputs of a layer, x / (1 + exp(-x)) of the sums.

    Args:
        rows: Rows of each member, or of all (members or 1, rows, inputs); a multiple of
            `ROWS_AT_ONCE` rows.
        weights: Weights of each member (members, inputs, outputs); outputs are multiples of 32.
        bias: Biases (members, outputs).
        few: The rows to use, from `runs`; all by default.

    Returns:
        (members, rows, outputs).
    """
    first, last = (0, rows.shape[1]) if few is None else (few.start, few.stop)
    sums = np.empty((len(weights), last - first, weights.shape[2]), dtype=np.float32)
    _sums(rows, first, weights, bias, sums)
    return _silu(sums)


def _silu(sums: SingleArray) -> SingleArray:
    """Return x / (1 + exp(-x)), by the hyperbolic tangent for speed and without overflow."""
    sums *= np.float32(0.5)
    silu: SingleArray = np.tanh(sums)
    silu *= sums
    silu += sums
    return silu


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FUSED)
def _sums(rows: Any, first: int, weights: Any, bias: Any, found: Any) -> None:
    """Find the sums of a layer of all members, of as many rows from the first as are wanted."""
    for member in range(len(weights)):
        of_member = rows[member if len(rows) > 1 else 0, first : first + found.shape[1]]
        _sums_of_one(of_member, weights[member], bias[member], found[member])


@njit(nogil=True, error_model="numpy", fastmath=FUSED)
def _sums_of_one(rows: Any, weights: Any, bias: Any, found: Any) -> None:
    """Find the sums of a layer: four rows by two vectors of outputs stay in registers."""
    count, inputs = rows.shape
    outputs = weights.shape[1]
    given, weight, least, total = place(rows), place(weights), place(bias), place(found)
    lanes = lanes_at(total)
    for first in range(0, count, 4):
        row_0 = first * inputs
        row_1, row_2, row_3 = row_0 + inputs, row_0 + 2 * inputs, row_0 + 3 * inputs
        for output in range(0, outputs, 2 * lanes):
            low_0 = low_1 = low_2 = low_3 = load(least, output)
            high_0 = high_1 = high_2 = high_3 = load(least, output + lanes)
            for each in range(inputs):
                low = load(weight, each * outputs + output)
                high = load(weight, each * outputs + output + lanes)
                value = fill(total, get(given, row_0 + each))
                low_0, high_0 = value * low + low_0, value * high + high_0
                value = fill(total, get(given, row_1 + each))
                low_1, high_1 = value * low + low_1, value * high + high_1
                value = fill(total, get(given, row_2 + each))
                low_2, high_2 = value * low + low_2, value * high + high_2
                value = fill(total, get(given, row_3 + each))
                low_3, high_3 = value * low + low_3, value * high + high_3
            place_0 = first * outputs + output
            place_1, place_2 = place_0 + outputs, place_0 + 2 * outputs
            place_3 = place_0 + 3 * outputs
            store(total, place_0, low_0)
            store(total, place_0 + lanes, high_0)
            store(total, place_1, low_1)
            store(total, place_1 + lanes, high_1)
            store(total, place_2, low_2)
            store(total, place_2 + lanes, high_2)
            store(total, place_3, low_3)
            store(total, place_3 + lanes, high_3)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FUSED)
def last_layer(rows: SingleArray, weights: SingleArray, bias: SingleArray) -> SingleArray:
    """Return the single output of each row (members, rows).

    Args:
        rows: Rows of each member (members, rows, inputs); a multiple of `ROWS_AT_ONCE` rows.
        weights: Weights of each member (members, inputs, 1).
        bias: Biases (members, 1).
    """
    members, count, inputs = rows.shape
    found = np.empty((members, count), dtype=np.float32)
    for member in range(members):
        weight, least = weights[member], bias[member, 0]
        for first in range(0, count, 4):
            zero = one = two = three = least
            for each in range(inputs):
                by = weight[each, 0]
                zero += rows[member, first, each] * by
                one += rows[member, first + 1, each] * by
                two += rows[member, first + 2, each] * by
                three += rows[member, first + 3, each] * by
            found[member, first], found[member, first + 1] = zero, one
            found[member, first + 2], found[member, first + 3] = two, three
    return found
