"""Small real blasts, simulated once."""

from typing import Any

import pytest

from blast_env.evaluation.engines import BlastResult, simulate
from blast_env.site import (
    BuildZone,
    ConcreteSquareSection,
    ModularObstacleSection,
    PointSource,
    Scenario,
    SimulationSection,
    Site,
)

SEED = 2**60 + 1
"""Greater than what Excel can hold as a number."""


def make_scenario(**overrides: dict[str, Any]) -> Scenario:
    return Scenario(
        schema_version=2,
        name="small_yard",
        site=Site(width_m=20.0, height_m=20.0),
        charge=(PointSource(position_m=(4.0, 10.0), tnt_kg=100.0),),
        structures=(
            ConcreteSquareSection(
                kind="ConcreteSquare",
                name="building",
                corner_m=(11.0, 8.5),
                side_modules=6,
                protected=True,
                module_capacity=2500.0,
            ),
            ModularObstacleSection(
                kind="ModularObstacle",
                name="facade",
                corner_m=(16.0, 1.0),
                rows=36,
                columns=1,
                protected=True,
            ),
            ModularObstacleSection(
                kind="ModularObstacle", name="shed", corner_m=(2.0, 15.0), rows=2, columns=4
            ),
        ),
        build_zone=BuildZone(corner_m=(8.0, 8.0), rows=8, columns=2, stock=16),
        simulation=SimulationSection(overrides={"explosive": {"ball_count": 480}} | overrides),
    )


@pytest.fixture(scope="session")
def blast() -> BlastResult:
    """Two protected structures, a shed and a barrier, all of them hit."""
    return simulate(make_scenario(), layout=[(3, 0), (4, 0), (5, 1)], seed=SEED)


@pytest.fixture(scope="session")
def quiet_blast() -> BlastResult:
    """A run that ends before anything is hit."""
    return simulate(make_scenario(stepping={"time_limit_s": 1e-4}))
