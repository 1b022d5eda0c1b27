"""Layers of the surrogate's networks in compiled code: a row alone is a row among others.

Four rows pass through all layers together and stay in a processor's nearest cache. The sum of each
output runs over the inputs in their order, in a register. So a row has the same result to the last
bit whichever rows are beside it, and a batch is one layout after the other. The kernels of BLAS
differ between the middle and the end of a matrix, on some processors.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

from blast_env.compilation import compiled
from blast_env.gas.simd import fill, get, lanes_at, larger, load, own_frame, place, smaller, store
from blast_env.gas.state import FUSED

SingleArray = NDArray[np.float32]
HalfArray = NDArray[np.float16]

ROWS_AT_ONCE: Final = 4
"""Rows that pass through a layer together."""

# The hyperbolic tangent is y P(y^2) / Q(y^2) up to this |y|, and constant beyond: the fit of both
# polynomials with the least greatest relative error, 3e-7 in single precision.
_MOST: Final = np.float32(9.0)
_P0: Final = np.float32(0.999999979)
_P1: Final = np.float32(0.133810249)
_P2: Final = np.float32(0.00349558721)
_P3: Final = np.float32(2.06090673e-05)
_P4: Final = np.float32(1.33546416e-08)
_Q0: Final = np.float32(1.0)
_Q1: Final = np.float32(0.467143405)
_Q2: Final = np.float32(0.0258769787)
_Q3: Final = np.float32(0.000328563331)
_Q4: Final = np.float32(7.77654996e-07)
_HALF: Final = np.float32(0.5)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _silu(at: Any, value: Any) -> Any:
    """Return x / (1 + exp(-x)) of a vector, by the hyperbolic tangent of x / 2."""
    # x / (1 + exp(-x)) = h + h tanh(h) with h = x / 2: the hyperbolic tangent saturates, where the
    # exponential would overflow. Both polynomials by Horner's rule, which fuses.
    half = fill(at, _HALF) * value
    most = fill(at, _MOST)
    near = smaller(larger(half, fill(at, -_MOST)), most)
    square = near * near
    above = fill(at, _P4) * square + fill(at, _P3)
    above = above * square + fill(at, _P2)
    above = above * square + fill(at, _P1)
    above = above * square + fill(at, _P0)
    below = fill(at, _Q4) * square + fill(at, _Q3)
    below = below * square + fill(at, _Q2)
    below = below * square + fill(at, _Q1)
    below = below * square + fill(at, _Q0)
    return half * (near * above / below) + half


def _four_rows(bend: Any) -> Any:
    """Return the function of a layer with a bend."""

    @njit(error_model="numpy", fastmath=FUSED)
    def rows(
        given: Any,
        first: int,
        inputs: int,
        weight: Any,
        outputs: int,
        base: Any,
        bases: Any,
        total: Any,
        to: int,
    ) -> None:
        """Find the outputs of a layer for four rows: two vectors of outputs of each in registers.

        Args:
            given: Place of the inputs of the rows, one row after the other.
            first: Index of the first of them.
            inputs: Number of inputs.
            weight: Place of the weights (inputs, outputs).
            outputs: Number of outputs, a multiple of 16.
            base: Place of what is added to the sums: biases, or biases and part of the sums.
            bases: The first entry of each row in it (4,).
            total: Place of the outputs of the rows.
            to: Index of the first of them.
        """
        # Each weight is loaded once for four rows: two vectors of outputs of each are eight sums,
        # which stay in registers beside the weights.
        lanes = lanes_at(total)
        row_0, row_1, row_2, row_3 = first, first + inputs, first + 2 * inputs, first + 3 * inputs
        base_0, base_1, base_2, base_3 = bases
        to_0, to_1, to_2, to_3 = to, to + outputs, to + 2 * outputs, to + 3 * outputs
        for output in range(0, outputs, 2 * lanes):
            above = min(output + lanes, outputs - lanes)  # the last vector, if it is alone, twice
            low_0, high_0 = load(base, base_0 + output), load(base, base_0 + above)
            low_1, high_1 = load(base, base_1 + output), load(base, base_1 + above)
            low_2, high_2 = load(base, base_2 + output), load(base, base_2 + above)
            low_3, high_3 = load(base, base_3 + output), load(base, base_3 + above)
            for index in range(inputs):
                low = load(weight, index * outputs + output)
                high = load(weight, index * outputs + above)
                value = fill(total, get(given, row_0 + index))
                low_0, high_0 = value * low + low_0, value * high + high_0
                value = fill(total, get(given, row_1 + index))
                low_1, high_1 = value * low + low_1, value * high + high_1
                value = fill(total, get(given, row_2 + index))
                low_2, high_2 = value * low + low_2, value * high + high_2
                value = fill(total, get(given, row_3 + index))
                low_3, high_3 = value * low + low_3, value * high + high_3
            store(total, to_0 + output, bend(total, low_0))
            store(total, to_0 + above, bend(total, high_0))
            store(total, to_1 + output, bend(total, low_1))
            store(total, to_1 + above, bend(total, high_1))
            store(total, to_2 + output, bend(total, low_2))
            store(total, to_2 + above, bend(total, high_2))
            store(total, to_3 + output, bend(total, low_3))
            store(total, to_3 + above, bend(total, high_3))

    return rows


@njit(forceinline=True, error_model="numpy")
def _straight(_at: Any, value: Any) -> Any:
    return value


four_rows: Final = _four_rows(_silu)
"""Finds the outputs of a layer for four rows."""

four_sums: Final = _four_rows(_straight)
"""The same without the bend."""


PARTS: Final = 16
"""Parts of the sum of a row, on any processor; the number of inputs is a multiple."""


@njit(error_model="numpy", fastmath=FUSED)
def put_parts(given: Any, inputs: int, weight: Any, parts: Any) -> None:
    """Put parts of the only output of the last layer, without a bend and a bias, for four rows.

    Args:
        given: Place of the inputs of the rows, one row after the other.
        inputs: Number of inputs.
        weight: Place of the weights.
        parts: Place of the parts (4, PARTS).
    """
    lanes = lanes_at(given)
    row_1, row_2, row_3 = inputs, 2 * inputs, 3 * inputs
    for part in range(0, PARTS, lanes):
        sum_0 = sum_1 = sum_2 = sum_3 = fill(given, np.float32(0.0))
        for index in range(part, inputs, PARTS):
            by = load(weight, index)
            sum_0 = load(given, index) * by + sum_0
            sum_1 = load(given, row_1 + index) * by + sum_1
            sum_2 = load(given, row_2 + index) * by + sum_2
            sum_3 = load(given, row_3 + index) * by + sum_3
        store(parts, part, sum_0)
        store(parts, PARTS + part, sum_1)
        store(parts, 2 * PARTS + part, sum_2)
        store(parts, 3 * PARTS + part, sum_3)


def two_layers(
    rows: SingleArray,
    first: SingleArray,
    first_bias: SingleArray,
    second: SingleArray,
    second_bias: SingleArray,
) -> SingleArray:
    """Return the outputs of two layers of each member (members, rows, outputs).

    Args:
        rows: Rows of each member, or of all (members or 1, rows, inputs).
        first: Weights of the first layer (members, inputs, width); widths are multiples of 16.
        first_bias: Its biases (members, width).
        second: Weights of the second layer (members, width, outputs).
        second_bias: Its biases (members, outputs).
    """
    given = np.pad(rows, ((0, 0), (0, whole(rows.shape[1]) - rows.shape[1]), (0, 0)))
    found = np.empty((len(second), given.shape[1], second.shape[2]), dtype=np.float32)
    middle = np.empty((ROWS_AT_ONCE, second.shape[1]), dtype=np.float32)
    biases, of_rows = first_bias[:, np.newaxis], np.zeros(given.shape[1], dtype=np.int32)
    put_two_layers(given, first, biases, of_rows, second, second_bias, middle, found)
    return found[:, : rows.shape[1]]


@register_jitable
def whole(rows: int) -> int:
    """Return a number of rows, rounded up to a multiple of those that pass together."""
    return -(-rows // ROWS_AT_ONCE) * ROWS_AT_ONCE


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def put_sums(rows: Any, weight: Any, bias: Any, found: Any) -> None:
    """Put the sums of a layer over its first inputs, of a whole number of rows.

    Args:
        rows: The inputs (rows, inputs).
        weight: Weights of the layer, of at least as many inputs (members, inputs, width).
        bias: Its biases (members, width).
        found: The sums (members, rows, width).
    """
    own_frame()
    members, count, width = found.shape
    at, end, inputs, same = place(rows), place(found), rows.shape[1], (0, 0, 0, 0)
    for member in range(members):
        to, biases = place(weight[member]), place(bias[member])
        for row in range(0, count, ROWS_AT_ONCE):
            first = (member * count + row) * width
            four_sums(at, row * inputs, inputs, to, width, biases, same, end, first)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def put_two_layers(
    rows: Any,
    first: Any,
    sums: Any,
    of_rows: Any,
    second: Any,
    second_bias: Any,
    middle: Any,
    found: Any,
) -> None:
    """Put the outputs of two layers, of a whole number of rows.

    Compiled code that makes an array itself frees it after its last mention, which is where its
    place in memory is asked for: `middle` has room for four rows between the layers.

    Args:
        rows: The last inputs of each row, by each member or by all (members or 1, rows, inputs).
        first: Weights of the first layer, of all inputs (members, inputs, width).
        sums: Its biases, and its sums over the other inputs if there are any, which several rows
            may have in common (members, n, width).
        of_rows: Which of these is that of each row (rows,).
        second: See `two_layers`.
        second_bias: See `two_layers`.
        middle: Room for four rows (4, width).
        found: The outputs (members, rows, outputs).
    """
    own_frame()
    members, width, outputs = second.shape
    count, inputs = rows.shape[1:]
    at, between, end, shared = place(rows), place(middle), place(found), place(sums)
    same = 0, 0, 0, 0
    for member in range(members):
        own = member * count * inputs if len(rows) > 1 else 0
        to_first, to_second = place(first[member, first.shape[1] - inputs :]), place(second[member])
        bias, of_member = place(second_bias[member]), member * sums.shape[1]
        for row in range(0, count, ROWS_AT_ONCE):
            to, given = (member * count + row) * outputs, own + row * inputs
            bases = (
                (of_member + of_rows[row]) * width,
                (of_member + of_rows[row + 1]) * width,
                (of_member + of_rows[row + 2]) * width,
                (of_member + of_rows[row + 3]) * width,
            )
            four_rows(at, given, inputs, to_first, width, shared, bases, between, 0)
            four_rows(between, 0, width, to_second, outputs, bias, same, end, to)
