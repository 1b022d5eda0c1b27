"""Whether the open borders are far enough away: loads by margin and by the height of the air."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from blast_env.physics.gas.engine import GasEngine
from blast_env.scenario import Scenario
from blast_env.simulation.gas import GasBlast
from blast_env.studies.agreement.layouts import Layout
from blast_env.studies.gas.loads import protected_impulse_pa_s


@dataclass(frozen=True)
class BorderLoad:
    """The load on the protected structures with open borders at a distance.

    Attributes:
        margin_m: From the site to the borders at its sides.
        air_m: From the ground to the border at the top.
        impulse_pa_s: Of all positive phases.
    """

    margin_m: float
    air_m: float
    impulse_pa_s: float


def border_loads(
    scenario: Scenario, layout: Layout, margins_m: Sequence[float], engine: GasEngine
) -> list[BorderLoad]:
    """Return the loads of one blast with several margins."""
    found = []
    for margin_m in margins_m:
        blast = GasBlast(scenario, layout, engine=replace(engine, margin_m=margin_m))
        impulse = protected_impulse_pa_s(blast.run())
        found.append(BorderLoad(margin_m, scenario.air_height_m, impulse))
    return found
