"""Pressure-time histories of facades, on records made by hand and on real blasts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from blast_env.calibration import Friedlander
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.physics.collisions import COLLISION_DTYPE
from blast_env.physics.particles import CollisionType
from blast_env.recording.tables import faces_hit
from blast_env.scenario import Scenario
from blast_env.simulation import Blast, BlastResult
from studies.particles.pressure.pulses import Face, PressureHistory, facade_history

FACES: tuple[Face, ...] = ("left", "right", "bottom", "top")
NORMALS = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "bottom": (0.0, -1.0), "top": (0.0, 1.0)}

Hit = tuple[float, str, float]
"""Time in s, facade, transferred impulse."""


def yard(side_modules: int = 6) -> Scenario:
    """Return a shelter, 3 m wide, and a wall, 1 m high and 5 m wide."""
    return Scenario.model_validate(
        {
            "schema_version": 1,
            "name": "yard",
            "site": {"width_m": 20.0, "height_m": 20.0},
            "charge": [{"kind": "point", "position_m": (6.0, 10.0), "tnt_kg": 100.0}],
            "structures": [
                {
                    "kind": "ConcreteSquare",
                    "name": "shelter",
                    "corner_m": (12.0, 8.5),
                    "side_modules": side_modules,
                    "protected": True,
                },
                {
                    "kind": "ModularObstacle",
                    "name": "wall",
                    "corner_m": (3.0, 15.0),
                    "rows": 2,
                    "columns": 10,
                },
            ],
            "build_zone": {"corner_m": (8.5, 7.0), "rows": 12, "columns": 4, "stock": 12},
            "simulation": {
                "preset": "ballistic",
                "overrides": {
                    "explosive": {"ball_count": 240},
                    "stepping": {"time_limit_s": 0.05},
                },
            },
        }
    )


@pytest.fixture(scope="module")
def results() -> list[BlastResult]:
    return [Blast(yard(), ((3, 1), (4, 1)), seed).run() for seed in range(3)]


@pytest.fixture(scope="module")
def result(results: list[BlastResult]) -> BlastResult:
    return results[0]


def with_hits(result: BlastResult, hits: Sequence[Hit]) -> BlastResult:
    """Return the blast, 50 ms long, with these hits, all on the first module of the shelter."""
    records = np.zeros(len(hits), dtype=COLLISION_DTYPE)
    records["kind"] = CollisionType.AirBall
    records["time_s"] = [time_s for time_s, _, _ in hits]
    records["transferred_impulse"] = [impulse for _, _, impulse in hits]
    records["normal_x"] = [NORMALS[face][0] for _, face, _ in hits]
    records["normal_y"] = [NORMALS[face][1] for _, face, _ in hits]
    return replace(result, collision_array=records, time_s=0.05)


def wave_hits(wave: Friedlander, count: int) -> list[Hit]:
    """Return hits in the middle of short times, each with what a wave brings in its time."""
    edges_s = np.linspace(0.0, 0.05, count + 1)
    impulses = np.diff(wave.impulse_until(edges_s))
    middles_s = (edges_s[1:] + edges_s[:-1]) / 2.0
    return [(float(t), "left", float(i)) for t, i in zip(middles_s, impulses, strict=True)]


def history(result: BlastResult, hits: Sequence[Hit], bin_s: float = 0.01) -> PressureHistory:
    return facade_history([with_hits(result, hits)], "shelter", "left", bin_s)


def test_pressure_is_the_impulse_of_a_bin_per_time_and_metre(result: BlastResult) -> None:
    """The left facade of the shelter is 3 m: 6 in 10 ms on 3 m is 200 per s and m."""
    hits = [(0.012, "left", 2.0), (0.019, "left", 4.0), (0.031, "left", 9.0), (0.02, "top", 50.0)]
    found = history(result, hits)
    assert found.length_m == 3.0
    assert found.edges_s == pytest.approx(0.01 * np.arange(6))
    assert found.pressure == pytest.approx([0.0, 200.0, 0.0, 300.0, 0.0])
    assert found.impulse == pytest.approx(5.0)
    assert found.peak == pytest.approx(300.0)
    assert np.isnan(found.std_error).all()
    assert np.isnan(found.impulse_std_error)


@pytest.mark.parametrize("bin_s", [0.05, 3.3e-3, 1e-3, 1.7e-5])
@pytest.mark.parametrize("face", FACES)
def test_the_integral_is_the_summed_transferred_impulse(
    results: list[BlastResult], face: Face, bin_s: float
) -> None:
    for structure in ("shelter", "wall"):
        found = facade_history(results, structure, face, bin_s)
        summed = 0.0
        for result in results:
            table = result.collisions
            own = table[(table["structure"] == structure) & (faces_hit(table) == face)]
            summed += own["transferred_impulse_sim"].sum()
        per_metre = summed / len(results) / found.length_m
        assert found.impulse == pytest.approx(per_metre, rel=1e-12)
        integral = float((found.pressure * np.diff(found.edges_s)).sum())
        assert integral == pytest.approx(per_metre, rel=1e-12)


def test_the_four_facades_share_the_load_of_the_structure(results: list[BlastResult]) -> None:
    histories = [facade_history(results, "wall", face, 1e-3) for face in FACES]
    assert [found.length_m for found in histories] == [1.0, 1.0, 5.0, 5.0]
    total = sum(found.impulse * found.length_m for found in histories)
    whole = np.mean([result.obstacle("wall").transferred_impulse for result in results])
    assert total == pytest.approx(float(whole), rel=1e-12)
    assert total > 0.0


def test_the_scale_turns_the_unit_into_pa(results: list[BlastResult]) -> None:
    bare, scaled = (
        facade_history(results, "shelter", "left", 1e-3, scale=scale) for scale in (None, 0.3)
    )
    assert bare.scale is None
    assert scaled.pressure == pytest.approx(0.3 * bare.pressure)
    assert scaled.std_error == pytest.approx(0.3 * bare.std_error)
    assert scaled.impulse == pytest.approx(0.3 * bare.impulse)
    assert scaled.arrival_s == bare.arrival_s
    assert scaled.friedlander().decay == pytest.approx(bare.friedlander().decay, abs=1e-6)


def test_seeds_are_averaged_with_their_standard_error(result: BlastResult) -> None:
    blasts = [with_hits(result, [(0.011, "left", 3.0 * impulse)]) for impulse in (1.0, 2.0, 6.0)]
    found = facade_history(blasts, "shelter", "left", 0.01)
    error = np.std([1.0, 2.0, 6.0], ddof=1) / np.sqrt(3.0)
    assert found.impulse_by_seed == pytest.approx([1.0, 2.0, 6.0])
    assert found.pressure[1] == pytest.approx(300.0)
    assert found.std_error[1] == pytest.approx(100.0 * error)
    assert found.std_error[0] == 0.0
    assert found.impulse_std_error == pytest.approx(error)


def test_the_arrival_is_the_first_bin_that_counts(result: BlastResult) -> None:
    """4 % of the peak is a forerunner, 6 % is the blast."""
    early = [(0.003, "left", 4.0), (0.0131, "left", 6.0), (0.0202, "left", 100.0)]
    assert history(result, early, bin_s=1e-3).arrival_s == pytest.approx(0.013)


def test_a_straggler_does_not_stretch_the_duration(result: BlastResult) -> None:
    """Bins of 1 ms from 10 ms: 98 % of the impulse have come at 14 ms, the rest at 45 ms."""
    hits = [(0.0105 + 0.001 * k, "left", 24.5) for k in range(4)] + [(0.0455, "left", 2.0)]
    assert history(result, hits, bin_s=1e-3).positive_duration_s == pytest.approx(0.004)


@pytest.mark.parametrize("decay", [0.0, 1.0, 3.0])
def test_a_friedlander_wave_is_found_again(result: BlastResult, decay: float) -> None:
    wave = Friedlander(peak=900.0, positive_duration_s=0.02, decay=decay, arrival_s=0.01)
    found = history(result, wave_hits(wave, 5000), bin_s=5e-4)
    assert found.impulse == pytest.approx(wave.impulse() / 3.0, rel=1e-12)
    assert found.arrival_s == pytest.approx(0.01)
    assert found.peak == pytest.approx(300.0, rel=0.06)
    # Two bins of 0.025 t_2 for the roundings at both ends.
    share = {0.0: 0.776, 1.0: 0.713, 3.0: 0.570}[decay]
    assert found.positive_duration_s / 0.02 == pytest.approx(share, abs=0.05)
    fitted = found.friedlander()
    assert fitted.peak == pytest.approx(300.0, rel=1e-3)
    assert fitted.positive_duration_s == pytest.approx(0.02, rel=5e-3)
    assert fitted.decay == pytest.approx(decay, rel=0.01, abs=0.01)
    assert fitted.arrival_s == pytest.approx(0.01)


def test_a_real_blast_has_a_fit_of_about_its_impulse(results: list[BlastResult]) -> None:
    found = facade_history(results, "shelter", "left", 1e-3)
    assert 0.0 < found.arrival_s < 0.05
    assert found.friedlander().impulse() == pytest.approx(found.impulse, rel=0.5)


def test_a_facade_without_hits_has_no_times_and_no_waveform(result: BlastResult) -> None:
    found = history(result, [])
    assert found.impulse == found.peak == 0.0
    assert np.isnan(found.arrival_s)
    assert np.isnan(found.positive_duration_s)
    with pytest.raises(BlastEnvError, match="left facade of 'shelter' was hit in 0 bins"):
        found.friedlander()


def test_the_last_hit_is_in_the_last_bin_whatever_the_width(result: BlastResult) -> None:
    """0.07 / 0.01 rounds so that 7 bins of 10 ms end before 0.07 s."""
    for time_s in (0.07, np.nextafter(0.07, 1.0), 0.06):
        found = history(result, [(float(time_s), "left", 3.0)])
        assert found.impulse == pytest.approx(1.0, rel=1e-12)


def test_bad_input_is_named(results: list[BlastResult], result: BlastResult) -> None:
    with pytest.raises(BlastEnvError, match="results is empty"):
        facade_history([], "shelter", "left", 1e-3)
    with pytest.raises(UnknownNameError, match="did you mean 'shelter'"):
        facade_history(results, "sheltr", "left", 1e-3)
    with pytest.raises(UnknownNameError, match="no facade 'front'; known: bottom, left"):
        facade_history(results, "shelter", "front", 1e-3)  # type: ignore[arg-type]
    with pytest.raises(BlastEnvError, match="'barrier' is made of single cells"):
        facade_history(results, "barrier", "left", 1e-3)
    with pytest.raises(BlastEnvError, match="bin_s is 0, must be above 0"):
        facade_history(results, "shelter", "left", 0.0)
    with pytest.raises(BlastEnvError, match=r"bin_s is 1e-09, must be at least \S+ for a run"):
        facade_history(results, "shelter", "left", 1e-9)
    with pytest.raises(BlastEnvError, match="scale is -1, must be above 0"):
        facade_history(results, "shelter", "left", 1e-3, scale=-1.0)


def test_blasts_of_other_sites_do_not_mix(result: BlastResult) -> None:
    other = Blast(yard(side_modules=4)).run()
    with pytest.raises(
        BlastEnvError, match=r"results\[1\]: structure 'shelter' is .* results\[0\]"
    ):
        facade_history([result, other], "shelter", "left", 1e-3)
