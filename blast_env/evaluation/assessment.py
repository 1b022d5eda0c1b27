"""An assessment: the consequences of charges without a barrier and with a layout, and the verdict.

The answer has the verdict first, then its standing and flags, the probability of the required
level, the error of the cells, buildings with and without a facade, the barrier, and other glass.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from blast_env.evaluation.answers import (
    AnswerPart,
    AnswerTable,
    building_words,
    charge_text,
)
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.consequences import (
    Consequences,
    Neighbour,
    Verdict,
    other_glazing,
)
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.engines.pieces import pieces_answer
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.grid_error import GridError, convergence_index
from blast_env.evaluation.probability import Uncertainty, level_probability
from blast_env.evaluation.shared import consequences
from blast_env.geometry import Layout
from blast_env.response.buildings import BuildingDamage, LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.runner import ProgressCallback, share_of
from blast_env.site import AnyCharge, Scenario
from blast_env.units import PA_PER_KPA
from blast_env.values import count_of

_RESPONSE: Final = (
    *("building", "level of protection", "panes broken", "worst pane (GSA, ISO)", "worst panel"),
)
_NEIGHBOURS: Final = (
    *("layout", "building", "side-on peak (kPa)", "side-on impulse (Pa s)"),
    *(f"{damage} (%)" for damage in BuildingDamage),
)

_COARSER: Final = 10  # per cent of the work: coarser cells take little time


@dataclass(frozen=True, eq=False)
class Assessed:
    """The consequences of the charges for a site, without a barrier and with the layout.

    Attributes:
        scenario: The scenario.
        layouts: The layouts by name, no barrier first.
        found: The consequences with each of them.
        coarse: The same under the worst charge alone, on coarser cells; empty without these.
        coarser: The engine with the coarser cells.
    """

    scenario: Scenario
    layouts: Mapping[str, Layout]
    found: Mapping[str, Consequences]
    coarse: Mapping[str, Consequences]
    coarser: Engine | None

    @property
    def name(self) -> str:
        """The name of the layout that is judged: the last one."""
        return list(self.found)[-1]

    @property
    def judged(self) -> Consequences:
        """The consequences with that layout."""
        return self.found[self.name]

    @property
    def _judged_first(self) -> list[tuple[str, Consequences]]:
        return [*self.found.items()][::-1]

    @property
    def grid_error(self) -> GridError | None:
        """The error of the cells under the worst charge; `None` without coarser cells."""
        if self.coarser is None:
            return None
        number, unprotected = self.judged.worst_number, next(iter(self.found))
        threat = LoadCase(self.judged.barriers[number].charge)
        return GridError(
            case=LoadCaseSet(self.scenario, (threat,)),
            layout=self.layouts[self.name],
            threat=threat,
            coarser=self.coarser,
            fine=(self.judged.loads[number], self.found[unprotected].loads[number]),
            coarse=(self.coarse[self.name].loads[0], self.coarse[unprotected].loads[0]),
        )

    def answer(
        self,
        target: LevelOfProtection,
        mass_error: float,
        required: Sequence[Requirement] = (),
    ) -> Iterator[AnswerPart]:
        """Yield the verdict and what it rests on.

        Args:
            target: Required level of protection.
            mass_error: Uncertainty of the masses; see `Uncertainty`.
            required: Further requirements.
        """
        yield from self._verdict(target)
        for requirement in required:
            for name, judged in self._judged_first:
                kept = all(requirement.kept_by(each.facade) for each in judged.responses)
                word = Verdict.of(kept).word(judged.is_flagged).lower()
                yield f"{requirement.words}, {name}: {word}"
        error = self.grid_error
        uncertainty = Uncertainty.of(mass_error, error)
        for name, judged in self._judged_first:
            likely = level_probability(judged, uncertainty)
            yield f"probability, {name}: {likely.words(target)}"
        if error is not None:
            yield from self._cells(error)
        yield from self._buildings()
        yield from self._neighbours()
        yield from self._barriers()
        yield self._glazing(target)

    def _verdict(self, target: LevelOfProtection) -> Iterator[AnswerPart]:
        judged = self.judged
        verdict, level = judged.verdict_word(target), judged.level_words_for(target)
        charges = count_of("charge", len(judged.barriers))
        yield f"{self.scenario.name}, {self.name}: {verdict}: {level}, under {charges}"
        for building in judged.buildings:
            stood = judged.standing(building).words
            yield f"standing of the load that decides, {building}: {stood}"
        yield from (f"flag: {note}" for note in judged.notes)
        if doubt := judged.doubt(target):
            yield doubt
        yield judged.force_words

    def _cells(self, error: GridError) -> Iterator[AnswerPart]:
        """Yield the impulse under the worst charge with its error, and levels that cells change."""
        judged = self.judged
        yield error.impulse_words
        yield error.words
        for building in judged.buildings:
            fine = judged.of(building)[judged.worst_number].facade.level_of_protection
            other = self.coarse[self.name].level(building)
            if other != fine:
                yield (
                    f"note: {building} reaches level {other.label!r} with {error.coarser.words}, "
                    f"and {fine.label!r} with the finer cells, under the worst charge"
                )

    def _buildings(self) -> Iterator[AnswerPart]:
        rows = [
            (
                name,
                building_words(self.scenario, building),
                *_response(each, building, self.coarse.get(name)),
            )
            for name, each in self.found.items()
            for building in each.buildings
        ]
        title = f"{self.scenario.name}: the worst of all charges"
        yield AnswerTable.of(title, ("layout", *_RESPONSE), rows, 3)
        for name, each in list(self.found.items())[:-1]:
            yield from (f"flag, {name}: {note}" for note in each.notes)

    def _neighbours(self) -> Iterator[AnswerPart]:
        rows = []
        for name, each in self.found.items():
            coarse = self.coarse.get(name)
            for worst in each.worst_neighbours:
                shares = (f"{100.0 * worst.probability[damage]:.0f}" for damage in BuildingDamage)
                peak = _with_cells(worst, each, coarse, "peak_pa", PA_PER_KPA, 1)
                impulse = _with_cells(worst, each, coarse, "impulse_pa_s", 1.0, 0)
                words = building_words(self.scenario, worst.building)
                rows.append((name, words, peak, impulse, *shares))
        if rows:
            title = "without a facade: how likely an ordinary house there is damaged, worst charge"
            yield AnswerTable.of(title, _NEIGHBOURS, rows, 2)

    def _barriers(self) -> Iterator[AnswerPart]:
        worst = self.judged.worst_barrier
        if worst is not None:
            title = f"the barrier under {charge_text(worst.charge)}, the worst"
            yield from pieces_answer(worst.pieces, title)
        for each in self.judged.barriers:
            if each.taken_away:
                yield (
                    f"{len(each.taken_away)} pieces overturned before the blast of "
                    f"{charge_text(each.charge)} was over, and were taken away for it"
                )

    def _glazing(self, target: LevelOfProtection) -> AnswerTable:
        rows = []
        for name, glazing in other_glazing(self.scenario).items():
            other = self.judged.with_glazing(glazing)
            for building in other.buildings:
                passes = Verdict.of(other.level(building) >= target).word(other.is_flagged)
                words = building_words(self.scenario, building)
                rows.append((name, words, *_response(other, building), passes.lower()))
        headers = ("glass in all windows", *_RESPONSE, "verdict")
        return AnswerTable.of("the same loads, other glass", headers, rows, 3)


def assess(
    scenario: Scenario,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    engine: Engine,
    progress: ProgressCallback | None = None,
    *,
    without_fallen: bool = False,
    cache: Path | None = None,
) -> Assessed:
    """Run the blasts of an assessment, one per layout and charge, the worst on coarser cells too.

    Args:
        scenario: The scenario; some of its structures have facades.
        layouts: The layouts by name: no barrier, and perhaps the one to judge.
        charges: The charges.
        engine: Gas dynamics.
        progress: Called with the finished share of the work.
        without_fallen: Whether pieces that overturn are removed, and the blasts run again.
        cache: Folder of stored blasts, not used for those without fallen pieces.

    Raises:
        BlastEnvError: As for `consequences`.
    """

    def all_of(
        engine: Engine, charges: Sequence[AnyCharge], tell: ProgressCallback | None
    ) -> dict[str, Consequences]:
        found, evaluator = {}, BlastEvaluator(scenario, engine, cache=cache)
        for number, (name, layout) in enumerate(layouts.items()):
            part = share_of(tell, number, len(layouts))
            found[name] = consequences(
                evaluator, layout, charges, part, without_fallen=without_fallen
            )
        return found

    found = all_of(engine, charges, share_of(progress, 0, 100, 100 - _COARSER))
    coarser, coarse = engine.coarser, {}
    if coarser is not None:
        worst = charges[list(found.values())[-1].worst_number]
        coarse = all_of(coarser, [worst], share_of(progress, 100 - _COARSER, 100, _COARSER))
    return Assessed(scenario, layouts, found, coarse, coarser)


def _with_cells(
    worst: Neighbour,
    fine: Consequences,
    coarse: Consequences | None,
    load: str,
    unit: float,
    digits: int,
) -> str:
    """Return a load on a neighbour; its error has the share that it has under the worst charge."""
    value = float(getattr(worst, load)) / unit
    text = f"{value:,.{digits}f}"
    if coarse is None:
        return text
    own = [each for each in fine.neighbours if each.building == worst.building]
    (other,) = (each for each in coarse.neighbours if each.building == worst.building)
    of_fine = float(getattr(own[fine.worst_number], load))
    error = convergence_index(of_fine, float(getattr(other, load))) / of_fine * value
    return f"{text} +- {error:,.{digits}f}"


def _response(
    found: Consequences, building: str, coarse: Consequences | None = None
) -> tuple[str, ...]:
    """Return the response of a building; of the panes with the error of the cells."""
    whole = found.summary(building)
    broken = f"{whole.broken:.1f}"
    if coarse is not None:
        fine = found.of(building)[found.worst_number].facade.broken_panes
        other = coarse.of(building)[0].facade.broken_panes
        broken += f" +- {convergence_index(fine, other):.1f}"
    return whole.level, f"{broken} of {whole.panes}", whole.condition, whole.damage
