"""The particle model of Martyniuk & Kochkarov: engines, collision tables and calibration."""

from typing import TYPE_CHECKING, Final

from blast_env.particles.balls import (
    Balls,
    CollisionType,
    air_lattice,
    distance_to_rectangle,
    explosion_fan,
)
from blast_env.particles.run import (
    COLLISION_DTYPE,
    BallStates,
    BlastRun,
    CollisionArray,
    incidence_angle_rad,
)
from blast_env.particles.scene import Scene, build_scene
from blast_env.particles.structure import ModularObstacle, load_colour, obstacle_of

if TYPE_CHECKING:
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
    from blast_env.particles.recording import write_blast
    from blast_env.particles.tables import (
        COLLISION_COLUMNS,
        MODULE_COLUMNS,
        STRUCTURE_COLUMNS,
        collision_table,
        faces_hit,
        module_table,
        structure_table,
    )

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
    "distance_to_rectangle",
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

_PAPER: Final = frozenset(
    {
        "LINEAR",
        "PAPER_LAWS",
        "POWER",
        "PROPORTIONAL",
        "PaperLaw",
        "comparative_table",
        "comparison_table",
        "metrics_row",
    }
)
_RECORDING: Final = frozenset({"write_blast"})
_TABLES: Final = frozenset(
    {
        "COLLISION_COLUMNS",
        "MODULE_COLUMNS",
        "STRUCTURE_COLUMNS",
        "collision_table",
        "faces_hit",
        "module_table",
        "structure_table",
    }
)


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _PAPER:
        from blast_env.particles import paper

        return getattr(paper, name)
    if name in _RECORDING:
        from blast_env.particles import recording

        return getattr(recording, name)
    if name in _TABLES:
        from blast_env.particles import tables

        return getattr(tables, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
