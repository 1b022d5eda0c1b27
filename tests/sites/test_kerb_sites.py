"""Sites along a kerb or a street: valid, of many sizes, like the small bundled ones."""

from functools import cache

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation import draw_threats
from blast_env.site import Scenario
from blast_env.sites import (
    KerbSiteRanges,
    court_site,
    generate_site,
    kerb_site,
    lane_site,
    low_site,
    square_site,
    street_site,
)

SEEDS = range(20_000, 20_012)


@cache
def sites() -> tuple[Scenario, ...]:
    return tuple(kerb_site(seed) for seed in SEEDS)


def test_a_seed_gives_its_site_and_no_other() -> None:
    assert kerb_site(SEEDS[0]) == sites()[0]
    assert len({site.content_hash for site in sites()}) == len(SEEDS)


def test_sizes_masses_and_threats_differ_within_their_bounds() -> None:
    sizes = {(site.site.width_m, site.site.height_m) for site in sites()}
    assert len(sizes) > len(SEEDS) // 2
    assert all(10.0 <= side <= 34.0 for size in sizes for side in size)
    masses = {source.tnt_kg for site in sites() for source in site.charge}
    assert min(masses) >= 15.0
    assert max(masses) <= 200.0
    assert max(masses) > 2.0 * min(masses)
    assert {source.kind for site in sites() for source in site.charge} == {"point", "vehicle"}
    assert {len(site.structures) for site in sites()} > {1, 2}


def test_the_charge_lies_outside_of_all_buildings() -> None:
    for site in sites():
        for threat in draw_threats(site, [0, 1]):
            x_m, y_m = threat.charge_against(site, ()).position_m
            for structure in site.structures:
                left, bottom, right, top = structure.rectangle_m
                assert not (left < x_m < right and bottom < y_m < top)


def test_a_side_out_of_bounds_is_an_error() -> None:
    with pytest.raises(BlastEnvError, match="along_m"):
        KerbSiteRanges(across_m=14.0, along_m=0.7)


def test_a_given_size_is_that_of_every_site() -> None:
    ranges = KerbSiteRanges(across_m=16.0, along_m=12.0)
    for seed in SEEDS[:3]:
        size = generate_site(seed, ranges).site
        assert {size.width_m, size.height_m} == {16.0, 12.0}


def test_a_vehicle_of_a_street_drives_along_the_front() -> None:
    for site in map(street_site, SEEDS[:6]):
        (source,) = site.vehicles
        (road,) = source.drivable
        front = next(structure for structure in site.structures if structure.protected)
        gaps_m = [
            max(low - end, start - high)
            for low, high, start, end in zip(
                road.rectangle_m[:2],
                road.rectangle_m[2:],
                front.rectangle_m[:2],
                front.rectangle_m[2:],
                strict=True,
            )
        ]
        assert 0.0 <= max(gaps_m) <= 2.0
        ends_m = {entry.start_m for entry in source.entries} | {
            entry.end_m for entry in source.entries
        }
        assert len(source.entries) == 2
        assert len(ends_m) == 4


def test_most_courts_have_a_wing_that_makes_a_corner_with_the_front() -> None:
    courts = tuple(map(court_site, SEEDS[:4]))
    wings = [
        (wing, front)
        for site in courts
        for wing in site.structures
        for front in site.structures
        if wing.name == "wing" and front.name == "building"
    ]
    assert len(wings) > len(courts) // 2
    for wing, front in wings:
        assert not wing.rectangle_m.overlaps(front.rectangle_m)
        assert wing.rectangle_m.grown(0.1).overlaps(front.rectangle_m)
    assert {len(site.structures) for site in courts} & {3, 4}


def test_on_squares_charges_may_go_off_past_the_ends_of_short_fronts() -> None:
    squares = tuple(map(square_site, SEEDS[:4]))
    assert {len(site.vehicles) for site in squares} == {0, 1}
    for site in squares:
        fronts = [structure for structure in site.structures if structure.protected]
        for front in fronts:
            _, bottom, _, top = front.rectangle_m
            assert top - bottom <= 0.5 * site.site.height_m + 0.5


def test_walls_of_the_stock_may_be_as_tall_as_low_buildings() -> None:
    margins_m = []
    for site in map(low_site, SEEDS[:4]):
        assert site.build_zone is not None
        tall_m = max(item.height_m for item in site.build_zone.items)
        fronts_m = [own.height_m or 0.0 for own in site.structures if own.protected]
        assert 2.5 <= min(fronts_m) <= max(fronts_m) <= 4.5
        margins_m.append(tall_m - min(fronts_m))
    assert max(margins_m) >= 0.0


def test_a_vehicle_in_a_lane_may_come_past_both_ends_of_short_fronts() -> None:
    for site in map(lane_site, SEEDS[:3]):
        (vehicle,) = site.vehicles
        (lane,) = vehicle.drivable
        along = int(np.argmax(lane.size_m))
        start_m, length_m = lane.corner_m[along], lane.size_m[along]
        for structure in site.structures:
            low_m, high_m = (structure.rectangle_m[number] for number in (along, along + 2))
            assert start_m <= low_m
            assert high_m <= start_m + length_m
            assert high_m - low_m <= 0.45 * length_m + 0.5
