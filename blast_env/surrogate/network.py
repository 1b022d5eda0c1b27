"""Small networks that predict the load at each point of a wall.

Each solid sends a message to each point, computed from their relations. Those of pieces are
weighted, number by number, by how a piece stands to the others. The prediction at a point is a
function of the features of the point, of its view and of the sum of all messages.
"""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.surrogate.approach import FEATURES
from blast_env.surrogate.layers import SingleArray, two_layers
from blast_env.surrogate.load_arrays import NetworkLayers
from blast_env.surrogate.loads import LEAST_OVER, MOST_OVER
from blast_env.surrogate.neighbours import TRAITS
from blast_env.surrogate.relations import IN_PLAN, RELATIONS, RISING
from blast_env.surrogate.views import VIEW
from blast_env.surrogate.ways import SHARES

AnyFloats = NDArray[np.floating[Any]]

HIDDEN: Final = (96, 64)
"""Widths of the two hidden layers."""

MESSAGE: Final = 32
"""Length of a message, and width of its hidden layer."""

SIGHT: Final = 48
"""Length of what a view says."""

IMPULSE_POWER: Final = 1.0
"""Exponent of the power mean over the walls for impulses: the arithmetic mean."""

PEAK_POWER: Final = 16.0
"""Exponent of the power mean over the walls for peaks: close to the maximum."""

MOST_SPREADS: Final = 4.0
"""Bound on the distance of inputs from their mean, in units of their scale."""

_SENDING: Final = ((RELATIONS, MESSAGE), (MESSAGE,), (MESSAGE, MESSAGE), (MESSAGE,))
_WEIGHING: Final = ((TRAITS, MESSAGE), *_SENDING[1:])

VIEWS: Final = ((VIEW, SIGHT), (VIEW, SIGHT))

SHAPES: Final = (*_SENDING, *_SENDING, *_WEIGHING, *VIEWS) + (
    (FEATURES + 2 * MESSAGE + 2 * SIGHT, HIDDEN[0]),
    (HIDDEN[0],),
    HIDDEN,
    (HIDDEN[1],),
    (HIDDEN[1], 1),
    (1,),
)
"""Shapes of the arrays of a network, in the order of `Member`."""


class Member(NamedTuple):
    """A network: weights and biases of its layers, in the order of their use.

    The first two layers compute the messages of structures, the next two those of pieces, the next
    two the weights of these by the traits of pieces, the others the prediction at a point from
    features and the sums of both.
    """

    send: AnyFloats
    send_bias: AnyFloats
    message: AnyFloats
    message_bias: AnyFloats
    piece_send: AnyFloats
    piece_send_bias: AnyFloats
    piece_message: AnyFloats
    piece_message_bias: AnyFloats
    trait: AnyFloats
    trait_bias: AnyFloats
    weight: AnyFloats
    weight_bias: AnyFloats
    structure_view: AnyFloats
    piece_view: AnyFloats
    first: AnyFloats
    first_bias: AnyFloats
    second: AnyFloats
    second_bias: AnyFloats
    last: AnyFloats
    last_bias: AnyFloats


class Networks:
    """An ensemble of networks fitted to the same loads from different initial weights.

    They use single precision: its rounding is far below their errors.

    Args:
        members: The networks.

    Attributes:
        members: The networks.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self.members = tuple(members)
        stacked = [
            np.stack(arrays) if members else np.empty((0, *shape))
            for arrays, shape in zip_longest(zip(*members, strict=True), SHAPES)
        ]
        single = [np.ascontiguousarray(item, dtype=np.float32) for item in stacked]
        self._layers = Member(*single)

    def messages(self, scaled: FloatArray, *, of_pieces: bool) -> SingleArray:
        """Return the message of each solid to each point (members, solids x points, MESSAGE).

        Args:
            scaled: Their relations, less the mean, over the scale (solids x points, RELATIONS).
            of_pieces: Whether they are pieces, not structures.
        """
        layers = self._layers[len(_SENDING) :] if of_pieces else self._layers
        given = np.ascontiguousarray(scaled, dtype=np.float32)[np.newaxis]
        found: SingleArray = two_layers(given, *layers[: len(_SENDING)])
        return found

    def weights(self, scaled: FloatArray) -> SingleArray:
        """Return the weights of the numbers of the messages of pieces (members, pieces, MESSAGE).

        Args:
            scaled: Their traits, less the mean, over the scale (pieces, TRAITS).
        """
        given = np.ascontiguousarray(scaled, dtype=np.float32)[np.newaxis]
        first = 2 * len(_SENDING)
        found: SingleArray = two_layers(given, *self._layers[first : first + len(_WEIGHING)])
        return found

    def __call__(
        self, scaled: FloatArray, heard: SingleArray, seen: Sequence[AnyFloats]
    ) -> FloatArray:
        """Return the predicted differences of logarithmic loads from Kingery and Bulmash's.

        Args:
            scaled: Features of points, less the mean, over the scale (points, FEATURES).
            heard: Sums of the messages of structures and of pieces to each point (members, points,
                2 MESSAGE).
            seen: The views of structures and of pieces from each point (points, VIEW).

        Returns:
            (members, points).
        """
        layers = self._layers
        members, points, _ = heard.shape
        told = np.broadcast_to(scaled.astype(np.float32), (members, points, FEATURES))
        weights = layers.structure_view, layers.piece_view
        of_views = [
            views.astype(np.float32) @ own for views, own in zip(seen, weights, strict=True)
        ]
        # Two hidden layers, then a linear one to a single number per point.
        inputs = np.concatenate((told, heard, *of_views), axis=2)
        second = two_layers(
            inputs, layers.first, layers.first_bias, layers.second, layers.second_bias
        )
        found: FloatArray = np.einsum("mpi,mi->mp", second, layers.last[..., 0])
        return np.clip(found + layers.last_bias, LEAST_OVER, MOST_OVER)

    def layers(self, kind: int, power: float) -> NetworkLayers:
        """Return the layers as compiled code takes them.

        Args:
            kind: 0 for networks of impulses, 1 for those of peaks.
            power: Exponent of the mean over the walls.
        """
        layers, members, length = self._layers, len(self.members), self._layers.message.shape[2]
        ends = np.cumsum((FEATURES - SHARES, SHARES, length, length, SIGHT))
        constants, shares, structures, pieces, seen, seen_pieces = np.split(
            layers.first, ends, axis=1
        )
        # Sums over relations in plan are made first.
        in_order = np.concatenate((IN_PLAN, RISING))
        arrays: list[Any] = [
            *(layers.send[:, in_order], *layers[1 : len(_SENDING)]),
            *(layers.piece_send[:, in_order], *layers[len(_SENDING) + 1 : 2 * len(_SENDING)]),
            *layers[2 * len(_SENDING) : 2 * len(_SENDING) + len(_WEIGHING)],
            *(layers.structure_view, layers.piece_view),
            np.concatenate((constants, structures, seen), axis=1),
            layers.first_bias,
            np.concatenate((shares, pieces, seen_pieces), axis=1),
            *(layers.second, layers.second_bias),
            np.ascontiguousarray(layers.last[..., 0]),
            np.ascontiguousarray(layers.last_bias[:, 0]),
            *(np.full(members, kind), np.full(members, power)),
        ]
        return NetworkLayers(*arrays)


def bounded(numbers: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
    """Return numbers less their mean, over their scale, clipped to the range of a fit (rows, n).

    A wall of 60 m has points much farther from its edges than the sites of a fit, and predictions
    so far outside that range are unbounded.
    """
    found: FloatArray = np.clip((numbers - mean) / scale, -MOST_SPREADS, MOST_SPREADS)
    return found


def agreed(logs: FloatArray) -> FloatArray:
    """Return the mean over the networks without the highest and the lowest (members, n) -> (n,).

    A single network may be far off on layouts unlike those of the fit.
    """
    middle: FloatArray = np.sort(logs, axis=0)[1:-1] if len(logs) > 2 else logs
    mean: FloatArray = middle.mean(axis=0)
    return mean


def log_loads(
    differs: FloatArray, known: FloatArray, area_m2: FloatArray, starts: IntArray, power: float
) -> FloatArray:
    """Return the logarithm of the load on each structure, by each network (members, structures).

    It is the power mean of the loads at its points, weighted by area.

    Args:
        differs: Predictions at all points, from `Networks` (members, points).
        known: Logarithm of Kingery and Bulmash's load (points,).
        area_m2: Wall area represented by each point (points,).
        starts: Index of the first point of each structure (structures,).
        power: Exponent of the mean.
    """
    # L = (sum of A L_i^p / sum of A)^(1 / p): p = 1 is the mean, a large p nearly the largest.
    area_of_all_m2 = np.add.reduceat(area_m2, starts)
    loads = area_m2 * np.exp(power * (known + differs))
    logs: FloatArray = np.log(np.add.reduceat(loads, starts, axis=1) / area_of_all_m2) / power
    return logs
