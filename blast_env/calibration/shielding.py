"""The shielding study: how much of a blast's impulse gets round the corners of a block.

Street-junction experiments give the impulse behind a long box as a share of the free-field impulse
at the same path length round the corner. The study measures the same shares in a simulation: the
load on gauges on the sides and the back of a block, over the load on a wall parallel to the flow in
the open, as far from the charge as the path round the corner is long.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blast_env.calibration.shielding_loads import Face, face_loads
from blast_env.calibration.shielding_ratios import EXPERIMENT, REGIONS, Region, scaled_ratio
from blast_env.calibration.shielding_report import ShieldingReport
from blast_env.calibration.shielding_scenes import (
    BlockGeometry,
    FloatArray,
    block_scenario,
    wall_scenario,
)
from blast_env.calibration.shielding_settings import StudySettings

__all__ = [
    "EXPERIMENT",
    "REGIONS",
    "BlockGeometry",
    "Region",
    "ShieldingReport",
    "ShieldingStudy",
    "scaled_ratio",
]


@dataclass(frozen=True)
class ShieldingStudy(StudySettings):
    """Blasts on a block, and on a wall parallel to the flow in the open; see `StudySettings`.

    `ShieldingReport.late_shares` says whether the time limit was long enough.
    """

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: As `StudySettings`.
            ScenarioError: If the parameters do not fit each other or the scenes.
        """
        super().__post_init__()
        block_scenario(self.geometry, self.scene_parameters)

    def run(
        self, processes: int = 1, progress: Callable[[float], None] | None = None
    ) -> ShieldingReport:
        """Run all blasts. The result does not depend on the number of processes.

        Args:
            processes: Worker processes.
            progress: Called with the share of the blasts that is done.

        Raises:
            BlastEnvError: If a blast ended at its limit of collisions, or if nothing at all
                arrived at the wall in the open.
        """
        parameters = self.scene_parameters
        scenes = (
            block_scenario(self.geometry, parameters),
            wall_scenario(self.geometry, parameters),
        )
        block, wall = self.run_blasts(scenes, face_loads, processes, progress)
        return ShieldingReport(
            self,
            np.array([gauge_loads(faces) for faces in block]),
            np.array([wall_loads(faces) for faces in wall]),
        )


def gauge_loads(faces: FloatArray) -> FloatArray:
    """Return the loads on the gauges of a block, symmetric ones folded (kinds, gauges).

    Args:
        faces: Loads on all faces (kinds, faces, rows, columns).
    """
    # Along the sides a gauge is a column of modules, at the back it is a row.
    side = (faces[:, Face.LEFT] + faces[:, Face.RIGHT]).sum(axis=1) / 2.0
    back = faces[:, Face.BACK].sum(axis=2)
    back = (back + back[:, ::-1]) / 2.0
    half = (back.shape[1] + 1) // 2
    return np.concatenate((side, back[:, :half]), axis=1)


def wall_loads(faces: FloatArray) -> FloatArray:
    """Return the loads on the wall in the open, mean of its two faces (kinds, modules).

    Args:
        faces: Loads on all faces (kinds, faces, rows, columns).
    """
    loads: FloatArray = (faces[:, Face.LEFT] + faces[:, Face.RIGHT]).sum(axis=1) / 2.0
    return loads
