"""The site of one blast, from a scenario, a layout and a charge."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from blast_env.geometry import Element, Layout, standing
from blast_env.layout.placement import LayoutState, LegalLayout, check_layout, usable_cells
from blast_env.site import AnyCharge, Scenario, VehicleCharge, VehicleSource
from blast_env.site.blast_site import BlastSite, Charge, Gauge
from blast_env.site.content import highest_top_m
from blast_env.site.sources import charge_from
from blast_env.site.structures import (
    BARRIER_NAME,
    ConcreteSquareSection,
    StructureOutline,
    ground_below_m,
)
from blast_env.values import checked_seed
from blast_env.vehicles.vehicle import NOTHING, Obstacles

if TYPE_CHECKING:  # most sites have no vehicle
    from blast_env.vehicles.drive import Drive
    from blast_env.vehicles.reach import Reach
    from blast_env.vehicles.worst_places import WorstPlaces


def random_streams(seed: int) -> tuple[np.random.Generator, ...]:
    """Return independent generators for the charge, the fan and the air.

    Separate streams keep fan and air unchanged if the charge is fixed.
    """
    return tuple(map(np.random.default_rng, np.random.SeedSequence(checked_seed(seed)).spawn(3)))


def draw_charge(scenario: Scenario, seed: int) -> Charge:
    """Return the charge of a scenario for a seed: of a vehicle, at its place without a layout.

    Raises:
        ValueError: If the seed is negative.
    """
    return charge_against(scenario, (), draw_threat(scenario, seed))


def draw_threat(scenario: Scenario, seed: int) -> AnyCharge:
    """Return the charge of `draw_charge` before its place against a layout is determined.

    Raises:
        ValueError: If the seed is negative.
    """
    return scenario.sample_charge(random_streams(seed)[0])


def worst_places(
    scenario: Scenario, source: VehicleSource, layout: Sequence[Element] = ()
) -> "WorstPlaces":
    """Return the worst places of a vehicle's charge against a layout.

    Args:
        layout: (row, column) of the build-zone cells with a barrier module, or pieces.
    """
    known: dict[int, WorstPlaces] = {}
    if isinstance(layout, LegalLayout) and layout.scenario is scenario:
        known = layout.worst
    found = known.get(id(source))
    if found is None or found.source is not source:
        ground = scenario.vehicle_ground(source, layout)
        found = known[id(source)] = ground.worst_places(_obstacles(scenario, layout))
    return found


def vehicle_reach(
    scenario: Scenario, source: VehicleSource, layout: Sequence[Element] = ()
) -> "Reach":
    """Return the reach of a vehicle; arguments as for `worst_places`."""
    return scenario.vehicle_ground(source, layout).reach(_obstacles(scenario, layout))


def vehicle_drive(
    scenario: Scenario, source: VehicleSource, layout: Sequence[Element] = ()
) -> "Drive":
    """Return the drive of a vehicle against a layout; arguments as for `worst_places`."""
    return scenario.vehicle_ground(source, layout).drive(_obstacles(scenario, layout))


def charge_against(scenario: Scenario, layout: Sequence[Element], charge: AnyCharge) -> Charge:
    """Return a charge at its place, which for a vehicle depends on the layout.

    Args:
        layout: (row, column) of the build-zone cells with a barrier module, or pieces.
        charge: The charge; a `Charge` is returned unchanged.
    """
    if isinstance(charge, VehicleCharge):
        source = charge.source
        place_m = worst_places(scenario, source, layout).place_m(charge.rank)
        return Charge(place_m, source.tnt_kg, source.height_m)
    return charge


def _obstacles(scenario: Scenario, layout: Sequence[Element]) -> Obstacles:
    if not layout:
        return NOTHING
    from blast_env.layout.obstacles import obstacles_of  # most sites have no vehicle

    return obstacles_of(scenario, layout)


def build_site(
    scenario: Scenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    charge: AnyCharge | None = None,
    *,
    with_zone: bool = True,
) -> BlastSite:
    """Return the site of one blast.

    Args:
        layout: (row, column) of the build-zone cells with a barrier module, or pieces.
        seed: Seed of the charge if the scenario has several; the same charge as for particles.
        charge: The charge, instead of one drawn from the scenario.
        with_zone: Whether to give the whole build zone, too, which only gas dynamics needs.

    Raises:
        LayoutError: If the layout does not fit the build zone, or the charge.
        ScenarioError: If the charge is not clear of a structure or the border.
        BlastEnvError: If the charge has another form.
        ValueError: If the seed is negative.
    """
    legal = check_layout(scenario, layout)
    if charge is not None and not isinstance(charge, Charge):
        charge = charge_from(charge)
    # The scenario and the layout are sound with the scenario's own charges, and a vehicle keeps
    # clear of all obstacles: only a charge from elsewhere is checked here.
    if isinstance(charge, Charge) and not scenario.may_have(charge):
        _check_clear(scenario.with_charge(charge), legal)
    drawn = draw_threat(scenario, seed) if charge is None else charge
    charge = charge_against(scenario, legal, drawn)
    structures = outlines(scenario, legal)
    barrier = standing(legal)
    if barrier:
        structures += (barrier_outline(scenario, barrier),)
    return BlastSite(
        site_m=scenario.site.rectangle_m,
        charge=charge,
        structures=structures,
        gauges=tuple(Gauge(gauge.name, gauge.position_m) for gauge in scenario.gauges),
        air_height_m=scenario.air_height_m,
        build_zone=_whole(scenario) if with_zone and scenario.build_zone is not None else None,
    )


def _check_clear(scenario: Scenario, layout: Layout) -> None:
    """Refuse a layout with a module on the charge, the only condition that a charge can break."""
    usable = usable_cells(scenario)
    if not all(usable[cell] for cell in LayoutState(scenario, layout).cells):
        check_layout(scenario, tuple(layout))  # a plain one, which is not known to be legal here


def outlines(scenario: Scenario, layout: Iterable[Element] = ()) -> tuple[StructureOutline, ...]:
    """Return the outlines of the structures that remain with a layout."""
    zone = scenario.build_zone
    removable = () if zone is None else zone.removable
    may_go = frozenset[str]().union(*map(attrgetter("structures"), removable))
    found = []
    for section in scenario.structures_with(layout):
        is_square = isinstance(section, ConcreteSquareSection)
        outline = StructureOutline(
            kind="ConcreteSquare" if is_square else "ModularObstacle",
            name=section.name,
            corner_m=section.corner_m,
            rows=section.rows,
            columns=section.columns,
            protected=section.protected,
            weight=section.weight,
            cells=section.cells,
            capacity=section.module_capacity,
            height_m=section.height_m,
            faces=section.faces,
            base_m=section.base_m,
            is_lasting=section.name not in may_go,
            footprint=section.footprint,
        )
        found.append(outline)
    return tuple(found)


def _whole(scenario: Scenario) -> StructureOutline:
    """Return a barrier that fills the whole zone, at the largest possible height."""
    empty = barrier_outline(scenario, ())
    return replace(empty, cells=None, heights_m=None, bases_m=None, pieces=None)


def barrier_outline(scenario: Scenario, layout: Layout) -> StructureOutline:
    """Return the barrier of a layout in the build zone."""
    # A barrier is one structure of modules; each stands on the ground below it, which may be a
    # terrace.
    zone, modules = scenario.zone, scenario.zone.modules(layout)
    terraces = [structure for structure in scenario.structures if structure.carries]
    bases_m = [ground_below_m(terraces, zone.cell_rectangle_m(module.cell)) for module in modules]
    tops_m = [
        None if module.height_m is None else base_m + module.height_m
        for module, base_m in zip(modules, bases_m, strict=True)
    ]
    return StructureOutline(
        kind="ModularObstacle",
        name=BARRIER_NAME,
        corner_m=zone.corner_m,
        rows=zone.rows,
        columns=zone.columns,
        protected=False,
        weight=1.0,
        cells=tuple(module.cell for module in modules),
        capacity=zone.module_capacity,
        height_m=highest_top_m(zone, scenario.structures),
        heights_m=tuple(tops_m) if zone.items or any(bases_m) else None,
        bases_m=tuple(bases_m) if any(bases_m) else None,
        pieces=tuple(module.piece for module in modules) if zone.items else None,
    )
