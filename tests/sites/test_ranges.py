"""Ranges of sites: every wrong value is an error with its bound."""

from typing import Any

import pytest

from blast_env.errors import BlastEnvError
from blast_env.sites import SiteRanges


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"side_m": 36.2}, r"side_m: is 36.2, must be a multiple of 0.5"),
        ({"side_m": 1.0}, r"side_m: is 1.0: .* greater than or equal to 2"),
        (
            {"tnt_kg": (20.0, 10.0)},
            r"tnt_kg: is .*20.0, 10.0.*, must be a pair \(lowest, highest\)",
        ),
        ({"stand_off_m": (12.1, 12.4)}, r"12.1, 12.4.*, must have a multiple of 0.5 m between"),
        ({"parking_probability": 1.5}, r"parking_probability: is 1.5: .* less than or equal to 1"),
        ({"stock": (8.0, 9.0)}, r"stock\[0\]: is 8.0: .* valid integer"),
        ({"stock": (0, 9)}, r"stock\[0\]: is 0: .* greater than or equal to 1"),
        ({"stok": (1, 9)}, r"stok: unknown key, did you mean 'stock'"),
        ({"preset": "balistic"}, r"preset: is 'balistic', .*did you mean 'ballistic'"),
    ],
)
def test_a_value_out_of_bounds_is_named_with_its_bound(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BlastEnvError, match=rf"SiteRanges: .*{words}"):
        SiteRanges(**changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"side_m": 20.0}, r"side_m: is 20, must be at least 26, .* least stand-off"),
        ({"zone_side_m": 25.0}, r"side_m: is 36, must be at least 40, .* build zone"),
        ({"road_length_m": (8.0, 40.0)}, r"side_m: is 36, must be at least 42, .* longest road"),
        ({"facade_m": (8.0, 35.0)}, r"side_m: is 36, must be at least 37, .* longest facade"),
        (
            {"zone_from_threat_m": (3.0, 12.0)},
            r"zone_from_threat_m: is \(3.0, 12.0\), must be less than 12, the least stand_off_m",
        ),
    ],
)
def test_what_has_no_room_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        SiteRanges(**changes)


def test_a_parking_area_that_never_is_needs_no_room() -> None:
    assert SiteRanges(side_m=25.0, parking_probability=0.0).side_m == 25.0
    with pytest.raises(BlastEnvError, match="must be at least"):
        SiteRanges(side_m=25.0, parking_probability=0.1)
