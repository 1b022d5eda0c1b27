"""Gas dynamics: the compressible Euler equations in three dimensions around solid cells."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.gas.coarsening import CoarseningSolver, shape_to_double, with_double_cells
    from blast_env.gas.cost import CostGuess, cost_words, time_words
    from blast_env.gas.engine import GasRun
    from blast_env.gas.faces import Faces, exposed_faces, ground_faces
    from blast_env.gas.grid import FaceKind, GasGrid
    from blast_env.gas.oblique_walls import STEPPED, stepped_buildings
    from blast_env.gas.probes import (
        FaceLoads,
        Gauges,
        GroundMap,
        LoadTable,
        PatchHistories,
        Snapshots,
    )
    from blast_env.gas.settings import CELLS, CHECKED_CELLS, Cells, GasSettings
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
else:
    __getattr__, __dir__ = on_first_use(__name__)

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
    "set_charge",
    "shape_to_double",
    "stepped_buildings",
    "time_words",
    "with_double_cells",
]
