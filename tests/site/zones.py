"""Scenarios with a small build zone, and the rules of building in it written out the slow way."""

from collections import Counter, deque
from collections.abc import Collection
from itertools import product
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from blast_env.geometry import Cell, Piece, Rectangle
from blast_env.layout import LayoutState
from blast_env.site import BuildZone, Scenario, ScenarioError
from tests import builders
from tests.builders import Document, block, point, site_document

CORNER_M = (10.0, 10.0)
"""Lower left corner of the zone."""

SHAPES = ((1, 1), (3, 1), (1, 4), (2, 2))
"""Rows and columns of structures inside drawn zones."""

TERRACES = ((4, 3), (8, 2), (3, 8))
"""Rows and columns of terraces there."""


def structure(name: str, x_m: float, y_m: float, rows: int, columns: int) -> Document:
    """An unprotected structure, its corner so far from the zone's corner."""
    return block(name, CORNER_M[0] + x_m, CORNER_M[1] + y_m, rows, columns)


def area(x_m: float, y_m: float, width_m: float, height_m: float, **keys: Any) -> Document:
    """A no-build area or cost area, its corner so far from the zone's corner."""
    corner_m = [CORNER_M[0] + x_m, CORNER_M[1] + y_m]
    return {"corner_m": corner_m, "size_m": [width_m, height_m], **keys}


def zone_document(*structures: Document, **zone: Any) -> Document:
    """A zone of 8 x 8 cells and 10 modules, unless said otherwise; all else is far away."""
    protected = {**structure("protected", 20.0, 20.0, 2, 2), "protected": True}
    cells = builders.zone(*CORNER_M, 8, 8, stock=10) | zone
    charge = point(2.0, 2.0)
    return site_document("zone", (40.0, 40.0), charge, protected, *structures, build_zone=cells)


def zone_scenario(*structures: Document, **zone: Any) -> Scenario:
    """The scenario of `zone_document`."""
    return Scenario.from_document(zone_document(*structures, **zone), "zone")


def available(placement: LayoutState) -> list[Cell]:
    """The cells that may take a module, as plain integers."""
    return [(int(row), int(column)) for row, column in np.argwhere(placement.free)]


def filled(scenario: Scenario, rng: np.random.Generator) -> LayoutState:
    """Modules on free cells drawn at random, until there are none."""
    placement = LayoutState.empty(scenario)
    while not placement.is_full:
        cells = available(placement)
        placement = placement.place(cells[rng.integers(len(cells))])
    return placement


@st.composite
def zone_documents(draw: st.DrawFn) -> Document:
    """Zones of up to 8 x 8 cells with any of the conditions; not all of them can be built in."""
    rows, columns = draw(st.integers(3, 8)), draw(st.integers(3, 8))
    x_m = st.integers(0, 2 * columns - 1).map(lambda n: n / 4)
    y_m = st.integers(0, 2 * rows - 1).map(lambda n: n / 4)
    sizes = st.integers(1, 4).map(lambda n: n / 4)
    costs = st.sampled_from([0.1, 0.3, 1.0, 2.5, 4.0])
    areas = st.builds(area, x_m, y_m, sizes, sizes, reason=st.just("a reason"))
    document = zone_document(
        rows=rows,
        columns=columns,
        stock=draw(st.sampled_from([1, 4, rows * columns // 3])),
        module_cost=draw(costs),
        clearance_m=draw(st.sampled_from([0.0, 0.0, 0.25, 0.5, 1.0])),
        keep_outs=draw(st.lists(areas, max_size=2)),
        cost_areas=[{**case, "module_cost": draw(costs)} for case in draw(st.lists(areas))],
    )
    zone = document["build_zone"]
    if draw(st.booleans()):
        zone["budget"] = draw(st.sampled_from([1.0, 3.0, 5.5, 8.0]))
    if draw(st.integers(0, 3)) > 0:
        between = draw(st.sampled_from(["left_right", "bottom_top"]))
        zone["access_way"] = {"width_m": draw(st.sampled_from([0.5, 1.0, 1.5])), "between": between}
    if draw(st.booleans()):
        shape = draw(st.sampled_from(SHAPES))
        document["structures"].append(structure("inside", draw(x_m), draw(y_m), *shape))
    return document


def buildable(document: Document) -> Scenario:
    """The scenario of a drawn document; the draw does not count if it is none."""
    try:
        return Scenario.from_document(document, "drawn")
    except ScenarioError:
        assume(False)
        raise


def may_stand(scenario: Scenario, cells: Collection[Cell]) -> bool:
    """Whether modules may stand on all these cells, as the format's description says it."""
    zone = scenario.build_zone
    if zone is None or len(cells) > zone.stock:
        return False
    squares = [zone.cell_rectangle_m(cell) for cell in cells]
    limit = np.inf if zone.budget is None else zone.budget * (1.0 + 1e-9)
    if sum(_cost(zone, square) for square in squares) > limit:
        return False
    return modules_may_stand(scenario, cells)


def modules_may_stand(scenario: Scenario, cells: Collection[Cell]) -> bool:
    """Whether the site leaves room for modules on all these cells, whatever they cost."""
    zone = scenario.zone
    squares = [zone.cell_rectangle_m(cell) for cell in cells]
    if any(
        square.overlaps(keep_out.rectangle_m) for square in squares for keep_out in zone.keep_outs
    ):
        return False
    solids = [structure.rectangle_m for structure in scenario.structures]
    for square in squares:
        grounds = _grounds_m(scenario, square)
        if len(grounds) > 1:
            return False
        beside = [
            structure.rectangle_m
            for structure in scenario.structures
            if not structure.carries or (structure.height_m or 0.0) > min(grounds)
        ]
        if any(square.overlaps(solid) for solid in beside):
            return False
        if any(_distance_m(square, solid) < zone.clearance_m - 1e-9 for solid in beside):
            return False
    if zone.access_way is None:
        return True
    passable = np.array(
        [
            cell not in cells
            and not any(zone.cell_rectangle_m(cell).overlaps(solid) for solid in solids)
            for cell in zone.cells()
        ]
    ).reshape(zone.rows, zone.columns)
    turned = passable if zone.access_way.between == "left_right" else passable.T
    return can_cross(turned, round(zone.access_way.width_m / 0.5))


def _grounds_m(scenario: Scenario, square: Rectangle) -> set[float]:
    """The heights of the ground in the quarters of a cell, of which everything drawn consists."""
    left, bottom, _, _ = square
    heights_m = set()
    for x_m, y_m in product((left + 0.125, left + 0.375), (bottom + 0.125, bottom + 0.375)):
        quarter = Rectangle(x_m, y_m, x_m, y_m)
        carrying = [structure for structure in scenario.structures if structure.carries]
        own = [
            structure.height_m or 0.0
            for structure in carrying
            if structure.rectangle_m.contains(quarter)
        ]
        heights_m.add(max(own, default=0.0))
    return heights_m


def can_cross(passable: np.ndarray, width: int) -> bool:
    """Whether a square of width x width cells can go from the left to the right, step by step."""
    rows, columns = (length - width + 1 for length in passable.shape)
    places = {
        (row, column)
        for row in range(rows)
        for column in range(columns)
        if passable[row : row + width, column : column + width].all()
    }
    reached = {place for place in places if place[1] == 0}
    queue = deque(reached)
    while queue:
        row, column = queue.popleft()
        for place in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if place in places and place not in reached:
                reached.add(place)
                queue.append(place)
    return any(column == columns - 1 for _, column in reached)


def _cost(zone: BuildZone, square: Rectangle) -> float:
    areas = [cost_area for cost_area in zone.cost_areas if square.overlaps(cost_area.rectangle_m)]
    return max((area.module_cost or 0.0 for area in areas), default=zone.module_cost)


def _distance_m(one: Rectangle, other: Rectangle) -> float:
    gap_x = max(0.0, one.left - other.right, other.left - one.right)
    gap_y = max(0.0, one.bottom - other.top, other.bottom - one.top)
    return float((gap_x**2 + gap_y**2) ** 0.5)


# --- Zones with a catalogue.


@st.composite
def catalogue_documents(draw: st.DrawFn) -> Document:
    """Drawn zones with a catalogue of up to three items instead of single modules.

    They may have terraces, side by side, of the same height or not.
    """
    document = draw(zone_documents())
    zone = document["build_zone"]
    del zone["module_cost"]
    zone["cost_areas"] = [
        {"cost_factor": cost_area.pop("module_cost"), **cost_area}
        for cost_area in zone["cost_areas"]
    ]
    lengths, costs = st.integers(1, 4), st.sampled_from([0.5, 1.0, 2.5])
    zone["items"] = [
        {
            "name": f"item{number}",
            "length_modules": draw(lengths),
            "thickness_modules": draw(st.integers(1, 2)),
            "height_m": 1.0 + number,
            "cost": draw(costs),
            "stock": draw(st.integers(0, 3)),
            "rotatable": draw(st.booleans()),
        }
        for number in range(draw(st.integers(1, 3)))
    ]
    x_m, y_m = (st.integers(-4, 2 * zone[key]).map(lambda n: n / 4) for key in ("columns", "rows"))
    for number in range(draw(st.integers(0, 2))):
        size, high_m = draw(st.sampled_from(TERRACES)), draw(st.sampled_from([1.0, 1.5]))
        terrace = structure(f"terrace{number}", draw(x_m), draw(y_m), *size)
        document["structures"].append(terrace | {"height_m": high_m, "carries": True})
    pieces = sum(item["stock"] for item in zone["items"])
    zone["stock"] = draw(st.integers(1, max(pieces, 1)))
    return document


def pieces_may_stand(scenario: Scenario, layout: Collection[Piece]) -> bool:
    """Whether all these pieces may stand, as the format's description says it."""
    zone = scenario.zone
    if len(layout) > zone.stock:
        return False
    items, cost = {item.name: item for item in zone.items}, 0.0
    cells: list[Cell] = []
    for piece in layout:
        item = items[piece.item]
        if piece.turned and (not item.rotatable or item.length_modules == item.thickness_modules):
            return False
        size = (item.thickness_modules, item.length_modules)
        rows, columns = size[::-1] if piece.turned else size
        own = [
            (piece.row + up, piece.column + right) for up in range(rows) for right in range(columns)
        ]
        cells += own
        squares = [zone.cell_rectangle_m(cell) for cell in own]
        if len(set().union(*(_grounds_m(scenario, square) for square in squares))) > 1:
            return False
        cost += item.cost * sum(_factor(zone, square) for square in squares) / len(own)
    of_items = Counter(piece.item for piece in layout)
    if any(of_items[name] > item.stock for name, item in items.items()):
        return False
    if len(set(cells)) < len(cells) or not all(zone.has(cell) for cell in cells):
        return False
    if zone.budget is not None and cost > zone.budget * (1.0 + 1e-9):
        return False
    return modules_may_stand(scenario, cells)


def _factor(zone: BuildZone, square: Rectangle) -> float:
    areas = [cost_area for cost_area in zone.cost_areas if square.overlaps(cost_area.rectangle_m)]
    return max((area.cost_factor or 0.0 for area in areas), default=1.0)
