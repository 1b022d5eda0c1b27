"""What an engine is: it tells the loads of a blast, and what kind of answer that is.

An engine of one's own is a class with a name, a version and `loads`; everything else has a default:

    class Mine(Engine):
        name, version = "mine", "mine 1"

        def loads(self, scenario, layout, charge, seed): ...

It can be given wherever an engine's name can. A line in `engines.table` gives it a name of its own.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from blast_env.calibration.model import Calibration
from blast_env.engines.loads import BlastLoads
from blast_env.errors import BlastEnvError, value_text
from blast_env.geometry import Element
from blast_env.scenario import AnyCharge, AnyScenario, Scenario

if TYPE_CHECKING:  # pandas takes a third of a second to import
    import pandas as pd


@dataclass(frozen=True)
class EngineOption:
    """A setting that one engine has and others have not.

    Attributes:
        name: Name of the field and, with dashes, of the command line's option.
        help: What it is, a sentence for people.
    """

    name: str
    help: str


class BlastOutcome(Protocol):
    """What happened in a blast, whichever engine ran it."""

    @property
    def structures(self) -> "pd.DataFrame":
        """One row a structure."""

    @property
    def digest(self) -> str:
        """Hexadecimal digest of the whole outcome."""


class RunnableBlast(Protocol):
    """One blast that can be run to its end."""

    def run(self, progress: Callable[[float], None] | None = None) -> BlastOutcome:
        """Run the blast.

        Args:
            progress: Called from time to time with the share of the time limit that has passed.
        """


class Engine(ABC):
    """Tells what a blast does to a site.

    Attributes:
        name: Name in records and calibrations.
        version: Version of the code that does the physics.
        has_noise: Whether a charge has several realisations, drawn by a seed.
        has_peaks: Whether it knows overpressures, and not impulses alone.
        knows_heights: Whether a blast goes over what stands.
        needs_calibration: Whether a law of the scenario's turns its impulses into Pa s.
        title: Its kind, for people.
        caveat: What is to be said with every result, a sentence; empty for nothing.
        checked_for: What its loads were checked for, as in "outside what gas dynamics was ...".
        options: Settings that it alone has.
        unfolding: Where `BlastSimulator-v0` finds what shows a blast step by step, as
            "module:Class"; empty where there is no blast to show.
        screening: Where films of a blast are made, in the same form.
        shown: Where `blast-env simulate` finds what shows a blast, in the same form.
    """

    has_noise: ClassVar[bool] = False
    has_peaks: ClassVar[bool] = False
    knows_heights: ClassVar[bool] = True
    needs_calibration: ClassVar[bool] = False
    title: ClassVar[str] = "Own engine"
    caveat: ClassVar[str] = ""
    checked_for: ClassVar[str] = "what the engine was checked for"
    options: ClassVar[tuple[EngineOption, ...]] = ()
    unfolding: ClassVar[str] = ""
    screening: ClassVar[str] = ""
    shown: ClassVar[str] = ""

    name: str
    version: str

    @abstractmethod
    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return the loads of one blast on all structures.

        Args:
            scenario: The scenario.
            layout: A legal layout.
            charge: What goes off: where it does, or the vehicle that brings it.
            seed: Decides the noise; engines without any pay no heed to it.
        """

    def blast(
        self,
        scenario: AnyScenario,  # noqa: ARG002
        layout: Sequence[Element] = (),  # noqa: ARG002
        seed: int = 0,  # noqa: ARG002
        charge: AnyCharge | None = None,  # noqa: ARG002
    ) -> RunnableBlast:
        """Return one blast, to be run and looked into.

        Raises:
            BlastEnvError: If the engine tells loads without running one.
        """
        raise BlastEnvError(
            f"engine {self.name!r} tells loads without a blast: there is none to show"
        )

    def check(self, scenario: Scenario) -> None:
        """Refuse a scenario whose loads this engine cannot tell.

        Raises:
            BlastEnvError: If it cannot; the message says why.
        """
        if scenario.objective.needs_peaks and not self.has_peaks:
            raise BlastEnvError(
                f"scenario {scenario.name!r}: objective.quantity is"
                f" {scenario.objective.quantity!r}, but engine {self.name!r} knows no"
                " overpressure: must be 'impulse', or the engine 'gas'"
            )

    def calibration(self, scenario: Scenario) -> Calibration | None:  # noqa: ARG002
        """Return the law that turns its impulses into Pa s; `None` where none is needed."""
        return None

    def preset(self, scenario: Scenario) -> str | None:  # noqa: ARG002
        """Return the name of the scenario's parameters that it runs with; `None` for none."""
        return None

    @property
    def words(self) -> str:
        """The engine for people: its name, and the settings that decide its results."""
        return self.name

    def describe(self, scenarios: Iterable[Scenario] = ()) -> str:  # noqa: ARG002
        """Return in a line which engine spoke.

        Args:
            scenarios: What it runs; engines with parameters name their presets.
        """
        known = self.version.split()[0] == self.name
        return f"engine {self.version}" if known else f"engine {self.name}, {self.version}"

    def configured(self, **settings: object) -> Self:
        """Return the engine with other settings; `None` leaves one as it is.

        Raises:
            BlastEnvError: If the engine has no such setting, or the value is out of bounds.
        """
        given = {name: value for name, value in settings.items() if value is not None}
        own = {option.name for option in self.options}
        for name, value in given.items():
            if name not in own:
                noun = "cells" if name == "cell_m" else f"setting {name}"
                raise BlastEnvError(
                    f"{name} is {value_text(value)}, but engine {self.name!r} has no {noun}"
                )
        made: Self = replace(self, **given) if given else self  # type: ignore[type-var]
        return made


def plain_settings(engine: Engine) -> Mapping[str, Any]:
    """Return the values of an engine's own options, for records."""
    return {option.name: getattr(engine, option.name) for option in engine.options}
