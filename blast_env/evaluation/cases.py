"""Cases: the threats that layouts are compared on, who is told what, and which seeds are whose."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, value_text
from blast_env.geometry import Element
from blast_env.physics.scene import Charge
from blast_env.scenario import (
    AnyCharge,
    AnyScenario,
    Placement,
    ScenarioField,
    VehicleCharge,
    find_scenario,
)
from blast_env.scenario.build_scene import charge_against, draw_threat
from blast_env.scenario.vehicles import ranked
from blast_env.statistics import MeanRisk, Risk
from blast_env.values import checked_seed, generator


@dataclass(frozen=True)
class Threat:
    """One blast that may happen, whatever stands in its way.

    Two layouts that meet the same threat meet the same charge, fan and air: the difference
    between their loads is then due to the layouts alone (common random numbers).

    The charge of a vehicle is the same one with either layout, at the place where that lets it
    come: its worst place, its second worst, and so on.

    Attributes:
        charge: The charge.
        seed: Decides the fan and the air.
    """

    charge: AnyCharge
    seed: int

    def __post_init__(self) -> None:
        """Make the values plain Python numbers, so that a threat can be a key and be written.

        Raises:
            BlastEnvError: If the seed is not an integer of at least 0, or the charge is not a
                pair of coordinates and a mass.
        """
        object.__setattr__(self, "seed", checked_seed(self.seed, "seed"))
        if isinstance(self.charge, VehicleCharge):
            return
        try:
            (x_m, y_m), tnt_kg, *height_m = self.charge
            charge = Charge((float(x_m), float(y_m)), float(tnt_kg), *map(float, height_m))
        except (TypeError, ValueError):
            raise BlastEnvError(
                f"charge is {self.charge!r}, must be ((x, y) in m, kg of TNT)"
            ) from None
        object.__setattr__(self, "charge", charge)

    def charge_against(self, scenario: AnyScenario, layout: Sequence[Element]) -> Charge:
        """Return the charge where it goes off with a layout; only a vehicle's depends on that."""
        if not isinstance(self.charge, VehicleCharge):
            return self.charge
        return charge_against(find_scenario(scenario), layout, self.charge)


def draw_threats(scenario: AnyScenario, seeds: Iterable[int]) -> tuple[Threat, ...]:
    """Return one threat a seed, its charge drawn from the scenario as `simulate` draws it.

    Where several seeds draw the same vehicle, its charge is once at its worst place, once at its
    second worst, and so on.

    Args:
        scenario: The scenario, or its bundled name or path.
        seeds: At least one, none twice; each is the seed of its blast as well.

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
            raise BlastEnvError(f"seeds[{index}] is {seed}, is there already: must be none twice")
    found = find_scenario(scenario)
    charges = ranked(draw_threat(found, seed) for seed in plain)
    return tuple(Threat(charge, seed) for charge, seed in zip(charges, plain, strict=True))


class SeedRange(Enum):
    """Which seeds belong to what: no blast that something was chosen by ever judges it.

    The ranges are disjoint. A threat's seed decides its fan and air and, where it is drawn, its
    charge.
    """

    TRAINING = range(2**31)
    """Episodes of the environments, and what people name by hand."""
    JUDGEMENT = range(2**31, 2**33)
    """What layouts and agents are judged on in the end: league, evaluation, checks of a search."""
    SEARCH = range(2**33, 2**33 + 2**31)
    """What searches spend their blasts on."""
    SELECTION = range(2**33 + 2**31, 2**34)
    """What the best weights of a training are chosen by."""

    def seeds(self, first: int, count: int) -> range:
        """Return consecutive seeds of the range.

        Args:
            first: The first one, counted from the start of the range.
            count: How many.

        Raises:
            BlastEnvError: If they are not all in the range.
        """
        if first < 0 or count < 1 or first + count > len(self.value):
            raise BlastEnvError(
                f"seeds {first} to {first + count - 1} of {self.name.lower()}: must be at least "
                f"one, from 0 to {len(self.value) - 1}"
            )
        return self.value[first : first + count]

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.int64]:
        """Draw seeds of the range, an array of the shape; one may come twice."""
        return self.value.start + rng.integers(len(self.value), size=shape)

    def draw_distinct(self, rng: np.random.Generator, count: int) -> list[int]:
        """Draw so many different seeds of the range."""
        drawn = rng.choice(len(self.value), size=count, replace=False)
        return [self.value.start + int(each) for each in drawn]


@dataclass(frozen=True, eq=False)
class Case:
    """What layouts are held against each other on: a scenario and the threats that each meets.

    All layouts meet the same charges, fans and air (common random numbers), so that what differs
    is due to the layouts.

    Attributes:
        scenario: The scenario; its bundled name or path will do.
        threats: What layouts meet, at least one. With several realisations first one of each
            charge, then another of each, and so on: threat k is of charge k modulo the number of
            charges.
        realisations: How many threats there are of each charge.
        risk: How the loads of several charges become one; as the scenario's objective says
            unless given.
        charge: The charge, where whoever proposes a layout is told it; `None` where it is hidden.
        name: For people.
        seed: Decides what a search or a random layout draws.
        practice: What a search for this case may spend its blasts on: none of `threats`.

    Raises:
        BlastEnvError: If there are no threats, they are not as many for each charge, or one of
            `practice` is among them.
    """

    scenario: ScenarioField = ScenarioField()
    threats: tuple[Threat, ...]  # type: ignore[misc]  # a scenario has no default
    realisations: int = 1
    risk: Risk | None = None
    charge: AnyCharge | None = None
    name: str = ""
    seed: int = 0
    practice: "Case | None" = None

    def __post_init__(self) -> None:
        if not self.threats:
            raise BlastEnvError("threats: there are none, must be at least one")
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
        if self.practice is not None:
            both = set(self.threats) & set(self.practice.threats)
            if both:
                raise BlastEnvError(f"a search may not meet {both.pop()}: layouts are judged on it")

    @property
    def charges(self) -> tuple[AnyCharge, ...]:
        """The charges, each as often as it was drawn."""
        count = max(len(self.threats) // self.realisations, 1)
        return tuple(threat.charge for threat in self.threats[:count])

    def charges_against(self, layout: Sequence[Element]) -> tuple[Charge, ...]:
        """Return the charges where they go off with a layout, each as often as it was drawn."""
        threats = self.threats[: len(self.charges)]
        return tuple(each.charge_against(self.scenario, layout) for each in threats)

    @property
    def is_mean(self) -> bool:
        """Whether all charges count alike."""
        return isinstance(self.risk or self.scenario.objective.risk, MeanRisk)

    def combined(self, loads: Sequence[float] | FloatArray) -> float:
        """Return the one load that counts: the mean per charge, then the risk over the charges.

        Args:
            loads: One a threat, in their order; at least one, perhaps only the first ones.
        """
        values = np.asarray(loads, dtype=np.float64)
        count = min(len(self.charges), len(values))
        means = [float(values[index :: len(self.charges)].mean()) for index in range(count)]
        risk = self.risk or self.scenario.objective.risk
        return risk(np.array(means))

    def counted(self, loads: Sequence[float] | FloatArray, layout: Sequence[Element] = ()) -> float:
        """Return what a layout is worth by the scenario's objective, which may count its cost.

        Args:
            loads: What counts under each threat, as for `combined`.
            layout: The layout.
        """
        objective, combined = self.scenario.objective, self.combined(loads)
        if objective.target is None:
            return combined
        zone = self.scenario.build_zone
        budget = None if zone is None else zone.budget
        cost = Placement(self.scenario, tuple(layout)).cost
        return objective.counted(combined, cost / budget if budget else 0.0)


def visible_case(
    scenario: AnyScenario, charge: AnyCharge, seeds: Sequence[int], risk: Risk | None = None
) -> Case:
    """Return the case of a known charge: it goes off once a seed, with another fan and air."""
    threats = tuple(Threat(charge, seed) for seed in seeds)
    return Case(scenario, threats, realisations=len(threats), risk=risk, charge=charge)


def practice_visible(
    scenario: AnyScenario,
    charge: AnyCharge,
    realisations: int,
    seed: int,
    risk: Risk | None = None,
) -> Case:
    """Return what a search for a known charge may spend its blasts on.

    Args:
        scenario: The scenario, or its bundled name or path.
        charge: The charge.
        realisations: How many fans and airs, at least one.
        seed: Decides the seeds of the blasts, and what the search draws.
        risk: As for `Case`.

    Raises:
        BlastEnvError: If there are to be none.
    """
    _at_least_one("realisations", realisations)
    drawn = SeedRange.SEARCH.draw_distinct(generator(seed), realisations)
    return replace(visible_case(scenario, charge, drawn, risk), seed=seed)


def practice_hidden(
    scenario: AnyScenario, charges: int, realisations: int, seed: int, risk: Risk | None = None
) -> Case:
    """Return what a search for a hidden charge may spend its blasts on.

    Args:
        scenario: The scenario, or its bundled name or path; the charges are drawn from where it
            lets them be.
        charges: How many charges, at least one.
        realisations: How many fans and airs for each of them, at least one.
        seed: Decides the charges, the seeds of the blasts, and what the search draws.
        risk: As for `Case`.

    Returns:
        A case whose first charge is the one in the middle of all, and each further one as far as
        possible from those before it, so that the first few stand for all. Those of vehicles come
        before them, the worst first.

    Raises:
        BlastEnvError: If there are to be none.
    """
    _at_least_one("charges", charges)
    _at_least_one("realisations", realisations)
    rng = generator(seed)
    found = find_scenario(scenario)
    drawn = _spread_first(found.sample_charges(rng, charges))
    seeds = SeedRange.SEARCH.draw_distinct(rng, realisations * charges)
    threats = [Threat(drawn[index % charges], each) for index, each in enumerate(seeds)]
    return Case(found, tuple(threats), realisations, risk, seed=seed)


def one_of_each_charge(threats: Iterable[Threat]) -> tuple[Threat, ...]:
    """Return the first threat of each charge: without noise another one is the same blast again.

    A vehicle's charges beyond its places are at the same places again.
    """
    first: dict[AnyCharge, Threat] = {}
    for threat in threats:
        charge = threat.charge
        if isinstance(charge, VehicleCharge):
            charge = replace(charge, rank=charge.rank % charge.source.places)
        first.setdefault(charge, threat)
    return tuple(first.values())


def check_distinct(threats: Sequence[Threat]) -> None:
    """Refuse a threat that is there twice: it would count as evidence twice (`BlastEnvError`)."""
    for index, threat in enumerate(threats):
        if threat in threats[:index]:
            raise BlastEnvError(
                f"threats[{index}] is {threat}, is there already: must be none twice"
            )


def _spread_first(charges: Sequence[AnyCharge]) -> list[AnyCharge]:
    """Return charges, each as far as possible from those before it, the middle one first.

    Those of vehicles come before them, by their rank.
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


def _at_least_one(name: str, count: int) -> None:
    if count < 1:
        raise BlastEnvError(f"{name} is {count}, must be at least 1")
