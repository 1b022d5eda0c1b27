"""What the compiled code of guesses works on: layers, scales, pieces, a site, and room."""

from typing import Final, NamedTuple

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.surrogate.layers import PARTS, ROWS_AT_ONCE, SingleArray, whole
from blast_env.surrogate.neighbours import TRAITS
from blast_env.surrogate.points import WallPoints
from blast_env.surrogate.relations import IN_PLAN, RELATIONS, RISING
from blast_env.surrogate.rooms import (
    BOOL,
    BYTE,
    FLOAT,
    INTEGER,
    SINGLE,
    Counts,
    Numbers,
    Room,
)
from blast_env.surrogate.views import ViewRoom
from blast_env.surrogate.ways import ASIDE_M, STATIONS

_ASIDES: Final = len(ASIDE_M)
BOX: Final = 5
"""Numbers of a box: left, bottom, right, top and height."""


class NetworkLayers(NamedTuple):
    """The layers of a stack of networks, in single precision.

    Attributes:
        send: Weights of the first layer of messages of structures, of relations in plan before
            those that change with height (members, RELATIONS, width of messages).
        send_bias: Its biases (members, width of messages).
        message: Weights of the second layer of these messages (members, width, length).
        message_bias: Its biases (members, length).
        piece_send: The same for messages of pieces.
        piece_send_bias: The same.
        piece_message: The same.
        piece_message_bias: The same.
        trait: Weights of the first layer of the weights of messages (members, TRAITS, width).
        trait_bias: Its biases (members, width).
        weight: Weights of the second layer of these (members, width, length).
        weight_bias: Its biases (members, length).
        structure_view: Weights of views of structures (members, VIEW, sight).
        piece_view: Weights of views of pieces (members, VIEW, sight).
        constant: Weights of the first layer at points, of inputs that no layout changes, of the
            messages of structures and of their views (members, n + length + sight, width).
        first_bias: Its biases (members, width).
        first: Its weights of open shares, of the messages of pieces and of their views (members,
            SHARES + length + sight, width).
        second: Weights of the second layer (members, width, its own width).
        second_bias: Its biases (members, its width).
        last: Weights of the last layer (members, width of the second).
        last_bias: Its bias (members,).
        kinds: 0 for a network of impulses, 1 for one of peaks (members,).
        powers: Exponents of the means over the walls (members,).
    """

    send: SingleArray
    send_bias: SingleArray
    message: SingleArray
    message_bias: SingleArray
    piece_send: SingleArray
    piece_send_bias: SingleArray
    piece_message: SingleArray
    piece_message_bias: SingleArray
    trait: SingleArray
    trait_bias: SingleArray
    weight: SingleArray
    weight_bias: SingleArray
    structure_view: SingleArray
    piece_view: SingleArray
    constant: SingleArray
    first_bias: SingleArray
    first: SingleArray
    second: SingleArray
    second_bias: SingleArray
    last: SingleArray
    last_bias: SingleArray
    kinds: IntArray
    powers: FloatArray


class Scales(NamedTuple):
    """Mean and standard deviation of inputs, and the bound on the scaled values.

    Attributes:
        mean: Means of features, then of relations, then of traits.
        by: Reciprocals of standard deviations.
        most: The bound.
    """

    mean: FloatArray
    by: FloatArray
    most: float


class Pieces(NamedTuple):
    """What is known of some pieces.

    Attributes:
        boxes: Left, bottom, right, top and height of each, m (pieces, 5).
        stopped: Number of paths that each stops (pieces, points, stations, asides).
        is_open: Whether the straight path is open (pieces, points).
        messages: Their messages (members, pieces, rows, length).
        seen: What their views say (members, pieces, rows, sight).
    """

    boxes: FloatArray
    stopped: Counts
    is_open: BoolArray
    messages: SingleArray
    seen: SingleArray

    @classmethod
    def in_room(cls, points: int, layers: NetworkLayers, room: Room, pieces: int) -> "Pieces":
        """Return arrays with any content."""
        (members, _, length), sight = layers.message.shape, layers.piece_view.shape[2]
        return cls(
            room("boxes of pieces", (pieces, BOX), FLOAT),
            room("stopped by pieces", (pieces, points, len(STATIONS), _ASIDES), BYTE),
            room("open behind pieces", (pieces, points), BOOL),
            room("messages of pieces", (members, pieces, whole(points), length), SINGLE),
            room("views of pieces", (members, pieces, whole(points), sight), SINGLE),
        )


class Bench(NamedTuple):
    """Arrays for a moment in compiled code, with any content.

    Attributes:
        relations: Relations of pieces (pieces, points, RELATIONS).
        in_plan: Their scaled relations in plan, of one column of points after the other (n,).
        rising: The same of those that change with height, of one point after the other (n,).
        columns: The column of each of these (n,).
        sums: Sums over relations in plan, of one column after the other (n,).
        of_structures: Messages of structures (members, structures, rows, length).
        constants: Inputs of the first layer that no layout changes (rows, n + length).
        given: Open shares and messages of rows (n,).
        middle: Four rows between the layers of messages, or of their weights (n,).
        between: Four rows after the first layer (4, width).
        beyond: The same after the second one (4, its width).
        parts: Parts of the sums of the last layer (4, PARTS).
        boxes: Boxes of the pieces of a layout (pieces, 5).
        traits: Their traits (pieces, TRAITS).
        told: Their scaled traits, one row after the other (n,).
        weights: The weights of their messages, by each member (n,).
        view_room: Room for a view.
        of_views: What the view of structures says (members, 1, rows, sight).
    """

    relations: FloatArray
    in_plan: SingleArray
    rising: SingleArray
    columns: Numbers
    sums: SingleArray
    of_structures: SingleArray
    constants: SingleArray
    given: SingleArray
    middle: SingleArray
    between: SingleArray
    beyond: SingleArray
    parts: SingleArray
    boxes: FloatArray
    traits: FloatArray
    told: SingleArray
    weights: SingleArray
    view_room: ViewRoom
    of_views: SingleArray

    @classmethod
    def in_room(
        cls,
        points: int,
        structures: int,
        layers: NetworkLayers,
        room: Room,
        pieces: int,
        most: int,
    ) -> "Bench":
        """Return the arrays for a number of new pieces, and a largest number in a layout."""
        members, _, length = layers.message.shape
        rows, (_, inputs, width) = whole(points), layers.constant.shape
        solids, between = max(structures, pieces), layers.message.shape[1]
        columns, widest = whole(solids * points), max(between, layers.weight.shape[1])
        return cls(
            room("relations of pieces", (pieces, points, RELATIONS), FLOAT),
            room("relations in plan", (columns * len(IN_PLAN),), SINGLE),
            room("relations that rise", (solids * rows * len(RISING),), SINGLE),
            room("columns of points", (max(solids * rows, whole(most)),), INTEGER),
            room("sums in plan", (columns * between,), SINGLE),
            room("messages of structures", (members, structures, rows, length), SINGLE),
            room("constants", (rows, inputs), SINGLE),
            room("given", (rows * layers.first.shape[1],), SINGLE),
            room("middle", (ROWS_AT_ONCE * widest,), SINGLE),
            room("between", (ROWS_AT_ONCE, width), SINGLE),
            room("beyond", (ROWS_AT_ONCE, layers.second.shape[2]), SINGLE),
            room("parts", (ROWS_AT_ONCE, PARTS), SINGLE),
            room("boxes of a layout", (most, BOX), FLOAT),
            room("traits of pieces", (most, TRAITS), FLOAT),
            room("told of pieces", (whole(most) * TRAITS,), SINGLE),
            room("weights of messages", (members * whole(most) * length,), SINGLE),
            ViewRoom.in_room(room),
            room("view of structures", (members, 1, rows, layers.piece_view.shape[2]), SINGLE),
        )


class SiteArrays(NamedTuple):
    """What compiled code takes of a site.

    Attributes:
        points: The points on the walls.
        solids: Left, bottom, right, top and height of each structure, m (structures, 5).
        curves: See `approach.curves`.
    """

    points: WallPoints
    solids: FloatArray
    curves: tuple[FloatArray, FloatArray, FloatArray, FloatArray]


class LoadRequest(NamedTuple):
    """Charges with layouts against each of them.

    Attributes:
        charges: See `approach.charge_row` (charges, 5).
        layouts: Number of layouts up to each charge (charges + 1,).
        boxes: Left, bottom, right, top and height of the pieces of all layouts, m (pieces, 5).
        pieces: Number of pieces up to each layout (layouts + 1,).
    """

    charges: FloatArray
    layouts: IntArray
    boxes: FloatArray
    pieces: IntArray
