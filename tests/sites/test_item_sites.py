"""Sites with heights, catalogues and vehicles: `item_sites`, `BlastBarrierItemSites-v0`."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.planes import GridObservation
from blast_env.envs.strategies import check_size
from blast_env.errors import BlastEnvError
from blast_env.evaluation import draw_threats
from blast_env.geometry import Piece, Rectangle
from blast_env.layout import LayoutState, worst_places
from blast_env.site import Scenario
from blast_env.sites import (
    FAMILIES,
    HELD_OUT_SITES,
    ITEM_KINDS,
    ITEM_SITES,
    LARGE_SITES,
    POST,
    TARGETS,
    ItemSiteRanges,
    SiteSource,
    Visibility,
    close_ranges,
    cut_share_of,
    generate_site,
    large_ranges,
)
from tests.catalogue_sites import yard
from tests.envs.small import ThinEngine

RANGES = ItemSiteRanges()


@pytest.fixture(scope="module")
def item_sites() -> tuple[Scenario, ...]:
    return tuple(generate_site(seed, RANGES) for seed in range(16))


def test_a_seed_is_a_site_and_the_old_family_keeps_its_seeds(
    item_sites: tuple[Scenario, ...],
) -> None:
    assert generate_site(3, RANGES) == item_sites[3]
    assert len({site.content_hash for site in item_sites}) == len(item_sites)
    assert generate_site(3).zone.items == ()
    assert FAMILIES[ITEM_SITES] == RANGES


def test_everything_is_drawn(item_sites: tuple[Scenario, ...]) -> None:
    def differ(values: list[Any]) -> bool:
        return len(set(values)) > 1

    assert differ([bool(site.vehicles) for site in item_sites])
    assert differ(
        [sum(structure.protected for structure in site.structures) for site in item_sites]
    )
    assert differ([site.structures[0].height_m for site in item_sites])
    assert differ([site.zone.access_way is None for site in item_sites])
    assert differ([len(site.zone.keep_outs) for site in item_sites])
    assert differ([bool(site.zone.cost_areas) for site in item_sites])
    assert differ([site.objective.charges for site in item_sites])
    assert differ([site.zone.budget for site in item_sites])
    for number in range(len(ITEM_KINDS)):
        assert differ([site.zone.items[number].stock > 0 for site in item_sites])
        assert differ([site.zone.items[number].cost for site in item_sites]) or number in (0, 4)


def test_all_share_the_spaces(item_sites: tuple[Scenario, ...]) -> None:
    source = SiteSource.held_out(50, RANGES)
    assert source.representative.vehicles
    for site in item_sites:
        check_size(site, source.representative)
        assert [item.name for item in site.zone.items] == [kind.name for kind in ITEM_KINDS]
        assert site.zone.shape == (RANGES.zone_cells, RANGES.zone_cells)


def test_items_out_of_stock_are_masked(item_sites: tuple[Scenario, ...]) -> None:
    for site in item_sites:
        placement = LayoutState.empty(site)
        for legal, variant in zip(placement.legal, placement.catalogue.variants, strict=True):
            item = site.zone.items[variant.item]
            assert item.stock > 0 or not legal.any()
            assert (item.name != POST) or bool(site.vehicles) == (item.stock > 0)


def test_vehicles_come_near_and_can_be_kept_away(item_sites: tuple[Scenario, ...]) -> None:
    for site in item_sites:
        for source in site.vehicles:
            unprotected = worst_places(site, source)
            assert unprotected.stand_off_m < site.vehicle_ground(source).entry_stand_off_m - 2.0


def test_an_environment_draws_sites_with_and_without_vehicles() -> None:
    source = SiteSource.training(ranges=RANGES)
    env = gym.make(
        "BlastBarrierItemSites-v0", engine=ThinEngine(), realisations=1, observation="grid"
    ).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    assert env.task.source == source
    channels = GridObservation().channels_of(source.representative)
    seen = set()
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        scenario = env.observable.scenario
        assert env.observation_space.contains(observation)
        assert int(scenario.name.removeprefix("site_")) >= HELD_OUT_SITES
        reached = observation[channels.index("reach_without_barrier")].any()
        assert reached == bool(scenario.vehicles)
        seen.add(bool(scenario.vehicles))
    assert seen == {True, False}


def test_a_low_wall_cuts_the_lines_to_the_foot_of_a_building_alone() -> None:
    site = yard(budget=100.0)
    lines = Visibility.of(site)
    flat = len(lines.weight) // TARGETS
    assert len(lines.weight) == TARGETS * flat
    # Over one cell the lines to the upper third are five times as high as those to the lower one.
    crossed = lines.cut[:flat] & (lines.height_m[:flat] > 0.0)
    ratio = lines.height_m[2 * flat :][crossed] / lines.height_m[:flat][crossed]
    assert np.allclose(ratio, 5.0)
    wall = LayoutState.of(site, [Piece(5, 5, "wall", True)])
    posts = LayoutState.of(site, [Piece(row, 5, "post") for row in (5, 6, 7)])
    assert set(wall.cells) == set(posts.cells)
    assert cut_share_of(lines, wall) > cut_share_of(lines, posts) > 0.0
    assert lines.cut_share(wall.cells) >= cut_share_of(lines, wall)


def test_the_criterion_is_kept(item_sites: tuple[Scenario, ...]) -> None:
    assert all(ItemSiteRanges.criterion.objection(site) is None for site in item_sites[:4])


def test_large_sites_of_a_side_share_the_spaces_and_keep_the_criterion() -> None:
    source = SiteSource.held_out(ranges=FAMILIES[LARGE_SITES])
    for seed in range(1):
        site = source.site(seed)
        check_size(site, source.representative)
        assert (site.site.width_m, site.site.height_m) == (60.0, 60.0)
        assert ItemSiteRanges.criterion.objection(site) is None
        assert generate_site(seed, large_ranges()) == site
    assert source.representative.vehicles


@pytest.mark.parametrize("side_m", [40.0, 100.0])
def test_stand_offs_grow_with_large_sites(side_m: float) -> None:
    site = generate_site(0, large_ranges(side_m))
    assert site.site.width_m == side_m
    assert site.zone.shape == generate_site(0, large_ranges()).zone.shape
    for source in site.vehicles:
        assert 0.4 * side_m <= site.vehicle_ground(source).entry_stand_off_m <= 0.7 * side_m


@pytest.mark.parametrize("side_m", [16.0, 24.0])
def test_threats_are_closer_on_close_sites(side_m: float) -> None:
    for seed in range(2):
        site = generate_site(seed, close_ranges(side_m))
        assert site.site.width_m == site.site.height_m == side_m
        assert ItemSiteRanges.criterion.objection(site) is None
        assert generate_site(seed, close_ranges(side_m)) == site
        stand_offs_m = [
            Rectangle(*structure.rectangle_m).distance_to(
                threat.charge_against(site, ()).position_m
            )
            for threat in draw_threats(site, range(3))
            for structure in site.structures
            if structure.protected
        ]
        assert min(stand_offs_m) <= 0.55 * side_m < RANGES.stand_off_m[1]


@pytest.mark.parametrize(
    ("ranges", "side_m", "bounds"),
    [
        (close_ranges, 24.5, "16 to 24"),
        (large_ranges, 39.5, "40 to 100"),
    ],
)
def test_sides_out_of_bounds_are_refused(ranges: Any, side_m: float, bounds: str) -> None:
    with pytest.raises(BlastEnvError, match=f"side_m is {side_m:g}, must be {bounds}"):
        ranges(side_m)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"side_m": 16.0}, "side_m: is 16, must be at least"),
        ({"forecourt_m": (6.0, 20.0)}, "forecourt_m: is .* nothing could stop a vehicle"),
        ({"storeys": (1, 4)}, "storeys: is .* must be at most 9 m in all"),
        ({"budget": (0.0, 3.0)}, r"budget\[0\]: is 0.0: .* greater than or equal to 0.1"),
    ],
)
def test_ranges_without_room_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        ItemSiteRanges(**changes)
