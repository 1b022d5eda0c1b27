"""The time span of a blast that pictures show."""

import numpy as np

from blast_env.simulation import BlastResult

# The span ends at the earliest of these multiples of the time when that share of the impulse has
# arrived: a single straggler must not squeeze the blast into the first tenth of a picture.
_ENDS = ((0.999, 1.1), (0.95, 2.0))


def shown_until_s(result: BlastResult) -> float:
    """Return the simulated time at which a film or a history ends.

    It is a little after 99.9 % of the impulse on the protected structures has arrived (on all
    structures, if none is protected or hit), but not later than twice the time that 95 % took.
    """
    table = result.collisions
    protected = [obstacle.name for obstacle in result.obstacles if obstacle.protected]
    on_protected = table[table["structure"].isin(protected)]
    chosen = on_protected if len(on_protected) else table
    if not len(chosen):
        return result.time_s
    arrived = np.cumsum(chosen["impulse_sim"].to_numpy())
    times_s = chosen["time_s"].to_numpy()
    ends_s = (
        factor * float(times_s[np.searchsorted(arrived, share * arrived[-1])])
        for share, factor in _ENDS
    )
    return min(result.time_s, *ends_s)
