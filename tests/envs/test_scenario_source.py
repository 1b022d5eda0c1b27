"""Environments that draw a scenario at every reset."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation import Evaluators
from blast_env.site import Scenario
from tests.envs.small import ThinEngine, make, play, same, small_document, small_scenario

FINISH = 40


def site(shift: int) -> Scenario:
    """Return a small site with its house somewhere else, and another stock."""
    document = small_document(stock=2 + shift % 3)
    document["structures"][1]["corner_m"] = (14.0, 5.0 + 0.5 * (shift % 8))
    return Scenario.model_validate(document)


@dataclass
class Sites:
    """Draws small sites."""

    representative: Scenario = field(default_factory=small_scenario)

    def sample(self, rng: np.random.Generator) -> Scenario:
        return site(int(rng.integers(1000)))


@dataclass
class OneOf:
    """Draws a fixed scenario that is not of the size of the representative one."""

    scenario: Scenario
    representative: Scenario = field(default_factory=small_scenario)

    def sample(self, _: np.random.Generator) -> Scenario:
        return self.scenario


def test_every_reset_draws_a_site_by_the_seed() -> None:
    env, twin = make(Sites()), make(Sites())
    hashes = []
    for seed in range(6):
        first, second = play(env, seed), play(twin, seed)
        assert same(first, second)
        hashes.append(first[-1][4]["scenario_hash"])
        assert len(first[-1][4]["layout"]) == env.observable.scenario.zone.stock
    assert len(set(hashes)) > 3


def test_a_site_that_comes_again_is_remembered() -> None:
    evaluators = Evaluators(ThinEngine())
    first = evaluators.of(site(0))
    assert evaluators.of(site(1)) is not first
    assert evaluators.of(site(0)) is first


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"site": {"width_m": 20.0, "height_m": 18.0}}, r"site .* is \(20.0, 18.0\), must be"),
        ({"rows": 7}, r"build zone .* is \(7, 5\), must be \(8, 5\)"),
    ],
)
def test_a_site_of_another_size_is_an_error(change: dict, words: str) -> None:
    document = small_document()
    (document["build_zone"] if "rows" in change else document).update(change)
    env = make(OneOf(Scenario.model_validate(document)))
    with pytest.raises(BlastEnvError, match=words):
        env.reset(seed=0)


def test_a_site_without_a_zone_is_an_error() -> None:
    env = make(OneOf(small_scenario().model_copy(update={"build_zone": None})))
    with pytest.raises(BlastEnvError, match="has no build zone"):
        env.reset(seed=0)
