"""What the actions of many episodes do, compiled."""

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, IntArray
from blast_env.compilation import compiled


@compiled(nogil=True)
def put_placed(
    chosen: IntArray,
    wanted: NDArray[np.int64],
    legal: BoolArray,
    finishes: int,
    illegal: int,
    found: NDArray[np.int64],
) -> int:
    """Put what each action does, where it is the number of an element or the end.

    Args:
        chosen: The episodes (n,).
        wanted: The actions (n,).
        legal: See `LayoutBatch`.
        finishes: What is put for the end.
        illegal: What is put for an element that may not be placed.
        found: The number of the element to place, or one of these (n,).

    Returns:
        The number of elements that may not be placed.
    """
    count, variants, rows, columns = legal.shape
    finish, not_placed = variants * rows * columns, 0
    of_actions = legal.reshape((count, finish))
    for position in range(len(chosen)):
        action = wanted[position]
        if action == finish:
            found[position] = finishes
        elif of_actions[chosen[position], action]:
            found[position] = action
        else:
            found[position] = illegal
            not_placed += 1
    return not_placed
