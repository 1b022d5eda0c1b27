"""What proposes layouts without a blast: trained agents, rules."""

from typing import Protocol

from blast_env.scenario import Cell, Charge, Scenario

Layout = tuple[Cell, ...]
"""(row, column) of the modules in the order of their placing."""


class LayoutAgent(Protocol):
    """Proposes a layout for a site, at once: no blast is simulated."""

    def propose(self, scenario: Scenario, charge: Charge | None = None) -> Layout:
        """Return a layout that keeps every condition of the build zone; always the same one.

        Args:
            scenario: The scenario; it has a build zone.
            charge: Where the charge is, if that is known; otherwise the layout is for all the
                places where the scenario may have one.
        """
