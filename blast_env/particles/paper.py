"""The paper's Tables 1 to 4, recomputed from its columns i_sim and i_ufc without simulations."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from blast_env.particles.calibration.fits import (
    Fit,
    fit_linear,
    fit_metrics,
    fit_power_law,
    fit_proportional,
)
from blast_env.particles.calibration.model import (
    LinearLaw,
    PowerLaw,
    ProportionalLaw,
    ScalingLaw,
)
from blast_env.particles.calibration.paper_table import paper_table

CELLS: Final = ("scaled", "abs", "pct")
"""The computed cells of a row of Tables 1 to 3, by their names in `paper_table`."""


@dataclass(frozen=True)
class PaperLaw:
    """A law of the paper's section 3 with its printed results.

    Attributes:
        name: The paper's name of the method, in Table 4.
        number: Number of its table.
        fit: This project's fit.
        in_text: The law with the coefficients printed in the text.
        table_4: MAPE (%), RMSE (psi s) and integral error (%) as printed.
        decimals: Decimals of i_scaled, E_abs and E% in its table.
        subtracts_rounded: Whether the E_abs of its table are differences of printed cells.
    """

    name: str
    number: int
    fit: Fit
    in_text: ScalingLaw
    table_4: tuple[float, float, float]
    decimals: tuple[int, int, int] = (5, 5, 2)
    subtracts_rounded: bool = False

    @property
    def fitted(self) -> ScalingLaw:
        """The law fitted to the paper's columns."""
        paper = paper_table()
        return self.fit(paper["i_sim"], paper["i_ufc_psi_s"])


PROPORTIONAL: Final = PaperLaw(
    "Proportional Coefficient", 1, fit_proportional, ProportionalLaw(4.343e-5), (14.9, 0.0794, 5.2)
)
LINEAR: Final = PaperLaw(
    "Linear Regression", 2, fit_linear, LinearLaw(-0.01696, 4.392e-5), (16.7, 0.0788, 3.6)
)
POWER: Final = PaperLaw(
    "Power-Law Model",
    number=3,
    fit=fit_power_law,
    in_text=PowerLaw(0.000124, 0.881),
    table_4=(11.4, 0.0985, 1.5),
    decimals=(4, 4, 1),
    subtracts_rounded=True,
)
PAPER_LAWS: Final = (PROPORTIONAL, LINEAR, POWER)
TABLE_4_DECIMALS: Final = (1, 4, 1)


def comparison_table(paper_law: PaperLaw) -> pd.DataFrame:
    """Return Table 1, 2 or 3, not rounded, and its three computed columns as printed.

    E_abs is the difference of rounded cells if the paper computes it in that way.
    """
    paper = paper_table()
    reference = paper["i_ufc_psi_s"]
    scaled = pd.Series(paper_law.fitted(paper["i_sim"]))
    error, digits = (scaled - reference).abs(), paper_law.decimals[0]
    of_rounded = (scaled.round(digits) - reference.round(digits)).abs()
    ours = {
        "r_m": paper["r_m"],
        "i_ufc_psi_s": reference,
        "i_sim": paper["i_sim"],
        "i_scaled_psi_s": scaled,
        "e_abs_psi_s": of_rounded if paper_law.subtracts_rounded else error,
        "e_percent": 100.0 * error / reference,
    }
    printed = {f"printed_{cell}": paper[f"t{paper_law.number}_{cell}"] for cell in CELLS}
    return pd.DataFrame(ours | printed)


def comparative_table() -> pd.DataFrame:
    """Return Table 4, not rounded, and its three columns as printed."""
    names = ["mape_percent", "rmse_psi_s", "integral_error_percent"]
    methods = pd.Series([law.name for law in PAPER_LAWS], name="method")
    ours = pd.DataFrame([metrics_row(law.fitted) for law in PAPER_LAWS], columns=names)
    printed = pd.DataFrame([law.table_4 for law in PAPER_LAWS], columns=names)
    return pd.concat([methods, ours, printed.add_prefix("printed_")], axis=1)


def metrics_row(law: ScalingLaw) -> tuple[float, float, float]:
    """Return MAPE (%), RMSE (psi s) and integral error (%) of a law on the paper's columns."""
    paper = paper_table()
    metrics = fit_metrics(paper["r_m"], law(paper["i_sim"]), paper["i_ufc_psi_s"])
    return metrics.mape_percent, metrics.rmse, metrics.integral_error_percent


def deviations(table: pd.DataFrame, decimals: tuple[int, int, int]) -> NDArray[np.float64]:
    """Return recomputed minus printed cells (rows, 3), in units of the last printed digit.

    Deviations up to 0.5 are due to the paper's rounding.

    Args:
        table: Table of `comparison_table` or `comparative_table`, which ends with three columns and
            the same three as printed.
        decimals: Printed decimals of the three columns.
    """
    cells = table.iloc[:, -6:].to_numpy(dtype=np.float64)
    return np.asarray((cells[:, :3] - cells[:, 3:]) * 10.0 ** np.array(decimals))


CONTRADICTIONS: Final = """\
Where the paper contradicts itself (more in docs/paper/reading.md):
- k: the text prints 4.343e-05; Table 1 and the first row of Table 4 come from 4.2707e-05, which is
  what equation (6) gives.
- A and B: the text's "final conversion formula" has them rounded to three digits, which gives
  neither Table 3 nor the last row of Table 4; unrounded they give both.
- E_abs of Table 3: differences of rounded cells, up to 0.8 of the last digit beside the difference
  of the numbers themselves. Worked out as the paper did here."""
