"""Splits of tasks: what can be drawn by whom."""

import pytest

from blast_env.benchmark import DEFINITIONS, Definition
from blast_env.errors import BlastEnvError
from blast_env.tools import BUDGET, Episodes, Session, TaskLists, Tasks
from tests.tools.row_session import BEST, session, walls

SECRET = "correct horse"


def test_test_sites_need_the_secret() -> None:
    own, other = Tasks(SECRET), Tasks("another text")
    assert own.problem("test", 3) == Tasks(SECRET).problem("test", 3)
    assert own.problem("test", 3) != other.problem("test", 3)
    assert own.problem("train", 3) == other.problem("train", 3) == Tasks().problem("train", 3)
    seeds = [int(own.problem("test", index).site.partition("_")[2]) for index in range(20)]
    assert len(set(seeds)) == 20
    assert min(seeds) > 2**61
    with pytest.raises(BlastEnvError, match="start the server with a secret"):
        Tasks().problem("test", 0)
    assert SECRET not in repr(own)


def test_splits_have_ends() -> None:
    tasks = Tasks()
    assert tasks.count("test") == 0
    assert tasks.problem("benchmark", 0).name == next(iter(DEFINITIONS))
    for split, index, message in (
        ("benchmark", len(DEFINITIONS), "index is 11"),
        ("train", -1, "index is -1"),
        ("trial", 0, "no split 'trial'"),
    ):
        with pytest.raises(BlastEnvError, match=message):
            tasks.problem(split, index)
    with pytest.raises(BlastEnvError, match="8"):
        Tasks("short")


def test_resets_go_on_from_the_first() -> None:
    tasks = Tasks()
    assert tasks.resets("benchmark", 3)[2:] == tasks.resets("benchmark", 1, first=2)
    with pytest.raises(BlastEnvError, match="index is 11"):
        tasks.resets("benchmark", 2, first=len(DEFINITIONS) - 1)


def test_lists_tell_no_site() -> None:
    lists = TaskLists(Tasks(SECRET))
    assert lists.list_splits() == ["train", "test", "benchmark"]
    assert TaskLists(Tasks()).list_splits() == ["train", "benchmark"]
    assert lists.get_task("test", 3) == {"id": "test-3", "split": "test", "index": 3}
    assert lists.get_task_range("test", 2, 4) == [
        lists.get_task("test", 2),
        lists.get_task("test", 3),
    ]
    assert len(lists.list_tasks("benchmark")) == lists.num_tasks("benchmark") == len(DEFINITIONS)
    for index in (-1, len(DEFINITIONS)):
        with pytest.raises(IndexError, match=f"no problem {index}"):
            lists.get_task("benchmark", index)


def test_rewards_of_an_episode_sum_to_its_score() -> None:
    """A step before a reset, an illegal one and one after the end have none."""
    episodes = Episodes(Tasks(session=lambda _, seed, budget: session(seed, budget)))
    early = episodes.step("look", {})
    assert (early.done, early.error) == (True, "no episode has begun: call reset")
    first = episodes.reset({"budget": 2})
    assert first.result is not None
    assert first.result["blasts_left"] == 2
    turns = [
        episodes.step("submit", {"layout": "all"}),
        episodes.step("blast", {"layout": walls(BEST[0])}),
        episodes.step("submit", {"layout": walls(*BEST)}),
        episodes.step("submit", {"layout": walls(*BEST)}),
    ]
    assert [turn.reward for turn in turns] == [0.0, 0.0, 1.0, 0.0]
    assert [turn.done for turn in turns] == [False, False, True, True]
    assert [bool(turn.error) for turn in turns] == [True, False, False, True]
    assert episodes.steps == 4
    episodes.close()


def test_to_prepare_looks_at_a_site_with_a_vehicle_and_spends_nothing() -> None:
    begun: list[Session] = []

    def kept(definition: Definition, seed: int, budget: int) -> Session:
        begun.append(Session(definition, seed, budget))
        return begun[-1]

    Tasks(session=kept).prepare()
    assert ["vehicle" in own.problem_name for own in begun] == [True]
    assert begun[0].look().blasts_left == BUDGET
