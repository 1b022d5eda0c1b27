"""The observation as a `Dict`: planes, vector and mask."""

from itertools import pairwise

import numpy as np
import pytest
from gymnasium import spaces

from blast_env.envs.observations import FeaturesObservation, ImageObservation
from blast_env.errors import UnknownNameError
from blast_env.site import Scenario
from tests.catalogue_sites import yard
from tests.envs.small import make, play, same, small_scenario
from tests.vehicle_sites import gate_site


@pytest.mark.parametrize("scenario", [small_scenario(), yard(), gate_site()])
def test_it_has_what_image_features_and_information_have(scenario: Scenario) -> None:
    """The vector has the values of `features` that belong to no cell and no structure."""
    engine = {} if scenario == small_scenario() else {"engine": "gas", "realisations": 1}
    envs = [make(scenario, observation=name, **engine) for name in ("dict", "image", "features")]
    (seen, info), (image, _), (features, _) = [env.reset(seed=3) for env in envs]
    space = envs[0].observation_space
    assert isinstance(space, spaces.Dict)
    assert list(space) == ["action_mask", "planes", "vector"]
    assert space["planes"] == ImageObservation().space(scenario)
    assert space["action_mask"] == spaces.MultiBinary(int(envs[0].action_space.n))  # type: ignore[attr-defined]
    assert seen in space
    assert same(seen["planes"], image)
    assert same(seen["action_mask"], info["action_mask"])
    assert same(seen["vector"][:11], features[:11])
    items = len(scenario.zone.catalogue.names) if scenario.zone.items else 0
    assert len(seen["vector"]) == 11 + 3 * items + bool(scenario.vehicles)
    if scenario.vehicles:
        assert seen["vector"][-1] == features[-1]
    assert FeaturesObservation().space(scenario).shape == features.shape


def test_mask_and_stock_change_with_the_layout() -> None:
    steps = play(make(observation="dict"), seed=1)
    for before, after in pairwise(steps):
        assert after[0]["vector"][0] < before[0]["vector"][0]
        assert same(after[0]["action_mask"], after[4]["action_mask"])
    assert steps[-1][0]["action_mask"].sum() == 1  # the charge has gone off


def test_a_run_of_training_takes_single_arrays() -> None:
    from blast_agents.training.run_folder import settings_from

    with pytest.raises(UnknownNameError, match="no observation 'dict'"):
        settings_from({"observation": "dict"})


def test_a_dictionary_of_ones_own_gets_the_mask_too() -> None:
    class Own:
        def space(self, scenario: Scenario) -> spaces.Dict:
            return spaces.Dict({"none": spaces.Box(0.0, 1.0, (1,), np.float32)})

        def episode(self, observable: object) -> "Own":
            return self

        def observe(self, placement: object) -> dict[str, np.ndarray]:
            return {"none": np.zeros(1, dtype=np.float32)}

    env = make(observation=Own())
    observation, info = env.reset(seed=0)
    assert observation in env.observation_space
    assert same(observation["action_mask"], info["action_mask"])
