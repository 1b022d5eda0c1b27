"""Pictures of the atlas: the laws against the blasts that they were left out of or fitted to."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from blast_env.atlas import Law, Laws
from studies.atlas.families import FAMILIES
from studies.atlas.fitting import RECIPES
from studies.atlas.samples import Bays, samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def family_picture(scenes: Sequence[Bays], known: Laws) -> "Figure":
    """Return one panel per family with a law: factors on impulse by gas and by the law."""
    from matplotlib.figure import Figure

    shown = [(name, family) for name, recipe in RECIPES.items() for family in recipe.families]
    figure = Figure(figsize=(13.0, 8.8), layout="constrained")
    for place, (name, family) in enumerate(shown):
        law: Law = getattr(known, name)
        own = samples((bays for bays in scenes if bays.family == family), RECIPES[name].numbers_of)
        found = law.factors(own.numbers)
        axes = figure.add_subplot(3, 3, place + 1)
        measured = np.exp(own.log_change[:, 0])
        law_says = found.middle[:, 0]
        low, high = min(measured.min(), law_says.min()), max(measured.max(), law_says.max())
        axes.vlines(law_says, found.low[:, 0], found.high[:, 0], color="0.88", linewidth=0.6)
        axes.plot(law_says, measured, ".", markersize=2.5, color="#0b6e99")
        axes.plot([low, high], [low, high], color="black", linewidth=0.8)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(FAMILIES[family].title, fontsize=10)
        axes.set_xlabel("factor on the impulse, law")
        axes.set_ylabel("gas dynamics")
        ticks = [tick for tick in (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
                 if low <= tick <= high]  # fmt: skip
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.set_ticks([], minor=True)
    return figure
