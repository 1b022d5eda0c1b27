"""Scenes of the atlas: boxes around a charge, and the loads on the bays of one of them.

All scenes have a charge of 216 kg, whose cube root is 6, so that a module is a twelfth of the
scaled metre, m/kg^(1/3). Lengths are numbers of modules, from the charge.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.engines.gas_validation import bay_middles
from blast_env.response.sdof import impulses
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M

MODULES: Final = 12
"""Modules per m/kg^(1/3)."""

CUBE_ROOT: Final = MODULES * MODULE_SIDE_M
"""Cube root of the mass of the charge, kg^(1/3)."""

JUDGED: Final = "judged"
"""Name of the box whose bays have loads."""

_STIFF: Final = {
    "kind": "glazing",
    "title": "stiff pane, which needs no time to respond",
    "source": "for recording alone",
    "width_m": 0.3,
    "height_m": 0.3,
    "thickness_mm": 30.0,
}
_AROUND: Final = 4  # modules of open ground between the outermost box and the border
_ABOVE: Final = 6  # modules of air above the highest box


@dataclass(frozen=True)
class Box:
    """A solid box, in modules from the charge.

    Attributes:
        x: Its side towards the charge, or the lower one.
        y: Its lower side across.
        depth: Along x.
        width: Along y.
        top: Height of its top above the ground.
        base: Height of its underside.
    """

    x: int
    y: int
    depth: int
    width: int
    top: int
    base: int = 0


@dataclass(frozen=True)
class Scene:
    """A charge, a box with a facade, and other boxes.

    Attributes:
        numbers: Its dimensionless numbers, lengths over the cube root of the mass.
        judged: The box with the facade.
        faces: Its walls that have loads.
        others: The other boxes.
        up: Height of the charge, in modules.
    """

    numbers: Mapping[str, float]
    judged: Box
    faces: tuple[str, ...] = ("west",)
    others: tuple[Box, ...] = ()
    up: float = 0.0

    def scenario(self, cube_root: float = CUBE_ROOT) -> Scenario:
        """Return its site; another cube root makes the same scene for another charge."""
        module_m = MODULE_SIDE_M * cube_root / CUBE_ROOT
        boxes = (self.judged, *self.others)
        low_x = min(0, *(box.x for box in boxes)) - _AROUND
        low_y = min(0, *(box.y for box in boxes)) - _AROUND
        high_x = max(0, *(box.x + box.depth for box in boxes)) + _AROUND
        high_y = max(0, *(box.y + box.width for box in boxes)) + _AROUND
        structures = [
            {
                "kind": "ModularObstacle",
                "name": JUDGED if index == 0 else f"other{index}",
                "corner_m": [module_m * (box.x - low_x), module_m * (box.y - low_y)],
                "rows": round(box.width * module_m / MODULE_SIDE_M),
                "columns": round(box.depth * module_m / MODULE_SIDE_M),
                "height_m": module_m * box.top,
                "base_m": module_m * box.base,
                "protected": index == 0,
                **({"faces": [*self.faces], "facade": {"glazing": "stiff"}} if index == 0 else {}),
            }
            for index, box in enumerate(boxes)
        ]
        high = max(box.top for box in boxes) + _ABOVE
        charge = {
            "kind": "point",
            "position_m": [-module_m * low_x, -module_m * low_y],
            "tnt_kg": round(cube_root**3, 6),
            "height_m": module_m * self.up,
        }
        document = {
            "schema_version": 2,
            "name": "atlas",
            "site": {
                "width_m": module_m * (high_x - low_x),
                "height_m": module_m * (high_y - low_y),
                "air_height_m": module_m * high,
            },
            "charge": [charge],
            "structures": structures,
            "components": {"stiff": _STIFF},
        }
        return Scenario.from_document(document, "atlas")

    def described(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class SceneLoads:
    """The loads on the bays of a scene.

    Attributes:
        bays: Names of the bays.
        middles: Their middles from the charge's foot, m/kg^(1/3) (bays, 3).
        normals: Their outward normals (bays, 3).
        impulse: Peak specific impulses over the cube root, Pa s/kg^(1/3) (bays,).
        peak: Peak overpressures, Pa (bays,).
        known: Whether every load was known at the end of the run.
    """

    bays: tuple[str, ...]
    middles: FloatArray
    normals: FloatArray
    impulse: FloatArray
    peak: FloatArray
    known: bool


def scaled_impulse(scene: Scene, cell_m: float, cube_root: float) -> float:
    """Return the mean impulse of the facade over the cube root of the mass, Pa s/kg^(1/3).

    Cells, and the ground around them, keep their share of the cube root: 0.5 m belong to 6.
    """
    share = cube_root / CUBE_ROOT
    plain = GasEngine()
    engine = GasEngine(
        cell_m=cell_m, margin_m=share * plain.margin_m, border_m=share * plain.border_m
    )
    result = GasBlast(scene.scenario(cube_root), engine=engine).run()
    return result.impulse(JUDGED).pa_s / cube_root


def loads_of(scene: Scene, engine: GasEngine) -> SceneLoads:
    """Run the blast of a scene and return the loads on its bays."""
    site = scene.scenario()
    result = GasBlast(site, engine=engine).run()
    loads = result.bay_loads
    rectangles_m = {structure.name: structure.rectangle_m for structure in site.structures}
    middles_m, normals = bay_middles(rectangles_m, [own.bay for own in loads.bays])
    foot_m = np.array([*result.run.site.charge.position_m, 0.0])
    time_s, pressure_pa = loads.histories
    return SceneLoads(
        tuple(own.bay.name for own in loads.bays),
        (middles_m - foot_m) / CUBE_ROOT,
        normals,
        impulses(time_s, pressure_pa).max(axis=1) / CUBE_ROOT,
        pressure_pa.max(axis=1),
        all(loads.known(result.run).values()),
    )
