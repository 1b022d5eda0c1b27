"""The gas solver against rhoCentralFoam of OpenFOAM, on one scene with a barrier of finite height.

Both codes have the same cells, the same gas (gamma 1.4, no burning) and the same initial state,
and record the overpressure in the same cells. Only the scheme differs: MUSCL-Hancock with HLLC
here, central-upwind fluxes of Kurganov and Tadmor there. OpenFOAM runs as a separate program
(Debian's package `openfoam`); it is not part of this project.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder, write_atomically
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import Gauges
from blast_env.gas.solver import AIR_PRESSURE_PA, GasSolver
from blast_env.gas.source import Explosive, GasCharge, set_charge
from blast_env.gas.state import GAMMA
from studies.other_codes.histories import Histories

PROGRAMS: Final = ("blockMesh", "topoSet", "subsetMesh", "rhoCentralFoam")
BALLOON: Final = Explosive(1630.0, 4.52e6, 0.0, 1.0, 2.0)
"""A charge that every code can model: all its energy at once, no afterburning."""

_GAS_CONSTANT: Final = 287.0  # J/(kg K); only turns density into OpenFOAM's temperature
_MOST_COURANT: Final = 0.2  # as in rhoCentralFoam's tutorials
_SIZE_M: Final = (20.0, 16.0, 8.0)
_CHARGE_KG: Final = 20.0
_CHARGE_M: Final = (4.0, 8.0, 0.0)

Box = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Low and high corner, m."""
WALL: Final[Box] = ((7.0, 4.0, 0.0), (7.5, 12.0, 1.5))
BUILDING: Final[Box] = ((12.5, 6.0, 0.0), (14.5, 10.0, 3.0))
GAUGES_M: Final[Mapping[str, tuple[float, float, float]]] = MappingProxyType(
    {
        "before the wall": (6.9, 8.1, 0.6),
        "behind the wall": (7.6, 8.1, 0.6),
        "facade, at the ground": (12.4, 8.1, 0.1),
        "facade, top": (12.4, 8.1, 2.9),
        "side of the building": (13.6, 5.9, 0.6),
        "behind the building": (14.6, 8.1, 0.6),
    }
)
FACADE: Final = "facade, mean"


@dataclass(frozen=True, eq=False)
class WallScene:
    """A wall of finite height and a building as cells, with gauges.

    Attributes:
        grid: The grid.
        names: Names of the gauges; the last one is the mean over the facade.
        gauges: Cells of all gauges but the last, then those before the facade (n, 3).
    """

    grid: GasGrid
    names: tuple[str, ...]
    gauges: NDArray[np.int64]

    def named(self, overpressure_pa: FloatArray) -> FloatArray:
        """Reduce the overpressures of the cells (steps, n) to the names (steps, names)."""
        own = len(self.names) - 1
        mean = overpressure_pa[:, own:].mean(axis=1, keepdims=True)
        return np.concatenate((overpressure_pa[:, :own], mean), axis=1)


def scene(cell_m: float) -> WallScene:
    """Return the scene on cells of a given side.

    Raises:
        BlastEnvError: If 0.5 m is not a whole number of cells.
    """
    if not np.isclose(0.5 / cell_m, round(0.5 / cell_m)) or cell_m > 0.5:
        raise BlastEnvError(f"cell_m is {cell_m:g}, must be 0.5 m divided by a whole number")
    shape = tuple(round(side / cell_m) for side in _SIZE_M)
    solid = np.zeros(shape, dtype=np.bool_)
    for low, high in (WALL, BUILDING):
        solid[
            tuple(
                slice(round(a / cell_m), round(b / cell_m)) for a, b in zip(low, high, strict=True)
            )
        ] = True
    grid = GasGrid(cell_m, solid)
    cells = [grid.cell_at(place) for place in GAUGES_M.values()]
    (left, south, _), (_, north, top) = BUILDING
    rows = range(round(south / cell_m), round(north / cell_m))
    before = round(left / cell_m) - 1
    facade = [(before, row, level) for row in rows for level in range(round(top / cell_m))]
    return WallScene(grid, (*GAUGES_M, FACADE), np.array([*cells, *facade]))


def started(scene: WallScene, gauges: Gauges) -> GasSolver:
    """Return the project's solver with the charge set on the grid, its front at the wall."""
    charge = GasCharge(_CHARGE_KG, _CHARGE_M, BALLOON)
    solver = GasSolver(
        scene.grid, recorders=[gauges], with_fuel=True, burning=charge.burning, threads=1
    )
    set_charge(solver, charge)
    return solver


def ours(scene: WallScene, until_s: float) -> Histories:
    """Run the scene with the project's solver."""
    gauges = Gauges(scene.grid, scene.gauges)
    solver = started(scene, gauges)
    begin = process_time()
    solver.advance(until_s)
    cpu_s = process_time() - begin
    return Histories(
        gauges.time_s, scene.named(gauges.history_pa), float(solver.cell_updates), cpu_s
    )


def rho_central_foam(scene: WallScene, until_s: float, folder: Path) -> Histories:
    """Write the case into a folder, run it with OpenFOAM, and read its records.

    Args:
        scene: The scene.
        until_s: Simulated time at the end.
        folder: Folder of the case; must be empty or new.

    Raises:
        BlastEnvError: If OpenFOAM is not installed, the folder is not empty, or a program fails.
    """
    missing = [program for program in PROGRAMS if shutil.which(program) is None]
    if missing:
        raise BlastEnvError(
            f"OpenFOAM's {', '.join(missing)} not found: install it (Debian: apt install openfoam)"
        )
    if folder.exists() and any(folder.iterdir()):
        raise BlastEnvError(f"{folder} is not empty: take another folder for the case")
    solver = started(scene, Gauges(scene.grid, scene.gauges))
    _write_case(scene, solver, until_s, folder)
    for command in (
        ("blockMesh",),
        ("topoSet",),
        ("subsetMesh", "-overwrite", "air", "-patch", "solids"),
    ):
        _run(command, folder)
    _write_fields(scene, solver, folder / "0")
    log = _run(("rhoCentralFoam",), folder)
    table = np.loadtxt(folder / "postProcessing" / "gauges" / "0" / "p", comments="#")
    steps = len(re.findall(r"^Time = ", log, re.MULTILINE))
    cells = int((~scene.grid.solid).sum())
    cpu_s = float(re.findall(r"ExecutionTime = ([0-9.]+) s", log)[-1])
    time_s = table[:, 0] + solver.time_s
    overpressure_pa = scene.named(table[:, 1:] - AIR_PRESSURE_PA)
    return Histories(time_s, overpressure_pa, float(cells * steps), cpu_s)


def _run(command: tuple[str, ...], folder: Path) -> str:
    # Debian's programs need the path of their settings; other installations set the variable.
    settings = {"WM_PROJECT_DIR": "/usr/share/openfoam"} | os.environ
    done = subprocess.run(
        command, cwd=folder, env=settings, capture_output=True, text=True, check=False
    )
    _write(folder / f"log.{command[0]}", done.stdout + done.stderr)
    if done.returncode != 0:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:] or [""]
        raise BlastEnvError(
            f"{command[0]} failed with status {done.returncode} in {folder}: {last[0]}"
        )
    return done.stdout


def _write_case(scene: WallScene, solver: GasSolver, until_s: float, folder: Path) -> None:
    """Write the case without the fields, which need the mesh without the solids."""
    for name in ("system", "constant", "0"):
        make_folder(folder / name)
    centres_m = scene.grid.cell_m * (scene.gauges + 0.5)
    texts = {
        "system/blockMeshDict": _block_mesh(scene.grid),
        "system/topoSetDict": _TOPO_SET,
        "system/controlDict": _CONTROL.format(
            until_s=until_s - solver.time_s,
            first_s=1e-6,
            courant=_MOST_COURANT,
            probes="\n".join(f"({x:.9g} {y:.9g} {z:.9g})" for x, y, z in centres_m),
        ),
        "system/fvSchemes": _SCHEMES,
        "system/fvSolution": _SOLUTION,
        "constant/thermophysicalProperties": _GAS.format(
            mole_g=8314.46 / _GAS_CONSTANT, heat=_GAS_CONSTANT / (GAMMA - 1.0)
        ),
        "constant/turbulenceProperties": "simulationType laminar;\n",
    }
    for name, text in texts.items():
        _write(folder / name, _HEADER.format(kind="dictionary", name=Path(name).name) + text)


def _block_mesh(grid: GasGrid) -> str:
    x, y, z = (grid.cell_m * n for n in grid.shape)
    corners = [(a, b, c) for c in (0.0, z) for a, b in ((0.0, 0.0), (x, 0.0), (x, y), (0.0, y))]
    vertices = " ".join(f"({a:g} {b:g} {c:g})" for a, b, c in corners)
    cells = " ".join(str(n) for n in grid.shape)
    return (
        f"convertToMeters 1;\nvertices ({vertices});\n"
        f"blocks (hex (0 1 2 3 4 5 6 7) ({cells}) simpleGrading (1 1 1));\nedges ();\n"
        "boundary (\n"
        "ground { type wall; faces ((0 3 2 1)); }\n"
        "open { type patch; faces ((4 5 6 7) (0 4 7 3) (1 2 6 5) (0 1 5 4) (3 7 6 2)); }\n"
        "solids { type wall; faces (); }\n);\n"
    )


def _write_fields(scene: WallScene, solver: GasSolver, folder: Path) -> None:
    """Write pressure, temperature and velocity of the air cells in OpenFOAM's order, x first."""
    air = ~scene.grid.solid.transpose(2, 1, 0)
    pressure = solver.pressure().transpose(2, 1, 0)[air]
    density = solver.density().transpose(2, 1, 0)[air]
    velocity = np.stack([part.transpose(2, 1, 0)[air] for part in solver.velocity()], axis=1)
    fields = (
        ("p", "volScalarField", "[1 -1 -2 0 0 0 0]", "scalar", pressure, "zeroGradient"),
        (
            *("T", "volScalarField", "[0 0 0 1 0 0 0]", "scalar"),
            pressure / (density * _GAS_CONSTANT),
            "zeroGradient",
        ),
        ("U", "volVectorField", "[0 1 -1 0 0 0 0]", "vector", velocity, "slip"),
    )
    for name, kind, dimensions, of, values, wall in fields:
        if of == "vector":
            lines = "\n".join(f"({a:.9g} {b:.9g} {c:.9g})" for a, b, c in values)
        else:
            lines = "\n".join(f"{value:.9g}" for value in values)
        _write(
            folder / name,
            _HEADER.format(kind=kind, name=name)
            + f"dimensions {dimensions};\n"
            + f"internalField nonuniform List<{of}>\n{len(values)}\n(\n{lines}\n);\n"
            + "boundaryField {\n"
            + f'"(ground|solids)" {{ type {wall}; }}\nopen {{ type zeroGradient; }}\n}}\n',
        )


def _write(path: Path, text: str) -> None:
    with write_atomically(path, durable=False) as temporary:
        temporary.write_text(text, encoding="utf-8")


_HEADER: Final = "FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"
_TOPO_SET: Final = (
    "actions (\n"
    + "".join(
        f"{{ name air; type cellSet; action {action}; source boxToCell; "
        f"box ({' '.join(map(str, low))}) ({' '.join(map(str, high))}); }}\n"
        for action, (low, high) in (
            ("new", ((0.0, 0.0, 0.0), _SIZE_M)),
            ("subtract", WALL),
            ("subtract", BUILDING),
        )
    )
    + ");\n"
)
_CONTROL: Final = """application rhoCentralFoam;
startFrom startTime; startTime 0; stopAt endTime; endTime {until_s:.9g}; deltaT {first_s:g};
writeControl runTime; writeInterval 1; writePrecision 9; timePrecision 9;
runTimeModifiable no; adjustTimeStep yes; maxCo {courant:g}; maxDeltaT 1;
functions {{ gauges {{
type probes; libs ("libsampling.so"); fields (p); writeControl timeStep; writeInterval 1;
probeLocations (
{probes}
);
}} }}
"""
_SCHEMES: Final = """fluxScheme Kurganov;
ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes { default none; div(tauMC) Gauss linear; }
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes {
default linear;
reconstruct(rho) vanLeer; reconstruct(U) vanLeerV; reconstruct(T) vanLeer;
}
snGradSchemes { default corrected; }
"""
_SOLUTION: Final = """solvers {
"(rho|rhoU|rhoE)" { solver diagonal; }
U { solver smoothSolver; smoother GaussSeidel; nSweeps 2; tolerance 1e-9; relTol 0.01; }
e { $U; tolerance 1e-10; relTol 0; }
}
"""
_GAS: Final = """thermoType {{
type hePsiThermo; mixture pureMixture; transport const; thermo eConst;
equationOfState perfectGas; specie specie; energy sensibleInternalEnergy;
}}
mixture {{
specie {{ molWeight {mole_g:.9g}; }}
thermodynamics {{ Cv {heat:.9g}; Hf 0; }}
transport {{ mu 0; Pr 1; }}
}}
"""
