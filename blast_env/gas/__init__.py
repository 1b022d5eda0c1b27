"""Gas dynamics: the compressible Euler equations in three dimensions around solid cells."""

from typing import TYPE_CHECKING, Final

from blast_env.gas.cost import CostGuess, cost_words, time_words
from blast_env.gas.oblique_walls import STEPPED, stepped_buildings
from blast_env.gas.settings import CELLS, CHECKED_CELLS, Cells, GasSettings

if TYPE_CHECKING:
    from blast_env.gas.coarsening import CoarseningSolver, shape_to_double, with_double_cells
    from blast_env.gas.engine import GasRun
    from blast_env.gas.faces import Faces, exposed_faces, ground_faces
    from blast_env.gas.grid import FaceKind, GasGrid
    from blast_env.gas.probes import (
        FaceLoads,
        Gauges,
        GroundMap,
        LoadTable,
        PatchHistories,
        Snapshots,
        positive_phases,
    )
    from blast_env.gas.solver import AIR_DENSITY_KG_M3, Burning, Gas, GasSolver, Settling
    from blast_env.gas.source import (
        LEAST_RADIUS_CELLS,
        TNT,
        GasCharge,
        RadialProfile,
        clearance_m,
        largest_radius_m,
        lay,
        least_clearance_m,
        set_charge,
    )
    from blast_env.gas.spherical import SphericalBlast

__all__ = [
    "AIR_DENSITY_KG_M3",
    "CELLS",
    "CHECKED_CELLS",
    "LEAST_RADIUS_CELLS",
    "STEPPED",
    "TNT",
    "Burning",
    "Cells",
    "CoarseningSolver",
    "CostGuess",
    "FaceKind",
    "FaceLoads",
    "Faces",
    "Gas",
    "GasCharge",
    "GasGrid",
    "GasRun",
    "GasSettings",
    "GasSolver",
    "Gauges",
    "GroundMap",
    "LoadTable",
    "PatchHistories",
    "RadialProfile",
    "Settling",
    "Snapshots",
    "SphericalBlast",
    "clearance_m",
    "cost_words",
    "exposed_faces",
    "ground_faces",
    "largest_radius_m",
    "lay",
    "least_clearance_m",
    "positive_phases",
    "set_charge",
    "shape_to_double",
    "stepped_buildings",
    "time_words",
    "with_double_cells",
]

_COARSENING: Final = frozenset({"CoarseningSolver", "shape_to_double", "with_double_cells"})
_ENGINE: Final = frozenset({"GasRun"})
_FACES: Final = frozenset({"Faces", "exposed_faces", "ground_faces"})
_GRID: Final = frozenset({"FaceKind", "GasGrid"})
_PROBES: Final = frozenset(
    {
        "FaceLoads",
        "Gauges",
        "GroundMap",
        "LoadTable",
        "PatchHistories",
        "Snapshots",
        "positive_phases",
    }
)
_SOLVER: Final = frozenset({"AIR_DENSITY_KG_M3", "Burning", "Gas", "GasSolver", "Settling"})
_SOURCE: Final = frozenset(
    {
        "GasCharge",
        "LEAST_RADIUS_CELLS",
        "RadialProfile",
        "TNT",
        "clearance_m",
        "largest_radius_m",
        "lay",
        "least_clearance_m",
        "set_charge",
    }
)
_SPHERICAL: Final = frozenset({"SphericalBlast"})


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _COARSENING:
        from blast_env.gas import coarsening

        return getattr(coarsening, name)
    if name in _ENGINE:
        from blast_env.gas import engine

        return getattr(engine, name)
    if name in _FACES:
        from blast_env.gas import faces

        return getattr(faces, name)
    if name in _GRID:
        from blast_env.gas import grid

        return getattr(grid, name)
    if name in _PROBES:
        from blast_env.gas import probes

        return getattr(probes, name)
    if name in _SOLVER:
        from blast_env.gas import solver

        return getattr(solver, name)
    if name in _SOURCE:
        from blast_env.gas import source

        return getattr(source, name)
    if name in _SPHERICAL:
        from blast_env.gas import spherical

        return getattr(spherical, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
