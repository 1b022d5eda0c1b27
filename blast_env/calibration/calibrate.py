"""From the runs of a free-field study to a calibration."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
import pandas as pd

from blast_env.calibration.laws import Fit, ScalingLaw, fit_linear, fit_power_law, fit_proportional
from blast_env.calibration.metrics import (
    FitMetrics,
    bootstrap_coefficients,
    fit_metrics,
    leave_one_out,
)
from blast_env.calibration.model import (
    Calibration,
    MetricsSection,
    ReferenceSection,
    SimulatedQuantity,
)
from blast_env.calibration.references import kingery_bulmash, paper_ufc_column
from blast_env.calibration.study import FreeFieldStudy, impulse_by_seed, summarise
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import find_engine
from blast_env.physics.parameters import parameters_digest
from blast_env.units import PA_PER_PSI, UNITS_PER_M

FITS: Final[Mapping[str, Fit]] = MappingProxyType(
    {"proportional": fit_proportional, "linear": fit_linear, "power": fit_power_law}
)
LawName = Literal["proportional", "linear", "power"]
ImpulseQuantity = Literal["incident_impulse", "reflected_impulse"]


@dataclass(frozen=True)
class Reference:
    """What a simulator is calibrated against.

    Attributes:
        section: What it is, for the record.
        impulse_psi_s: Its impulse at each distance (n,), psi*s.
    """

    section: ReferenceSection
    impulse_psi_s: np.ndarray


def paper_reference(distances_m: tuple[float, ...]) -> Reference:
    """Return the paper's UFC column.

    Raises:
        BlastEnvError: If a distance is not among the paper's eight.
    """
    column = paper_ufc_column()
    for distance_m in distances_m:
        if distance_m not in column.index:
            known = ", ".join(f"{known_m:g}" for known_m in column.index)
            raise BlastEnvError(
                f"the paper's UFC column has no value at {distance_m:g} m, must be one of {known}"
            )
    section = ReferenceSection(source="paper UFC column", quantity="impulse")
    return Reference(section, column.loc[list(distances_m)].to_numpy(dtype=np.float64))


def kingery_bulmash_reference(
    distances_m: tuple[float, ...],
    charge_kg: float,
    quantity: ImpulseQuantity = "reflected_impulse",
    burst: Literal["hemispherical", "spherical"] = "hemispherical",
) -> Reference:
    """Return Kingery and Bulmash's impulse.

    Raises:
        BlastEnvError: If a distance is outside the range of the curves.
    """
    impulse_pa_s = kingery_bulmash(quantity, np.array(distances_m), charge_kg, burst)
    section = ReferenceSection(
        source="Kingery-Bulmash", quantity=quantity, burst=burst, charge_kg=charge_kg
    )
    return Reference(section, impulse_pa_s / PA_PER_PSI)


@dataclass(frozen=True, eq=False)
class CalibrationReport:
    """A study with its three fits.

    Attributes:
        study: What was run.
        runs: One row a blast.
        summary: One row a distance; see `summarise`.
        reference: What it was fitted to.
        laws: The three laws by name.
        metrics: How well each agrees.
        simulated: Which sum over the collisions they convert.
    """

    study: FreeFieldStudy
    runs: pd.DataFrame
    summary: pd.DataFrame
    reference: Reference
    laws: Mapping[str, ScalingLaw]
    metrics: Mapping[str, FitMetrics]
    simulated: SimulatedQuantity = "impulse"

    def table(self) -> pd.DataFrame:
        """Return the summary with the reference and the three laws beside it, psi*s."""
        table = self.summary.assign(reference_psi_s=self.reference.impulse_psi_s)
        for name, law in self.laws.items():
            scaled = law(table.i_sim.to_numpy())
            table[f"{name}_psi_s"] = scaled
            table[f"{name}_error_percent"] = 100.0 * (scaled / table.reference_psi_s - 1.0)
        return table

    def calibration(self, name: str, law: LawName = "power") -> Calibration:
        """Return the calibration of one of the laws.

        Args:
            name: Its name.
            law: Which of the laws.
        """
        study, by_seed = self.study, impulse_by_seed(self.runs, self.simulated)
        reference = self.reference.impulse_psi_s
        left_out = leave_one_out(
            study.distances_m, self.summary.i_sim.to_numpy(), reference, FITS[law]
        )
        intervals = bootstrap_coefficients(by_seed, reference, FITS[law])
        (structure,) = study.scenario.structures
        (source,) = study.scenario.charge
        metrics = self.metrics[law]
        return Calibration(
            name=name,
            law=law,
            coefficients=self.laws[law].coefficients,
            coefficient_intervals={key: (i.low, i.high) for key, i in intervals.items()},
            reference=self.reference.section,
            preset=study.scenario.simulation.preset,
            parameters_digest=parameters_digest(study.scenario.parameters, study.engine),
            engine=study.engine,
            engine_version=find_engine(study.engine).version,
            blast_env_version=version("blast-env"),
            facade_width_m=structure.rectangle_m.top - structure.rectangle_m.bottom,
            ball_radius_m=study.scenario.parameters.air.radius_units / UNITS_PER_M,
            simulated=self.simulated,
            tnt_kg=source.tnt_kg,
            distances_m=study.distances_m,
            seeds=study.seeds,
            i_sim=tuple(self.summary.i_sim),
            i_sim_ci95=tuple(self.summary.ci95),
            i_reference_psi_s=tuple(reference.tolist()),
            metrics=MetricsSection(
                mape_percent=metrics.mape_percent,
                rmse=metrics.rmse,
                integral_error_percent=metrics.integral_error_percent,
                leave_one_out_mape_percent=left_out.metrics.mape_percent,
            ),
        )


def calibrate(
    study: FreeFieldStudy,
    runs: pd.DataFrame,
    reference: Reference,
    simulated: SimulatedQuantity = "impulse",
) -> CalibrationReport:
    """Fit the three laws to the runs of a study.

    Args:
        study: The study.
        runs: Its runs.
        reference: What to fit to.
        simulated: Which sum over the collisions to convert.

    Raises:
        BlastEnvError: If the runs cannot be fitted, e.g. because nothing arrived at a distance.
    """
    summary = summarise(runs, simulated)
    i_sim = summary.i_sim.to_numpy(dtype=np.float64)
    laws = {name: fit(i_sim, reference.impulse_psi_s) for name, fit in FITS.items()}
    metrics = {
        name: fit_metrics(study.distances_m, law(i_sim), reference.impulse_psi_s)
        for name, law in laws.items()
    }
    return CalibrationReport(study, runs, summary, reference, laws, metrics, simulated)
