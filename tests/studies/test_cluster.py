"""The cost of a cluster: the share of the ideal that the widths of a search allow."""

import pytest

from studies.cluster import GUESSES, METHODS, SearchCost, search_cost


@pytest.mark.parametrize(
    ("widths", "workers", "share"),
    [((4, 4), 2, 1.0), ((5, 5), 2, 10 / 12), ((1, 3), 4, 4 / 8), ((1,) * 7, 1, 1.0)],
)
def test_workers_wait_for_the_last_round_of_each_batch(
    widths: tuple[int, ...], workers: int, share: float
) -> None:
    assert SearchCost((), widths, 0.0, 0.0).share(workers) == pytest.approx(share)


@pytest.mark.parametrize("method", METHODS)
def test_a_width_keeps_workers_at_work(method: str) -> None:
    """Widths add up to the blasts of the search, and a wider search leaves few workers idle."""
    found = {width: search_cost("control_room", GUESSES, method, 100, width) for width in (1, 4)}
    assert [sum(item.widths) for item in found.values()] == [100, 100]
    assert found[1].share(4) <= found[4].share(4)
    assert found[4].share(4) > 0.8  # a share of few blasts, whose layouts depend on guesses
    assert found[1].layout
