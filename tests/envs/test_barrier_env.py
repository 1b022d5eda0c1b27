"""Episodes of the barrier environment: actions, rewards, information, options, sites, memory."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from blast_env.arrays import FloatArray
from blast_env.envs.observable import Observable
from blast_env.envs.strategies import Transition
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.evaluation import BlastEvaluator, BlastStore, LoadCase, evaluate_layout
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import Scenario, load_scenario
from blast_env.units import PA_PER_PSI
from tests.envs.small import ThinEngine, make, play, same, small_document, small_scenario
from tests.gas_sites import WALL, hut

COLUMNS = 5
FINISH = 8 * COLUMNS
HYDRANT = 4 * COLUMNS  # a cell that is kept out


def test_placing_the_stock_or_finishing_sets_off_the_charge_with_what_stands() -> None:
    env = make()
    env.reset(seed=1)
    assert [env.step(cell)[2] for cell in (7, 8, 9)] == [False, False, True]
    assert env.placement.cells == ((1, 2), (1, 3), (1, 4))
    env.reset(seed=1)
    env.step(7)
    _, _, ended, truncated, info = env.step(FINISH)
    assert ended
    assert not truncated
    assert env.placement.layout == ((1, 2),)
    assert np.argwhere(info["layout"]).tolist() == [[0, 1, 2]]
    assert info["reward_terms"]["impulse"] == info["reduction"] > 0.0


def test_the_final_information_is_that_of_the_same_blasts_run_by_hand() -> None:
    scenario = small_scenario()
    env = make(scenario, realisations=2)
    info = play(env, seed=4)[-1][4]
    (charge,), (seeds,) = info["charges"], info["blast_seeds"]
    evaluator = BlastEvaluator(scenario, ThinEngine())
    by_hand = [
        [evaluator.loads(layout, LoadCase(charge, seed)) for seed in seeds]
        for layout in (info["layout"], ())
    ]
    impulse, unprotected = (
        np.mean([loads.protected_impulse_pa_s for loads in value]) for value in by_hand
    )
    assert info["impulse_pa_s"] == impulse
    assert info["impulse_psi_s"] == pytest.approx(impulse / PA_PER_PSI)
    assert info["impulse_sim"] == np.mean([loads.protected_impulse_sim for loads in by_hand[0]])
    assert info["unprotected_impulse_pa_s"] == unprotected
    assert info["reduction"] == pytest.approx(1.0 - impulse / unprotected)
    assert info["scenario_hash"] == scenario.content_hash
    assert info["calibration"] == scenario.calibration
    assert info["calibration_in_range"] == all(loads.in_range for loads in by_hand[0])
    assert info["blasts"] == 4


def test_an_illegal_action_changes_nothing_but_the_count_and_the_reward() -> None:
    env = make(invalid_action="penalty", invalid_action_cost=0.25)
    env.reset(seed=1)
    observation, _, _, _, info = env.step(7)
    assert not info["action_mask"][HYDRANT]
    after, reward, ended, _, info = env.step(HYDRANT)
    assert same(observation, after)
    assert not ended
    assert reward == -0.25
    assert info["reward_terms"] == {"unprotected": 0.0, "impulse": 0.0, "invalid_actions": -0.25}
    assert info["invalid_actions"] == 1
    env.step(0)
    again = env.step(0)  # the cell is taken now
    assert again[1] == -0.25
    assert again[4]["invalid_actions"] == 2


def test_the_limit_of_illegal_actions_ends_the_episode_as_finishing_does() -> None:
    env = make(invalid_action="penalty", invalid_action_limit=3, invalid_action_cost=0.5)
    env.reset(seed=1)
    env.step(7)
    rewards, ended = zip(*[env.step(HYDRANT)[1:3] for _ in range(3)], strict=True)
    assert ended == (False, False, True)
    env.reset(seed=1)
    env.step(7)
    assert rewards[2] == env.step(FINISH)[1] - 0.5


@pytest.mark.parametrize("action", [-1, FINISH + 1, 1.5, "3", np.int64(99), [0, 99]])
def test_an_action_outside_the_space_is_an_error(action: int) -> None:
    env = make()
    env.reset(seed=1)
    with pytest.raises(gym.error.InvalidAction, match="must be in Discrete") as refused:
        env.step(action)
    assert str(action) in str(refused.value)


def test_stepping_before_reset_and_after_the_end_is_refused() -> None:
    env = make()
    for call in (lambda: env.step(0), env.action_masks, lambda: env.explain((0, 0))):
        with pytest.raises(gym.error.ResetNeeded, match="call reset"):
            call()
    env.reset(seed=1)
    env.step(FINISH)
    with pytest.raises(gym.error.ResetNeeded, match="has ended"):
        env.step(FINISH)


@pytest.mark.parametrize("threat", ["visible", "hidden"])
@pytest.mark.parametrize("layout", [(), ((0, 1),)])
def test_incremental_rewards_add_up_to_the_terminal_one(threat: str, layout: tuple) -> None:
    rewards = {}
    for reward in ("terminal", "incremental"):
        env = make(reward=reward, threat=threat, threats=None if threat == "visible" else 2)
        steps = play(env, seed=5, layout=layout)
        rewards[reward] = [step[1] for step in steps[1:]]
    assert sum(rewards["incremental"]) == pytest.approx(sum(rewards["terminal"]), abs=1e-12)
    assert not any(rewards["terminal"][1:-1])
    assert sum(rewards["terminal"]) < 0.0


def test_terminal_rewards_add_up_to_minus_the_share_of_the_impulse_that_arrives() -> None:
    steps = play(make(), seed=5)[1:]
    terms, info = [step[4]["reward_terms"] for step in steps], steps[-1][4]
    before = [0.0] * (len(terms) - 1)
    assert [term["unprotected"] for term in terms] == [-1.0, *before]
    assert [term["impulse"] for term in terms] == [*before, info["reduction"]]
    arrives = info["impulse_pa_s"] / info["unprotected_impulse_pa_s"]
    assert sum(step[1] for step in steps) == pytest.approx(-arrives, rel=1e-12)


@pytest.mark.parametrize("threat", ["visible", "hidden"])
def test_relative_rewards_add_up_to_the_reduction(threat: str) -> None:
    env = make(reward="relative", threat=threat, threats=None if threat == "visible" else 2)
    steps = play(env, seed=5)[1:]
    assert [step[1] for step in steps] == [0.0, 0.0, steps[-1][4]["reduction"]]
    assert steps[-1][4]["reward_terms"].keys() == {"reduction", "invalid_actions"}
    env.reset(seed=5)
    assert env.step(FINISH)[1] == 0.0  # no barrier, no reduction


def test_a_module_earns_what_it_takes_off_the_impulse() -> None:
    env = make(reward="incremental", invalid_action="penalty")
    env.reset(seed=1, options={"charge_position_m": (3.0, 9.0), "layout": [(0, 4)]})
    env.step(HYDRANT)  # illegal: the first step pays for what stands from the start
    earned = env.step(3 * COLUMNS)[1]
    _, last, _, _, info = env.step(FINISH)
    unprotected = info["unprotected_impulse_pa_s"]
    evaluator, (charge,), ((seed,),) = (
        BlastEvaluator(small_scenario(), ThinEngine()),
        info["charges"],
        info["blast_seeds"],
    )
    before = evaluator.loads([(0, 4)], LoadCase(charge, seed)).protected_impulse_pa_s
    assert earned == pytest.approx((before - info["impulse_pa_s"]) / unprotected, abs=1e-9)
    assert last == 0.0


@pytest.mark.parametrize("reward", ["terminal", "incremental"])
@pytest.mark.parametrize("threat", ["visible", "hidden"])
@pytest.mark.parametrize("limit", [1, 3])
def test_to_be_cut_off_pays_what_to_finish_pays_or_as_much_as_no_barrier(
    reward: str, threat: str, limit: int
) -> None:
    """A time limit that a user puts round the environment, which does not learn of it."""
    env = make(small_scenario(stock=6), reward=reward, threat=threat)
    limited = gym.wrappers.TimeLimit(env, limit)
    for seed in range(3):
        cells = np.random.default_rng(seed).permutation(8)[:limit].tolist()
        limited.reset(seed=seed)
        steps = [limited.step(cell) for cell in cells]
        assert steps[-1][2:4] == (False, True)
        cut_off = sum(float(step[1]) for step in steps)
        env.reset(seed=seed)
        finished = sum(env.step(cell)[1] for cell in (*cells, FINISH))
        assert finished < 0.0
        if reward == "incremental":
            assert cut_off == pytest.approx(finished, rel=1e-12)
        else:
            assert cut_off == -1.0


class PayPerModule:
    """A reward of a user's."""

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        return "modules", "end"

    def layouts(self, transition: Transition) -> tuple[Layout, ...]:
        return ()

    def __call__(self, transition: Transition, loads: object) -> dict[str, float]:
        return {"modules": float(len(transition.after)), "end": -7.0 * transition.ended}


def test_a_reward_of_ones_own_names_its_terms() -> None:
    env = make(reward=PayPerModule())
    steps = play(env, seed=1)
    assert [step[1] for step in steps[1:]] == [1.0, 2.0, 3.0 - 7.0]
    terms = {"modules": 3.0, "end": -7.0, "invalid_actions": 0.0}
    assert steps[-1][4]["reward_terms"] == terms


class PayAtTheEnd:
    """A reward of a user's of many turns at once."""

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        return "first", "end"

    def paid(self, begins: np.ndarray, ended: np.ndarray, reductions: FloatArray) -> FloatArray:
        return np.stack((3.0 * begins, 10.0 * ended + reductions), axis=1)


def test_a_reward_of_ones_own_may_be_of_many_turns_at_once() -> None:
    steps = play(make(reward=PayAtTheEnd()), seed=1)
    reduction = steps[-1][4]["reduction"]
    assert [step[1] for step in steps[1:]] == [3.0, 0.0, 10.0 + reduction]
    terms = {"first": 0.0, "end": 10.0 + reduction, "invalid_actions": 0.0}
    assert steps[-1][4]["reward_terms"] == terms


class PaysOneNumber(PayAtTheEnd):
    """A reward that names two terms and pays one number a turn, which both would get."""

    def paid(self, begins: np.ndarray, ended: np.ndarray, reductions: FloatArray) -> FloatArray:
        return reductions


def test_a_reward_pays_as_many_numbers_as_it_has_terms() -> None:
    env = make(reward=PaysOneNumber())
    env.reset(seed=1)
    with pytest.raises(BlastEnvError, match=r"of shape \(1,\), must be \(1, 2\): \(turns, terms\)"):
        env.step(0)


def test_a_class_is_no_reward() -> None:
    with pytest.raises(BlastEnvError, match="reward is the class PayAtTheEnd, must be an object"):
        make(reward=PayAtTheEnd)


class AnyCharges:
    """Threats of a user's, in lists."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> list[Any]:
        return [scenario.sample_charge(rng)]

    def shown(self, scenario: Scenario, charges: Any) -> list[Any]:
        return [*scenario.charge]


def test_threats_of_ones_own_may_be_lists() -> None:
    assert len(play(make(threat=AnyCharges()), seed=1)[-1][4]["charges"]) == 1


class NamesOnly:
    """No reward: it names its terms and pays nothing."""

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        return ("end",)


def test_an_object_that_pays_nothing_is_no_reward() -> None:
    with pytest.raises(BlastEnvError, match="must have all methods of `Reward` or `EndReward`"):
        make(reward=NamesOnly())


class CountOfModules:
    """An observation of a user's: a number, and how it is made for an episode."""

    def space(self, scenario: Scenario) -> spaces.Box:
        return spaces.Box(0.0, 1e6, (1,), np.float32)

    def episode(self, observable: Observable) -> "CountOfModules":
        assert len(observable.sources) == 1  # the charge is visible
        return self

    def observe(self, placement: LayoutState) -> np.ndarray:
        return np.array([len(placement.layout)], dtype=np.float32)


def test_an_observation_of_ones_own_is_seen() -> None:
    env = make(observation=CountOfModules())
    assert env.observation_space == CountOfModules().space(small_scenario())
    assert [float(step[0][0]) for step in play(env, seed=1)] == [0.0, 1.0, 2.0, 3.0]


def test_a_reward_must_not_name_the_term_of_the_environment() -> None:
    class Reserved(PayPerModule):
        def terms(self, scenario: Scenario) -> tuple[str, ...]:
            return ("invalid_actions",)

    with pytest.raises(BlastEnvError, match="'invalid_actions', which the environment adds"):
        make(reward=Reserved()).reset(seed=1)


def test_a_reward_must_have_the_terms_that_it_names() -> None:
    class Other(PayPerModule):
        def terms(self, scenario: Scenario) -> tuple[str, ...]:
            return "modules", "last"

    env = make(reward=Other())
    env.reset(seed=1)
    with pytest.raises(BlastEnvError, match=r"terms modules, end, must have .*: modules, last"):
        env.step(0)


def test_hidden_threats_count_as_their_mean_or_their_worst() -> None:
    impulses = {}
    measures: dict[str, dict] = {
        "mean": {},
        "half": {"risk": "cvar", "cvar_level": 0.5},
        "worst": {"risk": "cvar", "cvar_level": 0.99},
        "own": {"risk": lambda impulses: 3.0 * impulses[0]},
    }
    for name, arguments in measures.items():
        env = make(threat="hidden", threats=4, **arguments)
        info = play(env, seed=2, blast_seed=10)[-1][4]
        impulses[name] = info["impulse_pa_s"]
        assert info["blast_seeds"] == ((10,), (11,), (12,), (13,))
        assert len(set(info["charges"])) > 1
    evaluator = BlastEvaluator(small_scenario(), ThinEngine())
    loads_pa_s = [
        evaluator.loads(info["layout"], LoadCase(charge, seed)).protected_impulse_pa_s
        for charge, (seed,) in zip(info["charges"], info["blast_seeds"], strict=True)
    ]
    assert impulses["mean"] == pytest.approx(np.mean(loads_pa_s))
    assert impulses["half"] == pytest.approx(np.mean(sorted(loads_pa_s)[2:]))
    assert impulses["worst"] == pytest.approx(max(loads_pa_s))
    assert impulses["own"] == pytest.approx(3.0 * loads_pa_s[0])


def test_one_seed_repeats_exactly_in_two_environments_and_after_a_reset() -> None:
    env, twin = make(observation="features"), make(observation="features")
    first, second, again = play(env, 3), play(twin, 3), play(env, 3)
    assert same(first, second)
    for case in (first, again):
        for count in ("blasts", "cache_hits", "cache_hit_rate"):  # these go on
            del case[-1][4][count]
    assert same(first, again)
    assert not same(first[-1][4]["charges"], play(env, 4)[-1][4]["charges"])


def test_the_layout_does_not_change_the_blasts() -> None:
    env = make(threat="hidden", threats=2, realisations=2)
    ends = [play(env, seed=3, policy_seed=policy)[-1][4] for policy in (0, 1)]
    assert not same(ends[0]["layout"], ends[1]["layout"])
    assert ends[0]["charges"] == ends[1]["charges"]
    assert ends[0]["blast_seeds"] == ends[1]["blast_seeds"]
    assert ends[0]["unprotected_impulse_pa_s"] == ends[1]["unprotected_impulse_pa_s"]


def test_episodes_without_a_seed_follow_from_the_first_seed() -> None:
    drawn = []
    for env in (make(), make()):
        env.reset(seed=9)
        ends = []
        for _ in range(3):
            env.reset()
            ends.append(env.step(FINISH)[4]["blast_seeds"])
        drawn.append(ends)
    assert drawn[0] == drawn[1]
    assert len(set(drawn[0])) == 3


def test_options_fix_charge_layout_and_seeds() -> None:
    env = make()
    options = {
        "charge_position_m": np.array([2.0, 8.0]),
        "tnt_kg": 50,
        "charge_height_m": 1.5,
        "layout": [(0, 0), np.array([1, 1])],
        "blast_seed": 77,
    }
    _, info = env.reset(seed=1, options=options)
    assert not info["action_mask"][[0, COLUMNS + 1]].any()
    _, _, _, _, info = env.step(FINISH)
    assert info["charges"] == (((2.0, 8.0), 50.0, 1.5),)
    assert info["blast_seeds"] == ((77,),)
    assert env.placement.layout == ((0, 0), (1, 1))


def test_modules_keep_clear_of_a_charge_that_an_option_puts_into_the_zone() -> None:
    env = make()
    _, info = env.reset(seed=1, options={"charge_position_m": (8.0, 10.0)})
    assert not info["action_mask"][5 * COLUMNS + 2]
    assert "closer than the charge's radius" in str(env.explain((5, 2)))
    assert info["action_mask"].sum() > 20
    assert play(env, seed=1, charge_position_m=(8.0, 10.0))[-1][4]["impulse_psi_s"] > 0.0


# --- Environments that draw a scenario at every reset.


def site(shift: int) -> Scenario:
    """Return a small site with its house somewhere else, and another stock."""
    document = small_document(stock=2 + shift % 3)
    document["structures"][1]["corner_m"] = (14.0, 5.0 + 0.5 * (shift % 8))
    return Scenario.model_validate(document)


@dataclass
class Sites:
    """Draws small sites, or always the one that is given."""

    drawn: Scenario | None = None
    representative: Scenario = field(default_factory=small_scenario)

    def sample(self, rng: np.random.Generator) -> Scenario:
        return self.drawn or site(int(rng.integers(1000)))


def test_every_reset_draws_a_site_by_the_seed() -> None:
    env, twin = make(Sites()), make(Sites())
    hashes = []
    for seed in range(6):
        first, second = play(env, seed), play(twin, seed)
        assert same(first, second)
        hashes.append(first[-1][4]["scenario_hash"])
        assert first[-1][4]["placed"] == env.observable.scenario.zone.stock
    assert len(set(hashes)) > 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"site": {"width_m": 20.0, "height_m": 18.0}}, r"site .* is \(20.0, 18.0\), must be"),
        (
            {"build_zone": small_document(rows=7)["build_zone"]},
            r"build zone .* is \(7, 5\), must be \(8, 5\)",
        ),
        ({"build_zone": None}, "has no build zone"),
    ],
)
def test_a_site_of_another_size_is_an_error(change: dict, words: str) -> None:
    env = make(Sites(Scenario.model_validate(small_document() | change)))
    with pytest.raises(BlastEnvError, match=words):
        env.reset(seed=0)


# --- What environments, evaluations and searches remember of each other's blasts.


COUNTS = ("blasts", "cache_hits", "cache_hit_rate")


def without_counts(steps: list[tuple]) -> tuple[list[tuple], dict[str, Any]]:
    """Return the steps of an episode without the counts of blasts, and these."""
    return steps, {name: steps[-1][4].pop(name) for name in COUNTS}


def test_the_hit_rate_is_told() -> None:
    env = make()
    env.reset(seed=3)
    first = env.step(FINISH)[4]  # the layout is the empty one: one blast, asked for once
    assert {name: first[name] for name in COUNTS} == dict(zip(COUNTS, (1, 0, 0.0), strict=True))
    env.reset(seed=3)
    second = env.step(FINISH)[4]
    assert {name: second[name] for name in COUNTS} == dict(zip(COUNTS, (1, 1, 0.5), strict=True))


@pytest.mark.parametrize("kind", ["folder", "memory"])
def test_a_second_environment_needs_no_blast_and_says_the_same(kind: str, tmp_path: Path) -> None:
    cache = tmp_path / "blasts" if kind == "folder" else BlastStore(size=100)
    unprotected, _ = without_counts(play(make(), seed=5))
    first, first_counts = without_counts(play(make(cache=cache), seed=5))
    second, second_counts = without_counts(play(make(cache=cache), seed=5))
    assert same(unprotected, first)
    assert same(first, second)
    assert first_counts["cache_hit_rate"] == 0.0
    assert (second_counts["blasts"], second_counts["cache_hit_rate"]) == (0, 1.0)


def test_sites_that_the_memory_has_let_go_are_still_in_the_cache(tmp_path: Path) -> None:
    env = make(Sites(), cache=tmp_path)
    for seed in (*range(8), *range(8)):
        env.reset(seed=seed)
        info = env.step(FINISH)[4]
    assert info["cache_hit_rate"] >= 0.5


# --- The environment on gas dynamics: the same rules, one realisation, no calibration.


HUT = hut()


def on_gas(**options: Any) -> gym.Env:
    return gym.make(
        "BlastBarrierGas-v0", scenario=HUT, action="place", disable_env_checker=True, **options
    )


def test_an_episode_pays_the_loads_of_gas_dynamics() -> None:
    env = on_gas(render_mode="rgb_array")
    env.reset(seed=0, options={"layout": WALL[:-1]})
    zone = HUT.zone
    _, reward, ended, _, info = env.step(WALL[-1][0] * zone.columns + WALL[-1][1])
    assert ended
    expected = evaluate_layout(HUT, WALL, [0], engine="gas", cell_m=0.5)
    assert info["impulse_pa_s"] == pytest.approx(expected.impulse_pa_s.value)
    assert info["reduction"] == pytest.approx(expected.mean_reduction)
    assert reward == pytest.approx(info["reduction"] - 1.0)
    assert info["calibration"] == "none"
    assert "impulse_sim" not in info
    assert info["blasts"] == 2
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    assert picture.ndim == 3


def test_more_realisations_are_refused() -> None:
    with pytest.raises(BlastEnvError, match="realisations is 2, must be 1: gas has no noise"):
        on_gas(realisations=2)


def test_a_site_on_which_no_layout_pays_is_told_of() -> None:
    """Behind the windows of `guard_post` a small charge is no hazard."""
    document = load_scenario("guard_post").model_dump(mode="json", exclude_none=True)
    document["charge"][0]["tnt_kg"] = document["charge"][1]["tnt_kg"] = 2.0
    weak = Scenario.from_document(document, "guard_post")
    returns = []
    for actions in ((), (0, 500)):
        env = gym.make("BlastBarrier-v0", scenario=weak, engine="surrogate", action="place")
        env.reset(seed=0)
        paid = sum(float(env.step(np.int64(action))[1]) for action in actions)
        with pytest.warns(BlastEnvWarning, match="guard_post: by surrogate the facades reach"):
            _, reward, _, _, info = env.step(env.get_wrapper_attr("finish"))
        assert np.isnan(info["reduction"])
        assert bool(info["placed"]) == bool(actions)
        returns.append(paid + float(reward))
    assert returns[0] == returns[1]
