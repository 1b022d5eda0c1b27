from collections.abc import Sequence

import numpy as np
import pytest

from blast_env.evaluation.engines import BlastResult
from blast_env.particles.run import COLLISION_DTYPE, CollisionArray
from blast_env.particles.tables import (
    COLLISION_COLUMNS,
    MODULE_COLUMNS,
    STRUCTURE_COLUMNS,
    collision_table,
    module_table,
    structure_table,
)
from blast_env.site.balls import CollisionType
from blast_env.site.structure import ModularObstacle
from blast_env.tables import Column


def record(**values: object) -> CollisionArray:
    """Return one collision: a unit mass that flies to the right, head-on, into module 0."""
    defaults: dict[str, object] = {
        "kind": CollisionType.ExplosionBall,
        "mass": 1.0,
        "vx": 1.0,
        "normal_x": -1.0,
    }
    array = np.zeros(1, dtype=COLLISION_DTYPE)
    for name, value in (defaults | values).items():
        array[name] = value
    return array


def two_obstacles() -> tuple[ModularObstacle, ModularObstacle]:
    """Return obstacles of two modules and of one module."""
    return (
        ModularObstacle("wall", corner=(40.0, 8.0), rows=2, columns=1, protected=True),
        ModularObstacle("post", corner=(80.0, 8.0), rows=1, columns=1, weight=2.0, capacity=5.0),
    )


@pytest.mark.parametrize(
    ("frame", "columns"),
    [
        ("collisions", COLLISION_COLUMNS),
        ("modules", MODULE_COLUMNS),
        ("structures", STRUCTURE_COLUMNS),
    ],
)
def test_a_table_has_exactly_the_columns_that_are_explained(
    blast: BlastResult, quiet_blast: BlastResult, frame: str, columns: Sequence[Column]
) -> None:
    names = [column.name for column in columns]
    assert list(getattr(blast, frame).columns) == names
    assert list(getattr(quiet_blast, frame).columns) == names
    assert len(set(names)) == len(names)
    assert all(column.meaning for column in columns)


def test_the_impulse_is_the_recorded_one_and_the_speed_is_of_the_velocity() -> None:
    row = collision_table(record(impulse=2.5, vx=3.0, vy=-4.0), two_obstacles()).iloc[0]
    assert (row["speed"], row["impulse_sim"]) == (5.0, 2.5)


@pytest.mark.parametrize(
    ("velocity", "normal", "angle_deg"),
    [
        ((2.0, 0.0), (-1.0, 0.0), 0.0),
        ((1.0, 1.0), (-1.0, 0.0), 45.0),
        ((1.0, -1.0), (-1.0, 0.0), 45.0),
        ((0.0, 3.0), (-1.0, 0.0), 90.0),
        ((0.0, -7.0), (0.0, 1.0), 0.0),
    ],
)
def test_angle_of_incidence_is_0_head_on_and_90_grazing(
    velocity: tuple[float, float], normal: tuple[float, float], angle_deg: float
) -> None:
    collision = record(vx=velocity[0], vy=velocity[1], normal_x=normal[0], normal_y=normal[1])
    row = collision_table(collision, two_obstacles()).iloc[0]
    assert row["angle_deg"] == pytest.approx(angle_deg)
    assert row["angle_rad"] == pytest.approx(np.radians(angle_deg))


def test_modules_are_counted_through_all_obstacles() -> None:
    collisions = np.concatenate([record(module=index) for index in range(3)])
    table = collision_table(collisions, two_obstacles())
    assert table["structure"].tolist() == ["wall", "wall", "post"]
    assert table["module_id"].tolist() == ["x10.250_y2.250", "x10.250_y2.750", "x20.250_y2.250"]


def test_balls_are_named_as_in_the_paper() -> None:
    collisions = np.concatenate(
        [record(kind=CollisionType.AirBall), record(kind=CollisionType.ExplosionBall)]
    )
    table = collision_table(collisions, two_obstacles())
    assert table["particle_type"].tolist() == ["AirBall", "ExplosionBall"]


def test_modules_are_placed_in_metres_and_unhit_ones_have_no_time() -> None:
    obstacles = two_obstacles()
    obstacles[0].parts[1].register(0.25, 3.0, 0.0)
    table = module_table(obstacles)
    assert table[["x_m", "y_m"]].to_numpy().tolist() == [
        [10.25, 2.25],
        [10.25, 2.75],
        [20.25, 2.25],
    ]
    assert table["row"].tolist() == [0, 1, 0]
    np.testing.assert_array_equal(table["first_hit_s"], [np.nan, 0.25, np.nan])


def test_structures_sum_their_modules_and_keep_the_first_time() -> None:
    obstacles = two_obstacles()
    for part, time_s in zip(obstacles[0].parts, (0.5, 0.25), strict=True):
        part.register(time_s, 3.0, 0.0)
    wall, post = structure_table(obstacles).to_dict("records")
    assert (wall["modules"], wall["hits"], wall["impulse_sim"]) == (2, 2, 6.0)
    assert wall["first_hit_s"] == 0.25
    assert (wall["protected"], post["protected"], post["weight"]) == (True, False, 2.0)
    assert np.isnan(post["first_hit_s"])


def test_a_module_is_destroyed_beyond_its_capacity_not_at_it() -> None:
    obstacles = two_obstacles()
    post = obstacles[1].parts[0]
    post.register(0.1, 5.0, 0.0)
    assert structure_table(obstacles)["modules_destroyed"].tolist() == [0, 0]
    post.register(0.2, 0.5, 0.0)
    assert structure_table(obstacles)["modules_destroyed"].tolist() == [0, 1]
    assert module_table(obstacles)["destroyed"].tolist() == [False, False, True]
