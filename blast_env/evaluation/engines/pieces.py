"""Barrier pieces under a gas-dynamics blast: their loads and their stability.

The load on a piece is the difference of the mean overpressures on its two sides, across its
length; a square piece is loaded along both axes, of which the worse counts. A side that touches
another piece or a building carries no load. Support by neighbouring pieces is ignored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import UnknownNameError
from blast_env.geometry import WALLS, Element, Piece
from blast_env.response.barriers import PieceResponses, RigidPiece, piece_responses
from blast_env.site import Scenario
from blast_env.site.structures import ground_below_m, module_name
from blast_env.site.zone import BuildZone
from blast_env.tables import Column, table_of
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.gas.engine import GasRun
    from blast_env.gas.probes import PatchHistories

PIECE_COLUMNS: Final = (
    Column("piece", "", "item and centre in metres; of a single module its centre"),
    Column("x_m", "m", "its centre, from the left border"),
    Column("y_m", "m", "its centre, from the lower border"),
    Column("height_m", "m", "its height"),
    Column("base_m", "m", "width of its base"),
    Column("mass_kg", "kg", "its mass"),
    Column("friction", "", "coefficient of friction with the ground"),
    Column("anchorage_n", "N", "horizontal force that its anchors hold"),
    Column("peak_pa", "Pa", "largest difference of the mean overpressures on its sides"),
    Column("impulse_pa_s", "Pa s", "impulse of that difference, from its beginning to its largest"),
    Column("anchors_hold", "", "whether it has anchors, and they hold"),
    Column("slide_m", "m", "how far it slides"),
    Column("tilt", "", "largest tilt over that at which it overturns"),
    Column("overturn_s", "s", "when it overturns, from the detonation; NaN if it does not"),
    Column("outcome", "", "stands, slides, rocks or overturns"),
    Column("falls_in_blast", "", "whether it overturns before the blast is over"),
)
"""One row per piece of a barrier, or per module of a barrier without pieces."""


class _Way(NamedTuple):
    """One axis along which a piece is loaded.

    Attributes:
        piece: Index of the piece.
        low: Index of the wall on the low side of the axis; the opposite one follows in `WALLS`.
        faces: Number of cell faces on one whole side.
    """

    piece: int
    low: int
    faces: int


def rigid_piece(zone: BuildZone, element: Element) -> RigidPiece | None:
    """Return a piece or a module as a rigid body.

    It is `None` for a module as high as the air, and for a measure.
    """
    variant = zone.catalogue.variant(element)
    if not variant.height_m:
        return None
    if not zone.items:
        return RigidPiece.of_block(MODULE_SIDE_M, MODULE_SIDE_M, variant.height_m)
    item = zone.items[variant.item]
    return RigidPiece.of_block(
        MODULE_SIDE_M * item.length_modules,
        MODULE_SIDE_M * item.thickness_modules,
        item.height_m,
        item.mass_kg,
        item.base_width_m,
        item.friction,
        item.anchorage_n or 0.0,
    )


@dataclass(frozen=True, eq=False)
class PieceLoads:
    """The pressure histories on both sides of the pieces of a barrier.

    Attributes:
        elements: The pieces or modules with a height, in the order of the layout.
        bodies: Each as a rigid body.
        ways: The axes along which the pieces are loaded.
        patches: Patch of the recorder on each piece and wall, -1 for no load (pieces, 4).
        recorder: The histories, one per patch.
    """

    elements: tuple[Element, ...]
    bodies: tuple[RigidPiece, ...]
    zone: BuildZone
    ways: tuple[_Way, ...]
    patches: FloatArray
    recorder: "PatchHistories"

    @classmethod
    def begin(
        cls, run: "GasRun", scenario: Scenario, layout: Sequence[Element]
    ) -> "PieceLoads | None":
        """Return the loads of a run that has not begun, to be recorded by `GasRun.record`.

        `None` where no piece has a height.
        """
        from blast_env.gas.probes import PatchHistories

        zone = scenario.build_zone
        if zone is None or not layout:
            return None
        bodied = [
            (element, body)
            for element in layout
            if (body := rigid_piece(zone, element)) is not None
        ]
        if not bodied:
            return None
        elements, bodies = zip(*bodied, strict=True)
        # 1. The piece on each cell of the zone.
        owner = np.full(zone.shape, -1)
        for index, element in enumerate(elements):
            for cell in zone.catalogue.cells(element):
                owner[cell] = index
        table = run.table
        barrier = next(k for k, structure in enumerate(run.site.structures) if structure.is_barrier)
        # 2. The sides that count: two opposite ones for each axis along which a piece is loaded.
        ways = tuple(_ways(scenario, elements, run.grid.cell_m))
        pushed = np.zeros((len(elements), len(WALLS)), dtype=bool)
        for way in ways:
            pushed[way.piece, way.low : way.low + 2] = True
        # 3. The faces of the barrier on those sides; those of one piece and side share a patch.
        own = np.flatnonzero((table.structure == barrier) & (table.face < len(WALLS)))
        piece = owner[table.row[own], table.column[own]]
        own, piece = own[piece >= 0], piece[piece >= 0]
        chosen = pushed[piece, table.face[own]]
        own, side = own[chosen], (len(WALLS) * piece + table.face[own])[chosen]
        seen, numbers = np.unique(side, return_inverse=True)
        patch = np.full(len(table.faces), -1)
        patch[own] = numbers
        patches = np.full(pushed.size, -1)
        patches[seen] = np.arange(len(seen))
        return cls(
            elements,
            bodies,
            zone,
            ways,
            patches.reshape(pushed.shape),
            PatchHistories(patch, len(seen)),
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the pieces."""
        return tuple(
            self.zone.piece_name(element)
            if isinstance(element, Piece)
            else module_name(*self.zone.element_rectangle_m(element).centre)
            for element in self.elements
        )

    @cached_property
    def pushes(self) -> FloatArray:
        """Mean overpressure on the low side minus that on the high side, Pa (ways, steps)."""
        histories = self.recorder.history_pa.astype(np.float64)
        pushes = np.zeros((len(self.ways), len(self.recorder.time_s)))
        for row, way in enumerate(self.ways):
            for sign, wall in ((1.0, way.low), (-1.0, way.low + 1)):
                patch = int(self.patches[way.piece, wall])
                if patch >= 0:
                    share = self.recorder.faces[patch] / way.faces
                    pushes[row] += sign * share * histories[patch]
        return pushes

    @cached_property
    def responses(self) -> PieceResponses:
        """The response of each piece along each of its axes."""
        bodies = [self.bodies[way.piece] for way in self.ways]
        return piece_responses(bodies, self.recorder.time_s, self.pushes)

    @cached_property
    def _worst(self) -> list[int]:
        """Index of the axis in `ways` along which each piece moves most."""
        found = self.responses
        rows: dict[int, int] = {}
        for row, way in enumerate(self.ways):
            best = rows.setdefault(way.piece, row)
            if (found.tilt[row], found.slide_m[row]) > (found.tilt[best], found.slide_m[best]):
                rows[way.piece] = row
        return [rows[piece] for piece in range(len(self.elements))]

    def fallen(self, end_s: float) -> tuple[Element, ...]:
        """Return the pieces that overturn by a time."""
        when_s = self.responses.overturn_s[self._worst]
        return tuple(
            element for element, at_s in zip(self.elements, when_s, strict=True) if at_s <= end_s
        )

    def history(self, name: str) -> "pd.DataFrame":
        """Return the mean overpressures on a piece over time: `time_s`, and one column per side."""
        import pandas as pd

        if name not in self.names:
            raise UnknownNameError("piece", name, self.names)
        columns = {"time_s": self.recorder.time_s}
        for wall, patch in zip(WALLS, self.patches[self.names.index(name)], strict=True):
            if patch >= 0:
                columns[f"{wall}_pa"] = self.recorder.history_pa[int(patch)]
        return pd.DataFrame(columns)

    def table(self, end_s: float) -> "pd.DataFrame":
        """Return one row per piece at the end of a blast; see `PIECE_COLUMNS`."""
        rows = [self._row(piece, end_s) for piece in range(len(self.elements))]
        return table_of(rows, PIECE_COLUMNS)

    def _row(self, piece: int, end_s: float) -> dict[str, object]:
        # The way of loading that moves it most; loads are per metre, sums for the whole piece.
        row, found, body = self._worst[piece], self.responses, self.bodies[piece]
        rectangle = self.zone.element_rectangle_m(self.elements[piece])
        length_m = max(rectangle.right - rectangle.left, rectangle.top - rectangle.bottom)
        push = self.pushes[row]
        overturn_s = float(found.overturn_s[row])
        return {
            "piece": self.names[piece],
            "x_m": rectangle.centre[0],
            "y_m": rectangle.centre[1],
            "height_m": body.height_m,
            "base_m": body.base_m,
            "mass_kg": body.mass_kg_m * length_m,
            "friction": body.friction,
            "anchorage_n": body.anchor_n_m * length_m,
            "peak_pa": np.abs(push).max(),
            "impulse_pa_s": np.abs(np.cumsum(push * self.recorder.step_s)).max(),
            "anchors_hold": bool(found.held[row]),
            "slide_m": found.slide_m[row],
            "tilt": found.tilt[row],
            "overturn_s": overturn_s if np.isfinite(overturn_s) else np.nan,
            "outcome": str(found.stability[row]),
            "falls_in_blast": overturn_s <= end_s,
        }


def _ways(scenario: Scenario, elements: Sequence[Element], cell_m: float) -> list[_Way]:
    """Return the axes along which pieces are loaded: across their length, both if square."""
    zone, west, south = scenario.zone, WALLS.index("west"), WALLS.index("south")
    cells_a_module = round(MODULE_SIDE_M / cell_m)
    ways = []
    for index, element in enumerate(elements):
        variant = zone.catalogue.variant(element)
        assert variant.height_m is not None
        base_m = ground_below_m(scenario.structures, zone.element_rectangle_m(element))
        ends = np.array([base_m, base_m + variant.height_m]) / cell_m
        layers = int(np.diff(np.ceil(np.round(ends - 0.5, 9)))[0])
        if variant.rows >= variant.columns:
            ways.append(_Way(index, west, layers * variant.rows * cells_a_module))
        if variant.columns >= variant.rows:
            ways.append(_Way(index, south, layers * variant.columns * cells_a_module))
    return ways


_VERBS: Final = {
    "stands": ("remains stable", "remain stable"),
    "slides": ("slides", "slide"),
    "rocks": ("rocks", "rock"),
    "overturns": ("overturns", "overturn"),
}


def outcome_words(pieces: "pd.DataFrame") -> str:
    """Return the outcomes, the most frequent first: `5 barriers remain stable, 1 barrier slides`.

    Args:
        pieces: One row per piece; see `PIECE_COLUMNS`.
    """
    counts = pieces["outcome"].value_counts().items()
    return ", ".join(
        f"{n} {'barrier' if n == 1 else 'barriers'} {_VERBS[str(word)][n > 1]}"
        for word, n in counts
    )
