"""One policy for sites of any size: each rule keeps its place, whatever the site."""

import numpy as np
import pytest

from blast_env.envs.actions import SUGGESTION
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.rules import RULES
from blast_env.site import load_scenario
from studies.benchmark.family import SuggestionView
from tests.benchmark.row import RowEngine

TITLES = [row.title for row in RULES.values()]


def view(site: str) -> SuggestionView:
    return SuggestionView(
        BlastBarrierEnv(
            load_scenario(site),
            action="suggestion",
            observation="features",
            realisations=1,
            engine=RowEngine(),
        )
    )


@pytest.mark.parametrize("site", ["control_room", "visitor_entrance"])
def test_each_rule_has_its_place_on_any_site(site: str) -> None:
    own = view(site)
    seen, _ = own.reset(seed=0)
    values = np.reshape(seen, (len(TITLES), len(SUGGESTION)))
    masks = own.action_masks()
    assert masks[-1]
    has_next = SUGGESTION.index("has a next piece")
    np.testing.assert_array_equal(values[:, has_next] > 0.0, masks[:-1])
    there = {TITLES[index] for index in np.flatnonzero(masks[:-1])}
    assert there <= set(own.site.suggestions)


def test_a_suggestion_is_placed_and_finishing_ends() -> None:
    own = view("control_room")
    own.reset(seed=0)
    rule = TITLES.index("ring around the building")
    _, _, ended, *_ = own.step(rule)
    assert not ended
    assert len(own.site.placement.layout) == 1
    _, _, ended, *_ = own.step(len(TITLES))
    assert ended
