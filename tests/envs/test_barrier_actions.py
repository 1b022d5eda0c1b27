"""Action spaces and masks: a choice is offered exactly if it can be taken."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env.envs.actions import ACTIONS, ActionChoice, ActionNumbers, ItemThenPlace
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.planes import GridObservation
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Element, Layout
from blast_env.layout import LayoutState, check_layout
from blast_env.site import BuildZone, Scenario, bundled_scenarios, load_scenario
from tests.catalogue_sites import WALL, yard
from tests.envs.small import make, restricted_scenario, same, small_document, small_scenario
from tests.evaluation.engines.shade import ShadeEngine
from tests.site.test_hardening import glazed_yard

BY_CHOICE = ["item_then_place", "item_then_block"]
KEEP_OUT = {"corner_m": (7.0, 6.0), "reason": "hydrant"}


def blocks_scenario(**zone: Any) -> Scenario:
    """Return the small scenario with a zone of 2 x 2 blocks of 8 x 8 cells."""
    return small_scenario(
        corner_m=(7.0, 6.0), rows=14, columns=10, **{"keep_outs": [], "clearance_m": 0.0, **zone}
    )


def yard_env(**arguments: Any) -> BlastBarrierEnv:
    return BlastBarrierEnv(scenario=yard(), engine="gas", **({"action": "place"} | arguments))


def numbered(name: str, scenario: Scenario) -> ActionNumbers:
    return ActionNumbers.of(ACTIONS[name], scenario)


def counted(name: str, scenario: Scenario) -> int:
    return ACTIONS[name].numbered(scenario, scenario).finish


def actions_for(actions: ActionNumbers, placement: LayoutState, element: Element) -> list[int]:
    """Return the actions that place an element: at each choice, the one that leads there."""
    variant = placement.catalogue.variant_number(element)
    place = (variant, element[0], element[1])
    chosen, made = ActionChoice(placement.legal), []
    while True:
        made.append(actions.first[chosen.choices] + int(actions.choices[chosen.choices][place]))
        found = actions.narrowed(chosen, made[-1])
        if not isinstance(found, ActionChoice):
            assert found is not None
            assert placement.catalogue.element(found) == element
            return made
        chosen = found


def test_there_are_as_many_actions_as_items_and_places() -> None:
    counts = [4 * 84, 4 * 84, 4 + 84, 4 + 2 + 48, 4 * 6, 2 * 9]
    assert [counted(name, yard()) for name in ACTIONS] == counts
    assert yard_env(action="item_then_place").action_space == gym.spaces.Discrete(4 + 84 + 1)
    zone = yard().zone.model_copy(update={"rows": 112, "columns": 43})
    large = yard().model_copy(update={"build_zone": zone})
    counts = [4 * 4816, 4 * 4816, 4 + 4816, 4 + 14 * 6 + 64, 4 * 43, 2 * 9]
    assert [counted(name, large) for name in ACTIONS] == counts
    # Without a catalogue there is no item to choose, and 8 x 5 cells are one block.
    assert [counted(name, small_scenario()) for name in ACTIONS] == [40, 40, 40, 40, 5, 2 * 4]


@pytest.mark.parametrize("scenario", [yard(), glazed_yard(), small_scenario()])
@pytest.mark.parametrize("name", ["place", *BY_CHOICE])
def test_choices_lead_to_what_is_legal_and_nowhere_else(name: str, scenario: Scenario) -> None:
    """By the masks, from an empty zone and from one in which something stands."""
    actions = numbered(name, scenario)

    def elements(chosen: ActionChoice) -> list[Element]:
        mask = actions.mask(chosen)
        assert mask[-1] == (chosen.choices == 0)
        found: list[Element] = []
        for action in np.flatnonzero(mask[:-1]).tolist():
            after = actions.narrowed(chosen, action)
            assert after is not None
            if isinstance(after, ActionChoice):
                found += elements(after)
            else:
                found.append(scenario.zone.catalogue.element(after))
        return found

    placement = LayoutState.empty(scenario)
    for _ in range(2):
        legal = [
            scenario.zone.catalogue.element(a) for a in np.flatnonzero(placement.legal).tolist()
        ]
        found = elements(ActionChoice(placement.legal))
        assert sorted(found) == sorted(legal)
        placement = placement.place(legal[len(legal) // 2])


def paid(env: BlastBarrierEnv, layout: Layout) -> tuple[list[float], dict[str, Any]]:
    env.reset(seed=0)
    actions, rewards = ActionNumbers.of(env.task.actions, env.placement.scenario), []
    for element in layout:
        for action in actions_for(actions, env.placement, element):
            _, reward, ended, _, info = env.step(action)
            assert (ended, info["invalid_actions"]) == (False, 0)
            rewards.append(reward)
    _, reward, ended, _, info = env.step(actions.finish)
    assert (ended, env.placement.layout) == (True, layout)
    return [*rewards, reward], info


@pytest.mark.parametrize("reward", ["terminal", "incremental"])
def test_a_layout_is_paid_alike_however_it_is_chosen(reward: str) -> None:
    env = yard_env(reward=reward, action="item_then_place")
    by_choice, info = paid(env, WALL)
    at_once, expected = paid(yard_env(reward=reward), WALL)
    assert len(by_choice) > len(at_once)
    assert sum(by_choice) == pytest.approx(sum(at_once), rel=1e-12)
    assert info["impulse_pa_s"] == expected["impulse_pa_s"]
    assert by_choice[2] == 0.0  # the item of the second piece: nothing is placed yet


def test_what_does_not_go_with_a_choice_is_illegal_and_changes_nothing() -> None:
    env = yard_env(action="item_then_place", invalid_action="penalty")
    env.reset(seed=0)
    before, *_ = env.step(0)
    finish = 4 + 84
    mask = env.action_masks()
    assert not mask[:4].any()  # an item is chosen
    assert not mask[-1]  # and not yet placed
    for count, action in enumerate((1, finish), start=1):
        after, reward, ended, _, info = env.step(action)
        assert same(before, after)
        assert (reward, ended, info["invalid_actions"]) == (-0.001, False, count)
        assert same(env.action_masks(), mask)
    assert env.placement.layout == ()


def test_observations_show_what_is_still_possible() -> None:
    env = yard_env(action="item_then_block", observation="grid")
    observation, _ = env.reset(seed=0)
    channels = GridObservation().channels_of(yard())
    legal = [number for number, name in enumerate(channels) if name.endswith(":legal")]
    assert [bool(plane.any()) for plane in observation[legal]] == [True] * 4
    chosen, *_ = env.step(2)
    assert [bool(plane.any()) for plane in chosen[legal]] == [False, False, True, False]
    assert (chosen[legal[2]] == observation[legal[2]]).all()
    in_block, *_ = env.step(4)
    assert 0.0 < in_block[legal[2]].sum() < chosen[legal[2]].sum()
    assert (in_block[channels.index("free")] == in_block[legal[2]]).all()


def test_a_strategy_of_ones_own_is_taken_and_a_wrong_one_is_told() -> None:
    of_four = make(action=ItemThenPlace(block_cells=4))
    assert of_four.action_space == gym.spaces.Discrete(2 * 2 + 16 + 1)
    with pytest.raises(BlastEnvError, match="item_then_place"):
        make(action="item_than_place")
    with pytest.raises(BlastEnvError, match=r"action is 3, must be one of .* choices"):
        make(action=3)
    with pytest.raises(BlastEnvError, match="block_cells is 0, must be"):
        ItemThenPlace(block_cells=0)


# --- Rows across the line of sight.


def test_the_same_row_again_builds_a_straight_wall_from_the_line_of_sight_outwards() -> None:
    env, first = make(blocks_scenario(), action="row", observation="features"), []
    for y_m in (9.0, 7.5):
        env.reset(seed=0, options={"charge_position_m": (3.0, y_m)})
        for _ in range(3):  # the stock
            env.step(2)
        assert {column for _, column in env.placement.cells} == {2}
        rows = [row for row, _ in env.placement.cells]
        assert sorted(rows) == [*range(min(rows), min(rows) + 3)]
        assert abs(rows[1] - rows[0]) == abs(rows[2] - rows[0]) == 1
        first.append(rows[0])
    assert first[1] < first[0]  # the line of sight has turned with the charge


def test_a_row_of_pieces_has_no_gap() -> None:
    env = yard_env(action="row")
    env.reset(seed=0)
    turned = 1  # the wall, along the columns of the zone
    for _ in range(3):
        env.step(turned * 6 + 1)
    assert sorted(env.placement.layout) == [(row, 1, "wall", True) for row in (2, 5, 8)]


def test_a_full_row_means_the_nearest_row() -> None:
    env = make(blocks_scenario(keep_outs=[{**KEEP_OUT, "size_m": (1.0, 7.0)}]), action="row")
    env.reset(seed=0)
    assert env.action_masks()[:3].tolist() == [False, False, True]
    _, _, _, _, info = env.step(0)
    assert (env.placement.cells[0][1], info["invalid_actions"]) == (2, 1)


# --- Illegal actions.


def test_an_illegal_action_means_the_nearest_legal_cell() -> None:
    """Every action of an environment with obstacles, against a search over all cells.

    The line of sight lies along x: distances in x count first.
    """
    corner = {"corner_m": (9.5, 10.0), "size_m": (2.5, 2.0), "reason": "door"}
    scenario = blocks_scenario(keep_outs=[{**KEEP_OUT, "size_m": (3.0, 2.5)}, corner])
    _, columns = scenario.zone.shape
    env = make(scenario)
    _, info = env.reset(seed=0)
    mask = info["action_mask"]
    legal = [divmod(int(index), columns) for index in np.flatnonzero(mask[:-1])]
    illegal = np.flatnonzero(mask == 0).tolist()
    assert len(illegal) > 20
    for action in illegal:
        row, column = divmod(action, columns)
        away = [(abs(right - column), abs(up - row)) for up, right in legal]
        env.reset(seed=0)
        _, _, ended, _, info = env.step(action)
        assert env.placement.cells == (legal[away.index(min(away))],)
        assert (info["invalid_actions"], ended) == (1, False)
        assert info["reward_terms"]["invalid_actions"] == 0.0


def test_the_nearest_place_is_of_the_same_item_in_the_same_rotation() -> None:
    env = yard_env()
    _, info = env.reset(seed=0)
    catalogue = env.placement.catalogue
    illegal = np.flatnonzero(info["action_mask"] == 0).tolist()
    tried = set()
    for action in illegal:
        env.reset(seed=0)
        env.step(action)
        (placed,) = env.placement.layout
        wanted = catalogue.variants[action // (catalogue.shape[0] * catalogue.shape[1])]
        tried.add(wanted)
        assert catalogue.variants[catalogue.variant_number(placed)] == wanted
    assert len(tried) == 3  # a post stands everywhere


def test_an_action_that_is_repeated_builds_a_wall_across_the_line_of_sight() -> None:
    """Where the line lies along y, along a row of cells; where along x, along a column."""
    document = small_document(rows=9, columns=9, stock=5, keep_outs=[])
    south = {**document["charge"][1], "position_m": (9.25, 2.0), "weight": 1000.0}
    north = {**document["structures"][1], "corner_m": (8.0, 15.0), "rows": 4, "columns": 8}
    turned = document | {"charge": [south], "structures": [north]}
    for found, wall in (
        (document, [(row, 4) for row in (2, 3, 4, 5, 6)]),
        (turned, [(4, column) for column in (2, 3, 4, 5, 6)]),
    ):
        env = make(Scenario.model_validate(found), action="dimensions")
        env.reset(seed=0)
        ended = False
        while not ended:
            *_, ended, _, info = env.step((0, 4, 4))
        assert sorted(env.placement.cells) == wall
        assert info["invalid_actions"] == 4


@pytest.mark.parametrize("name", list(ACTIONS))
def test_no_policy_that_repeats_an_action_gets_stuck(name: str) -> None:
    """With masks disregarded; every episode ends in a layout, not by the limit of 100 actions."""
    env = BlastBarrierEnv(yard(), engine=ShadeEngine(), action=name, invalid_action_limit=100)
    env.action_space.seed(0)
    for _ in range(40):
        action: Any = env.action_space.sample()
        env.reset(seed=0)
        actions, ended = 1, False
        while not ended:
            _, _, ended, _, _ = env.step(action)
            actions += not ended
        assert actions <= 3 * env.task.source.representative.zone.stock


def test_what_repeats_without_effect_ends_the_episode() -> None:
    env = make(action="item_then_block", scenario=blocks_scenario())
    env.reset(seed=1)
    other_choice = 60  # a cell, where a block is asked for
    _, _, ended, _, info = env.step(other_choice)
    assert (ended, info["invalid_actions"], info["reward_terms"]["invalid_actions"]) == (
        False,
        1,
        -0.001,
    )
    assert not env.step(0)[2]  # an action with an effect between two without
    env.step(int(np.flatnonzero(env.action_masks())[0]))
    assert not env.step(other_choice)[2]
    _, _, ended, _, info = env.step(other_choice)
    assert (ended, info["invalid_actions"], info["placed"]) == (True, 3, 1)


def test_block_and_cell_mean_the_nearest_ones() -> None:
    scenario = blocks_scenario(keep_outs=[{**KEEP_OUT, "size_m": (4.0, 4.0)}])  # block 0
    env = make(action="item_then_block", scenario=scenario)
    env.reset(seed=1)
    env.step(0)  # the block above it, across the line of sight
    env.step(4 + 9)
    env.step(0)
    env.step(4 + 9)  # taken: the cell below, before the equally near one
    env.step(1)
    env.step(4 + 9)  # that block has two columns
    assert env.placement.layout == ((9, 1), (8, 1), (1, 9))


# --- A cell is offered exactly if a module may be placed on it.


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
            for action in _some_of_both(mask[:-1], rng):
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


def _some_of_both(mask: np.ndarray, rng: np.random.Generator) -> list[int]:
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
