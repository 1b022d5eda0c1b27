"""A rule in a file of its own, as a user would add one."""

import numpy as np

from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import AnyCharge, AnyScenario


def fill_from_the_corner(scenario: AnyScenario, _charge: AnyCharge | None) -> Layout:
    """Place whatever may stand from the lower left corner on."""
    placement = LayoutState.empty(scenario)
    while not placement.is_full:
        first = int(np.flatnonzero(placement.legal)[0])
        placement = placement.place(placement.catalogue.element(first))
    return placement.layout
