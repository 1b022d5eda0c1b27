"""Problems as those of two other collections, which are no dependencies: their classes stand in."""

import sys
from enum import Enum
from types import ModuleType
from typing import Any, Generic, TypeVar

import numpy as np
import pandas as pd
import pytest

from blast_env.benchmark import make
from blast_env.benchmark.adapters import engibench_problem, mcbo_task
from blast_env.errors import MissingExtraError
from tests.benchmark.row import RowEngine

Design = TypeVar("Design")


class Problem(Generic[Design]):
    """What EngiBench's `Problem` does with its seed."""

    def __init__(self, seed: int) -> None:
        self.np_random = np.random.default_rng(seed)


@pytest.fixture(autouse=True)
def _collections(monkeypatch: pytest.MonkeyPatch) -> None:
    contents: dict[str, dict[str, Any]] = {
        "engibench": {},
        "engibench.core": {
            "Problem": Problem,
            "ObjectiveDirection": Enum("ObjectiveDirection", ["MINIMIZE"]),
        },
        "mcbo": {},
        "mcbo.tasks": {"TaskBase": object},
    }
    for name, content in contents.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


def test_designs_are_keys_and_simulations_spend_blasts() -> None:
    own = make("control_room-known-v2", 2, engine=RowEngine())
    found = engibench_problem(own, seed=1)
    design, _ = found.random_design()
    assert design in found.design_space
    (share,) = found.simulate(design)
    assert own.blasts == 1
    assert share == own.evaluate(found.render(design)) < 1.0
    assert own.blasts == 1


def test_a_row_of_integers_is_the_layout_of_its_pieces() -> None:
    own = make("control_room-known-v2", 2, engine=RowEngine())
    task = mcbo_task(own)
    params = task.get_search_space_params()
    assert len(params) == own.space.keys
    lowest = [0 if param["type"] == "int" else param["categories"][0] for param in params]
    highest = [param["ub"] if "ub" in param else param["categories"][-1] for param in params]
    rows = pd.DataFrame([lowest, highest], columns=[param["name"] for param in params])
    ends = [task.keys(row) for _, row in rows.iterrows()]
    assert all(((keys > 0.0) & (keys < 1.0)).all() for keys in ends)
    layouts = [own.space.from_keys(keys) for keys in ends]
    expected = [[own.evaluate(layout)] for layout in layouts]
    assert task.evaluate(rows).tolist() == expected


@pytest.mark.parametrize(
    ("adapter", "name"), [(engibench_problem, "engibench"), (mcbo_task, "mcbo")]
)
def test_a_collection_that_is_missing_is_named(
    adapter: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [module for module in sys.modules if module.partition(".")[0] == name]:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=f"{name} is not installed"):
        adapter(make("control_room-known-v2", engine=RowEngine()))
