"""The record of a fit: what a surrogate was fitted to, and how far it is off elsewhere."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class Check(BaseModel):
    """Errors of the predictions of one kind of load on sites held out of the fit.

    Attributes:
        rms: Root mean square error of the logarithm of a load.
        rank: Rank correlation with the engine among the layouts of a case.
        lost: Regret of a choice by prediction: excess of the load of the layout with the best
            prediction over the least load of the case, relative to the largest.
        spreads: Half-width of the 95 % interval of ln load, in spreads
            (`intervals.interval_factor`).
        least_spread: What adds to the standard deviation among the networks for such a spread
            (`intervals.widened`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    rms: float
    rank: float
    lost: float
    spreads: Annotated[float, Field(gt=0.0)]
    least_spread: Annotated[float, Field(ge=0.0)]


class Fit(BaseModel):
    """Provenance of a surrogate, and its errors on sites held out of the fit.

    Attributes:
        format: Version of the file format.
        command: Command that fitted it.
        versions: Versions of the software.
        engine: Engine of the blasts.
        blasts: Number of loads of structures in the fit.
        sites: Number of sites in the fit.
        seconds: Duration of the fit, in s.
        impulse: Errors of impulses, if checked.
        peak: Errors of peak overpressures, if checked.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    format: Literal[8] = 8
    command: str
    versions: dict[str, str]
    engine: str
    blasts: Annotated[int, Field(ge=1)]
    sites: Annotated[int, Field(ge=1)]
    seconds: Annotated[float, Field(ge=0.0)] = 0.0
    impulse: Check | None = None
    peak: Check | None = None
