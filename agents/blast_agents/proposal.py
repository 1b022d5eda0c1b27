"""Layouts that are proposed, and what proposes them without a blast."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter, process_time
from typing import Annotated, ClassVar, Protocol

from pydantic import ConfigDict, Field

from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, AnyScenario, Scenario, find_scenario


@dataclass(frozen=True)
class Proposal:
    """A layout that a method proposes, and what that took.

    Attributes:
        layout: (row, column) of the modules.
        seconds: Time until the layout was there.
        blasts: Blasts spent on it, of the engine that judges.
        other_blasts: Blasts of another engine spent on it, for a method's own purposes.
        cpu_s: Processor time that it took, of this process.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    layout: Layout
    seconds: Annotated[float, Field(ge=0.0)]
    blasts: Annotated[int, Field(ge=0)] = 0
    other_blasts: Annotated[int, Field(ge=0)] = 0
    cpu_s: Annotated[float, Field(ge=0.0)] = 0.0


class LayoutAgent(Protocol):
    """Proposes a layout for a site, at once: no blast is simulated."""

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None) -> Layout:
        """Return a layout that keeps every condition of the build zone; always the same one.

        Args:
            scenario: The scenario; it has a build zone.
            charge: Where the charge is, if that is known; otherwise the layout is for all the
                places where the scenario may have one.
        """


def timed_proposal(propose: Callable[[], Layout]) -> Proposal:
    """Return a layout that takes no blast, and how long it took."""
    began_s, began_cpu_s = perf_counter(), process_time()
    layout = propose()
    seconds, cpu_s = perf_counter() - began_s, process_time() - began_cpu_s
    return Proposal(layout, seconds, cpu_s=cpu_s)


def propose(agent: LayoutAgent, scenario: AnyScenario, charge: AnyCharge | None) -> Proposal:
    """Return what an agent proposes, and how long it took.

    Args:
        agent: The agent.
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: As for `LayoutAgent.propose`.
    """
    return timed_proposal(partial(agent.propose, find_scenario(scenario), charge))
