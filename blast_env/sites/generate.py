"""From a seed to a site."""

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.scenario import (
    SCHEMA_VERSION,
    AnySource,
    ModularObstacleSection,
    RectangleSource,
    Scenario,
    ScenarioError,
    SegmentSource,
    SimulationSection,
    Site,
)
from blast_env.sites.conditions import draw_build_zone
from blast_env.sites.criterion import Objection, SightLineCriterion, SiteCriterion
from blast_env.sites.draws import Draws
from blast_env.sites.ground import Ground, draw_ground
from blast_env.sites.ranges import SiteRanges
from blast_env.sites.turning import turned
from blast_env.units import MODULE_SIDE_M

RANGES: Final = SiteRanges()
"""The ranges that sites are drawn from unless others are given."""

CRITERION: Final = SightLineCriterion()
"""The criterion that sites meet unless another one is given."""

MOST_TRIES: Final = 200
"""Sites that are drawn for a seed before it is given up."""

MOST_SEED: Final = 2**63 - 1

PROTECTED: Final = "building"
"""Name of the protected structure."""

_SIDES: Final = ("left", "lower", "right", "upper")


def generate_site(
    seed: int, ranges: SiteRanges = RANGES, criterion: SiteCriterion = CRITERION
) -> Scenario:
    """Return the site of a seed: the first one of the seed's stream that the criterion accepts.

    A pure function of its arguments, in any process. The name is `site_` with the seed, whatever
    ranges and criterion are; the content hash tells sites apart.

    Args:
        seed: 0 to 2^63 - 1.
        ranges: What the site may be.
        criterion: Which sites are used.

    Raises:
        BlastEnvError: If the seed is out of bounds, or none of 200 sites is accepted.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise BlastEnvError(f"seed is {seed!r}, must be an integer")
    if not 0 <= seed <= MOST_SEED:
        raise BlastEnvError(f"seed is {seed}, must be 0 to {MOST_SEED}")
    rng = np.random.default_rng(int(seed))
    objections: list[Objection] = []
    for _ in range(MOST_TRIES):
        try:
            site = draw_site(rng, ranges, f"site_{seed}")
        except ScenarioError as error:
            problem = error.problems[0]
            objections.append(Objection(f"{problem.key}: must fit", problem.message))
            continue
        objection = criterion.objection(site)
        if objection is None:
            return site
        objections.append(objection)
    raise _nothing_accepted(int(seed), objections)


def draw_site(rng: np.random.Generator, ranges: SiteRanges, name: str) -> Scenario:
    """Draw a site, whether any criterion would accept it or not.

    Args:
        rng: The stream.
        ranges: What the site may be.
        name: Its name.

    Raises:
        ScenarioError: If the things that were drawn do not fit each other, which does not happen
            with the default ranges.
    """
    draws = Draws(rng)
    ground = draw_ground(draws, ranges)
    source = _source(ground.threat, draws.amount(ranges.tnt_kg, 0))
    structures = [_structure("building", ground.building)]
    if ground.neighbour is not None:
        structures.append(_structure("neighbour", ground.neighbour))
    zone = draw_build_zone(draws, ranges, ground)
    quarter_turns = draws.count((0, 3))
    document = {
        "schema_version": SCHEMA_VERSION,
        "name": name,
        "description": _description(ground, _SIDES[quarter_turns]),
        "calibration": ranges.calibration,
        "site": Site(width_m=ranges.side_m, height_m=ranges.side_m),
        "charge": (source,),
        "structures": tuple(structures),
        "build_zone": zone,
        "simulation": SimulationSection(preset=ranges.preset),
    }
    site = Scenario.from_document(document, name)
    return turned(site, quarter_turns)


def _source(threat: Rectangle, tnt_kg: float) -> AnySource:
    """Return a stretch of road, or a parking area."""
    left, bottom, right, top = threat
    if left == right:
        return SegmentSource(
            kind="segment", start_m=(left, bottom), end_m=(right, top), tnt_kg=tnt_kg
        )
    size_m = (right - left, top - bottom)
    return RectangleSource(kind="rectangle", corner_m=(left, bottom), size_m=size_m, tnt_kg=tnt_kg)


def _structure(name: str, rectangle: Rectangle) -> ModularObstacleSection:
    left, bottom, right, top = rectangle
    return ModularObstacleSection(
        kind="ModularObstacle",
        name=name,
        corner_m=(left, bottom),
        rows=round((top - bottom) / MODULE_SIDE_M),
        columns=round((right - left) / MODULE_SIDE_M),
        protected=name == PROTECTED,
    )


def _description(ground: Ground, side: str) -> str:
    building, threat = ground.building, ground.threat
    return (
        f"A generated site: a building with a facade of {building.top - building.bottom:g} m,"
        f" {building.left - threat.right:g} m from a"
        f" {'road' if threat.left == threat.right else 'parking area'} along the {side} side."
    )


def _nothing_accepted(seed: int, objections: Sequence[Objection]) -> BlastEnvError:
    """Return the error that says what was wrong how often."""
    counted = Counter(objection.rule for objection in objections)
    last = {objection.rule: objection.found for objection in objections}
    reasons = "; ".join(
        f"{rule} ({count} times, the last one {last[rule]})"
        for rule, count in counted.most_common()
    )
    return BlastEnvError(
        f"site of seed {seed}: none of {len(objections)} sites drawn is accepted: {reasons};"
        " change the ranges or the criterion"
    )
