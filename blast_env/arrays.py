"""Names of NumPy array types."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


def counts_before(mask: BoolArray) -> NDArray[np.int32]:
    """Return the number of true cells below and left of corners (..., rows + 1, columns + 1)."""
    *many, rows, columns = mask.shape
    counts = np.zeros((*many, rows + 1, columns + 1), dtype=np.int32)
    np.cumsum(np.cumsum(mask, axis=-2, dtype=np.int32), axis=-1, out=counts[..., 1:, 1:])
    return counts


def any_in_windows(counts: NDArray[np.int32], rows: int, columns: int) -> BoolArray:
    """Return whether any cell of each window is true.

    Args:
        counts: `counts_before` of the cells.

    Returns:
        By lower left cell (..., rows, columns); empty for windows larger than the grid.
    """
    strips = counts[..., rows:, :] - counts[..., :-rows, :]
    return strips[..., columns:] > strips[..., :-columns]
