"""`info` has one structure from `reset` to the end, so that tools can record it."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import blast_env
from blast_env.errors import LayoutError
from tests.catalogue_sites import WALL
from tests.envs.small import ThinEngine, make, play, small_scenario
from tests.envs.test_barrier_pieces import yard_env
from tests.libraries.ids import BARRIER_IDS, IDS, arguments


def structure(info: Any) -> Any:
    """Return the keys, shapes and types of nested information."""
    if isinstance(info, Mapping):
        return {key: structure(value) for key, value in info.items()}
    if isinstance(info, tuple):
        return tuple(map(structure, info))
    if isinstance(info, np.ndarray):
        return info.shape, info.dtype
    return type(info)


@pytest.mark.parametrize("name", IDS)
def test_all_steps_of_an_episode_have_one_structure(name: str) -> None:
    env = gym.make(name, **arguments(name))
    _, info = env.reset(seed=0)
    expected, ended = structure(info), False
    env.action_space.seed(0)
    while not ended:
        _, _, ended, _, info = env.step(env.action_space.sample())
        assert structure(info) == expected
    env.close()


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point"])
@pytest.mark.parametrize("name", BARRIER_IDS)
def test_all_steps_of_vectors_have_one_structure(name: str, mode: str) -> None:
    envs = gym.make_vec(name, 2, vectorization_mode=mode, **arguments(name))
    _, info = envs.reset(seed=0)
    expected = structure(info)
    envs.action_space.seed(0)
    for _ in range(6):
        *_, info = envs.step(envs.action_space.sample())
        assert structure(info) == expected
    envs.close()


def test_the_lowest_level_of_protection_has_a_name() -> None:
    """Without it, a site that fails looked as before the end."""
    env = gym.make("BlastBarrier-v0", scenario="clinic_front", engine="surrogate", action="place")
    _, info = env.reset(seed=0)
    assert info["level_of_protection"] == info["unprotected_level_of_protection"] == ""
    *_, info = env.step(env.action_space.n - 1)  # type: ignore[attr-defined]
    assert info["level_of_protection"] == info["unprotected_level_of_protection"]
    assert info["level_of_protection"] == "below standards"


def test_the_layout_of_the_information_is_one() -> None:
    """An array of a fixed size, that everything which takes a layout takes."""
    env = make()
    info = play(env, seed=1)[-1][4]
    by_layout, by_array = (
        blast_env.simulate(small_scenario(), case, engine=ThinEngine()).digest
        for case in (sorted(env.placement.layout), info["layout"])
    )
    assert by_layout == by_array


def test_pieces_in_the_information_are_a_layout() -> None:
    env = yard_env()
    _, info = env.reset(seed=0, options={"layout": WALL})
    catalogue = env.placement.catalogue
    assert info["placed"] == info["layout"].sum() == len(WALL)
    assert catalogue.layout_from(info["layout"]) == tuple(sorted(WALL))
    assert sorted(np.flatnonzero(info["layout"])) == sorted(map(catalogue.action, WALL))
    with pytest.raises(LayoutError, match=r"shape \(4, 14, 5\), must have \(4, 14, 6\)"):
        catalogue.layout_from(info["layout"][:, :, :-1])
    with pytest.raises(LayoutError, match="0 or 1"):
        catalogue.layout_from(2 * info["layout"])
