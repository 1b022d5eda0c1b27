"""Neighbours without a facade: how likely an ordinary house would be damaged where they stand.

The probits of the Green Book want the side-on wave. A blast has it nowhere near a building: its
walls turn it round. So it is worked back from the most loaded wall:

    peak      P_r = 2 P_s (7 P_0 + 4 P_s) / (7 P_0 + P_s), solved for P_s (normal reflection)
    impulse   half of that on the wall

In the open the first is exact, and the second within 7 % of Kingery and Bulmash's between 5 and
15 m/kg^(1/3), and too large nearer (docs/engineers/response.md). What clears round the edges of a
small wall is missing from both, and peaks of coarse cells are low.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.physics.scene import WALLS, Charge
from blast_env.response.buildings import BuildingDamage, building_damage_probability
from blast_env.scenario import Scenario

if TYPE_CHECKING:
    from blast_env.engines.gas import GasResult

_AMBIENT_PA: Final = 101_325.0


@dataclass(frozen=True)
class Neighbour:
    """A building without a facade under one charge.

    Attributes:
        building: Its name; structures that are parts of one building are one.
        charge: The charge where it went off.
        wall: Its most loaded wall.
        peak_pa: Side-on peak overpressure there.
        impulse_pa_s: Side-on impulse there.
        probability: How likely an ordinary masonry house would be damaged so badly.
    """

    building: str
    charge: Charge
    wall: str
    peak_pa: float
    impulse_pa_s: float
    probability: dict[BuildingDamage, float]


def side_on_peak_pa(reflected_pa: FloatArray) -> FloatArray:
    """Return the side-on peak overpressures that reflect to others on a rigid wall (n,)."""
    reflected = np.asarray(reflected_pa, dtype=np.float64)
    linear = 14.0 * _AMBIENT_PA - reflected
    root = np.sqrt(linear**2 + 224.0 * _AMBIENT_PA * reflected)
    return np.asarray((root - linear) / 16.0)


def side_on_impulse_pa_s(reflected_pa_s: FloatArray) -> FloatArray:
    """Return the side-on impulses that reflect to others on a rigid wall (n,)."""
    return 0.5 * np.asarray(reflected_pa_s, dtype=np.float64)


def neighbours_of(scenario: Scenario, result: "GasResult", charge: Charge) -> list[Neighbour]:
    """Return what a blast would do to ordinary houses where buildings without a facade stand.

    Args:
        scenario: Says which structures are parts of one building, and which have a facade.
        result: The blast.
        charge: The charge where it went off.
    """
    parts: dict[str, list[str]] = {}
    faced = {each.building or each.name for each in scenario.structures if each.facade is not None}
    for each in scenario.structures:
        building = each.building or each.name
        if building not in faced:
            parts.setdefault(building, []).append(each.name)
    faces = result.faces
    walls = faces[faces["face"].isin(WALLS)]
    found = []
    for building, names in parts.items():
        own = walls[walls["structure"].isin(names)]
        if not len(own):
            continue
        means = own.groupby("face", observed=True)[["positive_impulse_pa_s", "peak_pa"]].mean()
        wall = str(means["positive_impulse_pa_s"].idxmax())
        peak = side_on_peak_pa(means["peak_pa"][[wall]].to_numpy())
        impulse = side_on_impulse_pa_s(means["positive_impulse_pa_s"][[wall]].to_numpy())
        probability = {
            damage: building_damage_probability(damage, peak, impulse).item()
            for damage in BuildingDamage
        }
        found.append(Neighbour(building, charge, wall, peak.item(), impulse.item(), probability))
    return found
