"""Running a blast: a pure function of scenario, layout, seed and engine.

`simulation.gas` is not imported here: it takes Numba, and with it half a second.
"""

from blast_env.simulation.blast import Blast, BlastResult, simulate, simulate_many

__all__ = ["Blast", "BlastResult", "simulate", "simulate_many"]
