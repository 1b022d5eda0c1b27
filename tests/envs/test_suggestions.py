"""Suggestions as actions: what the rules propose, piece by piece or at once, and mixed."""

from itertools import count
from typing import Any, Final

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sb3_contrib import MaskablePPO

from blast_env.envs.actions import SUGGESTION
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observations import FeaturesObservation
from blast_env.geometry import Layout
from blast_env.layout import check_layout
from blast_env.rules import RULES, RuleRow
from blast_env.site import (
    AnyCharge,
    Charge,
    PointSource,
    Scenario,
    VehicleCharge,
    VehicleSource,
    load_scenario,
)
from blast_env.sites import ItemSiteRanges, SiteSource
from tests.catalogue_sites import yard
from tests.envs.small import (
    ThinEngine,
    batch_as_singles,
    restricted_scenario,
    same,
    small_document,
    small_scenario,
)
from tests.evaluation.engines.shade import ShadeEngine
from tests.site.test_hardening import glazed_yard

SITES: Final = ("courtyard", "control_room", "hotel_forecourt")
"""Modules, a catalogue, a catalogue and vehicles."""

ALONG: Final = "next piece: distance along the line of sight / its length"


def suggesting(scenario: Any, **arguments: Any) -> BlastBarrierEnv:
    defaults: dict[str, Any] = {
        "action": "suggestion",
        "observation": "features",
        "engine": ShadeEngine(),
        "realisations": 1,
    }
    env = gym.make("BlastBarrier-v0", scenario=scenario, **(defaults | arguments)).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    return env


def rules_for(scenario: Scenario) -> list[RuleRow]:
    return [row for row in RULES.values() if row.suits(scenario)]


def shown(env: BlastBarrierEnv) -> AnyCharge:
    """Return the charge that an agent is shown."""
    (source,) = env.observable.sources
    if isinstance(source, VehicleSource):
        return VehicleCharge(source)
    assert isinstance(source, PointSource)
    return Charge(source.position_m, source.tnt_kg, source.height_m)


def proposed(env: BlastBarrierEnv, row: RuleRow, charge: AnyCharge | None) -> Layout:
    return row.layout(env.placement.scenario, charge) or ()


def repeated(env: BlastBarrierEnv, action: int, seed: int, **options: Any) -> Layout:
    env.reset(seed=seed, options=options)
    ended = False
    while not ended:
        _, _, ended, _, _ = env.step(action)
    return env.placement.layout


@pytest.mark.parametrize("name", SITES)
def test_a_suggestion_again_and_again_is_the_layout_of_its_rule(name: str) -> None:
    env = suggesting(name)
    rules = rules_for(load_scenario(name))
    assert env.action_space == gym.spaces.Discrete(2 * len(rules) + 1)
    for action, row in enumerate(rules):
        found = repeated(env, action, seed=3)
        assert found == proposed(env, row, shown(env)), row.title


@pytest.mark.parametrize("name", SITES)
def test_all_the_rest_at_first_is_the_layout_of_its_rule_in_one_action(name: str) -> None:
    env = suggesting(name)
    rules = rules_for(load_scenario(name))
    for number, row in enumerate(rules):
        env.reset(seed=3)
        _, _, ended, _, info = env.step(len(rules) + number)
        expected = proposed(env, row, shown(env))
        assert env.placement.layout == expected, row.title
        assert info["placed"] == len(expected)
        assert ended == (not env.placement.legal.any())


@pytest.mark.parametrize("reward", ["terminal", "incremental"])
@pytest.mark.parametrize("scenario", [yard(), glazed_yard(), restricted_scenario(), *SITES])
def test_all_the_rest_is_the_next_piece_until_there_is_none(scenario: Any, reward: str) -> None:
    """After the same pieces of any rules: observation, mask, end and the sum of rewards."""
    at_once, by_pieces = (suggesting(scenario, reward=reward) for _ in range(2))
    count = len(at_once.suggestions) // 2
    rng = np.random.default_rng(1)
    for seed in range(6):
        at_once.reset(seed=seed)
        by_pieces.reset(seed=seed)
        for _ in range(seed % 4):
            piece = int(rng.choice(np.flatnonzero(at_once.action_masks()[:count])))
            at_once.step(piece)
            *_, ended, _, _ = by_pieces.step(piece)
            if ended:
                break
        open_rules = np.flatnonzero(at_once.action_masks()[:count])
        if not len(open_rules):
            continue
        rule = int(rng.choice(open_rules))
        observation, reward_at_once, ended, _, info = at_once.step(count + rule)
        paid, was_last = 0.0, False
        while by_pieces.action_masks()[rule]:
            other, part, was_last, _, expected = by_pieces.step(rule)
            paid += float(part)
        assert at_once.placement.layout == by_pieces.placement.layout
        assert same(observation, other)
        assert same(info["action_mask"], expected["action_mask"])
        assert ended == was_last
        assert reward_at_once == pytest.approx(paid, abs=1e-12)


def test_suggestions_against_a_hidden_threat_are_those_against_all_its_places() -> None:
    env = suggesting("courtyard", threat="hidden", threats=1)
    rules = rules_for(load_scenario("courtyard"))
    layouts = {seed: [repeated(env, k, seed) for k in range(len(rules))] for seed in (1, 2)}
    assert layouts[1] == layouts[2] == [proposed(env, row, None) for row in rules]


@pytest.mark.parametrize("scenario", [yard(), glazed_yard(), restricted_scenario(), "control_room"])
def test_the_mask_has_the_rules_with_a_piece_that_may_be_placed_now(scenario: Any) -> None:
    """And the first such piece is what the action places."""
    env = suggesting(scenario)
    rng = np.random.default_rng(0)
    for seed in range(4):
        env.reset(seed=seed)
        rules, ended = rules_for(env.placement.scenario), False
        layouts = [proposed(env, row, shown(env)) for row in rules]
        while not ended:
            placement = env.placement
            legal = [
                [piece for piece in layout if placement.explain(piece) is None]
                for layout in layouts
            ]
            mask = env.action_masks()
            assert mask.tolist() == [*map(bool, legal), *map(bool, legal), True]
            pieces = np.flatnonzero(mask[: len(rules)])
            action = int(rng.choice([*pieces, env.finish]))
            _, _, ended, _, info = env.step(action)
            assert np.array_equal(info["action_mask"], env.action_masks())
            if action != env.finish:
                assert env.placement.layout == (*placement.layout, legal[action][0])


def test_what_is_there_already_counts_as_placed() -> None:
    env = suggesting(small_scenario(), engine=ThinEngine())
    rules = rules_for(small_scenario())
    env.reset(seed=1)
    layout = proposed(env, rules[0], shown(env))
    assert repeated(env, 0, seed=1, layout=layout[:2]) == layout
    assert sorted(repeated(env, 0, seed=1, layout=layout[1:])) == sorted(layout)


def test_a_charge_of_the_options_is_the_one_that_rules_know() -> None:
    env = suggesting("courtyard")
    place_m = (4.0, 9.0)
    env.reset(seed=0, options={"charge_position_m": place_m})
    expected = proposed(env, RULES["wall_near_charge"], shown(env))
    assert shown(env).position_m == place_m  # type: ignore[union-attr]
    assert repeated(env, 0, seed=0, charge_position_m=place_m) == expected


def test_a_rule_that_has_had_its_say_is_masked_and_finishes() -> None:
    """So that a policy without masks gets stuck nowhere."""
    env = suggesting("courtyard")
    rules = [*RULES]
    action = [row.title for row in rules_for(load_scenario("courtyard"))].index(
        RULES["sight_lines"].title
    )
    assert "sight_lines" in rules
    layout = repeated(env, action, seed=0)
    env.reset(seed=0)
    for _ in layout:
        assert env.action_masks()[action]
        _, _, ended, _, info = env.step(action)
    assert not ended
    assert not info["action_mask"][action]
    _, _, ended, _, info = env.step(action)
    assert (ended, info["placed"], info["invalid_actions"]) == (True, len(layout), 1)
    assert info["reward_terms"]["invalid_actions"] == 0.0
    # All the rest, twice, is the rule's layout as well.
    rest = len(env.suggestions) // 2 + action
    assert repeated(env, rest, seed=0) == layout
    env.reset(seed=0)
    env.step(rest)
    assert not env.action_masks()[[action, rest]].any()
    _, _, ended, _, info = env.step(rest)
    assert (ended, info["placed"], info["invalid_actions"]) == (True, len(layout), 1)


def test_with_a_penalty_it_costs_instead() -> None:
    env = suggesting("courtyard", invalid_action="penalty", invalid_action_limit=3)
    placed = len(repeated(suggesting("courtyard"), 3, seed=0))
    env.reset(seed=0)
    steps = [env.step(3) for _ in range(placed + 3)]
    assert [step[2] for step in steps] == [False] * (placed + 2) + [True]
    costs = [step[4]["reward_terms"]["invalid_actions"] for step in steps]
    assert costs == [0.0] * placed + [-0.001] * 3


def test_generated_sites_have_the_suggestions_of_their_family() -> None:
    """A line of posts has nothing to say on a site without a vehicle."""
    source = SiteSource.held_out(12, ItemSiteRanges())
    env = suggesting(source)
    rules = rules_for(source.representative)
    posts = [row.title for row in rules].index(RULES["line_of_posts"].title)
    assert env.action_space == gym.spaces.Discrete(2 * len(rules) + 1)
    seen = set()
    for seed in count():
        env.reset(seed=seed)
        scenario = env.placement.scenario
        legal = env.action_masks()[:-1]
        assert legal.tolist() == 2 * [bool(proposed(env, row, shown(env))) for row in rules]
        assert scenario.vehicles or not legal[posts]
        seen.add(bool(scenario.vehicles))
        if len(seen) == 2:
            break


@pytest.mark.parametrize("how", [{}, {"threat": "hidden", "threats": 3}])
@pytest.mark.parametrize("scenario", ["control_room", "hotel_forecourt", "item_sites"])
def test_a_batch_plays_what_single_environments_play(scenario: str, how: dict[str, Any]) -> None:
    batch_as_singles(
        scenario=scenario,
        engine=ShadeEngine(),
        observation="features",
        action="suggestion",
        **how,
    )


@pytest.mark.parametrize("scenario", [yard(), glazed_yard(), restricted_scenario()])
@given(data=st.data(), seed=st.integers(0, 3))
@settings(max_examples=20, deadline=None)
def test_whatever_is_played_ends_in_a_legal_layout(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    """Within the stock, illegal actions included: each action places pieces, or is the last."""
    env = suggesting(scenario)
    env.reset(seed=seed)
    ended, placed = False, 0
    while not ended:
        action = data.draw(st.integers(0, env.finish))
        _, _, ended, _, info = env.step(action)
        assert info["placed"] > placed or ended
        placed = info["placed"]
    assert placed <= scenario.zone.stock
    check_layout(scenario, env.placement.layout)


def test_maskable_ppo_takes_the_masks() -> None:
    env = suggesting(small_scenario(), engine=ThinEngine())
    agent = MaskablePPO("MlpPolicy", env, n_steps=32, batch_size=16, n_epochs=1, seed=0)
    agent.learn(64)
    observation, _ = env.reset(seed=2)
    action, _ = agent.predict(observation, action_masks=env.action_masks())
    assert env.action_space.contains(action)


def test_the_space_comes_with_two_objectives() -> None:
    env: Any = gym.make(
        "BlastBarrier-MO-v0", scenario="control_room", engine=ShadeEngine(), action="suggestion"
    )
    env.reset(seed=0)
    _, reward, _, _, _ = env.step(0)
    assert reward.shape == (2,)
    assert reward[1] < 0.0  # the cost of the piece


@pytest.mark.parametrize("name", SITES)
def test_the_vector_goes_on_with_seven_values_of_each_rule(name: str) -> None:
    env, plain = suggesting(name), suggesting(name, action="place")
    vector, _ = env.reset(seed=3)
    others, _ = plain.reset(seed=3)
    count = len(env.suggestions) // 2
    assert same(vector[: len(others)], others)
    assert vector in env.observation_space
    values = vector[len(others) :].reshape(count, len(SUGGESTION))
    assert (values[:, 0] == env.action_masks()[:count]).all()
    # 1. A layout of two pieces or more, piece by piece: its share rises, the others' may as well.
    action = env.suggestions.index(RULES["wall_near_charge"].title)
    layout = proposed(env, RULES["wall_near_charge"], shown(env))
    for piece in range(len(layout)):
        assert values[action, 1] == pytest.approx(piece / len(layout))
        vector, *_ = env.step(action)
        values = vector[len(others) :].reshape(count, len(SUGGESTION))
    # 2. Walls near the charge stand before those near the building.
    vector, _ = env.reset(seed=3)
    values = vector[len(others) :].reshape(count, len(SUGGESTION))
    along = [
        values[env.suggestions.index(RULES[rule].title), SUGGESTION.index(ALONG)]
        for rule in ("wall_near_charge", "wall_in_middle", "wall_near_building")
    ]
    assert 0.0 < along[0] < along[1] < along[2] < 1.0


def test_a_mean_charge_in_the_middle_of_what_is_protected_has_no_line_of_sight() -> None:
    """Rules propose nothing then, and the values are numbers all the same."""
    document = small_document()
    around = [
        {**document["charge"][1], "position_m": place, "weight": 1.0}
        for place in ((10.0, 1.0), (18.0, 1.0), (10.0, 17.0), (18.0, 17.0))
    ]
    house = {**document["structures"][1], "corner_m": (13.0, 6.0), "rows": 12, "columns": 4}
    found = Scenario.model_validate(document | {"charge": around, "structures": [house]})
    env = suggesting(found, engine=ThinEngine(), threat="hidden", threats=2)
    vector, info = env.reset(seed=0)
    assert vector in env.observation_space
    assert not info["action_mask"][:3].any()


def test_the_page_has_each_value_by_name() -> None:
    text = FeaturesObservation.__doc__ or ""
    for number, name in enumerate(SUGGESTION, 1):
        assert f"\n    {number}. {name}" in text


def test_only_suggestions_have_names() -> None:
    assert suggesting("courtyard").suggestions == (
        "wall near the charge",
        "wall in the middle",
        "wall near the building",
        "most sight lines cut",
        "wall near the charge: all the rest",
        "wall in the middle: all the rest",
        "wall near the building: all the rest",
        "most sight lines cut: all the rest",
    )
    assert suggesting("courtyard", action="place").suggestions == ()
