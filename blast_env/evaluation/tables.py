"""The tables of an evaluation: by structure, by module, by threat.

`unprotected` in a column's name stands for no barrier on the same threats. Impulses and momenta
are means over the threats. Reductions are 1 - with / without, NaN where nothing arrives without.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from blast_env.evaluation.loads import BlastLoads, StructureLoad
from blast_env.evaluation.statistics import FloatArray, reduction_estimate
from blast_env.recording.tables import Column, module_table
from blast_env.scene import build_scene

if TYPE_CHECKING:
    from blast_env.evaluation.layout_evaluation import LayoutEvaluation

STRUCTURE_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("protected", "", "whether its load counts"),
    Column("weight", "", "its weight among the protected structures"),
    Column("impulse_pa_s", "Pa s", "calibrated impulse per area with the barrier"),
    Column("unprotected_impulse_pa_s", "Pa s", "calibrated impulse per area without it"),
    Column("reduction", "", "of the calibrated impulse"),
    Column("reduction_low", "", "lower end of its 95 % confidence interval"),
    Column("reduction_high", "", "upper end of its 95 % confidence interval"),
    Column("impulse_psi_s", "psi s", "calibrated impulse per area with the barrier"),
    Column("unprotected_impulse_psi_s", "psi s", "calibrated impulse per area without it"),
    Column("impulse_sim", "sim", "sum of m |v| with the barrier"),
    Column("unprotected_impulse_sim", "sim", "sum of m |v| without it"),
    Column("transferred_impulse_sim", "sim", "momentum really transferred with the barrier"),
    Column("unprotected_transferred_impulse_sim", "sim", "momentum transferred without it"),
    Column("threats_in_range", "", "threats that the calibration was made for"),
)

MODULE_COLUMNS: Final = (
    Column("module_id", "", "name of the module, made from its centre in metres"),
    Column("structure", "", "structure that the module is part of"),
    Column("x_m", "m", "centre, from the left border"),
    Column("y_m", "m", "centre, from the lower border"),
    Column("impulse_sim", "sim", "sum of m |v| with the barrier"),
    Column("unprotected_impulse_sim", "sim", "sum of m |v| without it"),
    Column("reduction", "", "of the sum of m |v|"),
)

THREAT_COLUMNS: Final = (
    Column("seed", "", "seed of fan and air"),
    Column("charge_x_m", "m", "centre of the charge, from the left border"),
    Column("charge_y_m", "m", "centre of the charge, from the lower border"),
    Column("tnt_kg", "kg", "TNT-equivalent mass of the charge"),
    Column("impulse_pa_s", "Pa s", "protected structures, with the barrier"),
    Column("unprotected_impulse_pa_s", "Pa s", "protected structures, without it"),
    Column("reduction", "", "of that impulse"),
    Column("in_range", "", "whether the calibration was made for this threat"),
)


def structure_reductions(evaluation: "LayoutEvaluation") -> pd.DataFrame:
    """Return one row a structure; see `STRUCTURE_COLUMNS`."""
    pairs = zip(_by_structure(evaluation.loads), _by_structure(evaluation.unprotected), strict=True)
    return _table([_structure_row(loads, bare) for loads, bare in pairs], STRUCTURE_COLUMNS)


def module_reductions(evaluation: "LayoutEvaluation") -> pd.DataFrame:
    """Return one row a module of the structures, in the scene's order; see `MODULE_COLUMNS`."""
    threat = evaluation.threats[0]
    scene = build_scene(evaluation.scenario, (), threat.seed, threat.charge)
    impulse, bare = (
        np.mean([load.module_impulse_sim for load in loads], axis=0)
        for loads in (evaluation.loads, evaluation.unprotected)
    )
    table = module_table(scene.obstacles()).assign(
        impulse_sim=impulse, unprotected_impulse_sim=bare, reduction=_share_gone(impulse, bare)
    )
    return table[[column.name for column in MODULE_COLUMNS]]


def threat_reductions(evaluation: "LayoutEvaluation") -> pd.DataFrame:
    """Return one row a threat; see `THREAT_COLUMNS`."""
    rows = [
        (
            outcome.threat.seed,
            *outcome.threat.charge.position_m,
            outcome.threat.charge.tnt_kg,
            outcome.impulse_pa_s,
            outcome.unprotected_impulse_pa_s,
            outcome.reduction,
            outcome.in_range,
        )
        for outcome in evaluation.outcomes
    ]
    return _table(rows, THREAT_COLUMNS)


def _table(rows: Sequence[Sequence[object]], columns: Sequence[Column]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=[column.name for column in columns])


def _by_structure(loads: Sequence[BlastLoads]) -> list[tuple[StructureLoad, ...]]:
    """Return the loads of each structure, one a threat."""
    return list(zip(*(load.structures for load in loads), strict=True))


def _structure_row(
    loads: Sequence[StructureLoad], bare: Sequence[StructureLoad]
) -> tuple[object, ...]:
    first = loads[0]
    pa_s, bare_pa_s = (np.array([load.impulse_pa_s for load in each]) for each in (loads, bare))
    means = [
        float(np.mean([getattr(load, name) for load in each]))
        for name in ("impulse_psi_s", "impulse_sim", "transferred_impulse_sim")
        for each in (loads, bare)
    ]
    return (
        first.name,
        first.protected,
        first.weight,
        float(pa_s.mean()),
        float(bare_pa_s.mean()),
        *reduction_estimate(pa_s, bare_pa_s),
        *means,
        sum(load.in_range for load in loads),
    )


def _share_gone(impulse: FloatArray, bare: FloatArray) -> FloatArray:
    """Return 1 - impulse / bare for each module (modules,); NaN where `bare` is 0."""
    reached = bare > 0.0
    gone = np.full(len(bare), np.nan)
    gone[reached] = 1.0 - impulse[reached] / bare[reached]
    return gone
