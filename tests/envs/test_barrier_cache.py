"""What environments, evaluations and searches remember of each other's blasts."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.evaluation import BlastStore
from tests.envs.small import make, play, same
from tests.envs.test_scenario_source import Sites

FINISH = 40
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
