"""Damage of bays, houses and people: curves at points, limits, levels of protection."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from blast_env.response import (
    Alternatives,
    Bay,
    BuildingDamage,
    DamageLevel,
    FacadeBay,
    Glazing,
    LevelOfProtection,
    TriangularLoads,
    bay_damages,
    building_damage_probability,
    catalogue,
    eardrum_peak_pa,
    fails_from,
    ground_thresholds,
    level_of,
    level_of_protection,
    respond,
)

BAY = Bay("office", "west", 1, 1, 0.0, 3.0, 0.0, 3.5)
PEAKS_PA = np.geomspace(1e3, 200e3, 40)
DURATION_S = 0.012


def filled(name: str) -> FacadeBay:
    component = catalogue()[name]
    if isinstance(component, Glazing):
        return FacadeBay(BAY, component)
    return FacadeBay(BAY, None, component)


def alternatives(*names: str) -> Alternatives:
    bays = {name: filled(name) for name in names}
    return Alternatives(
        BAY.name,
        BAY.structure,
        {name: bay for name, bay in bays.items() if bay.glazing is not None},
        {name: bay for name, bay in bays.items() if bay.wall is not None},
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


def test_bays_with_panes_of_one_name_respond_by_their_own_sizes() -> None:
    """Those of the second facade had the damage of the first one's panes."""
    small = alternatives("window_annealed_6")
    ((name, own),) = small.glazing.items()
    assert own.glazing is not None
    wide = replace(own, glazing=own.glazing.model_copy(update={"width_m": 2.4}))
    large = replace(small, glazing={name: wide})
    alone = [TriangularLoads([bay]).damages(6e3, 60.0)[0].damage for bay in (small, large)]
    assert alone[0] != alone[1]
    together = TriangularLoads([small, large]).damages(6e3, 60.0)
    assert [found.damage for found in together] == alone


def test_a_long_training_does_not_keep_every_response() -> None:
    """It had kept those of all loads that it ever met."""
    many = TriangularLoads([alternatives("window_annealed_6")] * 9_000)
    sizes = []
    for number in range(4):
        peaks_pa = np.linspace(2e3, 3e4, 9_000) + number
        first = many.damages(peaks_pa, 150.0)[0]
        sizes.append(len(pickle.dumps(many)))
    assert sizes[1] > 1.5 * sizes[0]
    assert sizes[2] == pytest.approx(sizes[0], rel=0.02)
    assert first == many.damages(peaks_pa, 150.0)[0]


# --- Houses and people: the Green Book's curves at points, their limits, and levels of protection.


def test_collapse_by_impulse_alone() -> None:
    """Between 270 and 500 Pa s it goes from 9 to 58 %; above 1,000 it hardly moves."""
    impulse = np.array([270.0, 500.0, 1000.0, 1500.0])
    found = building_damage_probability(BuildingDamage.COLLAPSE, np.full(4, 1e9), impulse)
    assert found == pytest.approx([0.093, 0.582, 0.973, 0.998], abs=1e-3)


def test_half_of_the_houses_at_the_constants_of_the_curve() -> None:
    pressure = np.array([4600.0, 17500.0, 40000.0])
    for damage, peak_pa in zip(BuildingDamage, pressure, strict=True):
        found = building_damage_probability(damage, np.array([peak_pa]), np.array([1e9]))
        assert found == pytest.approx([0.5])


def test_worse_damage_is_never_likelier() -> None:
    peak_pa, impulse = np.geomspace(1e3, 1e6, 30), np.geomspace(10.0, 5000.0, 30)
    minor, major, collapse = (
        building_damage_probability(damage, peak_pa, impulse) for damage in BuildingDamage
    )
    assert np.all(minor >= major - 1e-3)  # both are 1 in the end
    assert np.all(major >= collapse - 1e-3)


def test_no_load_no_damage() -> None:
    nothing = np.zeros(1)
    assert building_damage_probability(BuildingDamage.MINOR, nothing, nothing) == [0.0]


def test_half_of_the_eardrums_at_43_kpa() -> None:
    assert eardrum_peak_pa(0.5) == pytest.approx(43.5e3, rel=0.01)


def test_levels_of_protection() -> None:
    assert level_of_protection(DamageLevel.SUPERFICIAL) is LevelOfProtection.HIGH
    assert level_of_protection(DamageLevel.HAZARDOUS) is LevelOfProtection.VERY_LOW
    assert level_of_protection(DamageLevel.BLOWOUT).label == "below standards"


def test_thresholds_on_the_ground_say_their_source_and_go_up() -> None:
    peaks = [ground_threshold.peak_pa for ground_threshold in ground_thresholds()]
    assert peaks == sorted(peaks)
    assert all("19" in ground_threshold.source for ground_threshold in ground_thresholds())
    for share in (0.01, 0.5, 0.99):
        probit = -15.6 + 1.93 * np.log(eardrum_peak_pa(share))
        assert norm.cdf(probit - 5.0) == pytest.approx(share)
