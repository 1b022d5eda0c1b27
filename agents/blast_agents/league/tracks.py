"""Tracks of a league: cases with their held-out threats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal

from blast_env.bundled import REAL_SIZE
from blast_env.envs.arguments import check_names
from blast_env.envs.episode import HIDDEN_THREATS, VISIBLE_REALISATIONS
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case, SeedRange, Threat, draw_threats
from blast_env.evaluation.cases import (
    are_all,
    fixed_charges,
    in_turn,
    one_of_each_charge,
    practice_hidden,
    practice_visible,
    visible_case,
)
from blast_env.layout.build_scene import draw_threat
from blast_env.site import (
    AnyScenario,
    Scenario,
    bundled_scenarios,
    find_scenario,
    load_scenario,
)
from blast_env.sites import FAMILIES, ITEM_SITES, LARGE_SITES, SITES, SiteSource
from blast_env.values import whole_number

TRACKS: Final = ("known", "hidden", "vehicle", *FAMILIES)
"""The tracks by name; those of generated sites have the names of the families."""

KNOWN_SCENARIOS: Final = ("courtyard", "perimeter_gate")
HIDDEN_SCENARIOS: Final = ("courtyard",)

_SITES_TITLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        SITES: "Hidden threat on unseen generated sites",
        ITEM_SITES: "Hidden threat on unseen generated sites with heights and a catalogue",
        LARGE_SITES: "Hidden threat on unseen generated sites of real size",
    }
)

MOST_CASES: Final = 1000
MOST_SEEDS: Final = 1000
MOST_LEAGUE_SEED: Final = 1000
HIDDEN_SEEDS: Final = 4
"""Factor on the held-out threats of the single case of a hidden threat on a known site."""


@dataclass(frozen=True, eq=False)
class Track:
    """Cases of one kind, all with the same number of held-out threats.

    Layouts are judged on the threats of a case (`SeedRange.JUDGEMENT`); a search spends its blasts
    on those of its `practice` (`SeedRange.SEARCH`).

    Attributes:
        name: Name of the track and its files.
        title: Title for readers.
        threat: `"visible"` or `"hidden"`, as in training.
        site: Content hash of the scenario, or the family of generated sites.
        cases: At least one case.
        reference_budget: Blasts per case of genetic search as the reference of agents.
    """

    name: str
    title: str
    threat: Literal["visible", "hidden"]
    site: str
    cases: tuple[Case, ...]
    reference_budget: int

    @property
    def has_all_charges(self) -> bool:
        """Whether the cases have all possible charges of a scenario, which are fixed."""
        return are_all(self.cases[0].scenario, [case.charge for case in self.cases])


def known_track(
    scenario: AnyScenario, cases: int, seeds: int, seed: int = 0, *, noisy: bool = True
) -> Track:
    """Return the track of a known threat at other positions than those of any training.

    If the scenario has fixed charges, the cases have these in turn, each once before any repeats.
    A search uses `VISIBLE_REALISATIONS` fans and airs of the case's charge; without noise it uses
    the same blast as the judgement.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        cases: Number of charges to draw, at most 1,000.
        seeds: Held-out fans and airs per charge, at most 1,000.
        seed: Seed of all draws, at most 1,000.
        noisy: Whether the engine draws fans and airs; if not, there is one held-out blast per case,
            regardless of `seeds`, and repeated charges are dropped: there may be fewer cases.

    Raises:
        BlastEnvError: If a number is out of bounds, or there is no build zone.
    """
    scenario = find_scenario(scenario)
    scenario.zone  # noqa: B018  # refuses a scenario without one
    drawn: list[Case] = []
    realisations = VISIBLE_REALISATIONS if noisy else 1
    firsts = _first_seeds(cases, seeds, seed)
    threats = in_turn(scenario, [Threat(draw_threat(scenario, each), each) for each in firsts])
    for index, (charge, first) in enumerate((each.charge, each.seed) for each in threats):
        search_seed = seed * MOST_CASES + index
        if not noisy and any(charge == case.charge for case in drawn):
            continue
        judged = visible_case(scenario, charge, range(first, first + (seeds if noisy else 1)))
        drawn.append(
            replace(
                judged,
                name=f"{scenario.name} {index}",
                seed=search_seed,
                practice=practice_visible(scenario, charge, realisations, search_seed),
            )
        )
    fixed = fixed_charges(scenario)
    of_fixed = f"one of {len(fixed)} fixed places" if len(fixed) > 1 else "the only place"
    where = of_fixed if fixed else "an unseen position"
    return Track(
        name=f"known_{scenario.name}",
        title=f"Known threat at {where}: {scenario.name}",
        threat="visible",
        site=scenario.content_hash,
        cases=tuple(drawn),
        reference_budget=200,
    )


def hidden_track(scenario: AnyScenario, seeds: int, seed: int = 0, *, noisy: bool = True) -> Track:
    """Return the track of a hidden threat on a known site: one case.

    A search uses `HIDDEN_THREATS` charges, with one fan and air each.

    Args:
        scenario: As for `known_track`.
        seeds: The case has `HIDDEN_SEEDS` times as many held-out threats.
        seed: As for `known_track`.
        noisy: As for `known_track`; if not, repeated charges, which are common for vehicles, are
            dropped as identical blasts.

    Raises:
        BlastEnvError: As for `known_track`.
    """
    scenario = find_scenario(scenario)
    scenario.zone  # noqa: B018  # refuses a scenario without one
    (first,) = _first_seeds(1, seeds, seed)
    case = _hidden_case(scenario.name, scenario, first, HIDDEN_SEEDS * seeds, seed * MOST_CASES)
    if not noisy:
        practice = practice_of(case)
        practice = replace(practice, threats=one_of_each_charge(practice.threats))
        case = replace(case, threats=one_of_each_charge(case.threats), practice=practice)
    return Track(
        name=f"hidden_{scenario.name}",
        title=f"Hidden threat on a known site: {scenario.name}",
        threat="hidden",
        site=scenario.content_hash,
        cases=(case,),
        reference_budget=200,
    )


def vehicle_track(scenario: AnyScenario, seeds: int, seed: int = 0, *, noisy: bool = True) -> Track:
    """Return the track of a vehicle on a known site: one case, a hidden threat.

    Args:
        scenario: As for `known_track`; it has a vehicle.
        seeds: As for `hidden_track`.
        seed: As for `known_track`.
        noisy: As for `hidden_track`.

    Raises:
        BlastEnvError: As for `known_track`, or if there is no vehicle.
    """
    scenario = find_scenario(scenario)
    if not scenario.vehicles:
        raise BlastEnvError(
            f"{scenario.name} has no vehicle (a source of kind 'vehicle'), which the track "
            "'vehicle' is about"
        )
    return replace(
        hidden_track(scenario, seeds, seed, noisy=noisy),
        name=f"vehicle_{scenario.name}",
        title=f"A vehicle on a known site: {scenario.name}",
    )


def sites_track(sites: Sequence[Scenario], seeds: int, seed: int = 0, family: str = SITES) -> Track:
    """Return the track of a hidden threat on generated sites, each of them a case.

    Args:
        sites: Sites used by no training, at most 1,000.
        seeds: Held-out threats per site, at most 1,000.
        seed: As for `known_track`.
        family: Family of the sites, one of `FAMILIES`.

    Raises:
        BlastEnvError: As for `known_track`.
    """
    firsts = _first_seeds(len(sites), seeds, seed)
    return Track(
        name=family,
        title=_SITES_TITLES[family],
        threat="hidden",
        site=family,
        cases=tuple(
            _hidden_case(site.name, site, first, seeds, seed * MOST_CASES + index)
            for index, (site, first) in enumerate(zip(sites, firsts, strict=True))
        ),
        reference_budget=50,
    )


def practice_of(case: Case) -> Case:
    """Return the practice case on which a search spends its blasts.

    Raises:
        BlastEnvError: If the case has none.
    """
    if case.practice is None:
        raise BlastEnvError(f"case {case.name!r} has no threats for a search")
    return case.practice


def find_tracks(
    name: str,
    cases: int,
    seeds: int,
    seed: int = 0,
    scenarios: Sequence[str] = (),
    *,
    noisy: bool = True,
) -> tuple[Track, ...]:
    """Return the tracks of a name.

    Args:
        name: One of `TRACKS`, or `"all"`.
        cases: Cases per track; a hidden threat on a known site has one.
        seeds: Held-out seeds per case.
        seed: Seed of all draws.
        scenarios: Bundled names or files for the tracks with a known site; by default
            `KNOWN_SCENARIOS`, `HIDDEN_SCENARIOS` and the bundled ones with a vehicle. With
            `"all"`, the track `"vehicle"` uses only those with a vehicle.
        noisy: As for `known_track` and `hidden_track`. For engines with noise, those of particles,
            the default omits scenarios with a vehicle and no calibration; `"all"` also omits
            sites with heights.

    Raises:
        UnknownNameError: If the track is unknown; the message names the nearest one.
        BlastEnvError: If a number is out of bounds, a scenario is repeated or unsuitable, or a
            scenario is given for a track of generated sites.
    """
    check_names("track", [name], [*TRACKS, "all"])
    if name in FAMILIES and scenarios:
        raise BlastEnvError(f"scenario is {scenarios[0]!r}: the track {name!r} generates its own")
    tracks: list[Track] = []
    if name in ("known", "all"):
        known = [load_scenario(each) for each in scenarios or KNOWN_SCENARIOS]
        tracks += [known_track(scenario, cases, seeds, seed, noisy=noisy) for scenario in known]
    if name in ("hidden", "all"):
        known = [load_scenario(each) for each in scenarios or HIDDEN_SCENARIOS]
        tracks += [hidden_track(scenario, seeds, seed, noisy=noisy) for scenario in known]
    if name in ("vehicle", "all"):
        every = (each for each in bundled_scenarios() if each not in REAL_SIZE)
        known = [load_scenario(each) for each in scenarios or every]
        if not scenarios or name == "all":
            known = [scenario for scenario in known if scenario.vehicles]
        if not scenarios and noisy:
            known = [scenario for scenario in known if scenario.calibration is not None]
        if name == "vehicle" and not known:
            raise BlastEnvError(
                "scenario is missing: the bundled ones with a vehicle name no calibration for "
                "particles; gas dynamics needs none (--engine gas)"
            )
        tracks += [vehicle_track(scenario, seeds, seed, noisy=noisy) for scenario in known]
    families = [name] if name in FAMILIES else [SITES, ITEM_SITES] if name == "all" else []
    if name == "all" and noisy:
        families.remove(ITEM_SITES)
    for family in families:
        count = whole_number("cases", cases, 1, MOST_CASES)
        sites = tuple(SiteSource.held_out(count, FAMILIES[family]))
        tracks.append(sites_track(sites, seeds, seed, family))
    names = [track.name for track in tracks]
    for each in names:
        if names.count(each) > 1:
            raise BlastEnvError(f"track {each!r} appears twice: scenarios need different names")
    return tuple(tracks)


def _hidden_case(name: str, scenario: Scenario, first: int, seeds: int, search_seed: int) -> Case:
    return Case(
        scenario=scenario,
        threats=draw_threats(scenario, range(first, first + seeds)),
        name=name,
        seed=search_seed,
        practice=practice_hidden(scenario, HIDDEN_THREATS, 1, search_seed),
    )


def _first_seeds(cases: int, seeds: int, seed: int) -> list[int]:
    """Return the first held-out seed of each case; the others are consecutive."""
    whole_number("cases", cases, 1, MOST_CASES)
    whole_number("seeds", seeds, 1, MOST_SEEDS)
    whole_number("seed", seed, 0, MOST_LEAGUE_SEED)
    stride = HIDDEN_SEEDS * MOST_SEEDS
    return [
        SeedRange.JUDGEMENT.seeds((seed * MOST_CASES + index) * stride, stride).start
        for index in range(cases)
    ]
