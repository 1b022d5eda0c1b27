"""Reflection at normal incidence and arrival times of the shielding study's blasts."""

import numpy as np
import pytest

from blast_env.calibration import kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.simulation import simulate
from blast_env.studies.shielding.ratios import LoadKind
from blast_env.studies.shielding.reflection import (
    ARRIVAL_SHARE,
    ReflectionReport,
    ReflectionStudy,
    head_on_load,
    reference_near_field,
)
from blast_env.studies.shielding.report import BlockGeometry, ShieldingStudy
from blast_env.studies.shielding.scenes import facade_scenario
from tests.studies.shielding_cases import DENSE

GEOMETRY = BlockGeometry(margin_m=8.0)


@pytest.fixture(scope="module")
def report() -> ReflectionReport:
    study = ReflectionStudy(
        DENSE, seeds=(0, 1, 2), geometry=GEOMETRY, distances_m=(8.0, 12.0, 16.0)
    )
    return study.run()


def test_the_load_is_that_of_the_four_metres_around_the_axis() -> None:
    result = simulate(facade_scenario(8.0, GEOMETRY, DENSE), seed=1, engine="event")
    (structure,) = result.obstacles
    assert (structure.rows, structure.columns) == (32, 2)
    collisions = result.collisions[result.collisions.normal_x < -0.99]
    middle_m = GEOMETRY.margin_m + 8.0
    rows_m = collisions.module_id.str.split("_y").str[1].astype(float)
    hits = collisions[(rows_m - middle_m).abs() < 2.0]
    load = head_on_load(result)
    assert load.transferred_impulse == pytest.approx(hits.transferred_impulse_sim.sum() / 8)
    before = hits[hits.time_s < load.arrival_s].transferred_impulse_sim.sum()
    until = hits[hits.time_s <= load.arrival_s].transferred_impulse_sim.sum()
    assert before < ARRIVAL_SHARE * hits.transferred_impulse_sim.sum() <= until


def test_a_head_on_facade_gets_more_than_one_along_the_flow(report: ReflectionReport) -> None:
    table = report.reflection
    assert (table.ratio_low > 1.5).all()
    assert (table.head_on.diff().dropna() < 0.0).all()
    assert table.ratio.to_numpy() == pytest.approx((table.head_on / table.side_on).to_numpy())
    expected = [
        kingery_bulmash("reflected_impulse", d, 100.0)
        / kingery_bulmash("incident_impulse", d, 100.0)
        for d in (8.0, 12.0, 16.0)
    ]
    assert table.kingery_bulmash_ratio.to_list() == pytest.approx(expected)


def test_the_reference_ratio_at_a_scaled_distance_of_five_is_about_two() -> None:
    study = ReflectionStudy(
        DENSE, seeds=(0,), geometry=GEOMETRY, distances_m=(12.0, 5.0 * 100.0 ** (1 / 3))
    )
    row = study.run().reflection.iloc[-1]
    assert row.scaled_distance == pytest.approx(5.0)
    assert row.kingery_bulmash_ratio == pytest.approx(2.1, abs=0.05)
    assert np.isnan(row.ratio_low)


def test_arrivals_are_scaled_by_one_factor_that_leaves_no_mean_error(
    report: ReflectionReport,
) -> None:
    table = report.arrivals
    assert (table.simulated_s.diff().dropna() > 0.0).all()
    assert table.scaled_s.to_numpy() == pytest.approx(
        (table.time_scale * table.simulated_s).to_numpy()
    )
    # Least squares of the logarithms: the mean logarithm of what remains is 0.
    residual = np.log1p(table.residual_percent / 100.0)
    assert residual.mean() == pytest.approx(0.0, abs=1e-12)
    assert residual.std() > 0.0


def test_processes_do_not_change_it(report: ReflectionReport) -> None:
    again = report.study.run(processes=2)
    assert again.head_on.tobytes() == report.head_on.tobytes()
    assert again.side_on.tobytes() == report.side_on.tobytes()


def test_progress_rises_to_one() -> None:
    shares: list[float] = []
    study = ReflectionStudy(
        "ballistic", seeds=(0, 1), geometry=GEOMETRY, distances_m=(8.0, 12.0, 16.0)
    )
    study.run(progress=shares.append)
    assert shares == pytest.approx([number / 8 for number in range(1, 9)])


def test_nothing_within_the_time_is_an_error() -> None:
    study = ReflectionStudy(
        DENSE, seeds=(0,), geometry=GEOMETRY, distances_m=(8.0, 25.0), time_limit_s=0.02
    )
    with pytest.raises(BlastEnvError, match="nothing arrived at the facade at 25 m"):
        study.run()


@pytest.mark.parametrize(
    ("distances", "words"),
    [
        ((10.0,), "at least two"),
        ((12.0, 10.0), "ascending"),
        ((5.0, 10.0), "5 m must be within the wall"),
        ((10.0, 40.0), "40 m must be within the wall"),
    ],
)
def test_bad_distances_are_refused(distances: tuple[float, ...], words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        ReflectionStudy("ballistic", distances_m=distances)


def test_side_on_loads_are_the_transferred_ones(report: ReflectionReport) -> None:
    """The same blasts in the open as the shielding study's, so that the two can be compared."""
    study = report.study
    shielding = ShieldingStudy(DENSE, seeds=study.seeds, geometry=GEOMETRY).run()
    assert shielding.wall[:, LoadKind.TRANSFERRED].tobytes() == report.side_on.tobytes()


def test_the_reference_of_the_near_field_is_kingery_and_bulmash_s() -> None:
    near = reference_near_field((10.0, 25.0))
    reflected, incident = (
        kingery_bulmash(quantity, 10.0, 100.0)
        for quantity in ("reflected_impulse", "incident_impulse")
    )
    assert near.ratio_near == pytest.approx(reflected / incident)
    assert near.side_on_slope < 0.0
