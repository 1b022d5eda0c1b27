"""Loads on the protected structures, for the studies of the gas engine.

Sites have real heights, or are a small yard.
"""

from typing import Any, Final

from blast_env.evaluation.engines.gas import GasBlast, GasResult
from blast_env.site import Scenario


def protected_impulse_pa_s(result: GasResult) -> float:
    """Return the weighted mean impulse on the protected buildings, Pa s."""
    loads = result.loads()
    return loads.protected_impulse_pa_s / sum(structure.weight for structure in loads.protected)


def impulse_until(blast: GasBlast, until_s: float) -> float:
    """Return the mean impulse on the protected buildings up to a time, Pa s.

    The run continues to that time even if its loads are known before.
    """
    result = blast.start()
    result.run.solver.advance(until_s)
    return protected_impulse_pa_s(result)


BUILDING_M: Final = 6.0
BARRIER_M: Final = 3.0


def with_heights(
    scenario: Scenario,
    structures_m: float = BUILDING_M,
    barrier_m: float = BARRIER_M,
    air_m: float | None = None,
) -> Scenario:
    """Return a scenario whose structures and barrier have heights.

    Args:
        scenario: The scenario.
        structures_m: Height of all structures.
        barrier_m: Height of the modules of the build zone.
        air_m: Height of the air; that of the scenario unless given.
    """
    document: dict[str, Any] = scenario.model_dump()
    document["schema_version"] = 2
    for structure in document["structures"]:
        structure["height_m"] = structures_m
    if document.get("build_zone") is not None:
        document["build_zone"]["height_m"] = barrier_m
    if air_m is not None:
        document["site"]["air_height_m"] = air_m
    return Scenario.from_document(document, scenario.name)


def yard() -> Scenario:
    """Return a site small enough for cells of 0.125 m.

    A charge of 20 kg is in the open, 8.5 m before a building of 2 x 4 x 3 m, with walls of 1.5 m
    between them.
    """
    document = {
        "schema_version": 2,
        "name": "yard",
        "site": {"width_m": 16.0, "height_m": 12.0, "air_height_m": 8.0},
        "charge": [{"kind": "point", "position_m": (2.5, 6.0), "tnt_kg": 20.0}],
        "structures": [
            {
                "kind": "ModularObstacle",
                "name": "building",
                "corner_m": (11.0, 4.0),
                "rows": 8,
                "columns": 4,
                "protected": True,
                "height_m": 3.0,
            }
        ],
        "build_zone": {
            "corner_m": (4.5, 2.0),
            "rows": 16,
            "columns": 10,
            "stock": 8,
            "height_m": 1.5,
        },
        "simulation": {"preset": "ballistic"},
    }
    return Scenario.from_document(document, "yard")
