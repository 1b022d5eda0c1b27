"""The vectors of many episodes, compiled."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.envs.observable import Plane


@compiled(nogil=True)
def put_vectors(
    own: IntArray,
    constants: Plane,
    variants: Plane,
    left: IntArray,
    stock: IntArray,
    budget_left: FloatArray,
    budget: FloatArray,
    legal: NDArray[np.uint8],
    occupancy: NDArray[np.uint8],
    has_items: bool,  # Numba has no keywords only
    full_stock: int,
    of_site: int,
    vectors: Plane,
) -> None:
    """Put the values of episodes into their vectors, all but the stand-off.

    Args:
        own: Number of the constants of each episode (episodes,).
        constants: See `FeaturesEpisode` (numbers, n).
        variants: See `FeaturesEpisode` (numbers, 2, variants + 1).
        left: See `LayoutBatch` (episodes, 1 + items).
        stock: See `LayoutBatch` (episodes, 1 + items).
        budget_left: See `LayoutBatch` (episodes,).
        budget: See `LayoutBatch` (episodes,).
        legal: 1 where each variant may be placed (episodes, variants, cells).
        occupancy: Number of the variant on each cell (episodes, cells).
        has_items: Whether there is a catalogue.
        full_stock: Number of modules in stock shown as 1.
        of_site: Number of constants of the site, which follow.
        vectors: The vectors (episodes, features).
    """
    _, kinds, cells = legal.shape
    items = left.shape[1] - 1
    for episode in range(len(vectors)):
        vector, known = vectors[episode], constants[own[episode]]
        # 1. As `stock_shares`: NaN marks a zone without a budget, which never runs out.
        there = left[episode, 0]
        vector[0] = min(max(there / stock[episode, 0], 0.0), 1.0)
        vector[1] = min(max(there / full_stock, 0.0), 1.0)
        money = 1.0 if isnan(budget[episode]) else budget_left[episode] / budget[episode]
        vector[2] = min(max(money, 0.0), 1.0)
        at = 3
        for index in range(of_site):  # slices would compile NumPy's messages too
            vector[at + index] = known[index]
        at += of_site
        stands, is_free = vector[at : at + cells], vector[at + cells : at + 2 * cells]
        for cell in range(cells):
            stands[cell] = min(occupancy[episode, cell], 1)
            is_free[cell] = legal[episode, 0, cell]
        for kind in range(1, kinds):
            for cell in range(cells):
                is_free[cell] = max(is_free[cell], np.float32(legal[episode, kind, cell]))
        at += 2 * cells
        for index in range(of_site, len(known)):
            vector[at + index - of_site] = known[index]
        at += len(known) - of_site
        if has_items:
            for index in range(1, items + 1):  # as `items_left`
                share = min(left[episode, index], there) / max(stock[episode, index], 1)
                vector[at + index - 1] = min(max(share, 0.0), 1.0)
            at += items
            heights, stops = vector[at : at + cells], vector[at + cells : at + 2 * cells]
            of_variants = variants[own[episode]]
            for cell in range(cells):
                heights[cell] = of_variants[0, occupancy[episode, cell]]
                stops[cell] = of_variants[1, occupancy[episode, cell]]
            at += 2 * cells
            for kind in range(kinds):
                places = vector[at : at + cells]
                for cell in range(cells):
                    places[cell] = legal[episode, kind, cell]
                at += cells
