"""What comes out of the blasts of a report."""

from dataclasses import dataclass

from blast_env.geometry import Layout, Rectangle
from blast_env.reporting.loads import ReportedBuilding, TargetLoad
from blast_env.reporting.threats import NamedCharge
from blast_env.statistics import reductions


@dataclass(frozen=True)
class LoadPair:
    """Loads on a building under a threat, without and with the layout.

    Attributes:
        target: The building.
        threat: The threat.
        cell_m: Side of the cells.
        bare: Without the layout.
        walled: With it.
    """

    target: ReportedBuilding
    threat: NamedCharge
    cell_m: float
    bare: TargetLoad
    walled: TargetLoad

    @property
    def reduction(self) -> float:
        """Share of the impulse that is gone; NaN if there is none."""
        return reductions(self.walled.impulse_pa_s, self.bare.impulse_pa_s).item()


@dataclass(frozen=True)
class Outcome:
    """The weighted impulse on what is protected under one charge or layout.

    Attributes:
        name: Of the charge, or of the layout.
        words: What more there is to say of it.
        bare_pa_s: Without the layout.
        walled_pa_s: With it.
    """

    name: str
    words: str
    bare_pa_s: float
    walled_pa_s: float

    @property
    def reduction(self) -> float:
        """Share of the impulse that is gone; NaN if there is none."""
        return reductions(self.walled_pa_s, self.bare_pa_s).item()


@dataclass(frozen=True)
class ItemWorth:
    """What one module or piece of the layout is worth.

    Attributes:
        name: Its row and column, and its item if it is a piece.
        rectangle_m: The ground that it covers.
        worth: By how much of the impulse without a barrier the impulse grows where it is left
            out, mean over the threats; below 0 where the layout is better without it.
    """

    name: str
    rectangle_m: Rectangle
    worth: float


@dataclass(frozen=True)
class FrontPoint:
    """A layout of a front.

    Attributes:
        layout: Its modules or pieces.
        cost: Its cost.
        reduction: Share of the impulse that is gone, mean over the threats.
    """

    layout: Layout
    cost: float
    reduction: float
