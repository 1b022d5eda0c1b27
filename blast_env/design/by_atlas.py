"""What the atlas of shielding says of a proposed layout, without a blast.

It tells which proposals make a site worse: a row behind the charge throws the wave back on the
facade, and pieces just before a facade take little off.
"""

from typing import Final

import numpy as np

from blast_env.atlas import packaged_laws
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem
from blast_env.evaluation.questions.screening import likely_impulses
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant

_ANY: Final = "window_annealed_6"  # a facade for sites without bays; loads do not depend on it
_LEAST_GAIN: Final = 0.02  # of the impulse; less is no help

WORSE: Final = (
    "by the atlas of shielding it does not help here, and may make the site worse: blast it before"
    " you use it"
)
"""The word on a layout that takes nothing off."""


def word_on(problem: DesignProblem, layout: Layout) -> str:
    """Return `WORSE` for a layout that takes nothing off by the atlas, else nothing.

    Sites that the atlas does not cover, without heights, have no word, and neither have layouts
    that harden facades.
    """
    stands = bool(layout) and load_relevant(layout) == layout
    share = expected_share(problem, layout) if stands else None
    return "" if share is None or share < 1.0 - _LEAST_GAIN else WORSE


def expected_share(problem: DesignProblem, layout: Layout) -> float | None:
    """Return the share of the mean impulse of the facades that a layout leaves.

    It is the mean over the threats of a problem and over the bays that nothing covers; `None` for a
    site without heights, or without bays that are free.
    """
    site = problem.scenario
    try:
        site = site if site.bays else site.with_facades(_ANY, None)
        before, after = (
            likely_impulses(
                site,
                own,
                [threat.charge_against(site, own) for threat in problem.threats],
                packaged_laws(),
            )
            for own in ((), layout)
        )
    except BlastEnvError:  # it has no heights, or nothing to protect
        return None
    areas = {own.bay.name: own.bay.width_m * own.bay.height_m for own in site.bays}
    free = [name for name in before if name in after]
    if not free:
        return None
    weights = np.array([areas[name] for name in free])
    left, whole = (
        float(weights @ np.stack([own[name].mean() for name in free])) for own in (after, before)
    )
    return left / whole
