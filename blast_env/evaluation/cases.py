"""Cases for comparing layouts: threats, known or hidden charges, and disjoint seed ranges."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from operator import attrgetter
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, value_text
from blast_env.geometry import Element
from blast_env.layout import LayoutState
from blast_env.layout.build_site import charge_against, draw_threat
from blast_env.site import (
    AnyCharge,
    AnyScenario,
    PointSource,
    Scenario,
    VehicleCharge,
    VehicleSource,
    find_scenario,
)
from blast_env.site.blast_site import Charge
from blast_env.site.objective import MeanRisk, Risk, WorstRisk
from blast_env.site.sources import charge_from, ranked
from blast_env.values import checked_seed, generator


@dataclass(frozen=True)
class LoadCase:
    """One possible blast, independent of the layout: a threat.

    Two layouts under the same load case have the same charge, fan and air, so that the difference
    between their loads is due to the layouts alone (common random numbers).

    The charge in a vehicle is the same with either layout, but its place depends on the layout:
    the worst place that the vehicle can reach, the second worst, and so on by rank.

    Attributes:
        charge: The charge, or the vehicle that carries it.
        seed: Seed of the fan and the air.
        name: Name for display, which does not count in comparisons, as the others below.
        why: The reason for its choice.
        source: Number of its charge source, -1 for none.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    charge: AnyCharge
    seed: int = 0
    name: str = field(default="", compare=False)
    why: str = field(default="", compare=False, repr=False)
    source: int = field(default=-1, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Convert the values to plain Python numbers, so that they can be hashed and written."""
        object.__setattr__(self, "seed", checked_seed(self.seed, "seed"))
        object.__setattr__(self, "charge", charge_from(self.charge))

    def charge_against(self, scenario: AnyScenario, layout: Sequence[Element] = ()) -> Charge:
        """Return the charge at its place with a layout, which matters for vehicles only."""
        if not isinstance(self.charge, VehicleCharge):
            return self.charge
        return charge_against(find_scenario(scenario), layout, self.charge)


def draw_threats(scenario: AnyScenario, seeds: Iterable[int]) -> tuple[LoadCase, ...]:
    """Return one threat per seed, its charge drawn from the scenario as in `simulate`.

    If several seeds draw the same vehicle, the first has its charge at the worst place, the next at
    the second worst, and so on.

    Raises:
        BlastEnvError: If there are no seeds, or one is repeated, negative or no integer.
    """
    if not isinstance(seeds, Iterable):
        raise BlastEnvError(f"seeds is {value_text(seeds)}, must be integers")
    plain = [checked_seed(seed, f"seeds[{index}]") for index, seed in enumerate(seeds)]
    if not plain:
        raise BlastEnvError("seeds: there are none, must be at least one")
    for index, seed in enumerate(plain):
        if seed in plain[:index]:
            raise BlastEnvError(f"seeds[{index}] is {seed}, appears twice, must be unique")
    found = find_scenario(scenario)
    # A vehicle drawn twice stands at two different places, the worst first.
    charges = ranked(draw_threat(found, seed) for seed in plain)
    return tuple(LoadCase(charge, seed) for charge, seed in zip(charges, plain, strict=True))


def fixed_charges(scenario: AnyScenario) -> tuple[Charge, ...]:
    """Return the possible charges of a scenario whose sources are all points; otherwise none."""
    sources = find_scenario(scenario).charge
    points = [source for source in sources if isinstance(source, PointSource)]
    if len(points) < len(sources):
        return ()
    charges = (Charge(point.position_m, point.tnt_kg, point.height_m) for point in points)
    return tuple(dict.fromkeys(charges))


def in_turn(scenario: AnyScenario, threats: Sequence[LoadCase]) -> tuple[LoadCase, ...]:
    """Return threats with the fixed charges of a scenario in turn, each once before any repeats.

    Their order is drawn by the seed of the first threat. Weights of the sources do not count.
    Threats of a scenario whose charges are not all fixed are returned unchanged.
    """
    charges = fixed_charges(scenario)
    if not charges:
        return tuple(threats)
    order = generator(threats[0].seed).permutation(len(charges)).tolist()
    return tuple(
        replace(threat, charge=charges[order[index % len(order)]])
        for index, threat in enumerate(threats)
    )


def judged_threats(
    scenario: AnyScenario, seeds: Iterable[int], *, has_noise: bool
) -> tuple[LoadCase, ...]:
    """Return one threat per seed, for means over them; fixed charges come in turn.

    Without noise a charge has one realisation. Where all charges are at a few places, repeated ones
    are dropped, since they are no further evidence. Where a charge may be anywhere on a segment or
    an area, all draws count, and so do the weights of the sources.

    Raises:
        BlastEnvError: As for `draw_threats`.
    """
    drawn = in_turn(scenario, draw_threats(scenario, seeds))
    return drawn if has_noise or not has_few_places(scenario) else one_per_charge(drawn)


def has_few_places(scenario: AnyScenario) -> bool:
    """Return whether all charges are at points, or at the worst places of vehicles."""
    sources = find_scenario(scenario).charge
    return all(isinstance(source, PointSource | VehicleSource) for source in sources)


def are_all(scenario: AnyScenario, charges: Iterable[AnyCharge | None]) -> bool:
    """Return whether charges include all possible ones of a scenario, which are fixed.

    An interval over them then describes their spread, not an uncertainty about others.
    """
    fixed = fixed_charges(scenario)
    return bool(fixed) and set(fixed) <= set(charges)


class SeedRange(Enum):
    """Disjoint seed ranges for training, search, selection and judgement.

    No blast that influenced the choice of a layout or agent is used to judge it. The seed of a
    threat determines its fan and air and, where the charge is drawn, its charge.

    The seed of a `reset` is of no range. It determines the charges and the seeds of the blasts of
    an episode, which are of `TRAINING`. The charges are of another stream than a threat's, so that
    an episode and a threat with the same number have nothing in common.
    """

    TRAINING = range(2**31)
    """Blasts of episodes, and seeds given by users."""
    TEST = range(2**31, 2**33)
    """Final judgement of layouts and agents: benchmark, evaluation, checks of a search."""
    SEARCH = range(2**33, 2**33 + 2**31)
    """Blasts of searches."""
    VALIDATION = range(2**33 + 2**31, 2**34)
    """Choice of the best weights of a training."""

    def seeds(self, first: int, count: int) -> range:
        """Return consecutive seeds of the range, from an index on; refuse those beyond its ends."""
        if first < 0 or count < 1 or first + count > len(self.value):
            raise BlastEnvError(
                f"seeds {first} to {first + count - 1} of {self.name.lower()}: must be at least "
                f"one, from 0 to {len(self.value) - 1}"
            )
        return self.value[first : first + count]

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.int64]:
        """Draw an array of seeds of the range, with replacement."""
        if shape == (1, 1):  # the same number, without the time to make a shape
            return np.array([[self.value.start + int(rng.integers(len(self.value)))]])
        return self.value.start + rng.integers(len(self.value), size=shape)

    def draw_distinct(self, rng: np.random.Generator, count: int) -> list[int]:
        """Draw `count` seeds of the range, without replacement."""
        drawn = rng.choice(len(self.value), size=count, replace=False)
        return [self.value.start + int(number) for number in drawn]


_PLAIN: Final = (MeanRisk, WorstRisk)
"""Risk measures of which a single load is its own."""


@dataclass(frozen=True, eq=False)
class LoadCaseSet:
    """A scenario and its threats, for comparing layouts.

    All layouts are under the same charges, fans and air (common random numbers), so that
    differences between loads are due to the layouts.

    Attributes:
        scenario: The scenario, or its bundled name or path.
        threats: At least one. With several realisations, first one of each charge, then another
            of each, and so on: threat k has charge k modulo the number of charges.
        realisations: Number of threats of each charge.
        risk: Risk measure over the charges; that of the scenario's objective unless given.
        charge: The charge, if it is known when a layout is proposed; `None` if it is hidden.
        name: Name for display.
        seed: Seed of the random numbers of a search or a random layout.
        search_set: The set for the blasts of a search, without any of `threats`.

    Raises:
        ScenarioError: If the known charge could not be on the site.
        BlastEnvError: If there are no threats, they are not as many for each charge, or one of
            `search_set` is among them.
    """

    scenario: Scenario
    threats: tuple[LoadCase, ...]
    realisations: int = 1
    risk: Risk | None = None
    charge: AnyCharge | None = None
    name: str = ""
    seed: int = 0
    search_set: "LoadCaseSet | None" = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "scenario", find_scenario(self.scenario))
        if not self.threats:
            raise BlastEnvError("threats: there are none, must be at least one")
        if self.charge is not None:
            object.__setattr__(self, "charge", charge_from(self.charge))
            self.scenario.check_charge(self.charge)
        charges = self.charges
        for index, threat in enumerate(self.threats):
            if (
                len(self.threats) % self.realisations
                or threat.charge != charges[index % len(charges)]
            ):
                raise BlastEnvError(
                    f"threats[{index}] is {threat}, must be one of {self.realisations} "
                    f"realisations of each charge, in the order of the charges"
                )
        if self.search_set is not None:
            both = set(self.threats) & set(self.search_set.threats)
            if both:
                raise BlastEnvError(f"a search may not use {both.pop()}: layouts are judged on it")

    @cached_property
    def charges(self) -> tuple[AnyCharge, ...]:
        """The charges of one realisation; a charge that was drawn twice is included twice."""
        count = max(len(self.threats) // self.realisations, 1)
        return tuple(map(attrgetter("charge"), self.threats[:count]))

    def charges_against(self, layout: Sequence[Element]) -> tuple[Charge, ...]:
        """Return `charges` at their places with a layout."""
        threats = self.threats[: len(self.charges)]
        return tuple(threat.charge_against(self.scenario, layout) for threat in threats)

    @property
    def label(self) -> str:
        """Its name, else that of the scenario."""
        return self.name or self.scenario.name

    @property
    def is_mean(self) -> bool:
        """Whether the risk measure is the mean over the charges."""
        return isinstance(self.risk or self.scenario.objective.risk, MeanRisk)

    @property
    def takes_one_as_it_is(self) -> bool:
        """Whether a single load is the combined one and, without a target, the objective value."""
        objective = self.scenario.objective
        return objective.target is None and isinstance(self.risk or objective.risk, _PLAIN)

    def combined(self, loads: Sequence[float] | FloatArray) -> float:
        """Combine loads into one: the mean per charge, then the risk measure over the charges.

        Args:
            loads: One per threat, in their order; all, or only the first ones, at least one.
        """
        # 1. A single load is its own mean and its own worst; 2. the mean over the realisations of
        # each charge; 3. the risk measure over the charges.
        risk = self.risk or self.scenario.objective.risk
        if len(loads) == 1 and isinstance(risk, _PLAIN):
            return float(loads[0])
        values = np.asarray(loads, dtype=np.float64)
        count = len(self.threats) // self.realisations
        if len(values) > count:
            values = np.array([values[index::count].mean() for index in range(count)])
        return risk(values)

    def objective_value(
        self, loads: Sequence[float] | FloatArray, layout: Sequence[Element] = ()
    ) -> float:
        """Return the objective value of a layout, which may include its cost.

        The loads are those under each threat, in the unit of the objective, as for `combined`.
        """
        objective, combined = self.scenario.objective, self.combined(loads)
        if objective.target is None:
            return combined
        zone = self.scenario.build_zone
        budget = None if zone is None else zone.budget
        cost = LayoutState(self.scenario, tuple(layout)).cost
        return objective.objective_value(combined, cost / budget if budget else 0.0)


def search_set(
    scenario: AnyScenario,
    charge: AnyCharge | None,
    realisations: int = 1,
    seed: int = 0,
    risk: Risk | None = None,
    *,
    charges: int = 16,
) -> LoadCaseSet:
    """Return the case for the blasts of a search, with a known charge or a hidden one (`None`).

    The seed draws the seeds of the blasts and `charges` hidden charges, and seeds the search. The
    charges of vehicles come first, by rank, then the most central of the others, then each as far
    as possible from those before it, so that the first few represent all.
    """
    for name, count in (("charges", charges), ("realisations", realisations)):
        if count < 1:
            raise BlastEnvError(f"{name} is {count}, must be at least 1")
    rng, found = generator(seed), find_scenario(scenario)
    drawn = [charge] if charge is not None else _spread_first(found.sample_charges(rng, charges))
    seeds = SeedRange.SEARCH.draw_distinct(rng, realisations * len(drawn))
    threats = tuple(LoadCase(drawn[k % len(drawn)], item) for k, item in enumerate(seeds))
    return LoadCaseSet(found, threats, realisations, risk, charge, seed=seed)


def one_per_charge(threats: Iterable[LoadCase]) -> tuple[LoadCase, ...]:
    """Return the first threat of each charge, for engines without noise.

    Ranks of a vehicle beyond the number of its places repeat the same places.
    """
    # A rank beyond the last place begins again at the first.
    first: dict[AnyCharge, LoadCase] = {}
    for threat in threats:
        charge = threat.charge
        if isinstance(charge, VehicleCharge):
            charge = replace(charge, rank=charge.rank % charge.source.places)
        first.setdefault(charge, threat)
    return tuple(first.values())


def check_distinct(threats: Sequence[LoadCase]) -> None:
    """Refuse a repeated threat, which would count as evidence twice (`BlastEnvError`)."""
    for index, threat in enumerate(threats):
        if threat in threats[:index]:
            raise BlastEnvError(f"threats[{index}] is {threat}, appears twice, must be unique")


def check_something_arrives(
    cases: Sequence[LoadCaseSet], unprotected: FloatArray, without_load: Sequence[Sequence[str]]
) -> None:
    """Refuse a case whose load without a barrier is 0 under every threat, or is no number.

    Args:
        cases: The cases.
        unprotected: Load without a barrier (cases, threats).
        without_load: The protected buildings of each case without a load: no air touches the walls
            that it would be the mean of.

    Raises:
        BlastEnvError: If there is such a case.
    """
    means = np.atleast_2d(unprotected).mean(axis=1)
    for case, mean, names in zip(cases, means, without_load, strict=True):
        if not mean > 0.0:  # or not a number
            check_loaded(case, names)
            raise BlastEnvError(
                f"{case.label}: nothing arrives at the protected structures "
                f"without a barrier ({len(case.threats)} threats): there is nothing to reduce"
            )


def check_loaded(case: LoadCaseSet, without_load: Sequence[str]) -> None:
    """Refuse a case with protected buildings without a load where no barrier stands."""
    if without_load:
        raise BlastEnvError(
            f"{case.label}: no load without a barrier on {', '.join(without_load)}: no air touches"
            " the assessed walls"
        )


def _spread_first(charges: Sequence[AnyCharge]) -> list[AnyCharge]:
    """Order charges: those of vehicles by rank, then the central one, then by largest distance.

    Each of the latter is as far as possible from the nearest of those before it.
    """
    vehicles = [charge for charge in charges if isinstance(charge, VehicleCharge)]
    fixed = [charge for charge in charges if isinstance(charge, Charge)]
    return [*sorted(vehicles, key=lambda vehicle: vehicle.rank), *_spread_places(fixed)]


def _spread_places(charges: Sequence[Charge]) -> list[Charge]:
    places_m = np.array([charge.position_m for charge in charges]).reshape(-1, 2)
    apart_m = np.hypot(*(places_m[:, np.newaxis] - places_m).T)
    order: list[int] = []
    nearest_m = -apart_m.sum(axis=0)
    while len(order) < len(charges):
        order.append(int(np.argmax(nearest_m)))
        nearest_m = apart_m[order].min(axis=0)
        nearest_m[order] = -np.inf
    return [charges[index] for index in order]
