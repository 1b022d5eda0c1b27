"""Panes: E1300's loads, order of kinds and sizes, flight, GSA's conditions, the table of plates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.response import (
    GlassKind,
    GlazingCondition,
    Interlayer,
    Pane,
    flight_condition,
    glazing_responses,
    plate_curve,
)

# Read by others from the charts of ASTM E1300, annealed, four sides held: least thickness (mm),
# long and short side (m), non-factored load (kPa).
NON_FACTORED_LOADS = [
    (4.57, 2.0, 2.0, 1.048),
    (4.57, 1.6, 1.0, 2.064),
    (4.57, 1.0, 0.8, 3.678),
    (5.56, 1.2, 1.0, 3.426),
    (5.56, 1.6, 1.0, 2.476),
    (5.56, 2.2, 1.4, 1.602),
    (7.42, 2.0, 2.0, 1.943),
    (7.42, 1.0, 0.6, 9.786),
    (7.42, 2.2, 1.0, 2.596),
]


@pytest.mark.parametrize(("thickness_mm", "long_m", "short_m", "load_kpa"), NON_FACTORED_LOADS)
def test_non_factored_loads_of_e1300(
    thickness_mm: float, long_m: float, short_m: float, load_kpa: float
) -> None:
    pane = Pane(long_m, short_m, thickness_mm * 1e-3)
    assert pane.load_resistance_pa() == pytest.approx(1e3 * load_kpa, rel=0.025)


def test_risk_and_resistance_are_inverse() -> None:
    pane = Pane(1.2, 1.5, 5.56e-3, GlassKind.FULLY_TEMPERED)
    load = pane.load_resistance_pa(0.3, 10.0)
    assert 1.0 - np.exp(-pane.risk(load, 10.0)) == pytest.approx(0.3, rel=1e-6)


def test_glass_type_factors() -> None:
    annealed, strengthened, tempered = (
        Pane(1.2, 1.5, 5.56e-3, kind).load_resistance_pa() for kind in GlassKind
    )
    assert strengthened / annealed == pytest.approx(2.0, rel=1e-3)
    assert tempered / annealed == pytest.approx(4.0, rel=1e-3)


def blast(peak_pa: float, impulse_pa_s: float) -> tuple[np.ndarray, np.ndarray]:
    end_s = 2.0 * impulse_pa_s / peak_pa
    return np.array([0.0, end_s, 2.0 * end_s]), np.array([[peak_pa, 0.0, 0.0]])


def test_a_long_load_breaks_as_many_panes_as_the_same_static_one() -> None:
    """A pressure that rises slowly and stays 3 s is E1300's own case."""
    pane = Pane(1.6, 1.0, 5.56e-3)
    load = pane.load_resistance_pa(0.008, 3.0)
    time_s = np.array([0.0, 1.0, 4.0, 4.5])
    found = glazing_responses([pane], time_s, np.array([[0.0, load, load, 0.0]]))
    assert found.break_probability[0] == pytest.approx(0.008, rel=0.1)
    static_m = np.interp(load, pane.curve.load_pa, pane.curve.deflection_m)
    assert found.peak_m[0] == pytest.approx(static_m, rel=0.02)


@given(st.floats(3e3, 2e5), st.floats(20.0, 800.0))
def test_more_load_never_breaks_fewer_panes(peak_pa: float, impulse_pa_s: float) -> None:
    time_s, pressure = blast(peak_pa, impulse_pa_s)
    pane = Pane(1.2, 1.5, 5.56e-3)
    less, more = (
        glazing_responses([pane], time_s, factor * pressure).break_probability[0]
        for factor in (1.0, 1.2)
    )
    assert more >= less - 1e-9


def test_better_glass_has_a_better_condition() -> None:
    time_s, pressure = blast(28e3, 200.0)
    annealed = Pane(1.2, 1.5, 5.56e-3)
    tempered = Pane(1.2, 1.5, 5.56e-3, GlassKind.FULLY_TEMPERED)
    laminated = Pane(1.2, 1.5, 11e-3, interlayer=Interlayer())
    worst, better, held = glazing_responses(
        [annealed, tempered, laminated], time_s, np.repeat(pressure, 3, axis=0)
    ).condition
    assert worst > better > held == GlazingCondition.RETAINED


def test_an_impulse_throws_a_pane_with_its_momentum() -> None:
    """A pane that breaks at once has the speed that the whole impulse gives its mass."""
    time_s, pressure = blast(1e6, 1000.0)
    pane = Pane(1.2, 1.5, 4e-3)
    speed = glazing_responses([pane], time_s, pressure).speed_m_s[0]
    assert speed == pytest.approx(1000.0 / pane.mass_kg_m2, rel=0.1)


def test_double_glazing_is_stiffer_and_heavier_than_its_inner_pane() -> None:
    time_s, pressure = blast(8e3, 60.0)
    single, double = Pane(1.2, 1.5, 3.78e-3), Pane(1.2, 1.5, 3.78e-3, outer_thickness_m=3.78e-3)
    found = glazing_responses([single, double], time_s, np.repeat(pressure, 2, axis=0))
    assert found.peak_m[1] < found.peak_m[0]
    assert found.break_probability[1] < found.break_probability[0]


@pytest.mark.parametrize(
    ("flight_m", "hit_m", "label"),
    [(0.8, -1.0, "3a"), (2.5, -1.0, "3b"), (4.0, 0.5, "4"), (9.0, 1.2, "5")],
)
def test_conditions_of_gsa(flight_m: float, hit_m: float, label: str) -> None:
    (condition,) = flight_condition(np.array([flight_m]), np.array([hit_m])).tolist()
    assert GlazingCondition(condition).label == label


def test_ratings_of_iso_go_with_the_conditions_of_gsa() -> None:
    assert [condition.words for condition in GlazingCondition] == [
        *("1, A", "2, B", "3a, D", "3b, E", "4, F", "5, F")
    ]


@pytest.mark.parametrize("sizes", [(0.0, 1.0, 0.006), (1.0, 1.0, -0.006), (6.0, 1.0, 0.006)])
def test_wrong_panes(sizes: tuple[float, float, float]) -> None:
    with pytest.raises(BlastEnvError, match="must"):
        Pane(*sizes)


def test_both_panes_of_double_glazing_bear_the_load() -> None:
    """As one under a slow pressure, too: two equal panes bear twice what one does."""
    single, double = (Pane(1.5, 1.2, 5.56e-3, outer_thickness_m=value) for value in (0.0, 5.56e-3))
    load = double.load_resistance_pa()
    assert load == pytest.approx(2.0 * single.load_resistance_pa())
    assert double.risk(load, 3.0) == pytest.approx(single.risk(0.5 * load, 3.0))
    time_s, slow = np.array([0.0, 1.0, 4.0, 4.5]), np.array([[0.0, load, load, 0.0]])
    (share,) = glazing_responses([double], time_s, slow).break_probability
    assert share == pytest.approx(0.008, rel=0.1)
    uneven = Pane(1.5, 1.2, 5.56e-3, outer_thickness_m=3e-3)
    assert single.load_resistance_pa() < uneven.load_resistance_pa() < load


def test_a_frame_carries_the_load_of_an_unbroken_pane_over_its_edges() -> None:
    pane = Pane(1.6, 1.0, 5.56e-3)
    load = 0.5 * pane.load_resistance_pa()
    found = glazing_responses([pane], np.array([0.0, 2.0, 3.0]), np.array([[0.0, load, load]]))
    assert found.edge_force_n_m[0] == pytest.approx(load * 1.6 * 1.0 / (2.0 * 2.6), rel=0.02)


def test_a_frame_carries_a_pane_until_it_breaks() -> None:
    """6 mm annealed under 20 kg at 10 m: not the 99 kN/m of a pane that bends on."""
    pane = Pane(1.2, 1.5, 5.56e-3)
    found = glazing_responses([pane], *blast(196.6e3, 480.5))
    assert found.break_probability[0] > 0.99
    assert 5_000.0 < found.edge_force_n_m[0] < 8_000.0
    assert pane.frame_n_m == pytest.approx(2.0 * pane.load_resistance_pa() / 3.0)
    whole, harder = (glazing_responses([pane], *blast(kpa * 1e3, 400.0)) for kpa in (100, 400))
    assert harder.edge_force_n_m[0] < 2.0 * whole.edge_force_n_m[0]  # not four times


def test_a_broken_laminated_pane_pulls_at_its_frame() -> None:
    pane = Pane(1.6, 1.0, 5.84e-3, interlayer=Interlayer())
    found = glazing_responses([pane], *blast(20e3, 100.0))
    assert found.break_probability[0] > 0.9
    assert found.edge_force_n_m[0] >= 16_000.0


# --- The table of glass plates.


def test_an_aspect_ratio_between_two_of_the_table() -> None:
    low, between, high = (plate_curve(ratio).load for ratio in (1.5, 1.6, 1.75))
    assert np.all((between - low) * (high - between) >= 0.0)
