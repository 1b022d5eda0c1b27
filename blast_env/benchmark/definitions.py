"""The benchmark problems by name and version."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

from blast_env.bundled import ITEM_SITES
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import LoadCase, LoadCaseSet, SeedRange, draw_threats
from blast_env.evaluation.cases import has_few_places, one_per_charge, search_set
from blast_env.layout.build_site import draw_threat
from blast_env.site import AnyCharge, PointSource, Scenario, VehicleCharge, load_scenario
from blast_env.sites import SITE_KINDS
from blast_env.values import whole_number

Family = Literal["known", "hidden", "vehicle", "unseen", "response"]

BUDGETS: Final = (0, 50, 200, 1000)
"""Gas blasts that a method may spend on a problem."""

SEEDS: Final = 10
"""Runs of a stochastic method, seeds 0 to 9."""

_PRACTICE_CHARGES: Final = 4
"""Places of a hidden charge in `evaluate`, unless the site has fewer."""

_JUDGED_CHARGES: Final = 4
"""Further places of a hidden charge, for the judge."""

_JUDGED_UNSEEN: Final = 2
"""The same per unseen site: additional sites carry more information than additional places."""

_DRAWS: Final = 16
"""Draws that find every place where the site has only a few."""

_GENERATED: Final = MappingProxyType({"site": SITE_KINDS[ITEM_SITES], **SITE_KINDS})
"""What makes a generated site from its seed, by the first part of its name; the seed follows."""

MOST_PLACES: Final = 1000
"""Most known charges of one site."""

_SECRET_BITS: Final = 62

_STRIDE: Final = 4000
"""Between the judge's seeds of two places that are drawn from one source."""


@dataclass(frozen=True)
class Definition:
    """Definition of a problem. It never changes; a changed problem is a new version.

    Attributes:
        site: Bundled name, path, or KIND_SEED for a generated site, such as `sites_3`;
            `site_SEED` is one with heights and a catalogue.
        family: Knowledge of the charge.
        place: Number of the charge in the family `known`, from 1: one of each of the site's sources
            in turn, then another of each.
        version: Version; 1 had the sum of positive phases as load.
    """

    site: str
    family: Family
    place: int = 1
    version: int = 2

    @property
    def name(self) -> str:
        """Name, such as `control_room-known-v2`; with another place, `control_room-known_2-v2`."""
        place = "" if self.place == 1 else f"_{self.place}"
        return f"{Path(self.site).stem}-{self.family}{place}-v{self.version}"

    @cached_property
    def scenario(self) -> Scenario:
        """The site."""
        family, _, seed = self.site.rpartition("_")
        if family in _GENERATED and seed.isdecimal():
            return _GENERATED[family](int(seed))
        return load_scenario(self.site)

    @cached_property
    def case(self) -> LoadCaseSet:
        """The case of the judge; its `search_set` is the case of `evaluate`.

        Both have the same charge in the family `known`. Otherwise each draws a few charges, at
        different places unless the site has only a few places.
        """
        case = self._known() if self.family == "known" else self._hidden()
        return replace(case, name=self.name)

    @cached_property
    def digest(self) -> str:
        """Digest of site, charges and budgets, 16 hexadecimal digits."""
        search_set = self.case.search_set
        assert search_set is not None
        says = {
            "name": self.name,
            "scenario": self.scenario.content_hash,
            "budgets": BUDGETS,
            "judged": [_charge(threat) for threat in self.case.threats],
            "search_set": [_charge(threat) for threat in search_set.threats],
        }
        return sha256(json.dumps(says, sort_keys=True).encode()).hexdigest()[:16]

    def _known(self) -> LoadCaseSet:
        scenario, threat = self.scenario, _known_threat(self.scenario, self.place)
        return LoadCaseSet(
            scenario,
            (threat,),
            charge=threat.charge,
            search_set=search_set(scenario, threat.charge),
        )

    def _hidden(self) -> LoadCaseSet:
        scenario = self.scenario
        few = all(isinstance(source, PointSource) for source in scenario.charge) or bool(
            scenario.vehicles
        )
        own = _JUDGED_UNSEEN if self.family == "unseen" else _JUDGED_CHARGES
        judged, met = (_DRAWS, _DRAWS) if few else (own, _PRACTICE_CHARGES)
        threats = draw_threats(scenario, SeedRange.TEST.seeds(0, judged))
        drawn = search_set(scenario, None, charges=met)
        drawn = replace(drawn, threats=one_per_charge(drawn.threats))
        return LoadCaseSet(scenario, one_per_charge(threats), search_set=drawn)


def _known_threat(scenario: Scenario, place: int) -> LoadCase:
    """Return the threat with the known charge of a number, as `Definition.place` has it."""
    drawn, number = divmod(place - 1, len(scenario.charge))
    seed = SeedRange.TEST.seeds(drawn * _STRIDE, 1)[0]
    alone = scenario.model_copy(update={"charge": (scenario.charge[number],)})
    return LoadCase(draw_threat(alone, seed), seed)


def _known_places(scenario: Scenario, most: int) -> Iterator[int]:
    """Yield the numbers of at most `most` known charges, each charge once.

    A point, and a vehicle, has the same charge in every draw: again it is no further evidence.
    """
    rounds = 1 if has_few_places(scenario) else most
    met: dict[AnyCharge, int] = {}
    for place in range(1, rounds * len(scenario.charge) + 1):
        if (
            len(met) < most
            and met.setdefault(_known_threat(scenario, place).charge, place) == place
        ):
            yield place


def _charge(threat: LoadCase) -> object:
    charge = threat.charge
    if isinstance(charge, VehicleCharge):
        return charge.source.model_dump(mode="json", exclude={"threat"}), charge.rank
    return charge._asdict()


_PROBLEMS: Final = (
    Definition("control_room", "known"),
    Definition("school_and_clinic", "known"),
    Definition("school_and_clinic", "known", 3),
    Definition("hotel_forecourt", "known"),
    Definition("item_sites_6302", "known"),
    *(Definition(f"kerb_sites_{seed}", "known") for seed in (6304, 6305, 6309)),
    Definition("hotel_forecourt", "vehicle"),
    Definition("site_6103", "unseen"),
    Definition("guard_post", "response"),
)

DEFINITIONS: Final[Mapping[str, Definition]] = MappingProxyType(
    {problem.name: problem for problem in _PROBLEMS}
)
"""The problems by name. In each the best known layout takes off at least 5 points more of the load
than the best rule, by the judge's cells."""


def find_definition(name: str) -> Definition:
    """Return a problem's definition."""
    if name not in DEFINITIONS:
        raise UnknownNameError("problem", name, DEFINITIONS)
    return DEFINITIONS[name]


def site_problems(
    scenario: str | Path, most: int = 16, *, is_hidden: bool = False
) -> tuple[Definition, ...]:
    """Return problems on a site of any scenario file, or on generated sites.

    Args:
        scenario: Bundled name or path, or a kind of generated sites (`SITE_KINDS`), for a
            problem on each of the first sites held out from training.
        most: Largest number of charges, each a problem, or of sites. A fixed charge counts once,
            and so does a vehicle, which goes to its worst place.
        is_hidden: Whether one problem has all charges of a site instead.

    Raises:
        BlastEnvError: If the file is invalid, it has no build zone, or `most` is out of bounds.
    """
    site = str(scenario)
    count = whole_number("cases", most, 1, MOST_PLACES)
    if site in SITE_KINDS:
        kind: Family = "unseen" if is_hidden else "known"
        return tuple(Definition(f"{site}_{seed}", kind) for seed in range(count))
    found = Definition(site, "vehicle" if is_hidden else "known")
    found.scenario.zone  # noqa: B018  # refuses a scenario without one
    if is_hidden:
        return (found if found.scenario.vehicles else Definition(site, "hidden"),)
    places = _known_places(found.scenario, count)
    return tuple(Definition(site, "known", place) for place in places)


@cache
def secret_sites(secret: str, count: int) -> tuple[Definition, ...]:
    """Return problems on generated sites that cannot be drawn without the secret.

    Args:
        secret: A text that the judge keeps; the same text gives the same sites.
        count: Number of sites, at least 1.

    Raises:
        BlastEnvError: If the secret is shorter than 8 characters, or the count is below 1.
    """
    if len(secret) < 8:
        raise BlastEnvError(f"secret has {len(secret)} characters, must have at least 8")
    if count < 1:
        raise BlastEnvError(f"sites is {count}, must be at least 1")
    seeds = []
    for index in range(count):
        drawn = sha256(f"{secret}/{index}".encode()).digest()
        # Beyond the seeds of training and of the public problems.
        seeds.append(2**_SECRET_BITS + int.from_bytes(drawn, "big") % 2**_SECRET_BITS)
    return tuple(Definition(f"site_{seed}", "unseen") for seed in seeds)
