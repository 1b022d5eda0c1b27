"""Charges under a roof within walls, whose gas pressure the source does not have.

In a room the products burn with its air, and the pressure that remains until it leaks is that of
all the heat of combustion. The source has the part that counts in the open, within milliseconds.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.gas.grid import GasGrid
from blast_env.gas.source import Explosive
from blast_env.gas.state import GAMMA

COMBUSTION_J_KG: Final = 14.5e6
"""Heat of combustion of TNT: C7H5N3O6 (0.227 kg/mol, -63 kJ/mol) to 7 CO2 (-393.5 kJ/mol) and
5/2 H2O (-241.8 kJ/mol): 3,296 kJ/mol."""

_WALLED: Final = 0.5
"""Least share of the sides of a covered space that are walls, from which it is a room: an
assumption, which leaves out canopies on posts and along one wall."""


@dataclass(frozen=True)
class Room:
    """The covered space around a charge.

    Attributes:
        volume_m3: Volume of the air.
        walled: Share of its sides that are walls.
    """

    volume_m3: float
    walled: float

    def note(self, charge_kg: float, explosive: Explosive) -> str:
        """Return the reason to distrust loads of a charge in it."""
        per_m3 = charge_kg / self.volume_m3
        source_j_kg = explosive.prompt_j_kg + explosive.later_j_kg
        burnt, known = (
            1e-3 * (GAMMA - 1.0) * per_m3 * heat for heat in (COMBUSTION_J_KG, source_j_kg)
        )
        return (
            f"the charge is under a roof within walls, {per_m3:.2g} kg/m3 of {self.volume_m3:.0f}"
            f" m3: closed, all heat of combustion gives {burnt:.0f} kPa, the source {known:.0f} kPa"
        )


def room_around(grid: GasGrid, place_m: tuple[float, float, float]) -> Room | None:
    """Return the room around a place; `None` without a roof above it, or with too few walls.

    1. A cell of air is covered if there is a solid above it.
    2. The space is that of the covered cells which hang together with the one of the place.
    3. Its sides are walls where solids are beside it, open where other air or the border is.
    """
    index = grid.cell_at(place_m)
    if not grid.solid[index[0], index[1], index[2] :].any():
        return None
    from scipy.ndimage import label  # takes a while to import

    # 1. Covered cells, from the top down.
    above = np.logical_or.accumulate(grid.solid[:, :, ::-1], axis=2)[:, :, ::-1]
    # 2. Those that hang together with the place.
    labels, _ = label(above & ~grid.solid)
    space = labels == labels[index]
    if not space[index]:
        return None
    # 3. The sides of the space, neighbour by neighbour.
    walls = sides = 0
    for axis in (0, 1):
        for step in (1, -1):
            beside = np.roll(np.pad(space, 1), step, axis=axis)[1:-1, 1:-1, 1:-1] & ~space
            walls += int((beside & grid.solid).sum())
            sides += int(beside.sum())
        # cells of the space at the border of the grid are open there
        ends = np.take(space, [0, -1], axis=axis)
        sides += int(ends.sum())
    walled = walls / sides if sides else 1.0
    if walled < _WALLED:
        return None
    return Room(float(space.sum()) * grid.cell_m**3, walled)
