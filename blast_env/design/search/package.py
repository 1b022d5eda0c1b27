"""The package's proposal: the best layout by the surrogate of gas dynamics, without a blast."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.calibration import kingery_bulmash
from blast_env.design.search.problem import Report, SearchResult
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem
from blast_env.geometry import Element, Layout, Removal
from blast_env.rules import layouts_by_rule
from blast_env.statistics import reductions
from blast_env.vehicles.worst_places import stand_off_m

if TYPE_CHECKING:  # half a second to import
    from blast_env.design.search.learnt import Guesses

LEAST_GAIN: Final = 0.03
"""Least predicted relative reduction of the load by a layout; otherwise nothing is proposed."""

LEAST_PIECE_GAIN: Final = 0.001
"""Least predicted relative reduction of the load by a piece; otherwise it is omitted."""


@dataclass(frozen=True)
class PackageProposer:
    """Proposes the best layout for a site by the surrogate of gas dynamics, without a blast.

    The surrogate was fitted to generated sites. Single modules are to it a catalogue of one item.
    """

    name: str = "package"

    def propose(
        self,
        problem: DesignProblem,
        budget: int = 0,
        seed: int = 0,
        report: Report | None = None,
    ) -> SearchResult:
        """Return the layout, its predicted gain, and its source in `by`.

        See `proposed`.

        Args:
            budget: Most blasts, none of which is spent.
            seed: Seed of all random draws.
        """
        # Imported here because the import takes half a second.
        from blast_env.design.search.learnt import search_by
        from blast_env.surrogate import packaged_surrogate

        found = search_by(packaged_surrogate()).propose(problem, 0, seed, report)
        result = proposed(problem, found.layout, "the surrogate of gas dynamics")
        return replace(result, method=self.name, budget=budget, seed=seed)


def proposed(problem: DesignProblem, layout: Layout, by: str) -> SearchResult:
    """Return a layout as a proposal by guesses, with its predicted gain.

    It is without useless pieces, or that of a better rule (`worth_its_pieces`), and empty if the
    predicted gain is below `LEAST_GAIN`.

    Args:
        by: What it is from, in words.
    """
    guesses, charge = _guesses(problem), problem.known_charge
    rules = layouts_by_rule(problem.scenario, charge).values()
    layout = worth_its_pieces(guesses, layout, rules)
    gain = reductions(*guesses.loads([layout, ()])).item()
    if not gain >= LEAST_GAIN:  # NaN: nothing arrives
        by = (
            f"{by}: barriers bring little here, an expected reduction of {100.0 * gain:.1f} % "
            f"at best (proposed from {100.0 * LEAST_GAIN:g} %); {_remedy(problem)}"
        )
        layout, gain = (), 0.0
    return SearchResult(layout, by=by, gain=gain)


def _remedy(problem: DesignProblem) -> str:
    """Return the stand-off that would halve the largest impulse, and the way to other help."""
    walls = problem.scenario.loaded_walls
    charges = [threat.charge_against(problem.scenario, ()) for threat in problem.threats]
    scale = {charge: float(np.cbrt(charge.tnt_kg)) for charge in charges}
    now_m = {
        charge: max(stand_off_m(walls, charge.position_m), scale[charge]) for charge in charges
    }
    worst = min(charges, key=lambda charge: now_m[charge] / scale[charge])
    further = np.linspace(1.0, 4.0, 301)
    with suppress(BlastEnvError):  # beyond the range of the curves
        impulse = kingery_bulmash("reflected_impulse", now_m[worst] * further, worst.tnt_kg)
        half_m = now_m[worst] * further[int(np.argmax(impulse <= 0.5 * impulse[0]))]
        return (
            f"half the impulse takes a stand-off of {half_m:.0f} m instead of {now_m[worst]:.0f} m "
            f"({worst.tnt_kg:g} kg, by Kingery and Bulmash); for glass see "
            "assess --screen and advise"
        )
    return "for stand-off and glass see assess --screen and advise"


def _guesses(problem: DesignProblem) -> "Guesses":
    # Imported here because the import takes half a second.
    from blast_env.design.search.learnt import Guesses, case_for
    from blast_env.surrogate import packaged_surrogate

    return Guesses.of(packaged_surrogate(), case_for(problem.scenario, problem.known_charge))


def worth_its_pieces(guesses: "Guesses", layout: Layout, rules: Iterable[Layout]) -> Layout:
    """Return a layout without useless pieces, or that of a better rule.

    A rule's layout with a better prediction replaces the layout. Each piece that reduces the load
    by less than `LEAST_PIECE_GAIN` is then removed, the least useful first, as long as the rest is
    not worse than the best rule's layout and gains `LEAST_GAIN`.
    """

    def load(layout: Layout) -> float:
        return guesses.loads([layout]).item()

    unprotected, ruled = load(()), [tuple(sorted(rule)) for rule in rules]
    best = min([layout, *ruled], key=load)
    most = min(map(load, ruled), default=unprotected)
    if load(best) <= (1.0 - LEAST_GAIN) * unprotected:
        most = min(most, (1.0 - LEAST_GAIN) * unprotected)

    def without(piece: Element) -> Layout:
        return tuple(feature for feature in best if feature != piece)

    # Removed walls stay removed, because pieces may stand in their place.
    pieces = [feature for feature in best if not isinstance(feature, Removal)]
    guesses.loads([without(piece) for piece in pieces])  # all at once
    for piece in sorted(pieces, key=lambda piece: load(without(piece))):
        fewer = without(piece)
        if load(fewer) <= min(load(best) + LEAST_PIECE_GAIN * unprotected, most):
            best = fewer
    return best
