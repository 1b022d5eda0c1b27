"""The particle engines, the paper's model on pymunk or event by event, and their blasts.

Impulses are in simulation units; a calibration of the scenario converts them to Pa s.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal

import numpy as np

from blast_env.errors import BlastEnvError, UnknownNameError, value_text
from blast_env.evaluation.engines.contract import Engine, RunnableBlast, find_engine
from blast_env.evaluation.record import BlastLoads, StructureLoad
from blast_env.evaluation.validation import Validation, ValidationStatus
from blast_env.geometry import Element, layout_text
from blast_env.particles.calibration.model import (
    Calibration,
    CalibrationError,
    scenario_calibration,
)
from blast_env.particles.event import VERSION as EVENT_VERSION
from blast_env.particles.pymunk import VERSION as PYMUNK_VERSION
from blast_env.provenance import versions
from blast_env.results import EndReason, ScaledImpulse
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario
from blast_env.values import path_of

if TYPE_CHECKING:  # pandas takes a third of a second to import
    import pandas as pd

    from blast_env.particles.calibration.load_unit import LoadUnit
    from blast_env.particles.event.engine import EventRun
    from blast_env.particles.objects import ModularObstacle
    from blast_env.particles.pymunk.engine import PymunkRun
    from blast_env.particles.run import BallStates, BlastRun, CollisionArray, Scene
    from blast_env.tables import RunRecord

_PROGRESS_CALLS: Final = 200
_CALIBRATED: Final = Validation(
    ValidationStatus.APPROXIMATE, "calibrated particles, which overrate walls"
)

PARTICLES_OVERRATE: Final = (
    "The particle model overrates barriers: on 'courtyard' it predicted 4.0 times the reduction of"
    " gas dynamics, with a rank correlation of 0.56 (docs/engineers/validity.md). Use engine"
    " 'gas' for decisions."
)
"""Caveat of every evaluation with particles; measured by `python -m studies.gas judge`."""


class ParticleEngine(Engine):
    """An engine of the particle model, which runs scenes of balls."""

    has_noise: ClassVar[bool] = True
    needs_calibration: ClassVar[bool] = True
    title: ClassVar[str] = "Particles"
    medium: ClassVar[Literal["", "gas", "particles"]] = "particles"
    step_name: ClassVar[str] = "steps"

    @abstractmethod
    def start(self, scene: "Scene") -> "BlastRun":
        """Return a run of the scene at time 0, independent of every other run."""

    def blast(
        self,
        scenario: AnyScenario,
        layout: Sequence[Element] = (),
        seed: int = 0,
        charge: AnyCharge | None = None,
    ) -> "Blast":
        """Return one blast, for running and inspection."""
        return Blast(find_scenario(scenario), layout, seed, self, charge)

    def check(self, scenario: Scenario) -> None:
        """Refuse a scenario that particles cannot run, or that has no calibration for them."""
        super().check(scenario)
        scenario.check_for_particles()
        self.calibration(scenario)

    def calibration(self, scenario: Scenario) -> Calibration:
        """Return the scenario's calibration, checked against its parameters and this engine."""
        return scenario_calibration(scenario, self.name)

    def caveats(self, scenario: Scenario) -> Sequence[str]:
        """Return that particles overrate barriers, and which heights they ignore."""
        return (PARTICLES_OVERRATE, *scenario.height_notes)

    def describe(self, scenarios: Iterable[Scenario] = ()) -> str:
        """Describe the engine and its presets in one line."""
        sections = [scenario.simulation for scenario in scenarios]
        presets = [
            section.preset + " with overrides" * bool(section.overrides) for section in sections
        ]
        text = super().describe()
        return f"{text}, preset {', '.join(dict.fromkeys(presets))}" if presets else text


@dataclass(frozen=True)
class PymunkEngine(ParticleEngine):
    """Runs scenes on pymunk (Chipmunk): the reference of the paper's model."""

    name: str = "pymunk"
    version: str = PYMUNK_VERSION

    def start(self, scene: "Scene") -> "PymunkRun":
        """Return a run of the scene in a new space."""
        from blast_env.particles.pymunk.engine import PymunkRun  # loads a compiled library

        return PymunkRun(scene)


@dataclass(frozen=True)
class EventEngine(ParticleEngine):
    """Runs scenes from one collision to the next, in compiled code.

    Attributes:
        cell_units: Side of the cells of the neighbour search; see `world_of`.
    """

    step_name: ClassVar[str] = "events"

    name: str = "event"
    version: str = EVENT_VERSION
    cell_units: float | None = None

    def start(self, scene: "Scene") -> "EventRun":
        """Return a run of the scene at time 0."""
        from blast_env.particles.event.engine import EventRun  # Numba takes half a second to import

        return EventRun(scene, self.cell_units)


def find_particle_engine(engine: str | Engine) -> ParticleEngine:
    """Return a particle engine by its name, or the engine itself; refuse any other engine."""
    found = engine if isinstance(engine, ParticleEngine) else find_engine(engine)
    if not isinstance(found, ParticleEngine):
        raise BlastEnvError(
            f"engine {found.name!r} has no particles: this is for the particle engines"
        )
    return found


@dataclass(frozen=True, eq=False)
class Blast(RunnableBlast):
    """One blast of a particle engine, which may be given by its name."""

    engine: Any = "pymunk"  # an engine from then on

    def __post_init__(self) -> None:
        """Find the scenario and the engine of a name."""
        super().__post_init__()
        object.__setattr__(self, "engine", find_particle_engine(self.engine))

    @cached_property
    def scene(self) -> "Scene":
        """The initial state."""
        from blast_env.particles.run import build_scene  # needed when the charge goes off

        return build_scene(self.scenario, self.layout, self.seed, self.charge)

    def start(self) -> "BlastRun":
        """Return a run at time 0."""
        run: BlastRun = self.engine.start(self.scene)
        return run

    def run(self, progress: Callable[[float], None] | None = None) -> "BlastResult":
        """Run the blast to its end.

        Args:
            progress: Called periodically with the elapsed share of the time limit.
        """
        # In parts only for who watches the progress.
        run = self.start()
        limit_s = self.scene.parameters.stepping.time_limit_s
        while run.end_reason is None:
            run.advance(np.inf if progress is None else run.time_s + limit_s / _PROGRESS_CALLS)
            if progress is not None:
                progress(min(run.time_s / limit_s, 1.0))
        return self.result(run)

    def result(self, run: "BlastRun") -> "BlastResult":
        """Return the outcome of a run that has ended."""
        if run.end_reason is None:
            raise ValueError(f"the run is at {run.time_s} s and has not ended: advance it first")
        return BlastResult(
            blast=self,
            engine_name=self.engine.name,
            engine_version=self.engine.version,
            collision_array=run.log.to_array(),
            obstacles=run.obstacles,
            final_balls=run.balls(),
            time_s=run.time_s,
            steps=run.steps,
            end_reason=run.end_reason,
        )


@dataclass(frozen=True, eq=False)
class BlastResult:
    """The outcome of a blast of a particle engine.

    Attributes:
        blast: The blast.
        engine_name: Name of the engine.
        engine_version: Version of the library that computed the physics.
        collision_array: The collisions with modules, of `COLLISION_DTYPE` (n,).
        obstacles: The structures and, with a layout, the barrier, with their hits.
        final_balls: The remaining balls at the end.
        time_s: Simulated time at the end.
        steps: Number of steps of the engine.
        end_reason: Reason for the end of the run.
    """

    blast: Blast
    engine_name: str
    engine_version: str
    collision_array: "CollisionArray"
    obstacles: "tuple[ModularObstacle, ...]"
    final_balls: "BallStates"
    time_s: float
    steps: int
    end_reason: EndReason

    @property
    def step_name(self) -> str:
        """The unit of `steps`: time steps, or the events of an event-driven engine."""
        name: str = self.blast.engine.step_name
        return name

    @cached_property
    def collisions(self) -> "pd.DataFrame":
        """One row per collision; the columns are `blast_env.particles.tables.COLLISION_COLUMNS`."""
        from blast_env.particles.tables import collision_table

        return collision_table(self.collision_array, self.obstacles)

    @cached_property
    def modules(self) -> "pd.DataFrame":
        """One row per module; the columns are `blast_env.particles.tables.MODULE_COLUMNS`."""
        from blast_env.particles.tables import module_table

        return module_table(self.obstacles)

    @cached_property
    def structures(self) -> "pd.DataFrame":
        """One row per structure; the columns are `blast_env.particles.tables.STRUCTURE_COLUMNS`."""
        from blast_env.particles.tables import structure_table

        return structure_table(self.obstacles)

    @cached_property
    def buildings(self) -> "pd.DataFrame":
        """One row per building; the columns are `blast_env.particles.tables.BUILDING_COLUMNS`."""
        from blast_env.particles.tables import building_table

        return building_table(self.structures, self.blast.scenario.building_names)

    @cached_property
    def calibration(self) -> Calibration:
        """The scenario's calibration.

        Raises:
            CalibrationError: If it has none, or one made with other parameters or another engine.
        """
        return scenario_calibration(self.blast.scenario, self.engine_name)

    def obstacle(self, name: str) -> "ModularObstacle":
        """Return a structure, or the barrier, by its name; errors name the nearest one."""
        by_name = {obstacle.name: obstacle for obstacle in self.obstacles}
        if name not in by_name:
            raise UnknownNameError("structure", name, by_name)
        return by_name[name]

    def impulse_sim(self, structure: str) -> float:
        """Return the sum of m |v| over the collisions with a structure, simulation units."""
        return self.obstacle(structure).impulse

    def impulse(self, structure: str, calibration: Calibration | None = None) -> ScaledImpulse:
        """Return the impulse per area on a structure, converted by a calibration.

        `.in_range` and `.notes` state whether this distance and charge lie in the range of the
        calibration, and the blast ran to its end.

        Raises:
            UnknownNameError: If there is no structure or no calibration of that name.
            CalibrationError: As for `calibration`, which is used unless another one is given.
        """
        obstacle = self.obstacle(structure)
        if obstacle.is_barrier:
            raise CalibrationError(f"{structure!r} is no structure: it has no facade of one width")
        return self._scaled(obstacle, self.calibration if calibration is None else calibration)

    def _scaled(self, structure: "ModularObstacle", law: Calibration) -> ScaledImpulse:
        """Return the impulse per area on a structure by a law."""
        if not isinstance(law, Calibration):
            raise CalibrationError(f"calibration is {value_text(law)}, must be a Calibration")
        scaled = law.convert_load(structure, self.blast.scene.charge)
        if self.end_reason is not EndReason.EVENT_LIMIT:
            return scaled
        notes = (*scaled.notes, f"the blast was cut off: {self.end_reason}")
        return ScaledImpulse(scaled.pa_s, False, notes)

    def loads(self, calibration: Calibration | None = None) -> BlastLoads:
        """Return the loads on all structures, by the scenario's calibration or another one."""
        law = self.calibration if calibration is None else calibration
        structures = [obstacle for obstacle in self.obstacles if not obstacle.is_barrier]
        # Loads on structures need the calibration; those on modules stay in simulation units.
        impulse = [part.impulse for obstacle in structures for part in obstacle.parts]
        named = {structure.name: structure for structure in self.blast.scenario.structures}
        loads = []
        for structure in structures:
            scaled = self._scaled(structure, law)
            outside = Validation(ValidationStatus.OUTSIDE, "; ".join(scaled.notes))
            load = StructureLoad.on(
                named[structure.name],
                scaled.pa_s,
                in_range=scaled.in_range,
                notes=scaled.notes,
                validation=_CALIBRATED if scaled.in_range else outside,
                impulse_sim=structure.impulse,
            )
            loads.append(load)
        return BlastLoads(tuple(loads), module_impulse_sim=np.array(impulse, dtype=np.float64))

    @cached_property
    def load_unit(self) -> "LoadUnit":
        """The unit of the loads in tables and pictures.

        It is Pa s if the scenario has a calibration for the engine and any structure was hit.
        """
        from blast_env.particles.calibration.load_unit import LoadUnit

        charge = self.blast.scene.charge
        try:
            return LoadUnit.of(self.obstacles, charge, lambda source: self.impulse(source.name))
        except BlastEnvError:
            return LoadUnit()

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the whole outcome, as hexadecimal digits.

        Two runs have the same digest if and only if all collisions, module loads, remaining balls,
        the end time and the number of steps are the same to the last bit.
        """
        # Collisions, loads of modules, remaining balls, end: all that a later step could differ by.
        state = sha256(self.collision_array.tobytes())
        loads = [
            (part.x, part.y, part.hits, part.impulse, part.transferred_impulse)
            for obstacle in self.obstacles
            for part in obstacle.parts
        ]
        state.update(np.array(loads).tobytes())
        balls = self.final_balls
        for array in (balls.index, balls.position, balls.velocity, balls.mass, balls.radius):
            state.update(np.ascontiguousarray(array).tobytes())
        state.update(np.array([self.time_s, self.steps]).tobytes())
        return state.hexdigest()

    @cached_property
    def run_record(self) -> "RunRecord":
        """The inputs and versions needed to repeat the run, and its outcome."""
        blast, charge = self.blast, self.blast.scene.charge
        known = versions(self.engine_version)
        record: RunRecord = {
            "scenario": blast.scenario.name,
            "scenario hash": blast.scenario.content_hash,
            "layout (row, column)": layout_text(blast.layout),
            "seed": blast.seed,
            "charge x (m)": charge.position_m[0],
            "charge y (m)": charge.position_m[1],
            "charge height (m)": charge.height_m,
            "charge TNT equivalent (kg)": charge.tnt_kg,
            "engine": self.engine_name,
            "engine version": known["engine"],
            "preset": blast.scenario.simulation.preset,
            "blast-env version": known["blast_env"],
            "python version": known["python"],
            "numpy version": known["numpy"],
            "balls at the start": len(blast.scene.balls),
            "balls at the end": len(self.final_balls),
            self.step_name: self.steps,
            "simulated time (s)": self.time_s,
            "ended because": str(self.end_reason),
            "digest": self.digest,
        }
        for group, values in blast.scenario.parameters.model_dump().items():
            record |= {f"parameter {group}.{name}": value for name, value in values.items()}
        return record

    def to_excel(self, path: str | Path) -> Path:
        """Write a workbook with collisions, modules, structures and run record; return its path."""
        from blast_env.particles.tables import write_blast

        return write_blast(self, path_of(path))
