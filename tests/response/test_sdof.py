"""Single-degree-of-freedom systems against closed forms, energy, and another integrator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from blast_env.errors import BlastEnvError
from blast_env.response import Resistance, System, responses

STIFFNESS = 1e6
MASS = 100.0
ELASTIC = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, 1e12))
PERIOD = ELASTIC.period_s


def triangle(duration_s: float, peak: float = 1e3) -> tuple[np.ndarray, np.ndarray]:
    return np.array([0.0, duration_s]), np.array([[peak, 0.0]])


def peak_over_static(system: System, time_s: np.ndarray, pressure: np.ndarray) -> float:
    return float(responses([system], time_s, pressure).peak_m[0] * STIFFNESS / 1e3)


def test_a_sudden_load_that_stays_doubles_the_deflection() -> None:
    time_s = np.array([0.0, 5.0 * PERIOD])
    assert peak_over_static(ELASTIC, time_s, np.full((1, 2), 1e3)) == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 1.0, 2.0, 5.0])
def test_dynamic_load_factor_of_a_triangle(share: float) -> None:
    """Biggs, figure 2.7, in its closed form."""
    td, w = share * PERIOD, 2.0 * np.pi / PERIOD
    t = np.linspace(0.0, td + PERIOD, 200_001)
    loaded = 1.0 - np.cos(w * t) + np.sin(w * t) / (w * td) - t / td
    free = (np.sin(w * t) - np.sin(w * (t - td))) / (w * td) - np.cos(w * t)
    expected = np.where(t <= td, loaded, free).max()
    assert peak_over_static(ELASTIC, *triangle(td)) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("share", [0.25, 0.75, 1.5, 3.2])
def test_dynamic_load_factor_of_a_ramp(share: float) -> None:
    """1 + |sin(pi tr / T)| / (pi tr / T) for a load that rises in tr and stays."""
    time_s = np.array([0.0, share * PERIOD, (share + 4.0) * PERIOD])
    expected = 1.0 + abs(np.sin(np.pi * share)) / (np.pi * share)
    pressure = np.array([[0.0, 1e3, 1e3]])
    assert peak_over_static(ELASTIC, time_s, pressure) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("ratio", [1.1, 1.25, 1.5, 2.0])
def test_ductility_under_a_sudden_load_that_stays(ratio: float) -> None:
    """Work of the load is the strain energy: F x = R (x - y / 2), mu = 1 / (2 (1 - F / R))."""
    system = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, ratio * 1e3))
    found = responses([system], np.array([0.0, 60.0 * PERIOD]), np.full((1, 2), 1e3))
    ductility = found.peak_m[0] / system.resistance.yield_m
    assert ductility == pytest.approx(0.5 / (1.0 - 1.0 / ratio), rel=5e-3)


@pytest.mark.parametrize("ductility", [2.0, 5.0, 20.0])
def test_ductility_of_an_impulse(ductility: float) -> None:
    """Kinetic energy is the strain energy: i^2 / (2 m) = R (x - y / 2)."""
    yield_m = 0.01
    cap = STIFFNESS * yield_m
    impulse = np.sqrt(2.0 * MASS * cap * yield_m * (ductility - 0.5))
    short_s = PERIOD / 500.0
    system = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, cap))
    found = responses([system], *triangle(short_s, 2.0 * impulse / short_s))
    assert found.peak_m[0] / yield_m == pytest.approx(ductility, rel=2e-2)
    assert found.permanent_m[0] == pytest.approx(found.peak_m[0] - yield_m, rel=1e-3)


@pytest.mark.parametrize(("resistance", "share"), [(0.3, 0.2), (0.5, 2.0), (0.8, 0.6), (1.2, 2.0)])
def test_another_integrator_finds_the_same_ductility(resistance: float, share: float) -> None:
    """Four points of Biggs' chart for triangles (figure 2.24), by scipy in its own way."""
    cap, td = resistance * 1e3, share * PERIOD
    yield_m = cap / STIFFNESS

    def motion(t: float, state: np.ndarray) -> list[float]:
        _, v, elastic = state
        load = max(1e3 * (1.0 - t / td), 0.0)
        yields = (elastic >= yield_m and v > 0.0) or (elastic <= -yield_m and v < 0.0)
        return [v, (load - STIFFNESS * elastic) / MASS, 0.0 if yields else v]

    def comes_to_rest(t: float, state: np.ndarray) -> float:
        return float(state[1]) if t > 0.0 else 1.0

    comes_to_rest.terminal, comes_to_rest.direction = True, -1.0  # type: ignore[attr-defined]
    ends, step = td + 5.0 * PERIOD, PERIOD / 2000.0
    solved = solve_ivp(
        motion, (0.0, ends), [0.0] * 3, max_step=step, rtol=1e-8, events=comes_to_rest
    )
    system = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, cap))
    found = responses([system], *triangle(td)).peak_m[0]
    assert found == pytest.approx(solved.y[0].max(), rel=5e-3)


@given(st.floats(0.05, 3.0), st.floats(0.2, 2.0))
def test_smaller_steps_change_little(share: float, resistance: float) -> None:
    system = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, resistance * 1e3))
    coarse = responses([system], *triangle(share * PERIOD)).peak_m[0]
    fine = responses([system], *triangle(share * PERIOD), steps_per_period=800).peak_m[0]
    assert coarse == pytest.approx(fine, rel=5e-3)


def test_a_load_outwards_is_the_mirror_of_one_inwards() -> None:
    system = System(MASS, 1.0, Resistance.elastic_plastic(STIFFNESS, 600.0))
    time_s, pressure = triangle(0.5 * PERIOD)
    inwards, outwards = (
        responses([system], time_s, pressure),
        responses([system], time_s, -pressure),
    )
    assert outwards.rebound_m[0] == -inwards.peak_m[0]


def test_what_cracks_goes_on_with_what_is_left() -> None:
    brittle = Resistance(
        np.array([0.0, 0.001]),
        np.array([0.0, 1e3]),
        crack_m=0.001,
        cracked_deflection_m=np.array([0.0, 0.01, 0.2]),
        cracked_pressure_pa=np.array([0.0, 100.0, 0.0]),
    )
    whole = Resistance.elastic_plastic(1e6, 1e3)
    time_s, pressure = triangle(0.02, 2e3)
    broken, kept = responses(
        [System(MASS, 1.0, brittle), System(MASS, 1.0, whole)],
        time_s,
        np.repeat(pressure, 2, axis=0),
    ).peak_m
    assert broken > 2.0 * kept


@pytest.mark.parametrize(
    ("deflection", "stiffness"), [([0.1, 1.0], 1.0), ([0.0, 0.0], 1.0), ([0.0, 1.0], 0.0)]
)
def test_wrong_resistances(deflection: list[float], stiffness: float) -> None:
    with pytest.raises(BlastEnvError, match="must"):
        Resistance(np.array(deflection), stiffness * np.array(deflection))


def test_histories_that_do_not_fit() -> None:
    with pytest.raises(BlastEnvError, match=r"shape \(2, 2\), must be \(1, 2\)"):
        responses([ELASTIC], np.array([0.0, 1.0]), np.zeros((2, 2)))
    with pytest.raises(BlastEnvError, match="must ascend"):
        responses([ELASTIC], np.array([1.0, 0.0]), np.zeros((1, 2)))
