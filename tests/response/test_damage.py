"""Damage of bays as numbers: in keeping with the verdict, and without a plain to get lost on."""

import numpy as np
import pytest

from blast_env.response.buildings import LevelOfProtection
from blast_env.response.components import Glazing, catalogue
from blast_env.response.damage import (
    Alternatives,
    TriangularLoads,
    bay_damages,
    fails_from,
    level_of,
)
from blast_env.response.facade import Bay, FilledBay, respond

BAY = Bay("office", "west", 1, 1, 0.0, 3.0, 0.0, 3.5)
PEAKS_PA = np.geomspace(1e3, 200e3, 40)
DURATION_S = 0.012


def filled(name: str) -> FilledBay:
    component = catalogue()[name]
    if isinstance(component, Glazing):
        return FilledBay(BAY, component)
    return FilledBay(BAY, None, component)


def alternatives(*names: str) -> Alternatives:
    each = {name: filled(name) for name in names}
    return Alternatives(
        BAY.name,
        BAY.structure,
        {name: bay for name, bay in each.items() if bay.glazing is not None},
        {name: bay for name, bay in each.items() if bay.wall is not None},
    )


@pytest.mark.parametrize("name", catalogue())
def test_damage_grows_with_the_load_and_agrees_with_the_level(name: str) -> None:
    bay = filled(name)
    time_s = np.array([0.0, DURATION_S, 2.0 * DURATION_S])
    pressure_pa = np.outer(PEAKS_PA, [1.0, 0.0, 0.0])
    found = respond([bay] * len(PEAKS_PA), time_s, pressure_pa)
    damage = found.glazing.hazard if bay.glazing is not None else found.walls.damage
    assert (np.diff(damage) > -1e-9).all()
    assert ((damage >= 0.0) & (damage < 5.0)).all()
    # Something to climb nearly everywhere: hardly two loads have the same damage.
    assert len(np.unique(damage.round(9))) > 0.75 * len(damage)
    for value, history in zip(damage.tolist(), pressure_pa, strict=True):
        alone = respond([bay], time_s, history[np.newaxis])
        assert level_of(value) == alone.level_of_protection


def test_a_level_fails_from_where_the_damage_stops_allowing_it() -> None:
    for level in LevelOfProtection:
        if level > LevelOfProtection.BELOW_STANDARDS:
            assert level_of(fails_from(level)) < level
            assert level_of(np.nextafter(fails_from(level), 0.0)) == level


def test_each_component_of_a_bay_gets_its_own_damage() -> None:
    bay = alternatives("window_annealed_6", "window_laminated_12", "brick_215")
    (found,) = TriangularLoads([bay]).damages(30e3, 180.0)
    assert set(found.damage) == {"window_annealed_6", "window_laminated_12", "brick_215"}
    assert found.damage["window_laminated_12"] < 2.0 < found.damage["window_annealed_6"]
    assert (found.area_m2, found.glazed_m2) == pytest.approx((10.5, 2 * 1.2 * 1.5))
    time_s = np.array([0.0, 0.012, 0.024])
    assert bay_damages([bay], time_s, np.array([[30e3, 0.0, 0.0]])) == (found,)
