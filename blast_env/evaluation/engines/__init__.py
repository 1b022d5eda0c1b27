"""Engines: their common interface, the registry, and functions that run blasts on them.

`engines.gas` is not imported here, because it imports Numba, which takes half a second.
"""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.evaluation.engines.contract import (
        CALIBRATED_ENGINES,
        ENGINE_NAMES,
        JUDGE,
        PAPER_ENGINES,
        Engine,
        choosing_engine,
        default_engine,
        final_engine,
        find_engine,
    )
    from blast_env.evaluation.engines.particles import Blast, BlastResult, ParticleEngine
    from blast_env.evaluation.engines.simulation import simulate
    from blast_env.evaluation.record import BlastLoads, StructureLoad
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "CALIBRATED_ENGINES",
    "ENGINE_NAMES",
    "JUDGE",
    "PAPER_ENGINES",
    "Blast",
    "BlastLoads",
    "BlastResult",
    "Engine",
    "ParticleEngine",
    "StructureLoad",
    "choosing_engine",
    "default_engine",
    "final_engine",
    "find_engine",
    "simulate",
]
