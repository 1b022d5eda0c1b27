"""The interface of engines, which compute the loads of a blast, and the registry of engines.

A custom engine is a class with a name, a version and `loads`; everything else has a default:

    class Mine(Engine):
        name, version = "mine", "mine 1"

        def loads(self, scenario, layout, charge, seed): ...

An instance is accepted wherever an engine's name is. An entry point registers a name.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from importlib.metadata import entry_points
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError, UnknownNameError, import_extra, value_text
from blast_env.evaluation.standing import UNSTATED, ReasonedStanding, worst_standing
from blast_env.geometry import Element
from blast_env.particles.calibration.model import Calibration
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.damage import BayDamage, level_of, worst
from blast_env.site import (
    AnyCharge,
    AnyScenario,
    ObjectiveSection,
    Scenario,
    find_scenario,
)
from blast_env.site.facade import NamedBay
from blast_env.site.structures import StructureSection
from blast_env.statistics import counted_parts, mean_over_area

if TYPE_CHECKING:  # pandas takes a third of a second to import
    import pandas as pd

    from blast_env.gas.cost import CostGuess


@dataclass(frozen=True)
class StructureLoad:
    """The load on one structure.

    Attributes:
        name: Name of the structure.
        protected: Whether its load counts.
        weight: Its weight among the protected structures.
        impulse_pa_s: Impulse per area, calibrated where the engine needs that, Pa*s; for gas
            dynamics the peak specific impulse, averaged over the counted walls.
        peak_pa: Largest overpressure on its walls, Pa; `None` for particles, which have none.
        peak_weight: Weight of the peak among the protected structures.
        in_range: Whether this distance and charge lie in the range of the calibration.
        notes: Reasons if they do not, one sentence each.
        building: The building that it is part of; its own name if it is a building by itself.
        area_m2: Area of the counted walls; `None` where the engine has no areas.
        response: Response of its bays in the objective; `None` unless the objective is a response.
        worst_damage: The largest damage of its bays, for the same objective.
        stood: Standing of the load, with its reason.
        impulse_sim: Sum of m |v| over the collisions, simulation units; `None` without particles.
    """

    name: str
    protected: bool
    weight: float
    impulse_pa_s: float
    peak_pa: float | None
    peak_weight: float
    in_range: bool
    notes: tuple[str, ...]
    building: str
    area_m2: float | None = None
    response: float | None = None
    worst_damage: float | None = None
    stood: ReasonedStanding = UNSTATED
    impulse_sim: float | None = None

    @classmethod
    def on(
        cls,
        structure: StructureSection,
        impulse_pa_s: float,
        peak_pa: float | None = None,
        in_range: bool = False,
        **others: Any,
    ) -> Self:
        """Return the load on a structure of a scenario; `others` are further attributes."""
        return cls(
            name=structure.name,
            protected=structure.protected,
            weight=structure.weight,
            impulse_pa_s=impulse_pa_s,
            peak_pa=peak_pa,
            peak_weight=structure.counted_peak_weight,
            in_range=in_range,
            building=structure.building_name,
            **({"notes": ()} | others),
        )


def on_buildings(loads: Sequence[StructureLoad]) -> tuple[StructureLoad, ...]:
    """Combine the loads on structures into loads on buildings.

    Impulses are means over the area of the counted walls. Where the engine has no areas, the
    weights of the structures replace them.
    """
    parts: dict[str, list[StructureLoad]] = {}
    for load in loads:
        parts.setdefault(load.building, []).append(load)
    found = []
    for name, own in parts.items():
        if len(own) > 1:
            found.append(_on_building(name, own))
        else:
            found.append(own[0] if own[0].name == name else replace(own[0], name=name))
    return tuple(found)


def _on_building(name: str, parts: Sequence[StructureLoad]) -> StructureLoad:
    counted = counted_parts(parts)
    areas_m2 = [each.area_m2 for each in counted if each.area_m2 is not None]
    weights = [each.weight for each in counted]
    is_known = len(areas_m2) == len(counted)
    peaks_pa = [each.peak_pa for each in counted if each.peak_pa is not None]
    impulses_pa_s = np.array([each.impulse_pa_s for each in counted])
    hit = [each.impulse_sim for each in parts if each.impulse_sim is not None]
    return replace(
        counted[0],
        name=name,
        weight=sum(weights),
        impulse_pa_s=mean_over_area(impulses_pa_s, np.array(areas_m2 if is_known else weights)),
        peak_pa=max(peaks_pa, default=None),
        in_range=all(each.in_range for each in counted),
        area_m2=sum(areas_m2) if is_known else None,
        stood=worst_standing(each.stood for each in counted),
        impulse_sim=sum(hit) if hit else None,
    )


@dataclass(frozen=True, eq=False)
class BlastLoads:
    """The loads of one blast on all structures, without the barrier.

    Attributes:
        structures: One load per structure, in the order of the scene.
        module_impulse: Load on each module of the structures, in the order of the scene (modules,):
            of particles the sum of m |v|, simulation units; of gas the momentum on its walls, N s.
        bays: Damage of the bays of facades with each of their possible components; empty unless
            the objective is a response.
    """

    structures: tuple[StructureLoad, ...]
    module_impulse: NDArray[np.float64]
    bays: tuple[BayDamage, ...] = ()

    def with_facades(
        self, named: Collection[NamedBay], objective: ObjectiveSection
    ) -> "BlastLoads":
        """Return the loads with the response of given facades, without another blast.

        Raises:
            BlastEnvError: If the bays were not recorded.
        """
        if not self.bays:
            raise BlastEnvError("the engine records no bays, but objective.kind is 'response'")
        responded = []
        for load in self.structures:
            own = [each for each in self.bays if each.structure == load.name]
            response, most = structure_response(own, named, objective)
            responded.append(replace(load, response=response, worst_damage=most))
        return replace(self, structures=tuple(responded))

    @property
    def has_particles(self) -> bool:
        """Whether these are loads by a particle engine."""
        return any(load.impulse_sim is not None for load in self.structures)

    @property
    def level(self) -> LevelOfProtection:
        """The level of protection of the facades of the protected structures."""
        return level_of(worst(load.worst_damage or 0.0 for load in self.protected))

    def are_for(self, scenario: AnyScenario) -> bool:
        """Return whether these can be the loads of a scenario.

        They must be finite, one per structure and module, with its bays where it needs them.
        """
        found = find_scenario(scenario)
        names = [structure.name for structure in found.structures]
        modules = sum(structure.modules for structure in found.structures)
        impulses = np.array([load.impulse_pa_s for load in self.structures])
        return (
            [load.name for load in self.structures] == names
            and self.module_impulse.shape == (modules,)
            and bool(np.isfinite(impulses).all() and np.isfinite(self.module_impulse).all())
            and self._has_bays_of(found)
        )

    def _has_bays_of(self, scenario: Scenario) -> bool:
        """Return whether the bays and components are the scenario's, and the damage is finite."""
        if not scenario.objective.is_response:
            return not self.bays
        known = {each.name: {*each.glazing, *each.wall} for each in scenario.alternatives}
        return bool(self.bays) and all(
            known.get(each.name) == set(each.damage)
            and np.isfinite([*each.damage.values(), each.area_m2, each.glazed_m2]).all()
            for each in self.bays
        )

    @cached_property
    def protected(self) -> tuple[StructureLoad, ...]:
        """The loads on the protected structures."""
        return tuple(load for load in self.structures if load.protected)

    @cached_property
    def _buildings(self) -> tuple[StructureLoad, ...]:
        """The loads on the protected buildings."""
        return on_buildings(self.protected)

    @property
    def protected_impulse_pa_s(self) -> float:
        """Weighted sum of the impulses of the protected buildings, Pa*s."""
        return sum(each.weight * each.impulse_pa_s for each in self._buildings)

    @property
    def protected_impulse_sim(self) -> float | None:
        """Weighted sum of the impulses of the protected structures, simulation units.

        `None` of an engine without particles.
        """
        sims = [(x.weight, x.impulse_sim) for x in self.protected if x.impulse_sim is not None]
        return sum(weight * impulse for weight, impulse in sims) if sims else None

    @property
    def protected_peak_pa(self) -> float:
        """The largest overpressure on any wall of a protected structure, Pa; NaN for particles."""
        peaks = [load.peak_pa for load in self.protected]
        return max((np.nan if peak is None else peak for peak in peaks), default=0.0)

    def load(self, objective: ObjectiveSection) -> float:
        """Return the load of the protected structures that an objective selects, in its unit."""
        impulse_pa_s = {each.name: each.impulse_pa_s for each in self._buildings}
        return sum(
            objective.load(
                impulse_pa_s[load.building],
                load.peak_pa or 0.0,
                load.weight,
                load.peak_weight,
                load.response,
            )
            for load in self.protected
        )

    @property
    def in_range(self) -> bool:
        """Whether the load on every protected structure is in the range of the calibration."""
        return all(load.in_range for load in self.protected)


def structure_response(
    bays: Collection[BayDamage], named: Collection[NamedBay], objective: ObjectiveSection
) -> tuple[float, float]:
    """Return the response of one structure in the objective, and the largest damage of its bays.

    `bays` has their damage with each of their possible components, `named` the components of all
    bays.
    """
    chosen = {each.bay.name: each for each in named}
    is_glazing = objective.measure == "glazing"
    damage, area_m2 = [], []
    for each in bays:
        bay = chosen[each.name]
        names = (bay.glazing,) if is_glazing else (bay.glazing, bay.wall)
        damage.append(worst(each.damage[name] for name in names if name is not None))
        area_m2.append(each.glazed_m2 if is_glazing else each.area_m2)
    return objective.response(np.array(damage), np.array(area_m2)), worst(damage)


class BlastOutcome(Protocol):
    """The outcome of a blast on any engine."""

    @property
    def structures(self) -> "pd.DataFrame":
        """One row per structure."""

    @property
    def digest(self) -> str:
        """Hexadecimal digest of the whole outcome."""

    def loads(self) -> BlastLoads:
        """Return the loads on all structures."""


@dataclass(frozen=True, eq=False)
class RunnableBlast(ABC):
    """One blast of an engine, ready to run.

    Attributes:
        scenario: The scenario, or its bundled name or path.
        layout: Cells of the build zone that hold a barrier module.
        seed: Draws the charge where the scenario leaves it open; of particles the fan and the air.
        engine: The engine.
        charge: The charge, instead of one drawn from the scenario.
    """

    scenario: Scenario
    layout: Sequence[Element] = ()
    seed: int = 0
    engine: Any = None
    charge: AnyCharge | None = None

    def __post_init__(self) -> None:
        """Find the scenario of a name, a path or plain data."""
        object.__setattr__(self, "scenario", find_scenario(self.scenario))

    @abstractmethod
    def run(self, progress: Callable[[float], None] | None = None) -> BlastOutcome:
        """Run the blast.

        Args:
            progress: Called periodically with the elapsed share of the time limit.
        """


class EngineBlast(NamedTuple):
    """The arguments of `Engine.loads`."""

    scenario: Scenario
    layout: Sequence[Element]
    charge: AnyCharge
    seed: int


class Engine(ABC):
    """Computes the loads of blasts on a site.

    Attributes:
        name: Name in records and calibrations.
        version: Version of the code that does the physics.
        has_noise: Whether one charge has several realisations, selected by a seed.
        has_peaks: Whether it computes overpressures as well as impulses.
        at_once: Largest number of blasts that take less time together than one by one.
        needs_calibration: Whether a calibration of the scenario converts its impulses to Pa s.
        title: Its kind, for display.
        validated_range: The range in which it was validated, for "outside ...".
        options: Names of the settings that only this engine has.
        medium: What carries its blasts, which decides how they are shown; empty where there is no
            blast to show.
    """

    has_noise: ClassVar[bool] = False
    has_peaks: ClassVar[bool] = False
    at_once: ClassVar[int] = 1
    needs_calibration: ClassVar[bool] = False
    title: ClassVar[str] = "Own engine"
    validated_range: ClassVar[str] = "the validated range of the engine"
    options: ClassVar[tuple[str, ...]] = ()
    medium: ClassVar[Literal["", "gas", "particles"]] = ""

    name: str
    version: str

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return the loads of one blast on all structures, by default by running `blast`.

        The layout is legal; the charge is in place, or the vehicle that carries it. Engines without
        noise ignore the seed.
        """
        return self.blast(scenario, layout, seed, charge).run().loads()

    def loads_at_once(self, blasts: Sequence[EngineBlast]) -> list[BlastLoads]:
        """Return the loads of several blasts, by default one after the other."""
        return [self.loads(*each) for each in blasts]

    def blast(
        self,
        scenario: AnyScenario,  # noqa: ARG002
        layout: Sequence[Element] = (),  # noqa: ARG002
        seed: int = 0,  # noqa: ARG002
        charge: AnyCharge | None = None,  # noqa: ARG002
    ) -> RunnableBlast:
        """Return one blast, for running and inspection.

        Raises:
            BlastEnvError: If the engine computes loads without a blast.
        """
        raise BlastEnvError(
            f"engine {self.name!r} predicts loads without a blast: there is none to show"
        )

    def check(self, scenario: Scenario) -> None:
        """Refuse a scenario whose loads this engine cannot compute.

        Raises:
            BlastEnvError: If it cannot; the message gives the reason.
        """
        if scenario.objective.needs_peaks and not self.has_peaks:
            counts = scenario.objective
            key, instead = ("kind", "load") if counts.is_response else ("quantity", "impulse")
            raise BlastEnvError(
                f"scenario {scenario.name!r}: objective.{key} is {getattr(counts, key)!r}, but"
                f" engine {self.name!r} knows no overpressure: must be {instead!r}, or the engine"
                " 'gas'"
            )

    def cost(self, scenario: Scenario, charge: AnyCharge) -> "CostGuess | None":  # noqa: ARG002
        """Return an estimate of the cost of a blast; `None` for engines without one."""
        return None

    def gives_peaks(self, scenario: Scenario) -> bool:  # noqa: ARG002
        """Return whether the loads on a site have overpressures."""
        return self.has_peaks

    def calibration(self, scenario: Scenario) -> Calibration | None:  # noqa: ARG002
        """Return the calibration that converts its impulses to Pa s; `None` if it needs none."""
        return None

    def caveats(self, scenario: Scenario) -> Sequence[str]:  # noqa: ARG002
        """Return the warnings with every result on a site, one sentence each."""
        return ()

    @property
    def words(self) -> str:
        """The engine's name and the settings that affect its results, for display."""
        return self.name

    def final(self, scenarios: Sequence[Scenario]) -> "Engine":  # noqa: ARG002
        """Return the engine with the resolution of final statements on some sites."""
        return self

    @property
    def coarser(self) -> "Engine | None":
        """The engine with cells twice as large, for their error; `None` if it has none."""
        return None

    def describe(self, scenarios: Iterable[Scenario] = ()) -> str:  # noqa: ARG002
        """Describe the engine in one line.

        Args:
            scenarios: The scenarios of its runs; engines with parameters name their presets.
        """
        known = self.version.split()[0] == self.name
        return f"engine {self.version}" if known else f"engine {self.name}, {self.version}"

    def configured(self, **settings: object) -> Self:
        """Return the engine with other settings; `None` leaves one as it is.

        Raises:
            BlastEnvError: If the engine has no such setting, or the value is out of bounds.
        """
        given = {name: value for name, value in settings.items() if value is not None}
        for name, value in given.items():
            if name not in self.options:
                noun = "cells" if name == "cell_m" else f"setting {name}"
                raise BlastEnvError(
                    f"{name} is {value_text(value)}, but engine {self.name!r} has no {noun}"
                )
        made: Self = replace(self, **given) if given else self  # type: ignore[type-var]
        return made


_PLACES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pymunk": "blast_env.evaluation.engines.particles:PymunkEngine",
        "event": "blast_env.evaluation.engines.particles:EventEngine",
        "gas": "blast_env.evaluation.engines.gas:GasEngine",
    }
)
"""The engines of this room, as text: only the one in use is imported, because Numba alone takes
half a second. Those of other rooms and packages have entry points in `blast_env.engines`."""

ENGINE_NAMES: Final = (*_PLACES, "surrogate")
"""The engines in the package; the first one is the reference of the paper's model."""

CALIBRATED_ENGINES: Final = ("pymunk", "event")
"""The engines whose loads need a calibration to be in Pa s."""

JUDGE: Final = "gas"
"""The engine whose results decide about protection."""


PAPER_ENGINES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "BlastBarrier-v0": "event",
        "BlastBarrierSites-v0": "event",
        "BlastSimulator-v0": "pymunk",
        "train": "event",
        "calibrate": "pymunk",
    }
)
"""The ids and commands of the paper's model, with their engines; everything else takes `JUDGE`."""


def default_engine(use: str, *scenarios: Scenario) -> str:
    """Return the name of the engine that runs where none is named.

    It is gas dynamics, except for the ids and commands of the paper's model (`PAPER_ENGINES`).
    These take gas dynamics too for sites that state heights, which that model would ignore.

    Args:
        use: The id of an environment, or a command.
        scenarios: The sites.
    """
    if any(each.height_notes for each in scenarios):
        return JUDGE
    return PAPER_ENGINES.get(use, JUDGE)


def find_engine(engine: str | Engine, cell_m: float | None = None, **settings: Any) -> Engine:
    """Return an engine by its name, or the engine itself, with any given settings.

    The settings of gas dynamics are the side of its cells, the loads that a blast waits for
    (`until`), and the growth of the cells (`cells`); `None` leaves one as it is.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If a setting is out of bounds or of another engine, or an extra is missing.
    """
    found = _made(engine) if isinstance(engine, str) else engine
    if not isinstance(found, Engine):
        raise BlastEnvError(f"engine is {value_text(engine)}, must be a name or an engine")
    return found.configured(cell_m=cell_m, **settings)


def final_engine(
    engine: str | Engine,
    scenarios: Sequence[Scenario],
    cell_m: float | None = None,
    cells: str | None = None,
) -> Engine:
    """Return the engine of final statements on some sites, or the one with the given cells.

    An engine in place of a name keeps its cells. Errors are those of `find_engine`.
    """
    found = find_engine(engine, cell_m, cells=cells)
    is_given = isinstance(engine, Engine) or cell_m is not None or cells is not None
    return found if is_given else found.final(scenarios)


def _made(name: str) -> Engine:
    if name in _PLACES:
        own: Engine = load_plugin(_PLACES[name])()
        return own
    found = entry_points(group="blast_env.engines")
    if name not in found.names:
        raise UnknownNameError("engine", name, sorted({*ENGINE_NAMES, *found.names}))
    with import_extra("agents", f"engine {name!r}") if name in ENGINE_NAMES else nullcontext():
        made: Engine = found[name].load()()
    return made


def load_plugin(place: str) -> Any:
    """Import and return the object at "module:name"."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
