"""A layout on its site, as files for other programs show it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from blast_env.geometry import Layout
from blast_env.physics.scene import Charge
from blast_env.physics.structure import ModularPart
from blast_env.plan import Feature, site_features
from blast_env.scenario import ScenarioField, check_layout
from blast_env.scenario.build_scene import barrier_outline


@dataclass(frozen=True, eq=False)
class LayoutPlan:
    """A layout on its site.

    Attributes:
        scenario: The scenario; its bundled name or path will do.
        layout: (row, column) of each module, or the pieces; their order is kept.
        charge: The charge that the layout was made for; `None` where it is for all the places
            where the scenario may have one, or nobody knows.
        provenance: How the layout was made: anything that JSON can hold.

    Raises:
        LayoutError: If the layout does not fit the scenario.
    """

    scenario: ScenarioField = ScenarioField()
    layout: Layout  # type: ignore[misc]  # a scenario has no default
    charge: Charge | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the layout."""
        object.__setattr__(self, "layout", check_layout(self.scenario, self.layout))

    @property
    def modules(self) -> tuple[ModularPart, ...]:
        """The modules, in the order of the layout, with the names that the blast's tables have."""
        zone = self.scenario.build_zone
        if zone is None:
            return ()
        return tuple(barrier_outline(zone, self.layout).build().parts)

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """Everything on the site, in metres; what lies on top comes last."""
        return site_features(self.scenario, self.layout, self.charge)
