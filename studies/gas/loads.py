"""What a blast of the gas engine does to the protected structures."""

from blast_env.engines.gas import GasBlast, GasResult


def protected_impulse_pa_s(result: GasResult) -> float:
    """Return the impulse of all positive phases on the protected structures, by weight."""
    table = result.structures
    of = table[table["protected"]]
    return float((of["weight"] * of["positive_impulse_pa_s"]).sum() / of["weight"].sum())


def impulse_until(blast: GasBlast, until_s: float) -> float:
    """Return the impulse on the protected structures up to a time, Pa s, whenever a run ends."""
    run = blast.engine.start_on(blast.site)
    run.solver.advance(until_s)
    return protected_impulse_pa_s(GasResult(blast, run))
