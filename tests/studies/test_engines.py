"""The two particle engines against each other, and the study of it."""

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from blast_env import load_scenario
from studies import engines
from studies.engines import HEADERS, Agreement, agreements, relative_difference

FACADE = (
    load_scenario("free_field")
    .at_stand_off(8.0)
    .with_simulation(overrides={"explosive": {"ball_count": 60}, "air": {"spacing_units": 0.0}})
)
"""Balls that meet nothing but the facade, on which the engines agree almost exactly."""


def test_the_engines_agree_where_balls_only_meet_a_facade() -> None:
    for each in agreements({"facade": FACADE}, 10, 1, (0.5, 0.25)):
        assert each.is_close
        assert abs(each.transferred.value) < 0.01
        assert len(each.cells()) == len(HEADERS)


def test_a_difference_by_hand() -> None:
    found = relative_difference(np.array([11.0, 12.0, 13.0]), np.array([10.0, 10.0, 10.0]))
    assert found.value == pytest.approx(0.2)
    half_width = 4.3026527 * 0.1 / 3.0**0.5  # Student's t with two degrees of freedom
    assert found.high - found.value == pytest.approx(half_width)
    near = relative_difference(np.array([10.3, 10.3, 10.3]), np.full(3, 10.0))
    assert Agreement("scene", 0.5, near, near).is_close
    assert not Agreement("scene", 0.5, near, found).is_close


def test_an_unknown_scene_is_named() -> None:
    app = Typer()
    app.command()(engines.main)
    result = CliRunner().invoke(app, ["--scene", "moon"])
    assert result.exit_code == 2
    assert "--scene is 'moon', must be one of free_field, 15 m" in " ".join(result.output.split())
