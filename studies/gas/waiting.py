"""What tables say of walls and gauges when a run ends, and what came later."""

from dataclasses import dataclass, replace
from time import process_time

import numpy as np
import pandas as pd

from blast_env.arrays import BoolArray, FloatArray
from blast_env.engines.gas import GasBlast, GasResult
from blast_env.physics.engine import EndReason
from blast_env.physics.gas.settings import COMPLETE


@dataclass(frozen=True, eq=False)
class Waiting:
    """What tables say of walls and gauges that a run did or did not wait for, and what came later.

    Attributes:
        until: What it waited for.
        time_s: When it ended.
        cpu_s: Time of a core, all threads together.
        reason: Why it ended.
        told: Whether each wall and gauge counts as complete (n,).
        came: Share of the impulse then that came until twice the time (n,).
    """

    until: str
    time_s: float
    cpu_s: float
    reason: EndReason
    told: BoolArray
    came: FloatArray

    @property
    def missed(self) -> int:
        """Of how many more than 2 % came that counted as complete."""
        return int((self.told & (self.came > COMPLETE)).sum())

    @property
    def worst(self) -> float:
        """The largest share that came of one that counted as complete."""
        return float(self.came[self.told].max(initial=0.0))


def waiting(blast: GasBlast, until: str) -> Waiting:
    """Run a blast until something is complete, and then for twice the time."""
    waited = replace(blast, engine=replace(blast.engine, until=until))
    start = process_time()
    result = waited.run()
    cpu_s = process_time() - start
    shown = _rows(result)
    result.run.solver.advance(2.0 * result.time_s)
    later = _rows(GasResult(waited, result.run))
    was = shown["positive_impulse_pa_s"].to_numpy()
    came = later["positive_impulse_pa_s"].to_numpy() / np.maximum(was, 1e-9) - 1.0
    return Waiting(
        until, result.time_s, cpu_s, result.end_reason, shown["complete"].to_numpy(dtype=bool), came
    )


def _rows(result: GasResult) -> pd.DataFrame:
    columns = ["positive_impulse_pa_s", "complete"]
    return pd.concat([result.walls[columns], result.gauges[columns]], ignore_index=True)
