"""The cost of a cluster: the share of the ideal that the widths of a search allow."""

import pytest

from blast_env.evaluation.engines import find_engine
from blast_env.surrogate import SurrogateEngine
from studies.cluster import SearchCost, search_cost


@pytest.mark.parametrize(
    ("widths", "workers", "share"),
    [((4, 4), 2, 1.0), ((5, 5), 2, 10 / 12), ((1, 3), 4, 4 / 8), ((1,) * 7, 1, 1.0)],
)
def test_workers_wait_for_the_last_round_of_each_batch(
    widths: tuple[int, ...], workers: int, share: float
) -> None:
    assert SearchCost((), widths, 0.0).share(workers) == pytest.approx(share)


def test_widths_add_up_to_the_blasts_of_the_search() -> None:
    found = search_cost("control_room", find_engine(SurrogateEngine()), "genetic", 30)
    assert sum(found.widths) == 30
    assert len(found.widths) > 2
    assert found.layout
