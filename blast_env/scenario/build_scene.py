"""From a scenario to the scene of one blast."""

from collections.abc import Sequence

import numpy as np

from blast_env.geometry import Cell, Rectangle
from blast_env.physics.particles import Balls, air_lattice, explosion_fan
from blast_env.physics.presets import for_charge
from blast_env.physics.scene import Charge, Scene, StructureOutline
from blast_env.physics.structure import BARRIER_NAME, ConcreteSquare, ModularObstacle
from blast_env.scenario import BuildZone, Scenario, check_layout, usable_cells
from blast_env.scenario.models import AnyStructure, ConcreteSquareSection
from blast_env.units import UNITS_PER_M


def random_streams(seed: int) -> tuple[np.random.Generator, ...]:
    """Return independent generators for the charge, the fan and the air.

    Separate streams, so that a charge fixed by hand leaves fan and air as they were.

    Raises:
        ValueError: If the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed is {seed}, must be at least 0")
    return tuple(np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3))


def draw_charge(scenario: Scenario, seed: int) -> Charge:
    """Return the charge that a seed draws from a scenario.

    Raises:
        ValueError: If the seed is negative.
    """
    return scenario.sample_charge(random_streams(seed)[0])


def build_scene(
    scenario: Scenario,
    layout: Sequence[Cell] = (),
    seed: int = 0,
    charge: Charge | None = None,
) -> Scene:
    """Lay out a scenario for one blast.

    Args:
        scenario: The scenario.
        layout: (row, column) of the build-zone cells that hold a barrier module.
        seed: Decides the charge (where the scenario leaves it open), the fan's phase and the
            air's jitter. The barrier does not shift any of them.
        charge: The charge, instead of one drawn from the scenario.

    Raises:
        LayoutError: If the layout does not fit the build zone, or the charge.
        ScenarioError: If the charge is not clear of a structure or the border.
        BlastEnvError: If the parameters do not reach to the mass of the charge.
        ValueError: If the seed is negative.
    """
    cells = check_layout(scenario, layout)
    if charge is not None:
        _check_clear(scenario.with_charge(charge), cells)
    charge_rng, fan_rng, air_rng = random_streams(seed)
    charge = scenario.sample_charge(charge_rng) if charge is None else charge
    parameters = for_charge(scenario.parameters, charge.tnt_kg)
    site = scenario.site.rectangle_m.scaled(UNITS_PER_M)
    structures = tuple(_outline(section) for section in scenario.structures)
    if cells:
        structures += (barrier_outline(scenario.zone, cells),)
    centre = (charge.position_m[0] * UNITS_PER_M, charge.position_m[1] * UNITS_PER_M)
    air = air_lattice(
        parameters.air,
        site,
        _solid_rectangles(structures),
        centre,
        parameters.explosive.offset_units + parameters.explosive.radius_units,
        air_rng,
    )
    fan = explosion_fan(parameters.explosive, centre, fan_rng)
    return Scene(
        site=site,
        charge_centre=centre,
        charge=charge,
        balls=Balls.concatenate((air, fan)),
        structures=structures,
        parameters=parameters,
    )


def _check_clear(scenario: Scenario, cells: tuple[Cell, ...]) -> None:
    """Refuse a layout with a module on the charge; nothing else depends on where that is.

    Raises:
        LayoutError: If there is one.
    """
    usable = usable_cells(scenario)
    if not all(usable[cell] for cell in cells):
        check_layout(scenario, cells)


def _solid_rectangles(structures: Sequence[StructureOutline]) -> list[Rectangle]:
    """Return rectangles that cover the modules: whole grids, and single cells of a barrier."""
    rectangles: list[Rectangle] = []
    for outline in structures:
        if outline.cells is None:
            rectangles.append(outline.rectangle)
        else:
            rectangles.extend(part.rectangle for part in outline.build().parts)
    return rectangles


def _outline(section: AnyStructure) -> StructureOutline:
    is_square = isinstance(section, ConcreteSquareSection)
    return StructureOutline(
        kind=ConcreteSquare if is_square else ModularObstacle,
        name=section.name,
        corner=(section.corner_m[0] * UNITS_PER_M, section.corner_m[1] * UNITS_PER_M),
        rows=section.rows,
        columns=section.columns,
        protected=section.protected,
        weight=section.weight,
        cells=None,
        capacity=section.module_capacity,
    )


def barrier_outline(zone: BuildZone, cells: tuple[Cell, ...]) -> StructureOutline:
    """Return the barrier that the modules on these cells of a zone make."""
    return StructureOutline(
        kind=ModularObstacle,
        name=BARRIER_NAME,
        corner=(zone.corner_m[0] * UNITS_PER_M, zone.corner_m[1] * UNITS_PER_M),
        rows=zone.rows,
        columns=zone.columns,
        protected=False,
        weight=1.0,
        cells=cells,
        capacity=zone.module_capacity,
    )
