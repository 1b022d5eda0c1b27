"""Blasts that unfold step by step, as `BlastSimulatorEnv` shows them: of particles, or of gas."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.geometry import Element
from blast_env.physics.engine import BlastRun, EndReason, Engine
from blast_env.physics.engines import is_gas
from blast_env.physics.particles import CollisionType, lattice_capacity
from blast_env.physics.scene import Charge
from blast_env.physics.structure import BARRIER_NAME, ModularPart, module_name
from blast_env.scenario import Scenario
from blast_env.simulation import Blast, BlastResult
from blast_env.units import MODULE_SIDE_M, UNITS_PER_M

if TYPE_CHECKING:  # drawing is an optional extra, and Numba takes half a second to import
    from blast_env.rendering.frames import FramePainter
    from blast_env.rendering.pressure_film import PressureNow
    from blast_env.simulation.gas import GasBlast, GasResult

Observation = dict[str, Any]
"""Arrays by name."""

_BALL_KINDS: Final = (CollisionType.ExplosionBall, CollisionType.AirBall)

PLAN_HEIGHT_M: Final = 1.5
"""Height of the plan of overpressure that is observed; the layer of cells that holds it."""

# Far beyond what is possible; without bounds, spaces draw warnings.
_MOST_IMPULSE: Final = 1e9
_MOST_OVERPRESSURE_PA: Final = 1e10
_LEAST_OVERPRESSURE_PA: Final = -101_325.0
_LATEST_S: Final = 60.0


class Unfolding(Protocol):
    """A blast on its way."""

    @property
    def time_s(self) -> float:
        """Time since the detonation."""

    @property
    def end_reason(self) -> EndReason | None:
        """Why it has ended; None while it has not."""

    @property
    def charge(self) -> Charge:
        """The charge where it goes off."""

    @property
    def layout(self) -> Sequence[Element]:
        """The barrier."""

    @property
    def impulse(self) -> float:
        """Impulse on the protected structures so far, by weight: simulation units, or Pa s."""

    @property
    def module_ids(self) -> tuple[str, ...]:
        """Names of the modules of the structures, as they are observed."""

    def advance(self, until_s: float) -> dict[str, Any]:
        """Go on to a time, or the end; return what is to be said of that part."""

    def observe(self) -> Observation:
        """Return what is seen now."""

    def result(self) -> "BlastResult | GasResult":
        """Return what happened, at the end."""

    def frame(self) -> NDArray[np.uint8]:
        """Return a picture of now."""


class UnfoldingParticles:
    """A blast of particles on its way.

    Args:
        blast: The blast.
    """

    def __init__(self, blast: Blast) -> None:
        self.blast = blast
        self.run = blast.start()
        self._painter: FramePainter | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what draws: it does not pickle, and is made anew."""
        return {**self.__dict__, "_painter": None}

    @property
    def time_s(self) -> float:
        """Time since the detonation."""
        return self.run.time_s

    @property
    def end_reason(self) -> EndReason | None:
        """Why it has ended; None while it has not."""
        return self.run.end_reason

    @property
    def charge(self) -> Charge:
        """The charge where it goes off."""
        return self.blast.scene.charge

    @property
    def layout(self) -> Sequence[Element]:
        """The barrier."""
        return self.blast.layout

    @property
    def impulse(self) -> float:
        """Impulse on the protected structures so far, by weight, simulation units."""
        return sum(o.weight * o.impulse for o in self.run.obstacles if o.protected)

    @property
    def module_ids(self) -> tuple[str, ...]:
        """Names of the modules of the structures, as they are observed."""
        return tuple(part.module_id for part in _structure_parts(self.run))

    def advance(self, until_s: float) -> dict[str, Any]:
        """Go on to a time, or the end; return the collisions on the way."""
        recorded = len(self.run.log)
        self.run.advance(until_s)
        return {
            "collisions": self._collisions(recorded) if len(self.run.log) > recorded else (),
            "impulse_sim": self.impulse,
        }

    def _collisions(self, start: int) -> tuple[dict[Any, Any], ...]:
        """Return the collisions from a number on, each as a row of `BlastResult.collisions`."""
        from blast_env.recording.tables import collision_table  # pandas takes long to import

        table = collision_table(self.run.log.to_array(start), self.run.obstacles)
        return tuple(table.to_dict("records"))

    def observe(self) -> Observation:
        """Return impulses, counts of balls and the time."""
        kinds = self.run.balls().kind
        counts = [(kinds == kind).sum() for kind in _BALL_KINDS]
        return {
            "module_impulses": np.array([part.impulse for part in _structure_parts(self.run)]),
            "particle_counts": np.array(counts, dtype=np.int64),
            "time_s": np.array([self.run.time_s]),
        }

    def result(self) -> BlastResult:
        """Return what happened, at the end.

        Raises:
            ValueError: If the run has not ended.
        """
        return self.blast.result(self.run)

    def frame(self) -> NDArray[np.uint8]:
        """Return a picture of the balls."""
        from blast_env.rendering.frames import FramePainter

        if self._painter is None:
            self._painter = FramePainter.for_blast(self.blast)
        return self._painter.paint(self.run.balls(), self.run.obstacles, self.run.time_s)

    @staticmethod
    def space(scenario: Scenario) -> spaces.Dict:
        """Return the space of the observations."""
        # With the heaviest charge every bound is the highest.
        source = max(scenario.charge, key=lambda source: source.tnt_kg)
        heaviest = scenario.model_copy(update={"charge": (source,)})
        scene = Blast(heaviest).scene
        stepping = scene.parameters.stepping
        # A step of the engine can begin just before the time limit.
        latest_s = stepping.time_limit_s + stepping.longest_step_s
        most_impulse = scene.largest_exact_impulse
        air_balls = lattice_capacity(scene.parameters.air, scene.site)
        counts = np.array([scene.parameters.explosive.ball_count, air_balls])
        return spaces.Dict(
            {
                "module_impulses": spaces.Box(
                    0.0, most_impulse, (_module_count(scenario),), np.float64
                ),
                "particle_counts": spaces.Box(0, counts, dtype=np.int64),
                "time_s": spaces.Box(0.0, latest_s, (1,), np.float64),
            }
        )


class UnfoldingGas:
    """A blast of gas dynamics on its way.

    Args:
        blast: The blast.
    """

    def __init__(self, blast: "GasBlast") -> None:
        self.blast = blast
        self.run = blast.engine.start_on(blast.site)
        grid = self.run.grid
        margin = round(-grid.origin_m[0] / grid.cell_m)
        rows, columns = _plan_shape(blast.scenario, grid.cell_m)
        self._plan = (slice(margin, margin + columns), slice(margin, margin + rows))
        self._layer = min(int(PLAN_HEIGHT_M / grid.cell_m), grid.shape[2] - 1)
        self._painter: PressureNow | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what draws: it does not pickle, and is made anew."""
        return {**self.__dict__, "_painter": None}

    @property
    def time_s(self) -> float:
        """Time since the detonation."""
        return self.run.time_s

    @property
    def end_reason(self) -> EndReason | None:
        """Why it has ended; None while it has not."""
        return self.run.end_reason

    @property
    def charge(self) -> Charge:
        """The charge where it goes off."""
        return self.run.site.charge

    @property
    def layout(self) -> Sequence[Element]:
        """The barrier."""
        return self.blast.layout

    @property
    def impulse(self) -> float:
        """Impulse on the protected structures so far, by weight, Pa s."""
        table = self._so_far().structures
        counts = table["protected"] * table["weight"]
        return float((counts * table["positive_impulse_pa_s"]).sum())

    @property
    def module_ids(self) -> tuple[str, ...]:
        """Names of the modules of the structures, as they are observed."""
        return tuple(
            module_name(
                outline.corner[0] / UNITS_PER_M + (column + 0.5) * MODULE_SIDE_M,
                outline.corner[1] / UNITS_PER_M + (row + 0.5) * MODULE_SIDE_M,
            )
            for outline in self.run.site.structures
            if outline.cells is None
            for row in range(outline.rows)
            for column in range(outline.columns)
        )

    def advance(self, until_s: float) -> dict[str, Any]:
        """Go on to a time, or the end; return the impulse so far."""
        self.run.advance(until_s)
        return {"impulse_pa_s": self.impulse}

    def observe(self) -> Observation:
        """Return loads, the plan of overpressure, gauges and the time."""
        so_far = self._so_far()
        solid = self.run.grid.solid[:, :, self._layer]
        plane = np.where(solid, 0.0, self.run.solver.overpressure_in(2, self._layer))
        gauges = self.run.gauges
        return {
            "module_impulses": so_far.module_impulse_n_s,
            "structure_impulses": so_far.structures["positive_impulse_pa_s"].to_numpy(np.float64),
            "overpressure": plane[self._plan].T.astype(np.float32),
            "gauges": np.zeros(0)
            if gauges is None
            else self.run.solver.overpressure_at(gauges.cells).astype(np.float64),
            "time_s": np.array([self.run.time_s]),
        }

    def result(self) -> "GasResult":
        """Return what happened, at the end.

        Raises:
            ValueError: If the run has not ended.
        """
        if self.run.end_reason is None:
            raise ValueError(f"the run is at {self.time_s} s and has not ended: advance it first")
        return self._so_far()

    def frame(self) -> NDArray[np.uint8]:
        """Return the overpressure in plan and in a section."""
        from blast_env.rendering.pressure_film import PressureNow

        if self._painter is None:
            self._painter = PressureNow(self.blast, self.run)
        return self._painter.frame()

    def _so_far(self) -> "GasResult":
        """Return what has happened so far, in the form of a result."""
        from blast_env.simulation.gas import GasResult

        return GasResult(self.blast, self.run)

    @staticmethod
    def space(scenario: Scenario, cell_m: float) -> spaces.Dict:
        """Return the space of the observations."""
        low_pa, high_pa = _LEAST_OVERPRESSURE_PA, _MOST_OVERPRESSURE_PA
        modules, structures = _module_count(scenario), len(scenario.structures)
        return spaces.Dict(
            {
                "module_impulses": spaces.Box(0.0, _MOST_IMPULSE, (modules,), np.float64),
                "structure_impulses": spaces.Box(0.0, _MOST_IMPULSE, (structures,), np.float64),
                "overpressure": spaces.Box(
                    low_pa, high_pa, _plan_shape(scenario, cell_m), np.float32
                ),
                "gauges": spaces.Box(low_pa, high_pa, (len(scenario.gauges),), np.float64),
                "time_s": spaces.Box(0.0, _LATEST_S, (1,), np.float64),
            }
        )


def observation_space(scenario: Scenario, engine: Engine) -> spaces.Dict:
    """Return the space of what `Unfolding.observe` gives with an engine."""
    if is_gas(engine):
        return UnfoldingGas.space(scenario, engine.cell_m)
    return UnfoldingParticles.space(scenario)


def _plan_shape(scenario: Scenario, cell_m: float) -> tuple[int, int]:
    """Return how many cells the site has upwards and to the right."""
    site = scenario.site
    rows, columns = (
        int(np.ceil(np.round(length_m / cell_m, 9))) for length_m in (site.height_m, site.width_m)
    )
    return rows, columns


def _module_count(scenario: Scenario) -> int:
    return sum(section.rows * section.columns for section in scenario.structures)


def _structure_parts(run: BlastRun) -> list[ModularPart]:
    """Return the modules of all structures, without those of the barrier."""
    return [
        part
        for obstacle in run.obstacles
        if obstacle.name != BARRIER_NAME
        for part in obstacle.parts
    ]
