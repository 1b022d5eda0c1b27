"""Placement in many layouts at once, compiled."""

from math import isnan

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled


@compiled(nogil=True)
def place(
    indices: IntArray,
    numbers: IntArray,
    variants: IntArray,
    legal: BoolArray,
    occupancy: NDArray[np.uint8],
    table: NDArray[np.int8],
    left: IntArray,
    all_numbers: IntArray,
    placed: IntArray,
    budget_left: FloatArray,
    is_full: BoolArray,
    costs: FloatArray,
    budget: float,
    most: float,
    dearest: float,
) -> None:
    """Place an element in each of some layouts on one site, and take away what it forbids.

    Args:
        indices: The layouts.
        numbers: Number of the element for each.
        variants: See `PlacementRules`.
        legal: See `LayoutBatch`; as the others, updated in place.
        occupancy: See `LayoutBatch`.
        table: See `LayoutBatch`.
        left: See `LayoutBatch`.
        all_numbers: Numbers of the elements of all layouts (layouts, most elements).
        placed: See `LayoutBatch`.
        budget_left: See `LayoutBatch`.
        is_full: See `LayoutBatch`.
        costs: Cost by the element's number, in any shape.
        budget: The budget; NaN without one.
        most: The same with an allowance for rounding.
        dearest: The largest cost at a legal place.
    """
    for index, number in zip(indices, numbers):  # noqa: B905  # not known to Numba
        all_numbers[index, placed[index]] = number
        placed[index] += 1
    _put(indices, numbers, variants, legal, occupancy, table, left)
    if not isnan(budget):
        limits = budget, most, dearest
        _limit_to_budget(indices, all_numbers, placed, budget_left, legal, costs, *limits)
    find_full(indices, legal, is_full)


@njit(nogil=True)
def _put(
    indices: IntArray,
    numbers: IntArray,
    variants: IntArray,
    legal: BoolArray,
    occupancy: NDArray[np.uint8],
    table: NDArray[np.int8],
    left: IntArray,
) -> None:
    """Place an element in each of some layouts; see `place`."""
    _, count, rows, columns = legal.shape
    for index, number in zip(indices, numbers):  # noqa: B905  # not known to Numba
        variant, cell = number // (rows * columns), number % (rows * columns)
        row, column = cell // columns, cell % columns
        high, wide, item = variants[variant]
        # 1. The element itself: its cells, and its piece less in stock.
        table[index, variant, row, column] = 1
        occupancy[index, row : row + high, column : column + wide] = variant + 1
        left[index, 0] -= 1
        left[index, 1 + item] -= 1
        # 2. What it takes away from every variant: all places of one that is used up, else those
        # from which a piece would reach into its cells.
        for other in range(count):
            if left[index, 0] == 0 or (
                left[index, 1 + item] == 0 and variants[other, 2] == item
            ):  # used up
                legal[index, other] = False
                continue
            up, right = variants[other, 0] - 1, variants[other, 1] - 1
            if high == 0 or up < 0:  # a measure covers no cell
                continue
            bottom, start = max(row - up, 0), max(column - right, 0)
            legal[index, other, bottom : row + high, start : column + wide] = False


@compiled(nogil=True)
def find_full(indices: IntArray, legal: BoolArray, is_full: BoolArray) -> None:
    """Find whether each of some layouts has no legal place left."""
    for index in indices:
        is_full[index] = not legal[index].any()


@njit(nogil=True)
def _exact_costs(
    indices: IntArray, numbers: IntArray, placed: IntArray, costs: FloatArray
) -> FloatArray:
    """Return the cost of each of some layouts (indices,), as by `math.fsum`, in any order.

    Shewchuk (1997): partial sums without common bits, from the least up, of each layout. (1) Each
    cost is added to all of them, and the rounding error of each addition is kept; (2) they are
    summed from the largest down until an addition rounds; (3) a tie is rounded by the next one.

    Args:
        numbers: Numbers of the elements of all layouts (layouts, most elements).
        placed: Number of elements in each (layouts,).
        costs: Cost by the element's number, in any shape.
    """
    flat, found = costs.reshape(-1), np.zeros(len(indices))
    partial = np.empty(numbers.shape[1] + 1)
    for position, index in enumerate(indices):
        count = 0
        for place in range(placed[index]):
            x, kept = flat[numbers[index, place]], 0
            for other in range(count):  # (1)
                large, small = partial[other], x
                if abs(large) < abs(small):
                    large, small = small, large
                x = large + small
                error = small - (x - large)
                if error != 0.0:
                    partial[kept] = error
                    kept += 1
            partial[kept] = x
            count = kept + 1
        total, error = 0.0, 0.0
        while count > 0 and error == 0.0:  # (2)
            count -= 1
            before, x = total, partial[count]
            total = before + x
            error = x - (total - before)
        if count > 0 and error * partial[count - 1] > 0.0:  # (3)
            twice = 2.0 * error
            if twice == (total + twice) - total:
                total += twice
        found[position] = total
    return found


@njit(nogil=True)
def _limit_to_budget(
    indices: IntArray,
    numbers: IntArray,
    placed: IntArray,
    budget_left: FloatArray,
    legal: BoolArray,
    costs: FloatArray,
    budget: float,
    most: float,
    dearest: float,
) -> None:
    """Take away the places of some layouts that cost more than the budget leaves; see `place`."""
    flat = costs.reshape(-1)
    for index, spent in zip(indices, _exact_costs(indices, numbers, placed, costs)):  # noqa: B905
        # What is spent only grows. Until it reaches what the dearest place leaves, nothing changes.
        budget_left[index] = max(0.0, budget - spent)
        spendable = most - spent
        if spendable < dearest:
            own = legal[index].reshape(-1)
            for place, cost in enumerate(flat):
                own[place] &= cost <= spendable
