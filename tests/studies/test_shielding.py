"""The shielding study: what gets round a block."""

import json

import numpy as np
import pytest

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import preset
from blast_env.scenario.build_scene import draw_charge
from blast_env.simulation import simulate
from blast_env.studies.shielding.ratios import Face, LoadKind, face_loads, faces_hit
from blast_env.studies.shielding.report import BlockGeometry, ShieldingReport, ShieldingStudy
from blast_env.studies.shielding.scenes import block_scenario, wall_scenario
from tests.studies.shielding_cases import DENSE, NARROW, SMALL


@pytest.fixture(scope="module")
def dense() -> ShieldingReport:
    return ShieldingStudy(DENSE, seeds=tuple(range(6)), geometry=NARROW).run()


# The scenes


def test_path_lengths_are_those_round_the_corners() -> None:
    # Half the face and the stand-off are the legs of a 3-4-5 triangle.
    geometry = BlockGeometry(side_modules=12, stand_off_m=4.0)
    assert geometry.corner_path_m == 5.0
    assert geometry.side_path_m[[0, -1]].tolist() == [5.25, 10.75]
    assert geometry.back_path_m.tolist() == [11.25, 11.75, 12.25, 12.75, 13.25, 13.75]
    assert geometry.gauge_path_m.tolist() == [*geometry.side_path_m, *geometry.back_path_m]


def test_a_gauge_in_the_middle_of_the_back_is_as_far_from_both_corners() -> None:
    geometry = BlockGeometry()  # 23 modules: the middle of the back is a module's middle
    assert len(geometry.back_path_m) == 12
    assert geometry.back_path_m[-1] == pytest.approx(geometry.corner_path_m + 1.5 * 11.5)


def test_the_default_block_is_the_experiments_at_full_size() -> None:
    geometry = BlockGeometry()
    assert geometry.side_m == pytest.approx(5 * 2.3)
    assert geometry.stand_off_m == pytest.approx(5 * 1.15)


def test_the_charge_is_before_the_middle_of_the_face() -> None:
    scenario = block_scenario(SMALL, DENSE)
    (structure,) = scenario.structures
    x_m, y_m = draw_charge(scenario, seed=0).position_m
    assert structure.rectangle_m.left - x_m == SMALL.stand_off_m
    assert structure.rectangle_m.centre[1] == y_m


def test_the_wall_in_the_open_points_at_the_charge_and_covers_all_paths() -> None:
    scenario = wall_scenario(SMALL, DENSE)
    (structure,) = scenario.structures
    x_m, y_m = draw_charge(scenario, seed=0).position_m
    assert structure.rows == 1
    assert structure.rectangle_m.centre[1] == y_m
    assert structure.rectangle_m.left - x_m < SMALL.gauge_path_m.min()
    assert structure.rectangle_m.right - x_m > SMALL.gauge_path_m.max()
    assert SMALL.wall_path_m[-1] + x_m == pytest.approx(structure.rectangle_m.right - 0.25)


def test_scenes_have_the_parameters_given_and_the_studys_time_limit() -> None:
    study = ShieldingStudy(DENSE, time_limit_s=0.7, geometry=SMALL)
    expected = with_overrides(DENSE, {"stepping": {"time_limit_s": 0.7}})
    assert block_scenario(SMALL, study.scene_parameters).parameters == expected
    assert study.parameters == DENSE
    assert ShieldingStudy("ballistic").parameters == preset("ballistic")


# The loads


def test_loads_are_those_of_the_collisions_with_each_face() -> None:
    result = simulate(block_scenario(SMALL, DENSE), engine="event")
    loads, collisions = face_loads(result), result.collision_array
    front = collisions[(collisions["normal_x"] < -0.99) & (collisions["module"] == 6 * 9)]
    assert len(front) > 3
    for kind, column in (
        (LoadKind.TRANSFERRED, "transferred_impulse"),
        (LoadKind.IMPULSE, "impulse"),
    ):
        assert loads[kind, Face.FRONT, 6, 0] == pytest.approx(front[column].sum())
    # Modules inside the block and on other faces have none.
    assert not loads[:, Face.LEFT, :8].any()
    assert not loads[:, Face.BACK, :, :8].any()
    assert loads[LoadKind.TRANSFERRED, Face.FRONT, :, 0].all()
    # Only hits on the four corners belong to no face.
    share = loads[LoadKind.TRANSFERRED].sum() / result.obstacles[0].transferred_impulse
    assert 0.98 < share <= 1.0
    assert np.array(list(faces_hit(collisions).values())).sum(axis=0).max() == 1


def test_symmetric_gauges_agree() -> None:
    """Nothing in the scene tells left from right: over seeds, neither side gets more."""
    study = ShieldingStudy(DENSE, seeds=tuple(range(24)), geometry=SMALL)
    scene = block_scenario(SMALL, study.scene_parameters)
    (faces,) = study.run_blasts([scene], face_loads)
    normal = np.array(faces)[:, LoadKind.TRANSFERRED]
    sides = normal[:, [Face.LEFT, Face.RIGHT]].sum(axis=(2, 3))
    back = normal[:, Face.BACK].sum(axis=2)
    halves = np.stack((back[:, :4].sum(axis=1), back[:, 5:].sum(axis=1)), axis=1)
    for pair in (sides, halves):
        difference = pair[:, 0] - pair[:, 1]
        error = difference.std(ddof=1) / np.sqrt(len(pair))
        assert abs(difference.mean()) < 3.5 * error
        assert error < 0.1 * pair.mean()


# The physics


def test_sparse_air_shields_nearly_everything_and_dense_air_does_not(
    dense: ShieldingReport,
) -> None:
    """The reason for the study: a ballistic blast does not bend round a corner."""
    sparse = ShieldingStudy("ballistic", seeds=tuple(range(24)), geometry=NARROW).run()
    assert sparse.one_corner.value < 0.25
    assert sparse.two_corners.value < 0.25
    assert dense.one_corner.low > 0.45
    assert dense.two_corners.low > 0.3


def test_a_second_corner_takes_more(dense: ShieldingReport) -> None:
    assert dense.two_corners.high < dense.one_corner.low


def test_loads_of_dense_air_are_complete_and_a_short_time_shows(dense: ShieldingReport) -> None:
    assert max(dense.late_shares) < 0.01
    short = ShieldingStudy(DENSE, seeds=(0, 1), time_limit_s=0.05, geometry=NARROW).run()
    assert short.late_shares.two_corners > 0.2


def test_lossy_air_lets_less_round_the_block(dense: ShieldingReport) -> None:
    lossy = with_overrides(DENSE, {"air": {"elasticity": 0.9}, "explosive": {"elasticity": 0.9}})
    report = ShieldingStudy(lossy, seeds=tuple(range(6)), geometry=NARROW).run()
    assert report.two_corners.high < dense.two_corners.low


# Running it


def loads_of(report: ShieldingReport) -> tuple[FloatArray, FloatArray]:
    return report.block, report.wall


@pytest.mark.parametrize("engine", ["event", "pymunk"])
def test_a_study_is_repeatable_in_any_number_of_processes(engine: str) -> None:
    study = ShieldingStudy("ballistic", seeds=(3, 1, 4), engine=engine, geometry=SMALL)
    shares: list[float] = []
    once, again = study.run(progress=shares.append), study.run(processes=2)
    assert [each.tobytes() for each in loads_of(once)] == [
        each.tobytes() for each in loads_of(again)
    ]
    assert once.to_json(1.1) == again.to_json(1.1)
    assert shares == pytest.approx([1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0])


def test_seeds_keep_their_order_and_are_blasts_of_their_own() -> None:
    both = ShieldingStudy(DENSE, seeds=(5, 2), geometry=SMALL).run()
    alone = ShieldingStudy(DENSE, seeds=(2,), geometry=SMALL).run()
    assert both.block[1].tolist() == alone.block[0].tolist()
    assert both.wall[0].tolist() != both.wall[1].tolist()


def test_the_record_repeats_the_study(dense: ShieldingReport) -> None:
    record = json.loads(dense.to_json(1.2))
    assert record["seeds"] == [0, 1, 2, 3, 4, 5]
    assert SimulationParameters(**record["parameters"]) == DENSE
    assert BlockGeometry(**record["geometry"]) == NARROW
    assert record["preset"] is None
    first = record["result"]["ratios"][0]
    assert first["region"] == "one_corner"
    assert first["ratio"] == dense.one_corner.value
    assert first["scaled"] == dense.one_corner.value**1.2
    assert record["result"]["ratios"][1]["experiment"] is None
    assert len(record["result"]["gauges"]) == 23 + 12


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"seeds": ()}, "at least one"),
        ({"seeds": (1, 1)}, "none twice"),
        ({"seeds": (-1,)}, "below 0"),
        ({"time_limit_s": 0.0}, "time_limit_s is 0, must be above 0"),
        ({"engine": "evnet"}, "did you mean 'event'"),
        ({"simulation": "balistic"}, "did you mean 'ballistic'"),
        ({"geometry": BlockGeometry(stand_off_m=0.25)}, "charge"),
    ],
)
def test_bad_studies_are_refused(arguments: dict, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        ShieldingStudy(**{"simulation": "ballistic", **arguments})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"side_modules": 2}, "side_modules is 2, must be at least 3"),
        ({"stand_off_m": 0.0}, "stand_off_m is 0, must be above 0"),
        ({"margin_m": float("inf")}, "margin_m is inf"),
        ({"tnt_kg": -1.0}, "tnt_kg is -1"),
    ],
)
def test_bad_blocks_are_refused(arguments: dict, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        BlockGeometry(**arguments)


def test_a_blast_that_was_cut_short_is_no_result() -> None:
    limited = with_overrides(DENSE, {"stepping": {"most_collisions": 500}})
    with pytest.raises(BlastEnvError, match=r"seed 7: .* limit of 500 collisions"):
        ShieldingStudy(limited, seeds=(7,), geometry=SMALL).run()


def test_without_a_free_field_there_is_no_ratio() -> None:
    with pytest.raises(BlastEnvError, match=r"nothing arrived .* within 0.001 s"):
        ShieldingStudy(DENSE, seeds=(0,), time_limit_s=0.001, geometry=SMALL).run()
