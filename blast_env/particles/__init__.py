"""The particle model of Martyniuk & Kochkarov: engines, collision tables and calibration."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.particles.objects import (
        Balls,
        CollisionType,
        ModularObstacle,
        air_lattice,
        explosion_fan,
        load_colour,
        obstacle_of,
    )
    from blast_env.particles.paper import (
        LINEAR,
        PAPER_LAWS,
        POWER,
        PROPORTIONAL,
        PaperLaw,
        comparative_table,
        comparison_table,
        metrics_row,
    )
    from blast_env.particles.run import (
        COLLISION_DTYPE,
        BallStates,
        BlastRun,
        CollisionArray,
        Scene,
        build_scene,
        incidence_angle_rad,
    )
    from blast_env.particles.tables import (
        COLLISION_COLUMNS,
        MODULE_COLUMNS,
        STRUCTURE_COLUMNS,
        collision_table,
        faces_hit,
        module_table,
        structure_table,
        write_blast,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "COLLISION_COLUMNS",
    "COLLISION_DTYPE",
    "LINEAR",
    "MODULE_COLUMNS",
    "PAPER_LAWS",
    "POWER",
    "PROPORTIONAL",
    "STRUCTURE_COLUMNS",
    "BallStates",
    "Balls",
    "BlastRun",
    "CollisionArray",
    "CollisionType",
    "ModularObstacle",
    "PaperLaw",
    "Scene",
    "air_lattice",
    "build_scene",
    "collision_table",
    "comparative_table",
    "comparison_table",
    "explosion_fan",
    "faces_hit",
    "incidence_angle_rad",
    "load_colour",
    "metrics_row",
    "module_table",
    "obstacle_of",
    "structure_table",
    "write_blast",
]
