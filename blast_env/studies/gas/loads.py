"""What a blast of the gas engine does to the protected structures."""

from blast_env.simulation.gas import GasResult


def protected_impulse_pa_s(result: GasResult) -> float:
    """Return the impulse of all positive phases on the protected structures, by weight."""
    table = result.structures
    of = table[table["protected"]]
    return float((of["weight"] * of["positive_impulse_pa_s"]).sum() / of["weight"].sum())
