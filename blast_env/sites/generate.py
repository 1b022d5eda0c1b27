"""Generation of a site from its seed."""

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.site import SCHEMA_VERSION, Scenario, ScenarioError
from blast_env.sites.criterion import Objection, SiteCriterion
from blast_env.sites.module_sites import SiteRanges
from blast_env.sites.ranges import Draws, Ranges
from blast_env.sites.turning import turned
from blast_env.values import generator

RANGES: Final = SiteRanges()
"""The default ranges of sites."""

MOST_TRIES: Final = 200
"""Most sites that are drawn for a seed."""

HELD_OUT_SITES: Final = 10_000
"""Number of held-out seeds, 0 to 9,999; training uses the seeds from 10,000."""

_SIDES: Final = ("left", "lower", "right", "upper")


def generate_site(
    seed: int, ranges: Ranges = RANGES, criterion: SiteCriterion | None = None
) -> Scenario:
    """Return the site of a seed: the first site of its random stream that the criterion accepts.

    It is a pure function of its arguments, in any process. The name is `site_` with the seed for
    all ranges and criteria; the content hash distinguishes sites.

    Args:
        seed: 0 to 2^63 - 1.
        criterion: Acceptance criterion; the family's default unless given.

    Raises:
        BlastEnvError: If the seed is out of bounds, or none of 200 sites is accepted.
    """
    rng = generator(seed)
    wanted = criterion or ranges.criterion
    objections: list[Objection] = []
    for _ in range(MOST_TRIES):
        try:
            site = draw_site(rng, ranges, f"site_{seed}")
        except ScenarioError as error:
            problem = error.problems[0]
            objections.append(Objection(f"{problem.key}: must fit", problem.message))
            continue
        objection = wanted.objection(site)
        if objection is None:
            return site
        objections.append(objection)
    raise _nothing_accepted(int(seed), objections)


def draw_site(rng: np.random.Generator, ranges: Ranges, name: str) -> Scenario:
    """Draw a site without applying a criterion.

    Args:
        rng: The random stream.

    Raises:
        ScenarioError: If the drawn objects are inconsistent, which does not happen with the
            default ranges.
    """
    draws = Draws(rng)
    description, sections = ranges.drawn(draws)
    quarter_turns = draws.count((0, 3))
    document = {
        "schema_version": SCHEMA_VERSION,
        "name": name,
        "description": description.format(side=_SIDES[quarter_turns]),
        "calibration": ranges.calibration,
        "simulation": {"preset": ranges.preset},
        **sections,
    }
    return turned(Scenario.from_document(document, name), quarter_turns)


def _nothing_accepted(seed: int, objections: Sequence[Objection]) -> BlastEnvError:
    """Return the error with the count and the last value of each violated rule."""
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
