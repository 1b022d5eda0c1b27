"""Every object of a random town has the fate that it must have, once.

`pytest tests/io/importing/test_towns.py --hypothesis-profile many` imports 2,000 towns of each
format.
"""

from collections.abc import Mapping

import pytest
from hypothesis import given

from blast_env.io.importing import FATES, Fate, ImportOptions, SiteImport, import_site
from tests.io.importing.maps import DEGREE_M
from tests.io.importing.towns import (
    Item,
    Town,
    as_geojson,
    as_osm,
    incomplete,
    towns,
    without_shape,
)

_ROUNDING = 0.01
"""Degrees of latitude are shorter than those on the equator by half a per cent."""


def check(site: SiteImport, items: Mapping[str, tuple[Item, bool]]) -> None:
    """Hold the fates of all objects and the buildings against those known.

    What is outside the site is not of it, or merged before that is known.
    """
    fates: dict[str, list[Fate]] = {}
    for entry in site.ledger.of(*FATES):
        fates.setdefault(entry.place, []).append(entry.fate)
    assert fates.keys() == {place for place, (item, _) in items.items() if item.fate}
    for place, (item, on_site) in items.items():
        if item.fate is None:
            continue
        (fate,) = fates[place]
        if on_site or item.shape.is_empty:
            assert fate is item.fate, (place, item)
        else:
            assert fate is Fate.PASSED or fate is item.fate is Fate.MERGED, (place, item)
    assert site.ledger.objects == sum(item.fate is not None for item, _ in items.values())
    solids: dict[str, tuple[float, float, float]] = {}
    for building in site.buildings:
        area, _, _ = solids.get(building.place, (0.0, 0.0, 0.0))
        assert building.height_m is not None
        solid = area + building.outline.area, building.base_m, building.height_m
        solids[building.place] = solid
    expected = {place: item.solid for place, (item, on_site) in items.items() if on_site}
    assert solids.keys() == {place for place, solid in expected.items() if solid}
    for place, solid in solids.items():
        assert solid == pytest.approx(expected[place], rel=_ROUNDING), (place, items[place])


def options_of(town: Town, metres: float) -> ImportOptions:
    """Return the options of a site of some columns of a town, in the coordinates of its file."""
    width_m, height_m = town.size_m
    origin = 0.0 / metres, 0.0 / metres
    return ImportOptions(
        origin=origin, size_m=(width_m, height_m), protect=("House",), rotation_deg=0.0
    )


@given(towns(without_shape()))
def test_every_object_of_geojson_has_its_fate(
    tmp_path_factory: pytest.TempPathFactory, town: Town
) -> None:
    path, items = as_geojson(town, tmp_path_factory.mktemp("towns"))
    check(import_site(path, options_of(town, 1.0)), items)


@given(towns(incomplete()))
def test_every_object_of_an_extract_has_its_fate(
    tmp_path_factory: pytest.TempPathFactory, town: Town
) -> None:
    path, items = as_osm(town, tmp_path_factory.mktemp("towns"))
    check(import_site(path, options_of(town, DEGREE_M)), items)
