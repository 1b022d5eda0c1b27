"""Layers of the surrogate's networks in compiled code: a row alone is a row among others.

Four rows pass through all layers together and stay in a processor's nearest cache. The sum of each
output runs over the inputs in their order, in a register. So a row has the same result to the last
bit whichever rows are beside it, and a batch is one layout after the other. The kernels of BLAS
differ between the middle and the end of a matrix, on some processors.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.compilation import compiled
from blast_env.gas.simd import fill, get, lanes_at, larger, load, place, put, smaller, store
from blast_env.gas.state import FUSED

SingleArray = NDArray[np.float32]

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


@njit(error_model="numpy", fastmath=FUSED)
def four_rows(
    given: Any, inputs: int, weight: Any, outputs: int, base: Any, bases: Any, total: Any
) -> None:
    """Find the outputs of a layer for four rows: two vectors of outputs of each in registers.

    Args:
        given: Place of the inputs of the rows, one row after the other.
        inputs: Number of inputs.
        weight: Place of the weights (inputs, outputs).
        outputs: Number of outputs, a multiple of 32.
        base: Place of what is added to the sums: biases, or biases and part of the sums.
        bases: The first entry of each row in it (4,).
        total: Place of the outputs of the rows.
    """
    # Each weight is loaded once for four rows: two vectors of outputs of each are eight sums, which
    # stay in registers beside the weights.
    lanes = lanes_at(total)
    row_1, row_2, row_3 = inputs, 2 * inputs, 3 * inputs
    base_0, base_1, base_2, base_3 = bases
    for output in range(0, outputs, 2 * lanes):
        low_0, high_0 = load(base, base_0 + output), load(base, base_0 + output + lanes)
        low_1, high_1 = load(base, base_1 + output), load(base, base_1 + output + lanes)
        low_2, high_2 = load(base, base_2 + output), load(base, base_2 + output + lanes)
        low_3, high_3 = load(base, base_3 + output), load(base, base_3 + output + lanes)
        for index in range(inputs):
            low = load(weight, index * outputs + output)
            high = load(weight, index * outputs + output + lanes)
            value = fill(total, get(given, index))
            low_0, high_0 = value * low + low_0, value * high + high_0
            value = fill(total, get(given, row_1 + index))
            low_1, high_1 = value * low + low_1, value * high + high_1
            value = fill(total, get(given, row_2 + index))
            low_2, high_2 = value * low + low_2, value * high + high_2
            value = fill(total, get(given, row_3 + index))
            low_3, high_3 = value * low + low_3, value * high + high_3
        store(total, output, _silu(total, low_0))
        store(total, output + lanes, _silu(total, high_0))
        store(total, outputs + output, _silu(total, low_1))
        store(total, outputs + output + lanes, _silu(total, high_1))
        store(total, 2 * outputs + output, _silu(total, low_2))
        store(total, 2 * outputs + output + lanes, _silu(total, high_2))
        store(total, 3 * outputs + output, _silu(total, low_3))
        store(total, 3 * outputs + output + lanes, _silu(total, high_3))


@njit(error_model="numpy", fastmath=FUSED)
def four_sums(given: Any, inputs: int, weight: Any, bias: Any) -> Any:
    """Return the only output of the last layer, without a bend, for four rows."""
    zero = one = two = three = bias
    for index in range(inputs):
        by = get(weight, index)
        zero += get(given, index) * by
        one += get(given, inputs + index) * by
        two += get(given, 2 * inputs + index) * by
        three += get(given, 3 * inputs + index) * by
    return zero, one, two, three


@njit(error_model="numpy")
def _take(rows: Any, first: int, given: Any) -> None:
    """Copy four rows, the last one again beyond the end."""
    count, inputs = rows.shape
    for number in range(ROWS_AT_ONCE):
        row = min(first + number, count - 1)
        for index in range(inputs):
            put(given, number * inputs + index, rows[row, index])


def buffers(*widths: int) -> tuple[SingleArray, ...]:
    """Return room for four rows of each width.

    Compiled code that makes an array itself frees it after its last mention, which is where its
    place in memory is asked for.
    """
    return tuple([np.empty((ROWS_AT_ONCE, width), dtype=np.float32) for width in widths])


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
        first: Weights of the first layer (members, inputs, width); widths are multiples of 32.
        first_bias: Its biases (members, width).
        second: Weights of the second layer (members, width, outputs).
        second_bias: Its biases (members, outputs).
    """
    layers = first, first_bias, second, second_bias
    given, middle, last = buffers(rows.shape[2], *second.shape[1:])
    found = np.empty((len(second), rows.shape[1], second.shape[2]), dtype=np.float32)
    _put_two_layers(rows, *layers, given, middle, last, found)
    return found


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def _put_two_layers(
    rows: Any,
    first: Any,
    first_bias: Any,
    second: Any,
    second_bias: Any,
    given: Any,
    middle: Any,
    last: Any,
    found: Any,
) -> None:
    """Find the outputs of two layers; see `two_layers`."""
    members, width, outputs = second.shape
    count, inputs = rows.shape[1:]
    at, between, end = place(given), place(middle), place(last)
    same = 0, 0, 0, 0
    for member in range(members):
        own = rows[member if len(rows) > 1 else 0]
        weights = place(first[member]), place(second[member])
        biases = place(first_bias[member]), place(second_bias[member])
        for row in range(0, count, ROWS_AT_ONCE):
            _take(own, row, at)
            four_rows(at, inputs, weights[0], width, biases[0], same, between)
            four_rows(between, width, weights[1], outputs, biases[1], same, end)
            for number in range(min(ROWS_AT_ONCE, count - row)):
                for index in range(outputs):
                    found[member, row + number, index] = last[number, index]


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def first_sums(rows: SingleArray, weights: SingleArray, bias: SingleArray) -> SingleArray:
    """Return the sums of a layer before its bend (members, rows, outputs).

    Args:
        rows: Rows of each member, or of all (members or 1, rows, inputs).
        weights: Weights (members, inputs, outputs).
        bias: Biases (members, outputs).
    """
    members, inputs, outputs = weights.shape
    found = np.empty((members, rows.shape[1], outputs), dtype=np.float32)
    for member in range(members):
        for row in range(rows.shape[1]):
            for output in range(outputs):  # a slice would compile NumPy's messages too
                found[member, row, output] = bias[member, output]
            for index in range(inputs):
                value = rows[member if len(rows) > 1 else 0, row, index]
                for output in range(outputs):
                    found[member, row, output] += value * weights[member, index, output]
    return found
