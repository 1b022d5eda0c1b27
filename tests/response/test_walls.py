"""Wall panels and pieces of a barrier: strengths by hand, energy, thresholds, damage."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from blast_env.errors import BlastEnvError
from blast_env.evaluation.questions.screening import stand_offs
from blast_env.response import (
    CONCRETE_LIMITS,
    DamageLevel,
    LevelOfProtection,
    Masonry,
    Panel,
    ReinforcedConcrete,
    RigidPiece,
    Sheeting,
    Stability,
    Supports,
    Wall,
    catalogue,
    damage_level,
    load_mass_factors,
    panel_responses,
    piece_responses,
)
from blast_env.response.kernels import move_piece
from blast_env.site import Charge

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
        Panel(STEEL, 3.0, support).system.resistance
        for support in Supports
        if support != "cantilever"
    )
    assert fixed.cap_pa == pytest.approx(2.0 * simple.cap_pa)
    assert fixed.stiffness_pa_m == pytest.approx(307.0 * 1.2e5 / 81.0, rel=0.01)


def test_concrete_moment_by_hand() -> None:
    section = ReinforcedConcrete(thickness_m=0.2)
    force = 0.003 * 0.165 * 500e6 * 1.17
    block = force / (0.85 * 30e6 * 1.17)
    assert section.moment_n == pytest.approx(force * (0.165 - block / 2.0))


def triangle(peak_pa: float, impulse_pa_s: float, rows: int = 1) -> tuple[np.ndarray, np.ndarray]:
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
    stresses = [section.design_stress_pa(value) for value in (2.0, 4.0, 8.0)]
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
    panels = [Panel(case, 3.5) for case in (plain, hard, held)]
    found = panel_responses(panels, *triangle(400e3, 2000.0, 3))
    assert 8.0 < found.rotation_deg[0] < 30.0
    assert found.rotation_deg[1] < 0.95 * found.rotation_deg[0]
    assert found.rotation_deg[2] < 0.75 * found.rotation_deg[0]
    small = panel_responses(panels, *triangle(400e3, 400.0, 3))
    assert small.rotation_deg[0] < 2.0
    assert small.rotation_deg[1] == small.rotation_deg[0]


# --- Pieces of a barrier as rigid bodies: energy, thresholds, anchors.


PIECE = RigidPiece(height_m=1.0, base_m=0.6, mass_kg_m=1000.0)


@pytest.mark.parametrize("impulse", [1200.0, 3000.0])
def test_an_impulse_slides_a_piece_until_friction_has_taken_its_energy(impulse: float) -> None:
    """M v^2 / 2 = mu M g x."""
    speed = impulse * PIECE.height_m / PIECE.mass_kg_m
    found = piece_responses([PIECE], *triangle(100.0 * impulse, impulse))
    assert found.slide_m[0] == pytest.approx(speed**2 / (2.0 * 0.5 * 9.81), rel=0.05)


def test_less_than_friction_and_weight_moves_nothing() -> None:
    force = 0.4 * PIECE.mass_kg_m * 9.81
    found = piece_responses([PIECE], np.array([0.0, 1.0]), np.full((1, 2), force))
    assert found.slide_m[0] == 0.0
    assert found.stability == [Stability.STANDS]


def test_the_impulse_that_overturns_by_energy() -> None:
    """I w^2 / 2 = M g (r - H / 2), with i H H / 2 = I w about an edge that holds."""
    piece = replace(PIECE, friction=2.0)
    inertia = piece.mass_kg_m * (1.0 + 0.36) / 3.0
    lift = 0.5 * (np.hypot(1.0, 0.6) - 1.0)
    impulse = inertia * np.sqrt(2.0 * piece.mass_kg_m * 9.81 * lift / inertia) / 0.5
    less, more = (
        piece_responses([piece], *triangle(500.0 * impulse, factor * impulse))
        for factor in (0.93, 1.07)
    )
    assert less.tilt[0] < 1.0 <= more.tilt[0]
    assert np.isinf(less.overturn_s[0])
    assert more.stability == [Stability.OVERTURNS]


@given(
    height_m=st.floats(0.5, 4.0),
    share=st.floats(0.1, 2.0),
    friction=st.floats(0.0, 1.5),
    impulse=st.floats(100.0, 1e4),
)
def test_a_piece_rocks_only_with_friction_above_base_over_height(
    height_m: float, share: float, friction: float, impulse: float
) -> None:
    """Less friction cannot lift it, however large the load is: it slides."""
    piece = RigidPiece(height_m, share * height_m, 1000.0, friction)
    found = piece_responses([piece], *triangle(100.0 * impulse, impulse))
    if friction < 0.999 * share:
        assert found.tilt[0] == 0.0
        speed = impulse * height_m / 1000.0
        if friction > 0.1:
            expected = speed**2 / (2.0 * friction * 9.81)
            assert found.slide_m[0] <= expected * 1.01 + 1e-3


def test_a_planter_of_one_metre_slides() -> None:
    """1 x 1 m with friction 0.5 under 20 kg at 3 m; its edge would have held with friction 2."""
    load = triangle(4e6, 3000.0)
    planter = RigidPiece.of_block(2.0, 1.0, 1.0)
    assert piece_responses([planter], *load).stability == [Stability.SLIDES]
    held = replace(planter, friction=2.0)
    assert piece_responses([held], *load).stability != [Stability.SLIDES]


def test_friction_at_the_edge_limits_the_moment() -> None:
    """From rest, theta'' = g (mu b - a) / (I / M - a (mu b - a)), whatever the force is."""
    piece = RigidPiece(2.0, 0.5, 1000.0, friction=0.5)
    lever = 0.5 * 1.0 - 0.25
    inertia = (4.0 + 0.25) / 12.0
    turns = 9.81 * lever / (inertia - 0.25 * lever)
    lasts_s = 0.02
    limit = np.arctan(0.25)
    for force in (2e4, 2e5):
        time_s = np.array([0.0, lasts_s])
        moved = move_piece(np.full(200, 2.0 * force), 1000.0, 2.0, 0.5, 0.5, 1e-4)
        assert moved[1] * limit == pytest.approx(0.5 * turns * lasts_s**2, rel=0.03)
        found = piece_responses([piece], time_s, np.full((1, 2), force))
        assert found.tilt[0] > 0.0
        assert found.slide_m[0] > 0.0


def test_the_side_that_is_pushed_does_not_matter() -> None:
    time_s, pressure = triangle(2e5, 1200.0)
    there, back = (
        piece_responses([PIECE], time_s, pressure),
        piece_responses([PIECE], time_s, -pressure),
    )
    assert there.slide_m[0] == back.slide_m[0]
    assert there.tilt[0] == back.tilt[0]


def test_anchors_hold_up_to_their_capacity() -> None:
    time_s, pressure = triangle(2e5, 1200.0)
    weak, strong = (
        RigidPiece(1.0, 0.6, 1000.0, anchor_n_m=capacity) for capacity in (1.9e5, 2.1e5)
    )
    found = piece_responses([weak, strong], time_s, np.repeat(pressure, 2, axis=0))
    assert found.held.tolist() == [0.0, 1.0]
    assert found.stability[1] is Stability.STANDS


def test_studs_have_the_limits_of_walls_that_buckle() -> None:
    """100 kg, medium: 72 m with slip tracks, 58 m where both ends are tied."""
    studs = catalogue()["steel_stud"]
    assert isinstance(studs, Wall)
    tied = studs.section.model_copy(update={"ductility": (0.5, 1.0, 2.0, 3.0)})
    names = {"slip": studs, "tied": studs.model_copy(update={"section": tied})}
    found = stand_offs(names, Charge((0.0, 0.0), 100.0))
    medium_m = [stand_off.distances_m[LevelOfProtection.MEDIUM] for stand_off in found]
    assert medium_m == pytest.approx([72.0, 58.0], abs=1.0)
    with pytest.raises(ValidationError, match="must ascend"):
        Sheeting(**STEEL.model_dump() | {"ductility": (1.0, 1.0, 2.0, 3.0)})


def test_wrong_pieces() -> None:
    with pytest.raises(BlastEnvError, match=r"mass_kg_m is 0.0, must be above 0"):
        RigidPiece(1.0, 0.6, 0.0)
    with pytest.raises(BlastEnvError, match=r"friction is -0.1, must be at least 0"):
        RigidPiece(1.0, 0.6, 1.0, friction=-0.1)
