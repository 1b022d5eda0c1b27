"""A cell is offered exactly if a module may be placed on it."""

import numpy as np
import pytest

from blast_env.errors import LayoutError
from blast_env.layout import check_layout
from blast_env.site import BuildZone, Scenario, bundled_scenarios, load_scenario
from tests.envs.small import make, restricted_scenario, small_scenario

SCENARIOS = {
    "small": small_scenario(),
    "restricted": restricted_scenario(),
    **{
        name: scenario
        for name in bundled_scenarios()
        if (scenario := load_scenario(name)).build_zone is not None and not scenario.zone.items
    },
}
EPISODES = 5


@pytest.mark.parametrize("name", SCENARIOS)
def test_an_action_is_legal_exactly_if_the_layout_with_it_is_accepted(name: str) -> None:
    """Hundreds of states; in each, some cells are tried that are legal and some that are not.

    Whether a layout is accepted is for `check_layout` to say, which looks at it as a whole.
    """
    scenario = SCENARIOS[name]
    env = make(scenario, invalid_action="penalty", invalid_action_limit=1000)
    rng = np.random.default_rng(0)
    states = 0
    for episode in range(EPISODES):
        _, info = env.reset(seed=episode)
        ended = False
        while not ended:
            mask = env.action_masks()
            assert (mask == info["action_mask"]).all()
            assert mask[-1]
            layout = env.placement.cells
            for action in _some_of_each(mask[:-1], rng):
                cell = divmod(action, _zone(scenario).columns)
                _check(env.explain(cell), mask[action])
                assert _is_accepted(scenario, (*layout, cell)) == mask[action]
            if not mask.all():
                _, _, ended, _, info = env.step(rng.choice(np.flatnonzero(~mask)))
                assert not ended
                assert env.placement.cells == layout
            states += 1
            if len(layout) + 1 == _zone(scenario).stock:
                break  # the next module would set off the charge, which costs time
            action = rng.choice(np.flatnonzero(mask[:-1]))
            _, _, ended, _, info = env.step(action)
            assert env.placement.cells == (*layout, divmod(action, _zone(scenario).columns))
    assert states >= EPISODES * min(3, _zone(scenario).stock)


def _check(reason: str | None, is_legal: bool) -> None:
    assert (reason is None) == is_legal
    if reason is not None:
        assert len(reason) > 20


def _some_of_each(mask: np.ndarray, rng: np.random.Generator) -> list[int]:
    """Return an action that is legal and one that is not, where there are such."""
    kinds = (np.flatnonzero(mask), np.flatnonzero(~mask))
    return [int(rng.choice(kind)) for kind in kinds if len(kind)]


def _zone(scenario: Scenario) -> BuildZone:
    assert scenario.build_zone is not None
    return scenario.build_zone


def _is_accepted(scenario: Scenario, layout: tuple) -> bool:
    try:
        check_layout(scenario, layout)
    except LayoutError:
        return False
    return True


def test_finishing_stays_legal_when_the_stock_is_not_used_up_but_no_cell_is_left() -> None:
    # A budget for two modules, though there are three: the second one ends the episode.
    env = make(small_scenario(budget=2.0))
    env.reset(seed=0)
    _, _, ended, _, _ = env.step(0)
    assert not ended
    assert env.step(1)[2]
    assert env.placement.stock_left == 1
    assert env.placement.is_full


def test_the_mask_of_the_information_is_what_a_space_samples_with() -> None:
    env = make(restricted_scenario())
    _, info = env.reset(seed=0)
    assert env.action_masks().dtype == np.bool_  # as MaskablePPO wants it
    assert info["action_mask"].dtype == np.int8
    env.action_space.seed(0)
    sampled = {int(env.action_space.sample(mask=info["action_mask"])) for _ in range(500)}
    assert sampled < set(np.flatnonzero(env.action_masks()))
    assert len(sampled) > 50
    _, _, _, _, info = env.step(min(sampled))
    assert info["action_mask"].dtype == np.int8
    assert env.action_space.sample(mask=info["action_mask"]) != min(sampled)
