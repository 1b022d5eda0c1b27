"""Blasts of the particle engines, and `simulate` for all engines."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from blast_env.calibration.load_unit import LoadUnit
from blast_env.calibration.model import (
    Calibration,
    CalibrationError,
    ScaledImpulse,
    scenario_calibration,
)
from blast_env.errors import BlastEnvError, UnknownNameError, value_text
from blast_env.geometry import Element, layout_text
from blast_env.physics.collisions import CollisionArray
from blast_env.physics.engine import BallStates, BlastRun, EndReason, Engine, ParticleEngine
from blast_env.physics.engines import (
    STEP_NAMES,
    find_engine,
    find_particle_engine,
    is_gas,
)
from blast_env.physics.scene import Charge, Scene
from blast_env.physics.structure import ModularObstacle
from blast_env.provenance import versions
from blast_env.runner import check_workers, in_order
from blast_env.scenario import AnyCharge, AnyScenario, ScenarioField
from blast_env.scenario.build_scene import build_scene, draw_threat
from blast_env.values import number_pair, path_of

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.physics.gas.engine import GasEngine
    from blast_env.recording.tables import RunRecord
    from blast_env.simulation.gas import GasResult

_PROGRESS_CALLS = 200


@dataclass(frozen=True, eq=False)
class Blast:
    """One blast that can be run: what `simulate` is called with.

    Attributes:
        scenario: The scenario; its bundled name or path will do.
        layout: Cells of the build zone that hold a barrier module.
        seed: Decides the charge, where the scenario leaves it open, the fan and the air.
        engine: The engine that runs it.
        charge: The charge, instead of one drawn from the scenario.
    """

    scenario: ScenarioField = ScenarioField()
    layout: Sequence[Element] = ()
    seed: int = 0
    engine: str | Engine = "pymunk"
    charge: AnyCharge | None = None

    @cached_property
    def scene(self) -> Scene:
        """The initial state."""
        return build_scene(self.scenario, self.layout, self.seed, self.charge)

    def with_charge_at(self, position_m: Sequence[float]) -> "Blast":
        """Return the same blast with the charge at (x, y) and the mass that it had.

        Raises:
            BlastEnvError: If that is not a pair of finite numbers.
        """
        x_m, y_m = number_pair("charge_position_m", position_m)
        drawn = draw_threat(self.scenario, self.seed) if self.charge is None else self.charge
        return replace(self, charge=Charge((x_m, y_m), drawn.tnt_kg, drawn.height_m))

    @cached_property
    def particle_engine(self) -> ParticleEngine:
        """The engine itself.

        Raises:
            UnknownNameError: If there is no such engine.
            BlastEnvError: If it is no engine of particles.
        """
        return find_particle_engine(self.engine)

    def start(self) -> BlastRun:
        """Return a run at time 0."""
        return self.particle_engine.start(self.scene)

    def run(self, progress: Callable[[float], None] | None = None) -> "BlastResult":
        """Run the blast to its end.

        Args:
            progress: Called from time to time with the share of the time limit that has passed.
        """
        run = self.start()
        limit_s = self.scene.parameters.stepping.time_limit_s
        while run.end_reason is None:
            run.advance(np.inf if progress is None else run.time_s + limit_s / _PROGRESS_CALLS)
            if progress is not None:
                progress(min(run.time_s / limit_s, 1.0))
        return self.result(run)

    def result(self, run: BlastRun) -> "BlastResult":
        """Return what happened in a run that has ended.

        Raises:
            ValueError: If the run has not ended.
        """
        if run.end_reason is None:
            raise ValueError(f"the run is at {run.time_s} s and has not ended: advance it first")
        engine = self.particle_engine
        return BlastResult(
            blast=self,
            engine_name=engine.name,
            engine_version=engine.version,
            collision_array=run.log.to_array(),
            obstacles=run.obstacles,
            final_balls=run.balls(),
            time_s=run.time_s,
            steps=run.steps,
            end_reason=run.end_reason,
        )


@dataclass(frozen=True, eq=False)
class BlastResult:
    """What happened in a blast.

    Attributes:
        blast: What was run.
        engine_name: Name of the engine.
        engine_version: Version of the library that did the physics.
        collision_array: The collisions with modules, of `COLLISION_DTYPE` (n,).
        obstacles: The structures and, with a layout, the barrier, with the hits they took.
        final_balls: The balls that were left at the end.
        time_s: Simulated time at the end.
        steps: Steps of the engine.
        end_reason: Why the run ended.
    """

    blast: Blast
    engine_name: str
    engine_version: str
    collision_array: CollisionArray
    obstacles: tuple[ModularObstacle, ...]
    final_balls: BallStates
    time_s: float
    steps: int
    end_reason: EndReason

    @property
    def step_name(self) -> str:
        """What `steps` counts: steps of time, or the events of an engine that goes by them."""
        return STEP_NAMES.get(self.engine_name, "steps")

    @cached_property
    def collisions(self) -> "pd.DataFrame":
        """One row a collision; the columns are `recording.tables.COLLISION_COLUMNS`."""
        from blast_env.recording.tables import collision_table

        return collision_table(self.collision_array, self.obstacles)

    @cached_property
    def modules(self) -> "pd.DataFrame":
        """One row a module; the columns are `recording.tables.MODULE_COLUMNS`."""
        from blast_env.recording.tables import module_table

        return module_table(self.obstacles)

    @cached_property
    def structures(self) -> "pd.DataFrame":
        """One row a structure; the columns are `recording.tables.STRUCTURE_COLUMNS`."""
        from blast_env.recording.tables import structure_table

        return structure_table(self.obstacles)

    @cached_property
    def calibration(self) -> Calibration:
        """The scenario's calibration.

        Raises:
            UnknownNameError: If there is no calibration of that name.
            CalibrationError: If the scenario names no calibration, or one that was made with
                other parameters or another engine.
        """
        return scenario_calibration(self.blast.scenario, self.engine_name)

    def obstacle(self, name: str) -> ModularObstacle:
        """Return a structure, or the barrier, by its name.

        Raises:
            UnknownNameError: If there is none of that name; the message names the nearest one.
        """
        by_name = {obstacle.name: obstacle for obstacle in self.obstacles}
        if name not in by_name:
            raise UnknownNameError("structure", name, by_name)
        return by_name[name]

    def impulse_sim(self, structure: str) -> float:
        """Return the sum of m |v| over the collisions with a structure, simulation units.

        Args:
            structure: Name of the structure.

        Raises:
            UnknownNameError: If there is no structure of that name.
        """
        return self.obstacle(structure).impulse

    def impulse(self, structure: str, calibration: Calibration | None = None) -> ScaledImpulse:
        """Return the impulse per area on a structure, through a calibration.

        Args:
            structure: Name of the structure.
            calibration: By default the scenario's.

        Returns:
            `.psi_s`, `.pa_s`, and `.in_range` with `.notes`: whether the calibration was made
            for this distance and charge, and the blast ran to its end.

        Raises:
            UnknownNameError: If there is no structure or no calibration of that name.
            CalibrationError: If the scenario names no calibration, or one that was made with
                other parameters or another engine.
        """
        obstacle = self.obstacle(structure)
        if obstacle.cells is not None:
            raise CalibrationError(f"{structure!r} is no structure: it has no facade of one width")
        law = self.calibration if calibration is None else calibration
        if not isinstance(law, Calibration):
            raise CalibrationError(f"calibration is {value_text(law)}, must be a Calibration")
        scaled = law.convert_load(obstacle, self.blast.scene.charge)
        if self.end_reason is not EndReason.EVENT_LIMIT:
            return scaled
        notes = (*scaled.notes, f"the blast was cut off: {self.end_reason}")
        return ScaledImpulse(scaled.psi_s, False, notes)

    @cached_property
    def load_unit(self) -> LoadUnit:
        """The unit of the loads in tables and pictures.

        Pa s where the scenario has a calibration for the engine and anything was hit.
        """
        charge = self.blast.scene.charge
        try:
            return LoadUnit.of(self.obstacles, charge, lambda each: self.impulse(each.name))
        except BlastEnvError:
            return LoadUnit()

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the whole outcome, as hexadecimal digits.

        Two runs have the same digest exactly if all collisions, all module loads, the end and
        all balls that were left are the same to the last bit.
        """
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
        """Everything needed to repeat the run: what was run, with which versions."""
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
        """Write a workbook with collisions, modules, structures and the run record.

        Returns:
            The path.

        Raises:
            BlastEnvError: If it cannot be written there; nothing is left behind then.
        """
        from blast_env.recording.excel import write_workbook

        return write_workbook(self, path_of(path))

    def to_parquet(self, path: str | Path) -> Path:
        """Write the collision table as Parquet, the run record in its metadata.

        Returns:
            The path.

        Raises:
            BlastEnvError: If it cannot be written there; nothing is left behind then.
        """
        from blast_env.recording.parquet import write_parquet

        return write_parquet(self, path_of(path))


@overload
def simulate(  # type: ignore[overload-overlap]  # "gas" is a name too
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    *,
    engine: "Literal['gas'] | GasEngine",
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
    cell_m: float | None = ...,
) -> "GasResult": ...


@overload
def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = ...,
    seed: int = ...,
    engine: str | Engine = ...,
    charge: AnyCharge | None = ...,
    progress: Callable[[float], None] | None = ...,
) -> BlastResult: ...


def simulate(
    scenario: AnyScenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    engine: str | Engine = "pymunk",
    charge: AnyCharge | None = None,
    progress: Callable[[float], None] | None = None,
    cell_m: float | None = None,
) -> "BlastResult | GasResult":
    """Run a blast to its end.

    The result is a pure function of the arguments, to the last bit and in any process.

    Args:
        scenario: The scenario, or its bundled name or path; see `load_scenario`.
        layout: (row, column) of the build-zone cells that hold a barrier module.
        seed: Decides the charge, where the scenario leaves it open, the fan and the air.
        engine: Name of an engine, or an engine: the particle engines `"pymunk"` and `"event"`, or
            gas dynamics, `"gas"`, for which the seed does no more than draw the charge.
        charge: The charge, instead of one drawn from the scenario.
        progress: Called from time to time with the share of the time limit that has passed.
        cell_m: Side of the cells of gas dynamics, 0.5 m unless given.

    Returns:
        A `BlastResult` of the particle engines, a `GasResult` of gas dynamics.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        UnknownNameError: If there is no such engine.
        ScenarioError: If the charge is not clear of a structure or the border.
        BlastEnvError: If `cell_m` does not divide the side of a module, or is given for an engine
            that has no cells.
        BlastEnvError: If the seed is no integer, negative or too large.
    """
    found = find_engine(engine, cell_m)
    # Anything else is refused where it is read.
    cells = tuple(layout) if isinstance(layout, Iterable) else layout
    if is_gas(found):
        from blast_env.simulation.gas import GasBlast  # Numba takes half a second to import

        return GasBlast(scenario, cells, seed, found, charge).run(progress)
    return Blast(scenario, cells, seed, found, charge).run(progress)


def simulate_many(
    blasts: Sequence[Blast],
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> list[BlastResult]:
    """Run blasts to their ends, several at a time in threads of this process.

    The results are those of `Blast.run`, to the last bit, whatever the number of threads. Threads
    pay with the compiled engines; with `pymunk` they change nothing but the order of the work.
    The preparation of a blast and its result are Python, which one thread at a time runs.

    Args:
        blasts: The blasts.
        threads: How many run at the same time; more than there are cores do not help.
        progress: Called in the caller's thread with the share of the blasts that is done.

    Returns:
        The results, in the order of the blasts.

    Raises:
        BlastEnvError: If `threads` is not a whole number of at least 1, or if a blast cannot be
            run; the message says which, the first one of them. Those that have not begun yet are
            left out then.
    """
    check_workers("threads", threads)
    results: list[BlastResult] = []
    for result in in_order(_run_numbered, list(enumerate(blasts)), threads, "threads"):
        if isinstance(result, BlastEnvError):
            raise result
        results.append(result)
        if progress is not None:
            progress(len(results) / len(blasts))
    return results


def _run_numbered(numbered: tuple[int, Blast]) -> BlastResult | BlastEnvError:
    """Run a blast; an error of the user's says which one it was.

    It is returned, not raised: the first one in the order of the blasts counts, whichever thread
    comes to one first.
    """
    number, blast = numbered
    try:
        return blast.run()
    except ValueError as error:  # what unusable arguments cause, `BlastEnvError` among it
        return BlastEnvError(f"blasts[{number}]: {error}")
