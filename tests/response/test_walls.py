"""Wall panels: strengths by hand, load-mass factors of Biggs, levels of damage."""

import numpy as np
import pytest

from blast_env.response.walls import (
    CONCRETE_LIMITS,
    DamageLevel,
    Masonry,
    Panel,
    ReinforcedConcrete,
    Sheeting,
    Supports,
    damage_level,
    load_mass_factors,
    panel_responses,
)

STEEL = Sheeting(moment_n=3000.0, bending_stiffness_n_m=1.2e5, mass_kg_m2=45.0, material="steel")


@pytest.mark.parametrize(
    ("supports", "elastic", "plastic"),
    [
        (Supports.SIMPLE, 0.78, 0.66),
        (Supports.FIXED, 0.77, 0.66),
        (Supports.CANTILEVER, 0.65, 0.66),
    ],
)
def test_load_mass_factors_of_biggs(supports: Supports, elastic: float, plastic: float) -> None:
    """Introduction to Structural Dynamics, tables 5.1 to 5.3, to two digits as printed there."""
    assert load_mass_factors(supports) == pytest.approx((elastic, plastic), abs=0.011)


def test_strength_of_a_simple_panel_by_hand() -> None:
    resistance = Panel(STEEL, 3.0).system.resistance
    assert resistance.cap_pa == pytest.approx(8.0 * 3000.0 / 9.0)
    assert resistance.stiffness_pa_m == pytest.approx(384.0 * 1.2e5 / (5.0 * 81.0))


def test_fixed_ends_give_twice_the_strength_and_the_equivalent_stiffness_of_ufc() -> None:
    """307 E I / L^4 stands for both elastic slopes (UFC 3-340-02, table 3-8)."""
    simple, fixed = (
        Panel(STEEL, 3.0, each).system.resistance for each in Supports if each != "cantilever"
    )
    assert fixed.cap_pa == pytest.approx(2.0 * simple.cap_pa)
    assert fixed.stiffness_pa_m == pytest.approx(307.0 * 1.2e5 / 81.0, rel=0.01)


def test_concrete_moment_by_hand() -> None:
    section = ReinforcedConcrete(thickness_m=0.2)
    force = 0.003 * 0.165 * 500e6 * 1.17
    block = force / (0.85 * 30e6 * 1.17)
    assert section.moment_n == pytest.approx(force * (0.165 - block / 2.0))


def triangle(peak_pa: float, impulse_pa_s: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
    end_s = 2.0 * impulse_pa_s / peak_pa
    return np.array([0.0, end_s]), np.tile([peak_pa, 0.0], (rows, 1))


def test_damage_goes_up_with_the_load_level_by_level() -> None:
    panel = Panel(ReinforcedConcrete(thickness_m=0.2), 3.5)
    levels = [
        panel_responses([panel], *triangle(peak, impulse, 1)).levels[0]
        for peak, impulse in ((20e3, 250.0), (96e3, 714.0), (509e3, 1577.0), (3e6, 6000.0))
    ]
    assert levels[0] == DamageLevel.SUPERFICIAL
    assert levels == sorted(levels)
    assert levels[-1] == DamageLevel.BLOWOUT


def test_masonry_cracks_and_falls_where_concrete_stands() -> None:
    brick, concrete = (
        Panel(Masonry(thickness_m=0.215), 3.0),
        Panel(ReinforcedConcrete(thickness_m=0.2), 3.0),
    )
    found = panel_responses([brick, concrete], *triangle(57e3, 521.0, 2))
    assert found.motion.cracked.tolist() == [1.0, 0.0]
    assert found.levels[0] == DamageLevel.BLOWOUT
    assert found.levels[1] <= DamageLevel.MODERATE


def test_damage_between_limits_is_even_and_the_worse_measure_decides() -> None:
    measure = CONCRETE_LIMITS.measure(
        np.array([0.5, 3.0, 3.0, 50.0]), np.array([0.1, 1.0, 3.5, 12.0])
    )
    assert measure == pytest.approx([0.5, 1.5, 2.5, 5.0 - 10.0 / 12.0])
    assert damage_level(measure) == [
        DamageLevel.SUPERFICIAL,
        DamageLevel.MODERATE,
        DamageLevel.HEAVY,
        DamageLevel.BLOWOUT,
    ]


def test_rotation_of_supports() -> None:
    assert Panel(STEEL, 2.0).rotation_deg(np.array([1.0])) == pytest.approx([45.0])
    assert Panel(STEEL, 2.0, Supports.CANTILEVER).rotation_deg(np.array([2.0])) == pytest.approx(
        [45.0]
    )


def test_the_support_carries_half_of_the_yield_resistance() -> None:
    panel = Panel(ReinforcedConcrete(thickness_m=0.15), 3.5)
    found = panel_responses([panel], *triangle(200e3, 2000.0, 1))
    assert found.ductility[0] > 1.0
    cap_pa = panel.system.resistance.cap_pa
    assert found.support_force_n_m[0] == pytest.approx(0.5 * 3.5 * cap_pa, rel=1e-3)


def test_the_stress_of_steel_grows_with_the_rotation_of_the_supports() -> None:
    """UFC 3-340-02, table 4-2, by hand: 420 and 620 MPa."""
    section = ReinforcedConcrete(thickness_m=0.2, steel_pa=420e6, steel_ultimate_pa=620e6)
    yields, ultimate = 1.17 * 420e6, 1.05 * 620e6
    stresses = [section.design_stress_pa(each) for each in (2.0, 4.0, 8.0)]
    expected = [yields, yields + 0.25 * (ultimate - yields), 0.5 * (yields + ultimate)]
    assert stresses == pytest.approx(expected)
    class_b = ReinforcedConcrete(thickness_m=0.2)
    assert class_b.design_stress_pa(8.0) == class_b.design_stress_pa(0.0)


def test_hardening_and_a_membrane_hold_a_panel_back() -> None:
    plain, hard, held = (
        ReinforcedConcrete(thickness_m=0.15, steel_pa=420e6, **more)
        for more in (
            {"steel_ultimate_pa": 420e6},
            {"steel_ultimate_pa": 800e6},
            {"steel_ultimate_pa": 420e6, "tension_membrane": True},
        )
    )
    panels = [Panel(each, 3.5) for each in (plain, hard, held)]
    found = panel_responses(panels, *triangle(400e3, 2000.0, 3))
    assert 8.0 < found.rotation_deg[0] < 30.0
    assert found.rotation_deg[1] < 0.95 * found.rotation_deg[0]
    assert found.rotation_deg[2] < 0.75 * found.rotation_deg[0]
    small = panel_responses(panels, *triangle(400e3, 400.0, 3))
    assert small.rotation_deg[0] < 2.0
    assert small.rotation_deg[1] == small.rotation_deg[0]
