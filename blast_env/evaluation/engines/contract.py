"""The interface of engines, which compute the loads of a blast, and the registry of engines.

A custom engine is a class with a name, a version and `loads`; everything else has a default:

    class Mine(Engine):
        name, version = "mine", "mine 1"

        def loads(self, scenario, layout, charge, seed): ...

An instance is accepted wherever an engine's name is. An entry point registers a name.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, NamedTuple, Protocol, Self

from blast_env.errors import BlastEnvError, UnknownNameError, import_extra, value_text
from blast_env.evaluation.record import BlastLoads, BlastRecord
from blast_env.geometry import Element
from blast_env.particles.calibration.model import Calibration
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario

if TYPE_CHECKING:  # pandas takes a third of a second to import
    import pandas as pd

    from blast_env.gas.cost import CostGuess


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
        seed: Draws the charge where the scenario leaves it open; for particles the fan and the air.
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


class BlastDrawing(Protocol):
    """Draws blasts, each while its result is in memory."""

    def recorders(self, blast: Any) -> Callable[[Any], Sequence[Any]]:
        """Return what makes the recorders that its pictures need, as for `GasBlast.run`."""

    def draw(self, found: Any) -> None:
        """Draw a finished blast, a `blast_env.evaluation.engines.gas.BlastMeasurement`."""


class Engine(ABC):
    """Computes the loads of blasts on a site.

    Attributes:
        name: Name in records and calibrations.
        version: Version of the code that does the physics.
        has_noise: Whether one charge has several realisations, selected by a seed.
        has_peaks: Whether it computes overpressures as well as impulses.
        at_once: Largest number of blasts that take less time together than one by one.
        needs_calibration: Whether a calibration of the scenario converts its impulses to Pa s.
        is_complete: Whether its records are complete, with walls and bays; see `BlastRecord`.
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
    is_complete: ClassVar[bool] = False
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
        return [self.loads(*blast) for blast in blasts]

    def record(
        self,
        blast: EngineBlast,
        progress: Callable[[float], None] | None = None,  # noqa: ARG002
        drawing: BlastDrawing | None = None,  # noqa: ARG002
    ) -> BlastRecord:
        """Run a blast and return its record, by default with the loads alone.

        Args:
            blast: The blast.
            progress: Called with the elapsed share of the blast, by engines that know it.
            drawing: Draws the blast, of engines that have something to draw.
        """
        (loads,) = self.loads_at_once([blast])
        return BlastRecord(loads)

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

    def response_s(self, scenario: Scenario) -> float:  # noqa: ARG002
        """Return how long a blast goes on for the response of facades, s; 0 if it does not."""
        return 0.0

    def calibration(self, scenario: Scenario) -> Calibration | None:  # noqa: ARG002
        """Return the calibration that converts its impulses to Pa s; `None` if it needs none."""
        return None

    def caveats(self, scenario: Scenario) -> Sequence[str]:  # noqa: ARG002
        """Return the warnings with every result on a site, one sentence each."""
        return ()

    def doubts(
        self,
        scenario: Scenario,  # noqa: ARG002
        layout: Sequence[Element],  # noqa: ARG002
        charge: AnyCharge,  # noqa: ARG002
    ) -> Sequence[str]:
        """Return the errors of its own of the loads of one charge and layout, in sentences."""
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

    @property
    def smallest_m(self) -> float:
        """Side of its smallest cells, m; 0 if it has none."""
        return 0.0

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
        given = {}
        for name, value in settings.items():
            if value is None:
                continue
            if name not in self.options:
                noun = "cells" if name == "cell_m" else f"setting {name}"
                raise BlastEnvError(
                    f"{name} is {value_text(value)}, but engine {self.name!r} has no {noun}"
                )
            given[name] = value
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
    """
    # A site that states heights means them.
    if any(map(attrgetter("height_notes"), scenarios)):
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


def choosing_engine(
    engine: str | Engine,
    scenarios: Sequence[Scenario],
    cell_m: float | None = None,
    cells: str | None = None,
) -> Engine:
    """Return the engine that chooses layouts for final statements, or that with the given cells.

    Its cells are twice as large as those of the statements. Errors are those of `find_engine`.
    """
    final = final_engine(engine, scenarios, cell_m, cells)
    is_given = cell_m is not None or cells is not None
    return final if is_given else final.coarser or final


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
