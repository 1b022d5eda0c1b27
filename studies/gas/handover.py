"""How loads depend on where the front is when the grid takes a charge over."""

from blast_env.engines.gas import GasBlast, GasResult
from blast_env.physics.gas.source import set_charge
from studies.gas.loads import protected_impulse_pa_s


def load_from_radius(blast: GasBlast, radius_m: float, until_s: float) -> float:
    """Return the impulse on the protected structures, Pa s, with a radius of one's own.

    Args:
        blast: The blast.
        radius_m: Where the front is when the grid takes over; nothing solid may be nearer.
        until_s: When the load is looked at.

    Raises:
        BlastEnvError: If the radius is within the charge.
    """
    run = blast.engine.start_on(blast.site)
    set_charge(run.solver, run.charge, radius_m)
    run.solver.advance(until_s)
    return protected_impulse_pa_s(GasResult(blast, run))
