"""Houses and people: the Green Book's curves at points, their limits, and levels of protection."""

import numpy as np
import pytest

from blast_env.response.buildings import (
    BuildingDamage,
    LevelOfProtection,
    building_damage_probability,
    eardrum_peak_pa,
    eardrum_rupture_probability,
    ground_thresholds,
    level_of_protection,
)
from blast_env.response.walls import DamageLevel


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
    assert eardrum_rupture_probability(nothing) == [0.0]


def test_half_of_the_eardrums_at_43_kpa() -> None:
    assert eardrum_rupture_probability(np.array([43.5e3])) == pytest.approx([0.5], abs=0.01)


def test_levels_of_protection() -> None:
    assert level_of_protection(DamageLevel.SUPERFICIAL) is LevelOfProtection.HIGH
    assert level_of_protection(DamageLevel.HAZARDOUS) is LevelOfProtection.VERY_LOW
    assert level_of_protection(DamageLevel.BLOWOUT).label == "below standards"


def test_thresholds_on_the_ground_say_their_source_and_go_up() -> None:
    peaks = [each.peak_pa for each in ground_thresholds()]
    assert peaks == sorted(peaks)
    assert all("19" in each.source for each in ground_thresholds())
    for share in (0.01, 0.5, 0.99):
        found = eardrum_rupture_probability(np.array([eardrum_peak_pa(share)]))
        assert found.item() == pytest.approx(share)
