"""The stores that are measured against each other do the same."""

from pathlib import Path

import pytest

from studies.scale import STORES


@pytest.mark.parametrize("name", STORES)
def test_a_store_gives_what_it_was_given_and_lets_the_oldest_go(name: str, tmp_path: Path) -> None:
    """So that the table compares like with like."""
    store = STORES[name](tmp_path, 40_000)
    for number in range(10):
        store.put(f"blast {number}", bytes([number]) * 2_000)
    assert len(store) == 10
    assert [store.get(f"blast {number}") for number in (3, 12)] == [b"\x03" * 2_000, None]
    again = STORES[name](tmp_path, 18_000)  # less than is there
    again.put("blast 10", b"new" * 100)
    assert again.get("blast 10") == b"new" * 100
    assert again.get("blast 3") == b"\x03" * 2_000  # was asked for
    assert again.get("blast 0") is None
    assert 6 <= len(again) <= 9
