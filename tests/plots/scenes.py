from typing import Any

import numpy as np

from blast_env.evaluation.engines import Blast
from blast_env.particles.run import BallStates
from blast_env.site import Scenario
from blast_env.site.scene import Scene

LAYOUT = tuple((row, 1) for row in range(2, 9))


def small_scenario(ball_count: int = 240, time_limit_s: float = 0.05) -> Scenario:
    document: dict[str, Any] = {
        "schema_version": 2,
        "name": "small",
        "site": {"width_m": 20.0, "height_m": 20.0},
        "charge": [{"kind": "point", "position_m": (6.0, 10.0), "tnt_kg": 100.0}],
        "structures": [
            {
                "kind": "ConcreteSquare",
                "name": "shelter",
                "corner_m": (12.0, 8.5),
                "side_modules": 6,
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
        "build_zone": {
            "corner_m": (8.5, 7.0),
            "rows": 12,
            "columns": 4,
            "stock": 12,
            "keep_outs": [{"corner_m": (8.5, 12.0), "size_m": (2.0, 1.0), "reason": "road"}],
        },
        "simulation": {
            "preset": "ballistic",
            "overrides": {
                "explosive": {"ball_count": ball_count},
                "stepping": {"time_limit_s": time_limit_s},
            },
        },
    }
    return Scenario.model_validate(document)


def small_blast(with_barrier: bool = False) -> Blast:
    return Blast(small_scenario(), LAYOUT if with_barrier else ())


def balls_at_start(scene: Scene) -> BallStates:
    balls = scene.balls
    return BallStates(
        index=np.arange(len(balls)),
        kind=balls.kind,
        position=balls.position,
        velocity=balls.velocity,
        mass=balls.mass,
        radius=balls.radius,
    )
