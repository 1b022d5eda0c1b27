"""Features and scores of candidate places, compiled; see `candidates`."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.compilation import compiled


@compiled(nogil=True)
def stand(
    index: int, edges_m: NDArray[np.float32], gap_m: NDArray[np.float32], nearest: IntArray
) -> None:
    """Let the piece of a candidate stand.

    Args:
        index: The candidate.
        edges_m: Left, bottom, right and top of each candidate (4, candidates).
        gap_m: Gap of each to the nearest piece (candidates,); updated in place.
        nearest: Candidate of that piece, the first of those at the same gap; updated in place.
    """
    left, bottom, right, top = edges_m
    none_m = np.float32(0.0)
    for other in range(len(gap_m)):
        across_m = max(left[index] - right[other], left[other] - right[index], none_m)
        up_m = max(bottom[index] - top[other], bottom[other] - top[index], none_m)
        # As by `numpy.hypot` in single precision.
        own_m = np.float32(sqrt(np.float64(across_m) ** 2 + np.float64(up_m) ** 2))
        if own_m < gap_m[other]:
            gap_m[other], nearest[other] = own_m, index


@compiled(nogil=True)
def put_relations(
    chosen: IntArray,
    gap_m: NDArray[np.float32],
    nearest: IntArray,
    frame_m: NDArray[np.float32],
    item: IntArray,
    variant: IntArray,
    found: NDArray[np.float32],
) -> None:
    """Write the features of some candidates that are relations to the nearest piece.

    Args:
        chosen: The candidates.
        gap_m: As in `stand`.
        nearest: As in `stand`.
        frame_m: Position of each candidate along and aside of the line to the walls, m.
        item: Its item.
        variant: Its variant.
        found: The features: gap, whether it touches, distances along and aside, whether item and
            variant are the same (6, chosen); written.
    """
    three, two = np.float32(3.0), np.float32(2.0)
    for place, own in enumerate(chosen):
        other = nearest[own]
        found[0, place] = gap_m[own] / three
        found[1, place] = gap_m[own] <= 0.0
        found[2, place] = abs(frame_m[0, own] - frame_m[0, other]) / two
        found[3, place] = abs(frame_m[1, own] - frame_m[1, other]) / two
        found[4, place] = item[own] == item[other]
        found[5, place] = variant[own] == variant[other]


@compiled(nogil=True)
def put_covers(
    chosen: IntArray,
    first: IntArray,
    last: IntArray,
    hidden: NDArray[np.float32],
    open_up_to: FloatArray,
    cover_up_to: FloatArray,
    places: int,
    found: NDArray[np.float32],
) -> None:
    """Add the features of some candidates on what they would hide, from one place of the charge.

    Args:
        chosen: The candidates.
        first: First bearing that each candidate hides (candidates,).
        last: Bearing after the last one (candidates,).
        hidden: Share of the walls' height that each hides (candidates,).
        open_up_to: Open share of the load up to before each bearing (bearings + 1,).
        cover_up_to: The same of the cover.
        places: Number of places of the charge, over which both features are means.
        found: The features: the load that is cut, and the cover (2, chosen); updated.
    """
    scale = 3.0 / places
    for place, own in enumerate(chosen):
        begin, end = first[own], last[own]
        is_open = np.float32((open_up_to[end] - open_up_to[begin]) * scale)
        cover = (cover_up_to[end] - cover_up_to[begin]) / max(end - begin, 1) / places
        found[0, place] += is_open * hidden[own]
        found[1, place] += np.float32(cover)


@compiled(nogil=True)
def rectify(
    values: NDArray[np.float32],
    prepared: NDArray[np.float32],
    chosen: IntArray,
    common: NDArray[np.float32],
) -> None:
    """Add the other inputs of a first layer to some candidates, and rectify, in place.

    Args:
        values: Sums of the changing features (chosen, width).
        prepared: Sums of the static ones of all candidates (candidates, width).
        chosen: The candidates.
        common: Sum of what is the same for all (width,).
    """
    none = np.float32(0.0)
    for place, own in enumerate(chosen):
        for unit in range(values.shape[1]):
            total = values[place, unit] + prepared[own, unit] + common[unit]
            values[place, unit] = max(total, none)
