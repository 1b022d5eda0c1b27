import numpy as np

from blast_env.evaluation.engines import Blast
from blast_env.particles import BallStates, Scene
from blast_env.site import Scenario
from tests.builders import block, point, site, square, zone

LAYOUT = tuple((row, 1) for row in range(2, 9))


def small_scenario(ball_count: int = 240, time_limit_s: float = 0.05) -> Scenario:
    road = {"corner_m": (8.5, 12.0), "size_m": (2.0, 1.0), "reason": "road"}
    overrides = {
        "explosive": {"ball_count": ball_count},
        "stepping": {"time_limit_s": time_limit_s},
    }
    return site(
        "small",
        (20.0, 20.0),
        point(6.0, 10.0),
        square("shelter", 12.0, 8.5, 6, protected=True),
        block("wall", 3.0, 15.0, 2, 10),
        build_zone=zone(8.5, 7.0, 12, 4, stock=12, keep_outs=[road]),
        simulation={"preset": "ballistic", "overrides": overrides},
    )


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
