"""What a charge does to the buildings of a site: panes, panels, levels of protection.

Loads come from gas dynamics, a blast a charge and a layout. Other glass needs no new blast: the
loads stay, and the response is worked out again.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blast_env.engines.contract import Engine
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element
from blast_env.physics.scene import Charge
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.components import Glazing, catalogue
from blast_env.response.facade import FacadeResponse, FilledBay, respond
from blast_env.scenario import AnyCharge, AnyScenario, Scenario, find_scenario
from blast_env.scenario.build_scene import charge_against


@dataclass(frozen=True, eq=False)
class BuildingResponse:
    """What one charge does to one building.

    Attributes:
        building: Its name; structures that are parts of one building are one.
        charge: The charge where it went off.
        facade: What became of its bays.
    """

    building: str
    charge: Charge
    facade: FacadeResponse


@dataclass(frozen=True, eq=False)
class Consequences:
    """What charges do to the buildings of a site behind a layout.

    Attributes:
        responses: One a building and charge.
    """

    responses: tuple[BuildingResponse, ...]

    @property
    def buildings(self) -> tuple[str, ...]:
        """The buildings with a facade, in the order of the scenario."""
        return tuple(dict.fromkeys(each.building for each in self.responses))

    def of(self, building: str) -> tuple[BuildingResponse, ...]:
        """Return what the charges do to one building."""
        return tuple(each for each in self.responses if each.building == building)

    def level(self, building: str) -> LevelOfProtection:
        """Return the level of protection that a building reaches under every charge."""
        return min(each.facade.level_of_protection for each in self.of(building))

    def passes(self, target: LevelOfProtection) -> bool:
        """Return whether all buildings reach a level under every charge."""
        return all(self.level(building) >= target for building in self.buildings)

    def with_glazing(self, glazing: Glazing) -> "Consequences":
        """Return the same with other glass in all windows; sizes and sills stay.

        Args:
            glazing: The component whose glass is taken.
        """
        return Consequences(
            tuple(
                replace(
                    each,
                    facade=respond(
                        [_reglazed(bay, glazing) for bay in each.facade.bays],
                        each.facade.time_s,
                        each.facade.pressure_pa,
                    ),
                )
                for each in self.responses
            )
        )


def _reglazed(bay: FilledBay, glazing: Glazing) -> FilledBay:
    if bay.glazing is None:
        return bay
    kept = {name: getattr(bay.glazing, name) for name in ("width_m", "height_m", "sill_m")}
    return replace(bay, glazing=glazing.model_copy(update=kept))


def other_glazing(scenario: Scenario) -> dict[str, Glazing]:
    """Return what the windows of a scenario may be replaced by: its own and the catalogue's."""
    known = {**catalogue(), **scenario.components}
    return {name: each for name, each in known.items() if isinstance(each, Glazing)}


def consequences(
    scenario: AnyScenario,
    layout: Sequence[Element],
    charges: Iterable[AnyCharge],
    engine: Engine,
    progress: Callable[[float], None] | None = None,
) -> Consequences:
    """Return what charges do to the buildings behind a layout; a blast a charge.

    Args:
        scenario: The scenario; some of its structures have facades.
        layout: A legal layout.
        charges: The charges, or the vehicles that bring them.
        engine: An engine that knows overpressures.
        progress: Called with the share of the blasts that is done.

    Raises:
        BlastEnvError: If no structure has a facade, or the engine knows no overpressure.
    """
    found = find_scenario(scenario)
    if not found.bays:
        raise BlastEnvError(
            f"scenario {found.name!r}: no structure has a facade with bays: add [structures.facade]"
        )
    if not engine.has_peaks:
        raise BlastEnvError(f"engine {engine.name!r} knows no overpressure: must be 'gas'")
    responses: list[BuildingResponse] = []
    every = list(charges)
    for number, charge in enumerate(every, start=1):
        result = engine.blast(found, layout, 0, charge).run()
        loads = getattr(result, "bay_loads", None)
        if loads is None:
            raise BlastEnvError(f"engine {engine.name!r} records no bays: must be 'gas'")
        where = charge_against(found, layout, charge)
        responses += by_building(found, loads.response, where)
        if progress is not None:
            progress(number / len(every))
    return Consequences(tuple(responses))


def by_building(
    scenario: Scenario, facade: FacadeResponse, charge: Charge
) -> list[BuildingResponse]:
    """Return what a blast does to each building with a facade.

    Args:
        scenario: Says which structures are parts of one building.
        facade: What became of all bays of the site.
        charge: The charge where it went off.
    """
    names = {each.name: each.building or each.name for each in scenario.structures}
    owners = [names[each.bay.structure] for each in facade.bays]
    found = []
    for building in dict.fromkeys(owners):
        own = np.flatnonzero(np.array([owner == building for owner in owners]))
        part = respond(
            [facade.bays[index] for index in own.tolist()], facade.time_s, facade.pressure_pa[own]
        )
        found.append(BuildingResponse(building, charge, part))
    return found
