"""What the end of a run cuts off: the loads then, and when everything has died away."""

from dataclasses import dataclass

from blast_env.engines.gas import GasBlast, GasResult
from blast_env.physics.engine import EndReason
from studies.gas.loads import protected_impulse_pa_s


@dataclass(frozen=True)
class Ending:
    """The load on the protected structures at the end of a run and later.

    Attributes:
        time_s: When the run ended.
        reason: Why.
        impulse_pa_s: Of all positive phases, then.
        later_s: When it was looked at again.
        later_pa_s: The impulse at that time.
    """

    time_s: float
    reason: EndReason
    impulse_pa_s: float
    later_s: float
    later_pa_s: float

    @property
    def cut_off(self) -> float:
        """Share of the later impulse that was still missing at the end."""
        return 1.0 - self.impulse_pa_s / self.later_pa_s


def ending(blast: GasBlast, later_s: float = 0.2) -> Ending:
    """Run a blast to its end, and its gas on until a later time."""
    result = blast.run()
    time_s, impulse = result.time_s, protected_impulse_pa_s(result)
    result.run.solver.advance(later_s)
    later = protected_impulse_pa_s(GasResult(blast, result.run))
    return Ending(time_s, result.end_reason, impulse, result.time_s, later)
