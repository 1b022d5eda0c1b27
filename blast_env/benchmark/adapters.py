"""Problems in the form of two other collections: EngiBench's `Problem`, MCBO's tasks.

Neither is a dependency. Each function returns an instance of the collection's class.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from blast_env.arrays import FloatArray
from blast_env.benchmark.problem import BenchmarkProblem
from blast_env.errors import MissingExtraError


@dataclass(frozen=True)
class BlastConditions:
    """Conditions of an EngiBench problem: the name alone, since nothing can be varied."""

    problem: str


def engibench_problem(problem: BenchmarkProblem, seed: int = 0) -> Any:
    """Return a problem as an EngiBench problem whose designs are random keys.

    `simulate` returns the share of the load that remains, and spends blasts; `check_constraints`
    checks that keys are 0 to 1; `render` returns the layout; `optimize` is not implemented.

    Args:
        problem: The problem with its budget.
        seed: Seed of `random_design`.

    Raises:
        MissingExtraError: If EngiBench is not installed.
    """
    try:
        from engibench.core import ObjectiveDirection, Problem
    except ModuleNotFoundError as error:
        raise MissingExtraError("engibench is not installed: pip install engibench") from error

    class BlastProblem(Problem[Any]):  # type: ignore[misc]
        version = problem.definition.version
        objectives = (("share_of_load", ObjectiveDirection.MINIMIZE),)
        Conditions = Config = BlastConditions
        conditions = config = BlastConditions(problem.name)
        design_space = spaces.Box(0.0, 1.0, (problem.space.keys,), np.float64)
        dataset_id = "gas_blasts"  # blast_env.benchmark.data.load
        container_id = None

        def simulate(self, design: Any, config: Any = None) -> Any:  # noqa: ARG002
            return np.array([problem.evaluate(problem.space.from_keys(design))])

        def random_design(self) -> tuple[Any, int]:
            return self.np_random.random(problem.space.keys), -1

        def render(self, design: Any, *, open_window: bool = False) -> Any:  # noqa: ARG002
            return problem.space.from_keys(design)

    return BlastProblem(seed=seed)


def mcbo_task(problem: BenchmarkProblem) -> Any:
    """Return a problem as an MCBO task.

    The search space discretises the random keys. It has three variables per piece: a nominal one
    for the variant, and two integers for the row and the column.

    Raises:
        MissingExtraError: If MCBO is not installed.
    """
    try:
        from mcbo.tasks import TaskBase
    except ModuleNotFoundError as error:
        raise MissingExtraError("mcbo is not installed: see huawei-noah/HEBO") from error
    sizes = problem.space.key_sizes

    class BlastTask(TaskBase):  # type: ignore[misc]
        @property
        def name(self) -> str:
            return problem.name

        def evaluate(self, x: Any) -> Any:
            layouts = [problem.space.from_keys(self.keys(row)) for _, row in x.iterrows()]
            return np.array([[problem.evaluate(layout)] for layout in layouts])

        def keys(self, row: Any) -> FloatArray:
            """Return the random keys of a row of the search space."""
            return np.array(
                [(int(item) + 0.5) / sizes[index % 3] for index, item in enumerate(row)]
            )

        def get_search_space_params(self) -> list[dict[str, Any]]:
            params: list[dict[str, Any]] = []
            for piece in range(problem.space.most_pieces):
                what = [str(number) for number in range(sizes[0])]
                params.append({"name": f"what_{piece}", "type": "nominal", "categories": what})
                for axis, size in zip(("row", "column"), sizes[1:], strict=True):
                    bounds = {"lb": 0, "ub": size - 1}
                    params.append({"name": f"{axis}_{piece}", "type": "int", **bounds})
            return params

    return BlastTask()
