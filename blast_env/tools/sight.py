"""What an agent sees of a problem without a blast: site, proposals, legality."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from typing import Any, Final

from blast_env.benchmark import BenchmarkProblem
from blast_env.design.search import ProposerKind, proposers
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element
from blast_env.layout import LayoutState
from blast_env.rules import random_layout
from blast_env.site import Scenario, VehicleCharge
from blast_env.tools.records import (
    Building,
    ItemOnOffer,
    Look,
    Picture,
    PlacedPiece,
    Proposal,
    Threat,
    pieces_of,
)
from blast_env.units import MODULE_SIDE_M
from blast_env.values import generator

_DOTS_PER_IN: Final = 80.0

_TASK: Final = (
    "Place barriers in the build zone so that least of the blast's {noun} arrives at the protected "
    "buildings, combined over the threats. `rules` has proposals, `check` says what is legal, "
    "`guess` predicts for nothing, `blast` runs gas dynamics within the budget. `submit` your best "
    "layout once: the judge blasts it anew, on finer cells, which gives the score. The score is "
    "linear in the share of the load taken off, from 0 to 1."
)


def look_at(problem: BenchmarkProblem, picture: bool, **more: Any) -> Look:
    """Return the site of a problem in words and numbers.

    Args:
        picture: Whether to add a picture of the plan.
        more: The other fields of the record.

    Raises:
        MissingExtraError: If a picture needs an extra.
    """
    scenario, zone = problem.scenario, problem.scenario.zone
    west_m, south_m = zone.corner_m
    ground = LayoutState.empty(scenario).open_ground
    return Look(
        problem=problem.name,
        task=_TASK.format(noun=scenario.objective.noun),
        blasts_per_layout=len(problem.threats),
        width_m=scenario.site.width_m,
        height_m=scenario.site.height_m,
        threats=tuple(_threats(problem)),
        buildings=tuple(_buildings(scenario)),
        zone_west_m=west_m,
        zone_south_m=south_m,
        cell_m=MODULE_SIDE_M,
        rows=zone.rows,
        columns=zone.columns,
        items=tuple(_items(scenario)),
        most_pieces=zone.stock,
        cost_limit=zone.budget,
        cost_unit=zone.cost_unit,
        plan=tuple("".join(".x"[not free] for free in row) for row in ground[::-1].tolist()),
        picture=_picture(scenario) if picture else None,
        **more,
    )


def proposals_for(problem: BenchmarkProblem, seed: int) -> tuple[Proposal, ...]:
    """Return the layout of each rule that suits the site, and a random one of the seed."""
    found = []
    for name, row in proposers(ProposerKind.RULE, suiting=[problem.scenario]).items():
        try:
            result = row.make().propose(problem)
        except BlastEnvError as error:
            found.append(Proposal(rule=name, layout=(), cost=0.0, note=str(error)))
            continue
        cost, layout = problem.cost(result.layout), pieces_of(result.layout)
        found.append(Proposal(rule=name, layout=layout, cost=cost, note=result.by))
    drawn = tuple(sorted(random_layout(problem.scenario, generator(seed))))
    note = f"a random layout of the seed {seed}"
    cost = problem.cost(drawn)
    return (*found, Proposal(rule="random", layout=pieces_of(drawn), cost=cost, note=note))


def legality_of(
    problem: BenchmarkProblem, layout: Sequence[PlacedPiece | Element]
) -> dict[str, Any]:
    """Return whether a layout is legal, the reasons against it, and the cost of what is legal."""
    placement, reasons = LayoutState.empty(problem.scenario), []
    for piece in layout:
        try:
            placement = placement.place(element_in(problem, piece))
        except BlastEnvError as error:
            reasons.append(str(error))
    return {"legal": not reasons, "reasons": tuple(reasons), "cost": placement.cost}


def element_in(problem: BenchmarkProblem, piece: PlacedPiece | Element) -> Element:
    """Return the element of a piece, which need not be legal.

    Raises:
        BlastEnvError: If it has another form.
    """
    if not isinstance(piece, PlacedPiece):
        return problem.scenario.zone.catalogue.element_from(piece, "a piece")
    names = [item.item for item in _items(problem.scenario)]
    if names and not piece.item:
        raise BlastEnvError(
            f"the piece at row {piece.row}, column {piece.column} has no `item`, which must be one "
            f"of {', '.join(names)}"
        )
    return piece.element


def _threats(problem: BenchmarkProblem) -> Iterator[Threat]:
    for threat in problem.threats:
        charge = threat.charge_against(problem.scenario)
        x_m, y_m = charge.position_m
        yield Threat(
            tnt_kg=charge.tnt_kg,
            height_m=charge.height_m,
            x_m=x_m,
            y_m=y_m,
            vehicle=isinstance(threat.charge, VehicleCharge),
        )


def _buildings(scenario: Scenario) -> Iterator[Building]:
    for structure in scenario.structures:
        west_m, south_m, east_m, north_m = structure.rectangle_m
        yield Building(
            name=structure.name,
            protected=structure.protected,
            west_m=west_m,
            south_m=south_m,
            east_m=east_m,
            north_m=north_m,
            height_m=structure.height_m,
        )


def _items(scenario: Scenario) -> Iterator[ItemOnOffer]:
    zone = scenario.zone
    for item in zone.items:
        yield ItemOnOffer(
            item=item.name,
            description=item.description,
            length_cells=item.length_modules,
            thickness_cells=item.thickness_modules,
            height_m=item.height_m,
            cost=item.cost,
            pieces=item.stock,
            rotatable=True in item.orientations,
            stops_vehicles=item.stops_vehicles,
        )
    for measure in zone.measures:
        yield ItemOnOffer(
            item=measure.name,
            description=measure.description,
            length_cells=0,
            thickness_cells=0,
            height_m=0.0,
            cost=measure.cost,
            pieces=1,
            rotatable=False,
            stops_vehicles=False,
        )


def _picture(scenario: Scenario) -> Picture:
    # Here, because pictures need the extra `render`.
    from blast_env.plots.figures import png_of
    from blast_env.plots.site_picture import site_picture

    content = png_of(site_picture(scenario), _DOTS_PER_IN)
    return Picture(base64=b64encode(content).decode("ascii"))
