"""The record of the event engine: every column, checked against what can be known of it."""

import numpy as np
import pytest

from blast_env import load_scenario, simulate
from blast_env.particles.run import COLLISION_DTYPE, incidence_angle_rad

COURTYARD = load_scenario("courtyard")


def test_the_record_has_the_columns_of_every_engine() -> None:
    """Field by field against what the row itself, the run and the parts say."""
    result = simulate(COURTYARD, [(4, 0), (5, 0)], seed=2, engine="event")
    log, scene_balls = result.collision_array, result.blast.scene.balls
    assert log.dtype == COLLISION_DTYPE
    assert len(log) > 100
    assert (np.diff(log["time_s"]) >= 0.0).all()
    assert (log["kind"] == scene_balls.kind[log["ball"]]).all()
    vx, vy, normal_x, normal_y = (
        np.asarray(log[name], dtype=float) for name in ("vx", "vy", "normal_x", "normal_y")
    )
    speed = np.hypot(vx, vy)
    quantum = result.blast.scene.impulse_quantum
    assert log["impulse"] == pytest.approx(log["mass"] * speed, abs=quantum)
    assert (log["impulse"] / quantum % 1.0 == 0.0).all()
    assert np.hypot(normal_x, normal_y) == pytest.approx(1.0, rel=1e-12)
    towards = -(vx * normal_x + vy * normal_y)
    restitution = COURTYARD.parameters.contact.module_restitution
    given = (1.0 + restitution) * log["mass"] * towards
    assert log["transferred_impulse"] == pytest.approx(given, rel=1e-12)
    assert (log["transferred_impulse"] > 0.0).all()
    assert (incidence_angle_rad(log) <= np.pi / 2).all()
    parts = [part for obstacle in result.obstacles for part in obstacle.parts]
    for index, part in enumerate(parts):
        of_part = log[log["module"] == index]
        assert part.hits == len(of_part)
        assert part.impulse == of_part["impulse"].sum()
        assert part.transferred_impulse == pytest.approx(of_part["transferred_impulse"].sum())
        if part.hits:
            assert part.first_hit_s == of_part["time_s"][0]
            assert of_part["first_contact"].tolist() == [True] + [False] * (part.hits - 1)
        else:
            assert part.first_hit_s is None
