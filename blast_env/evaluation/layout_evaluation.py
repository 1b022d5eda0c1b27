"""What an evaluation of a layout found."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from blast_env.atomic import write_atomically
from blast_env.calibration.model import Calibration
from blast_env.evaluation.loads import BlastLoads
from blast_env.evaluation.record import evaluation_record
from blast_env.evaluation.statistics import (
    Estimate,
    FloatArray,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)
from blast_env.evaluation.tables import module_reductions, structure_reductions, threat_reductions
from blast_env.evaluation.threats import Threat
from blast_env.scenario import Cell, Scenario
from blast_env.units import PA_PER_PSI


@dataclass(frozen=True)
class ThreatOutcome:
    """What a layout does against one threat; impulses as in `BlastLoads.protected_impulse_psi_s`.

    Attributes:
        threat: The threat.
        impulse_psi_s: Impulse on the protected structures with the barrier, psi*s.
        unprotected_impulse_psi_s: The same without it, psi*s.
        in_range: Whether the calibration was made for such a threat.
    """

    threat: Threat
    impulse_psi_s: float
    unprotected_impulse_psi_s: float
    in_range: bool

    @property
    def impulse_pa_s(self) -> float:
        """Impulse on the protected structures with the barrier, Pa*s."""
        return self.impulse_psi_s * PA_PER_PSI

    @property
    def unprotected_impulse_pa_s(self) -> float:
        """Impulse on the protected structures without the barrier, Pa*s."""
        return self.unprotected_impulse_psi_s * PA_PER_PSI

    @property
    def reduction(self) -> float:
        """Share of the impulse that is gone; NaN if there is none without a barrier."""
        if self.unprotected_impulse_psi_s <= 0.0:
            return np.nan
        return 1.0 - self.impulse_psi_s / self.unprotected_impulse_psi_s


@dataclass(frozen=True, eq=False)
class LayoutEvaluation:
    """A layout against no barrier, on the same threats.

    Impulses are those of `BlastLoads.protected_impulse_psi_s`: per area, by weight, added up over
    the protected structures. Intervals are 95 % confidence intervals of the mean over all threats
    that the scenario can draw; they say nothing about how right the model is.

    Attributes:
        scenario: The scenario.
        layout: The layout's cells, sorted.
        threats: What both were exposed to.
        loads: Loads with the layout, one a threat.
        unprotected: Loads without any barrier, one a threat.
        calibration: What converted simulated impulses.
        engine_name: Name of the engine.
        engine_version: Version of the library that did the physics.
        cvar_level: Level of `cvar`: 0.8 is the mean of the worst 20 %.
    """

    scenario: Scenario
    layout: tuple[Cell, ...]
    threats: tuple[Threat, ...]
    loads: tuple[BlastLoads, ...]
    unprotected: tuple[BlastLoads, ...]
    calibration: Calibration
    engine_name: str
    engine_version: str
    cvar_level: float

    @cached_property
    def outcomes(self) -> tuple[ThreatOutcome, ...]:
        """What the layout does against each threat."""
        return tuple(
            ThreatOutcome(
                threat, load.protected_impulse_psi_s, bare.protected_impulse_psi_s, load.in_range
            )
            for threat, load, bare in zip(self.threats, self.loads, self.unprotected, strict=True)
        )

    @cached_property
    def reduction(self) -> Estimate:
        """1 - mean impulse with the barrier / without; see `reduction_estimate`."""
        return reduction_estimate(self._impulse_psi_s, self._unprotected_psi_s)

    @property
    def mean_reduction(self) -> float:
        """The value of `reduction`: 0 changes nothing, 1 keeps everything off."""
        return self.reduction.value

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % confidence interval of `mean_reduction`; NaN with a single threat."""
        return self.reduction.low, self.reduction.high

    @cached_property
    def impulse_psi_s(self) -> Estimate:
        """Mean impulse with the barrier, psi*s."""
        return mean_estimate(self._impulse_psi_s)

    @property
    def impulse_pa_s(self) -> Estimate:
        """Mean impulse with the barrier, Pa*s."""
        return self.impulse_psi_s.scaled(PA_PER_PSI)

    @cached_property
    def unprotected_impulse_psi_s(self) -> Estimate:
        """Mean impulse without the barrier, psi*s."""
        return mean_estimate(self._unprotected_psi_s)

    @property
    def unprotected_impulse_pa_s(self) -> Estimate:
        """Mean impulse without the barrier, Pa*s."""
        return self.unprotected_impulse_psi_s.scaled(PA_PER_PSI)

    @cached_property
    def worst(self) -> ThreatOutcome:
        """The threat with the largest impulse in spite of the barrier."""
        return max(self.outcomes, key=lambda outcome: outcome.impulse_psi_s)

    @property
    def cvar(self) -> float:
        """Mean impulse of the worst threats with the barrier, Pa*s; see `cvar_level`."""
        return PA_PER_PSI * conditional_value_at_risk(self._impulse_psi_s, self.cvar_level)

    @property
    def unprotected_cvar(self) -> float:
        """Mean impulse of the worst threats without the barrier, Pa*s."""
        return PA_PER_PSI * conditional_value_at_risk(self._unprotected_psi_s, self.cvar_level)

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a structure; the columns are `tables.STRUCTURE_COLUMNS`."""
        return structure_reductions(self)

    @cached_property
    def module_table(self) -> pd.DataFrame:
        """One row a module of the structures; the columns are `tables.MODULE_COLUMNS`."""
        return module_reductions(self)

    @cached_property
    def threat_table(self) -> pd.DataFrame:
        """One row a threat; the columns are `tables.THREAT_COLUMNS`."""
        return threat_reductions(self)

    @property
    def in_range(self) -> bool:
        """Whether the calibration was made for every threat and protected structure."""
        return all(outcome.in_range for outcome in self.outcomes)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What the calibration was not made for, a sentence a structure."""
        notes = []
        for of_structure in zip(*(load.structures for load in self.loads), strict=True):
            outside = [load for load in of_structure if not load.in_range]
            if outside:
                notes.append(
                    f"{outside[0].name}: {len(outside)} of {len(self.threats)} threats are outside "
                    f"the range of calibration {self.calibration.name!r}, "
                    f"e.g. {'; '.join(outside[0].notes)}"
                )
        return tuple(notes)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data: what was asked, with which versions, and the answer.

        The same arguments and versions give the same data; numbers that do not exist are `None`.
        """
        return evaluation_record(self)

    def to_json(self, path: str | Path) -> Path:
        """Write `to_dict` to a file.

        Returns:
            The path.

        Raises:
            BlastEnvError: If it cannot be written there; nothing is left behind then.
        """
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        with write_atomically(path) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
        return Path(path)

    def figure(self, path: str | Path) -> Path:
        """Save a figure of the evaluation: `.png`, `.svg` or `.pdf`.

        Returns:
            The path.

        Raises:
            BlastEnvError: If it cannot be written there, or the extra `render` is missing.
        """
        from blast_env.rendering.evaluation_figure import evaluation_figure
        from blast_env.rendering.figures import save_figure

        return save_figure(evaluation_figure(self), path)

    @cached_property
    def _impulse_psi_s(self) -> FloatArray:
        return np.array([outcome.impulse_psi_s for outcome in self.outcomes])

    @cached_property
    def _unprotected_psi_s(self) -> FloatArray:
        return np.array([outcome.unprotected_impulse_psi_s for outcome in self.outcomes])
