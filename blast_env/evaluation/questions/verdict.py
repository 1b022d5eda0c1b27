"""Consequences of charges for the buildings of a site and for the barrier.

They are the damage of panes and panels and the level of protection of buildings with a facade, the
damage of an ordinary house in place of each other building, and the sliding, rocking or
overturning of barrier pieces.

Loads come from gas dynamics, with one blast per charge and layout. Other glass needs no new blast:
the loads stay, and only the response is computed again.

The probits of the Green Book need the side-on wave, which does not exist near a building, because
its walls reflect it. It is therefore derived from the load on the most loaded wall:

    peak      P_r = 2 P_s (7 P_0 + 4 P_s) / (7 P_0 + P_s), solved for P_s (normal reflection)
    impulse   half of that on the wall

In the open the first is exact. The second is within 7 % of Kingery and Bulmash's between 5 and
15 m/kg^(1/3), and too large nearer (docs/engineers/response.md). Both ignore the clearing of
reflected pressure round the edges of a small wall, and coarse cells underestimate peaks.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property
from math import nan
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.blasts import Blasts, Severity
from blast_env.evaluation.engines.bays import LOADED_BAY_COLUMNS, bay_rows
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.engines.gas_validation import BayPlaces, bay_places, bay_validations
from blast_env.evaluation.questions.reduction import CHARGE_COLUMNS, charge_values
from blast_env.evaluation.record import BlastRecord, WallLoad, WallsWithoutVerdict, on_buildings
from blast_env.evaluation.validation import Validation, ValidationStatus
from blast_env.gas.oblique_walls import STEPPED, stepped_buildings
from blast_env.geometry import Layout
from blast_env.layout.build_site import build_site
from blast_env.layout.placement import load_relevant
from blast_env.response.buildings import BuildingDamage, building_damage_probability
from blast_env.response.components import LEAST_INTERLAYER_MM, Glazing, catalogue
from blast_env.response.facade import (
    FacadeResponse,
    assumption_words,
    cells_of,
    force_words,
    peak_corrected,
    respond,
)
from blast_env.response.levels import LevelOfProtection, worst
from blast_env.response.requirements import Requirement
from blast_env.response.sdof import impulses
from blast_env.response.wall_sections import DamageLevel
from blast_env.site import Scenario
from blast_env.site.blast_site import BlastSite, Charge
from blast_env.site.facade import with_glass
from blast_env.site.structures import buildings_of
from blast_env.tables import Column, table_of

if TYPE_CHECKING:  # a third of a second to import
    import pandas as pd

_CLIPPED: Final = (
    "it complies with the peaks of the cells, which are clipped, but not with Kingery and"
    " Bulmash's sharp peaks of the same impulse: use smaller cells"
)


class Verdict(IntEnum):
    """Verdict on a layout; larger is better.

    Attributes:
        FAILS: The layout misses the target.
        PASSES_BARELY: It reaches the target, but not with peaks unclipped by the cell size, or not
            with the required probability.
        PASSES: It reaches the target either way.
    """

    FAILS = 0
    PASSES_BARELY = 1
    PASSES = 2

    @classmethod
    def of(cls, passes: bool, on_cells: bool = False) -> "Verdict":
        """Return the verdict with sharp peaks, and with those on the cells if it fails."""
        return cls.PASSES if passes else cls.PASSES_BARELY if on_cells else cls.FAILS

    def word(self, flagged: bool = False) -> str:
        """Return the word for the verdict; a pass with notes on loads or walls is flagged."""
        if self is not Verdict.PASSES:
            return "DOES NOT COMPLY"
        return "COMPLIES (flagged)" if flagged else "COMPLIES"


@dataclass(frozen=True, eq=False)
class BuildingResponse:
    """The response of one building to one charge.

    Attributes:
        charge: The charge at its place.
        on_cells: Response of its bays to the histories on the cells, which clip peaks.
        peak_factor: Factor on its peaks that corrects their clipping by cells.
        known: Whether the loads on its bays are known, by bay; empty if not recorded.
        stepped: Whether it has an oblique wall, modelled as a staircase of modules.
        site: The site with the charge and the barrier; `None` for loads without one.
        counted_peak_pa: The peak on it to compare with limits, see
            `blast_env.evaluation.engines.walls`; NaN if not recorded.
    """

    building: str
    charge: Charge
    on_cells: FacadeResponse
    peak_factor: float = 1.0
    known: Mapping[str, bool] = field(default_factory=dict)
    stepped: bool = False
    site: BlastSite | None = None
    counted_peak_pa: float = nan

    def keeps(self, requirement: Requirement) -> bool:
        """Return whether it keeps a requirement; cells keep no limit of the peak by clipping."""
        return requirement.kept_by(self.facade) and not self.counted_peak_pa > requirement.peak_pa

    @cached_property
    def places(self) -> BayPlaces:
        """The distances of its bays from the charge, and whether it sees them."""
        assert self.site is not None, "the response was made without a site"
        return bay_places(self.site, [bay.bay for bay in self.on_cells.bays])

    @cached_property
    def validations(self) -> tuple[Validation, ...]:
        """The validation status of the load on each bay."""
        assert self.site is not None, "the response was made without a site"
        bays = [bay.bay for bay in self.on_cells.bays]
        return bay_validations(self.site, bays, cells_of(self.peak_factor), self.known)

    @property
    def doubted(self) -> list[Validation]:
        """The validation statuses that are approximate or outside; none without a site."""
        statuses = self.validations if self.site is not None else ()
        return [own for own in statuses if own.status >= ValidationStatus.APPROXIMATE]

    @property
    def rows(self) -> list[dict[str, object]]:
        """One row per bay; see `LOADED_BAY_COLUMNS`."""
        return bay_rows(self.facade, self.known, self.validations)

    @property
    def deciding_bay(self) -> int:
        """The index of the bay with the worst component."""
        facade = self.facade
        # Panes and panels have damage on the same scale.
        glass, walls = facade.glazing.hazard, facade.walls.damage
        worst_glass, worst_wall = (float(own.max(initial=-1.0)) for own in (glass, walls))
        if worst_glass >= worst_wall:
            return int(facade.glazed[int(glass.argmax())])
        return int(facade.walled[int(walls.argmax())])

    @cached_property
    def facade(self) -> FacadeResponse:
        """The response for verdicts: the worse, bay by bay, of `on_cells` and sharper peaks.

        Histories with sharper peaks have the same impulse.
        """
        # Cells clip peaks and keep impulses. Which of both histories is worse depends on the period
        # of the component, so both are computed, and the worse one counts.
        found = self.on_cells
        if self.peak_factor <= 1.0:
            return found
        histories = peak_corrected(found.time_s, found.pressure_pa, self.peak_factor)
        return found.or_worse(respond(found.bays, *histories))

    @cached_property
    def severity(self) -> Severity:
        """Severity of the response; its load is the mean impulse on the bays by area, Pa s."""
        facade = self.facade
        # In this order: the level lost, then the damage of all, then the load.
        impulses_pa_s = impulses(facade.time_s, facade.pressure_pa).max(axis=1)
        areas_m2 = [bay.bay.area_m2 for bay in facade.bays]
        return Severity(
            4 - facade.level_of_protection,
            facade.total_damage,
            float(np.average(impulses_pa_s, weights=areas_m2)),
        )


_NONE: Final = "\N{EN DASH}"
_AMBIENT_PA: Final = 101_325.0


@dataclass(frozen=True)
class Neighbour:
    """A building without a facade under one charge.

    Attributes:
        charge: The charge at its place.
        wall: Its most loaded wall.
        peak_pa: Side-on peak overpressure there.
        impulse_pa_s: Side-on impulse there.
        probability: Probability of each grade of damage of an ordinary masonry house.
    """

    building: str
    charge: Charge
    wall: str
    peak_pa: float
    impulse_pa_s: float
    probability: dict[BuildingDamage, float]


@dataclass(frozen=True, eq=False)
class BarrierResponse:
    """The response of the barrier to one charge.

    Attributes:
        charge: The charge at its place.
        pieces: One row per piece; see `blast_env.evaluation.engines.pieces.PIECE_COLUMNS`.
        taken_away: Pieces that overturned during an earlier run of the blast and were removed.
    """

    charge: Charge
    pieces: "pd.DataFrame"
    taken_away: Layout = ()


class BuildingSummary(NamedTuple):
    """The response of a building with a facade: the worst of all charges.

    Attributes:
        level: Level of protection in words, with that on the cells where it is higher.
        broken: Expected number of broken panes.
        condition: Performance condition of the worst pane, GSA, and its rating, ISO 16933; a dash
            without panes.
        failed: Number of wall panels with hazardous damage or worse.
        panels: Number of its wall panels.
        damage: Damage of the worst panel; a dash without panels.
    """

    level: str
    broken: float
    panes: int
    condition: str
    failed: int
    panels: int
    damage: str


@dataclass(frozen=True, eq=False)
class Consequences:
    """The consequences of charges for the buildings of a site behind a layout.

    Attributes:
        responses: One per charge and building with a facade.
        neighbours: One per charge and building without a facade.
        barriers: One per charge.
        unchecked: A building and the reason to distrust its loads, one per charge and building
            with such a reason.
        unjudged: Walls of buildings with a facade that no verdict covers. A building of which none
            touches air has no response.
        unloaded: A building and the words on walls without a load behind pieces that fill a gap.
    """

    responses: tuple[BuildingResponse, ...]
    neighbours: tuple[Neighbour, ...] = ()
    barriers: tuple[BarrierResponse, ...] = ()
    unchecked: tuple[tuple[str, str], ...] = ()
    unjudged: tuple[WallsWithoutVerdict, ...] = ()
    unloaded: tuple[tuple[str, str], ...] = ()

    @classmethod
    def together(cls, parts: Iterable["Consequences"]) -> "Consequences":
        """Combine the consequences of several charges."""
        every = list(parts)
        return cls(
            tuple(response for part in every for response in part.responses),
            tuple(neighbour for part in every for neighbour in part.neighbours),
            tuple(barrier for part in every for barrier in part.barriers),
            tuple(own for part in every for own in part.unchecked),
            tuple(dict.fromkeys(walls for part in every for walls in part.unjudged)),
            tuple(dict.fromkeys(walls for part in every for walls in part.unloaded)),
        )

    def check_judged(self) -> None:
        """Refuse consequences without any building that can be judged.

        Raises:
            BlastEnvError: If there is none: it names those with a facade, and the reasons.
        """
        if not self.responses:
            reasons = "; ".join(self._wall_notes) or "no building has a facade"
            raise BlastEnvError(f"there is no level of protection: {reasons}")

    @property
    def worst_number(self) -> int:
        """The number of the charge with the governing response.

        Raises:
            BlastEnvError: If no building can be judged.
        """
        self.check_judged()
        worst = max(self.responses, key=lambda own: own.severity)
        return self._charges.index(worst.charge)

    @property
    def _charges(self) -> list[Charge]:
        """The charges by their numbers."""
        # A building that pieces hide under one charge, before they fall, has no response to it.
        charges = [barrier.charge for barrier in self.barriers]
        return charges or list(dict.fromkeys(response.charge for response in self.responses))

    @property
    def buildings(self) -> tuple[str, ...]:
        """The buildings with a facade, in the order of the scenario."""
        return tuple(dict.fromkeys(response.building for response in self.responses))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on a verdict: walls not covered, oblique walls, loads out of range or not known."""
        stepped = dict.fromkeys(
            response.building for response in self.responses if response.stepped
        )
        notes = [*self._wall_notes, *self._thin]
        notes += [f"{name}: {STEPPED}" for name in stepped]
        reasons: dict[str, list[str]] = {}
        for building, reason in self.unchecked:
            reasons.setdefault(building, []).append(reason)
        notes += [
            f"{building}: {len(own)} of {len(self.barriers)} charges are outside the validated "
            f"range of the engine, e.g. {own[0]}"
            for building, own in reasons.items()
        ]
        notes += self._doubted([*reasons])
        known = self._known
        if not all(known):
            notes.append(
                f"{known.count(False)} of {len(known)} bays of all charges: impulse not yet"
                " captured at the end of the run"
            )
        return tuple(notes)

    def _doubted(self, named: Collection[str]) -> list[str]:
        """Return notes on bays whose loads are approximate or outside, but of named buildings."""
        notes = []
        for building in self.buildings:
            responses = self.of(building)
            own = [status for response in responses for status in response.doubted]
            if own and building not in named and not any(part.stepped for part in responses):
                count = sum(len(response.on_cells.bays) for response in responses)
                notes.append(
                    f"{building}: the loads on {len(own)} of {count} bays of all charges are"
                    f" approximate or outside, e.g. {own[0].words}"
                )
        return notes

    @property
    def _wall_notes(self) -> list[str]:
        """Notes on walls without a verdict or without a load."""
        notes = [f"{walls.building}: {walls.words}" for walls in self.unjudged]
        return notes + [f"{building}: {words}" for building, words in self.unloaded]

    @property
    def _known(self) -> list[bool]:
        return [is_known for response in self.responses for is_known in response.known.values()]

    @property
    def _thin(self) -> list[str]:
        """Notes on interlayers that are thinner than those of arena tests."""
        found = dict.fromkeys(
            (response.building, thin_mm)
            for response in self.responses
            for thin_mm in response.on_cells.thin_interlayers
        )
        return [
            f"{building}: panes laminated with {thin_mm:g} mm: in arena tests interlayers under"
            f" {LEAST_INTERLAYER_MM:g} mm failed early"
            for building, thin_mm in found
        ]

    @property
    def force_words(self) -> str:
        """The largest forces that frames and connections have to carry, in a sentence."""
        return force_words(response.facade for response in self.responses)

    @property
    def is_flagged(self) -> bool:
        """Whether a building with a facade has a note on its loads or its walls."""
        return (
            any(building in self.buildings for building, _ in self.unchecked)
            or any(building in self.buildings for building, _ in self.unloaded)
            or bool(self.unjudged or self._thin)
            or any(response.stepped for response in self.responses)
            or not all(self._known)
            or any(response.doubted for response in self.responses)
        )

    def under(self, number: int) -> "Consequences":
        """Return the responses of the buildings to one charge, by its number."""
        charge = self._charges[number]
        return Consequences(tuple(own for own in self.responses if own.charge == charge))

    def of(self, building: str) -> tuple[BuildingResponse, ...]:
        """Return the responses of one building."""
        return tuple(response for response in self.responses if response.building == building)

    def level(self, building: str) -> LevelOfProtection:
        """Return the lowest level of protection of a building under any charge."""
        return min(own.facade.level_of_protection for own in self.of(building))

    def level_on_cells(self, building: str) -> LevelOfProtection:
        """Return the lowest level from the histories on the cells, which clip peaks."""
        return min(own.on_cells.level_of_protection for own in self.of(building))

    def validation(self, building: str) -> Validation:
        """Return the validation status of the load on the deciding bay under the worst charge."""
        worst = max(self.of(building), key=lambda own: own.severity)
        return worst.validations[worst.deciding_bay]

    def level_words(self, building: str) -> str:
        """Return the level of a building as text, with that on the cells where it is higher."""
        level, on_cells = self.level(building), self.level_on_cells(building)
        return level.label + (f" ({on_cells.label} on the cells)" if on_cells > level else "")

    def summary(self, building: str) -> BuildingSummary:
        """Return the response of a building under the worst charge, number by number."""
        found = [own.facade for own in self.of(building)]
        # Pieces that stand under one charge and fall under another hide some bays from it alone.
        panes, walled = (
            max(facade.panes for facade in found),
            max(len(facade.walled) for facade in found),
        )
        hazardous = [
            [level >= DamageLevel.HAZARDOUS for level in facade.walls.levels] for facade in found
        ]
        return BuildingSummary(
            level=self.level_words(building),
            broken=max(facade.broken_panes for facade in found),
            panes=panes,
            condition=max(facade.worst_condition for facade in found).words if panes else _NONE,
            failed=max(map(sum, hazardous)),
            panels=walled,
            damage=max(facade.worst_damage for facade in found).name.lower() if walled else _NONE,
        )

    def worst_damage(self, scenario: Scenario) -> float:
        """Return the worst damage of the protected buildings in the objective, from 0 to 5."""
        names = {
            structure.building_name for structure in scenario.structures if structure.protected
        }
        own = [response.facade for response in self.responses if response.building in names]
        if scenario.objective.measure == "glazing":
            return worst(float(other.glazing.hazard.max(initial=0.0)) for other in own)
        return worst(part.worst_number for part in own)

    def passes_on_cells(self, target: LevelOfProtection) -> bool:
        """Return whether all buildings reach a level under the clipped peaks on the cells."""
        return all(self.level_on_cells(building) >= target for building in self.buildings)

    def doubt(self, target: LevelOfProtection) -> str:
        """Explain a failure that is due to sharper peaks alone; empty if there is none."""
        return _CLIPPED if self.verdict(target) is Verdict.PASSES_BARELY else ""

    @property
    def worst_neighbours(self) -> tuple[Neighbour, ...]:
        """Each building without a facade, under the charge that would damage a house there most."""
        found: dict[str, list[Neighbour]] = {}
        for neighbour in self.neighbours:
            found.setdefault(neighbour.building, []).append(neighbour)
        major = BuildingDamage.MAJOR
        return tuple(
            max(own, key=lambda part: (part.probability[major], part.impulse_pa_s))
            for own in found.values()
        )

    @property
    def worst_barrier(self) -> BarrierResponse | None:
        """The barrier under the charge that tilts a piece most; `None` without pieces."""
        with_pieces = (barrier for barrier in self.barriers if len(barrier.pieces))
        return max(
            with_pieces,
            key=lambda own: (own.pieces["tilt"].max(), own.pieces["tilt"].sum()),
            default=None,
        )

    def passes(self, target: LevelOfProtection) -> bool:
        """Return whether all buildings reach a level under every charge."""
        return all(self.level(building) >= target for building in self.buildings)

    def verdict(self, target: LevelOfProtection) -> Verdict:
        """Return the verdict on whether all buildings reach a level."""
        return Verdict.of(self.passes(target), self.passes_on_cells(target))

    def verdict_word(self, target: LevelOfProtection) -> str:
        """Return the verdict in a word; see `Verdict.word`."""
        return self.verdict(target).word(self.is_flagged)

    def level_words_for(self, target: LevelOfProtection) -> str:
        """Return whether all buildings reach a level: `level of protection below Low`.

        If that rests on assumed properties of components, the words name these.
        """
        side = "at least" if self.passes(target) else "below"
        rests = assumption_words((response.facade for response in self.responses), target)
        return f"level of protection {side} {target.title}" + (f" ({rests})" if rests else "")

    def with_glazing(self, glazing: Glazing) -> "Consequences":
        """Return the consequences with other glass in all windows of the same sizes and sills."""
        return replace(
            self,
            responses=tuple(
                replace(
                    response,
                    on_cells=respond(
                        [
                            replace(bay, glazing=bay.glazing and with_glass(bay.glazing, glazing))
                            for bay in response.on_cells.bays
                        ],
                        response.on_cells.time_s,
                        response.on_cells.pressure_pa,
                    ),
                )
                for response in self.responses
            ),
        )


def other_glazing(scenario: Scenario) -> dict[str, Glazing]:
    """Return the possible replacement windows: those of the scenario and of the catalogue."""
    known = {**catalogue(), **scenario.components}
    return {name: own for name, own in known.items() if isinstance(own, Glazing)}


BAY_CASE_COLUMNS: Final = (
    Column("layout", "", "the layout, or that there is none"),
    *CHARGE_COLUMNS,
    *LOADED_BAY_COLUMNS,
)
"""The columns of `bay_table`."""


def bay_table(found: Mapping[str, Consequences]) -> "pd.DataFrame":
    """Return one row per layout (by its name), charge and bay; see `BAY_CASE_COLUMNS`."""
    rows = [
        {"layout": name} | charge_values(response.charge) | row
        for name, judged in found.items()
        for response in judged.responses
        for row in response.rows
    ]
    return table_of(rows, BAY_CASE_COLUMNS)


def check_facades(scenario: Scenario, engine: Engine) -> None:
    """Refuse, before any blast, a site without a facade or an engine that records no bays."""
    if not scenario.bays:
        raise BlastEnvError(
            f"scenario {scenario.name!r}: no structure has a facade with bays: add "
            "[structures.facade]"
        )
    if not engine.has_peaks:
        raise BlastEnvError(f"engine {engine.name!r} knows no overpressure: must be 'gas'")
    if not engine.is_complete:
        raise BlastEnvError(f"engine {engine.name!r} records no bays: must be 'gas'")


def consequences_of(blasts: Blasts, name: str | None = None) -> Consequences:
    """Return the consequences of blasts for the buildings and the barrier.

    They are those with the layout in question, unless another one is named. The present panes and
    walls stand in the bays, with the measures of the layout.
    """
    name = name or blasts.judged
    numbers = range(len(blasts.threats))
    return Consequences.together(
        response_to(
            blasts.scenario, blasts.layouts[name], blasts.charge(name, k), blasts.records[name][k]
        )
        for k in numbers
    )


def consequences_by_layout(blasts: Blasts) -> dict[str, Consequences]:
    """Return the consequences with each layout, by its name, no barrier first."""
    return {name: consequences_of(blasts, name) for name in blasts.layouts}


def response_to(
    scenario: Scenario, layout: Layout, charge: Charge, record: BlastRecord
) -> Consequences:
    """Return the consequences of one blast with the charge at its place; see `consequences_of`."""
    # 1. The layout as it stood in the last run: pieces that overturned are gone.
    details = record.complete
    placed = tuple(own for own in load_relevant(layout) if own not in record.taken_away)
    responses: list[BuildingResponse] = []
    # 2. The bays, whose components move under the recorded histories: no new blast.
    if record.bays:
        bays = {part.bay.name: part for part in scenario.bays_with(layout)}
        if not bays.keys() >= {*record.bays}:
            raise BlastEnvError("the bays of the record are those of another facade")
        facade = respond([bays[bay] for bay in record.bays], record.time_s, record.pressure_pa)
        site = build_site(scenario, placed, 0, charge)
        responses = by_building(scenario, facade, site, details.peak_factor, details.known)
        counted_pa = {name: load.counted_pa for name, load in details.buildings.items()}
        responses = [
            replace(own, counted_peak_pa=counted_pa.get(own.building, nan)) for own in responses
        ]
    # 3. Neighbours without a facade by probits, the barrier by its own movements.
    assert record.pieces is not None
    return Consequences(
        tuple(responses),
        tuple(neighbours_of(scenario, details.walls, charge)),
        (BarrierResponse(charge, record.pieces, record.taken_away),),
        details.unchecked,
        details.unjudged,
        tuple(
            (load.name, words)
            for load in on_buildings(record.loads.structures)
            if (words := load.unloaded_words)
        ),
    )


def by_building(
    scenario: Scenario,
    facade: FacadeResponse,
    site: BlastSite,
    peak_factor: float = 1.0,
    known: Mapping[str, bool] = MappingProxyType({}),
) -> list[BuildingResponse]:
    """Return the response of each building with a facade to a blast.

    `known` has whether the loads on bays are known, by bay; it is empty if that was not recorded.
    """
    names = scenario.building_names
    stepped = stepped_buildings(scenario.structures)
    owners = [names[bay.bay.structure] for bay in facade.bays]
    found = []
    # A building responds by itself: its parts may be several structures.
    for building in dict.fromkeys(owners):
        own = np.flatnonzero(np.array([owner == building for owner in owners]))
        part = respond(
            [facade.bays[index] for index in own.tolist()], facade.time_s, facade.pressure_pa[own]
        )
        inside = {bay.bay.name: known[bay.bay.name] for bay in part.bays if known}
        is_stepped = building in stepped
        found.append(
            BuildingResponse(building, site.charge, part, peak_factor, inside, is_stepped, site)
        )
    return found


def side_on_peak_pa(reflected_pa: FloatArray) -> FloatArray:
    """Return the side-on peaks, Pa, whose normal reflections have given peaks (n,)."""
    reflected = np.asarray(reflected_pa, dtype=np.float64)
    # Normal reflection in air by the jump conditions of Rankine and Hugoniot with gamma = 1.4: p_r
    # = 2 p_s (7 p_0 + 4 p_s) / (7 p_0 + p_s), the positive root of 8 p_s^2 + (14 p_0 - p_r) p_s - 7
    # p_0 p_r = 0.
    linear = 14.0 * _AMBIENT_PA - reflected
    root = np.sqrt(linear**2 + 224.0 * _AMBIENT_PA * reflected)
    return np.asarray((root - linear) / 16.0)


def side_on_impulse_pa_s(reflected_pa_s: FloatArray) -> FloatArray:
    """Return the side-on impulses, Pa s, whose normal reflections have given impulses (n,)."""
    # A wall doubles a weak wave. It more than doubles a strong one, so that half is too much and on
    # the safe side.
    return 0.5 * np.asarray(reflected_pa_s, dtype=np.float64)


def neighbours_of(
    scenario: Scenario, walls: Mapping[str, WallLoad], charge: Charge
) -> list[Neighbour]:
    """Return the damage of ordinary houses in place of the buildings without a facade.

    `walls` has the load on the most loaded wall of each building, by name.
    """
    found = []
    for building, parts in buildings_of(scenario.structures).items():
        if building not in walls or any(part.facade is not None for part in parts):
            continue
        load = walls[building]
        peak = side_on_peak_pa(np.array([load.peak_pa]))
        impulse = side_on_impulse_pa_s(np.array([load.impulse_pa_s]))
        probability = {
            damage: building_damage_probability(damage, peak, impulse).item()
            for damage in BuildingDamage
        }
        found.append(
            Neighbour(building, charge, load.wall, peak.item(), impulse.item(), probability)
        )
    return found
