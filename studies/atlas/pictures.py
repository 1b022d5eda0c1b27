"""Pictures of the atlas, one per family: what the blasts show, and the law beside them."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.atlas import Laws
from studies.atlas.families import FAMILIES
from studies.atlas.fitting import RECIPES
from studies.atlas.samples import Bays, Group, away_from, less_echoes, samples, scenes_with_loads
from studies.atlas.samples import impulses_in_the_open as in_the_open

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BLUE: Final = "#0b6e99"
_TICKS: Final = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)

SHOWN: Final[Mapping[str, tuple[str, str, str]]] = MappingProxyType(
    {
        "wall": ("height", "height of the wall", "from_facade"),
        "posts": ("solid", "share of solid", "height"),
        "opposite": ("behind", "distance of the front behind the charge", "height"),
        "street": ("width", "width of the street", "height"),
        "tee": ("width", "width of the street", "height"),
        "court": ("depth", "depth of the wings", "width"),
        "shadow": ("distance", "distance of the block", "depth"),
        "rows": ("height", "height of the houses", "length"),
        "canopy": ("depth", "depth of what projects", "level"),
        "raised": ("raised", "height of the charge", "distance"),
        "pieces": ("high", "height of the higher pieces", "from_charge"),
        "shaft": ("high", "height of the higher pieces", "from_charge"),
        "slant": ("height", "height of the wall", "away"),
        "yard": ("distance", "distance of the facade", "facade_height"),
        "open": ("facade_height", "height of the front", "distance"),
    }
)
"""Of each family, the number on the axis, its words, and the number that colours the points."""


def family_picture(family: str, groups: Sequence[Group], known: Laws) -> "Figure":
    """Return the picture of a family.

    On the left the mean factor of each blast against a number of its design, coloured by another;
    on the right the bays by gas dynamics against the law with its intervals, if there is a law.

    Args:
        family: Its name.
        groups: All groups.
        known: The laws.
    """
    from matplotlib.figure import Figure

    name = next((law for law, recipe in RECIPES.items() if family in recipe.families), None)
    scenes_of = in_the_open if family == "open" else scenes_with_loads
    own = [bays for bays in scenes_of(groups) if bays.family == family]
    figure = Figure(figsize=(9.6 if name else 5.0, 4.0), layout="constrained")
    figure.suptitle(FAMILIES[family].title, fontsize=11)
    _by_design(figure.add_subplot(1, 2 if name else 1, 1), figure, family, own)
    if name is not None:
        _by_law(figure.add_subplot(1, 2, 2), name, own, known)
    return figure


def _by_design(axes: "Axes", figure: "Figure", family: str, scenes: Sequence[Bays]) -> None:
    number, words, colour = SHOWN[family]
    chosen = [bays for bays in scenes if number in bays.numbers and colour in bays.numbers]
    means = [_mean_factor(bays) for bays in chosen]
    found = axes.scatter(
        [bays.numbers[number] for bays in chosen],
        means,
        c=[bays.numbers[colour] for bays in chosen],
        s=12,
        cmap="viridis_r",
    )
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xlabel(words if number == "solid" else f"{words}, m/kg^(1/3)")
    axes.set_ylabel("mean factor on the impulse, gas dynamics")
    bar = figure.colorbar(found, ax=axes)
    bar.set_label(f"{colour.replace('_', ' ')}, m/kg^(1/3)")


def _mean_factor(bays: Bays) -> float:
    """Return the mean factor on the impulse, of a block that of its walls out of sight."""
    change = bays.log_change[:, 0]
    if bays.family in ("shadow", "open"):
        away = away_from(bays)
        change = change[away if bays.family == "shadow" else ~away]
    return float(np.exp(change).mean())


def _by_law(axes: "Axes", name: str, scenes: Sequence[Bays], known: Laws) -> None:
    recipe = RECIPES[name]
    laws = [getattr(known, law) for law in recipe.less]
    own = samples(less_echoes(scenes, laws), recipe.numbers_of)
    found = own.with_known(getattr(known, name).factors(own.numbers))
    measured: FloatArray = np.exp(own.log_change[:, 0])
    says = found.middle[:, 0]
    low, high = min(measured.min(), says.min()), max(measured.max(), says.max())
    axes.vlines(says, found.low[:, 0], found.high[:, 0], color="0.88", linewidth=0.6)
    axes.plot(says, measured, ".", markersize=2.5, color=_BLUE)
    axes.plot([low, high], [low, high], color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("factor on the impulse of a bay, law")
    axes.set_ylabel("gas dynamics")
    ticks = [tick for tick in _TICKS if low <= tick <= high]
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)
