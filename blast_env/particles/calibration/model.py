"""Laws from simulated to reference impulse (paper, section 3), and calibrations stored in files."""

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cache, cached_property
from hashlib import sha256
from importlib.resources import files
from math import hypot
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, overload

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from blast_env.arrays import FloatArray
from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError, UnknownNameError, alternatives, type_word, value_text
from blast_env.files import write_text
from blast_env.geometry import Rectangle, distance_to_rectangle
from blast_env.results import ScaledImpulse
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.parameters import SimulationParameters, parameters_digest
from blast_env.units import PA_PER_PSI
from blast_env.values import Numbers, checked_array, first_bad, path_of

if TYPE_CHECKING:  # a calibration is read long before there are balls and parts
    from blast_env.particles.objects import ModularObstacle

SimulatedQuantity = Literal["impulse", "transferred_impulse"]
"""The paper's sum of m |v|, or the momentum actually transferred along the normals."""

LawName = Literal["proportional", "linear", "power"]
"""The laws that `blast-env calibrate` fits."""


@dataclass(frozen=True)
class ScalingLaw(ABC):
    """A law from simulated to reference impulse. Its fields are its coefficients."""

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not np.isfinite(value):
                raise BlastEnvError(
                    f"{type(self).__name__}: {name} is {value}, must be a finite number"
                )

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients by their names in the paper."""
        return asdict(self)

    @overload
    def __call__(self, i_sim: float) -> float: ...

    @overload
    def __call__(self, i_sim: Numbers) -> FloatArray: ...

    def __call__(self, i_sim: float | Numbers) -> float | FloatArray:
        """Return the impulse in the unit of the reference, in the shape of `i_sim`.

        Args:
            i_sim: Impulses, simulation units.

        Raises:
            BlastEnvError: If an impulse is negative or not a finite number.
        """
        return _like_input(self._forward(checked_array("i_sim", i_sim, least=0.0)))

    @overload
    def inverse(self, i_reference: float) -> float: ...

    @overload
    def inverse(self, i_reference: Numbers) -> FloatArray: ...

    def inverse(self, i_reference: float | Numbers) -> float | FloatArray:
        """Return the simulated impulse that the law converts into `i_reference`.

        Args:
            i_reference: Impulses in the unit of the reference.

        Raises:
            BlastEnvError: If an impulse is not a finite number, if no simulated impulse of at
                least 0 gives it, or if the law is a constant.
        """
        slope = list(self.coefficients)[-1]
        if self.coefficients[slope] == 0.0:
            raise BlastEnvError(f"{self} has no inverse: {slope} is 0, so it is a constant")
        reference = checked_array("i_reference", i_reference)
        with np.errstate(all="ignore"):  # values out of reach are rejected below
            simulated = self._backward(reference)
        out_of_reach = ~(np.isfinite(simulated) & (simulated >= 0.0))
        if out_of_reach.any():
            place, value = first_bad("i_reference", reference, out_of_reach)
            raise BlastEnvError(
                f"{place} is {value:g}, which {self} gives for no i_sim of at least 0"
            )
        return _like_input(simulated)

    @abstractmethod
    def _forward(self, i_sim: FloatArray) -> FloatArray:
        """Apply the law to impulses that have been checked."""

    @abstractmethod
    def _backward(self, i_reference: FloatArray) -> FloatArray:
        """Solve the law for i_sim; values out of reach give a negative number, infinity or NaN."""


@dataclass(frozen=True)
class ProportionalLaw(ScalingLaw):
    """i_scaled = k i_sim (equation 5).

    Attributes:
        k: Unit of the reference per simulation unit.
    """

    k: float

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        return self.k * i_sim

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        return i_reference / self.k


@dataclass(frozen=True)
class LinearLaw(ScalingLaw):
    """i_scaled = a + b i_sim (equation 7).

    It is not clipped: with a negative `a`, a small impulse becomes negative, as in the paper.

    Attributes:
        a: Offset, unit of the reference.
        b: Unit of the reference per simulation unit.
    """

    a: float
    b: float

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        return self.a + self.b * i_sim

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        return (i_reference - self.a) / self.b


@dataclass(frozen=True)
class PowerLaw(ScalingLaw):
    """i_scaled = A i_sim^B (section 3.3).

    Attributes:
        A: Impulse for i_sim = 1, unit of the reference, above 0.
        B: Exponent, dimensionless.
    """

    A: float
    B: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.A <= 0.0:
            raise BlastEnvError(f"PowerLaw: A is {self.A}, must be above 0")

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        if self.B < 0.0:
            checked_array("i_sim", i_sim, above=0.0)
        return self.A * i_sim**self.B

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        solved: FloatArray = (i_reference / self.A) ** (1.0 / self.B)
        return solved


def _like_input(array: FloatArray) -> float | FloatArray:
    return float(array) if array.ndim == 0 else array


LAWS: Final[Mapping[str, type[ScalingLaw]]] = MappingProxyType(
    {"proportional": ProportionalLaw, "linear": LinearLaw, "power": PowerLaw}
)


class CalibrationError(BlastEnvError):
    """A calibration that cannot be read, or does not belong to a simulation."""


Amount = Annotated[float, Field(ge=0.0)]


class CalibrationSection(BaseModel):
    """Base of the parts of a calibration file."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ReferenceSection(CalibrationSection):
    """The reference of a fit.

    Attributes:
        source: The paper's UFC column, or Kingery-Bulmash.
        quantity: The quantity compared, e.g. `reflected_impulse`.
        burst: `hemispherical` or `spherical`; `None` if the source does not state it.
        charge_kg: TNT-equivalent mass; `None` if the source does not state it.
    """

    source: Literal["paper UFC column", "Kingery-Bulmash"]
    quantity: str
    burst: str | None = None
    charge_kg: float | None = None


class MetricsSection(CalibrationSection):
    """Agreement of the law with the reference (`FitMetrics`), rmse in psi*s."""

    mape_percent: float
    rmse: float
    integral_error_percent: float
    leave_one_out_mape_percent: float


class Calibration(CalibrationSection):
    """A law from simulated impulse to psi*s, with all its dependencies.

    Attributes:
        schema_version: Version of the file format.
        name: Name, as in `load_calibration("ballistic_ufc")`.
        law: Kind of the law.
        coefficients: Its coefficients, by their names in the paper.
        coefficient_intervals: Their 95 % intervals (low, high) from the scatter between seeds.
        reference: Reference of the fit.
        preset: Preset of the simulations.
        parameters_digest: Digest of all their parameters.
        engine: Engine of the simulations.
        engine_version: Version of that engine at the time.
        blast_env_version: Version of the package at the time.
        facade_width_m: Width of the reference structure's facade.
        ball_radius_m: Radius of an air ball, by which the facade collects beyond either end.
        simulated: The sum over the collisions that the law converts.
        tnt_kg: TNT-equivalent mass of the simulated charge.
        tnt_range_kg: Range of masses in which the law holds with Hopkinson-Cranz scaling;
            `None` for `tnt_kg` only.
        distances_m: Distances, ascending; the first and last are the range of validity.
        seeds: Seeds at every distance.
        i_sim: Mean simulated impulse at each distance.
        i_sim_ci95: Half-width of its 95 % confidence interval.
        i_reference_psi_s: Reference impulse at each distance.
        metrics: Agreement of the law with the reference.
    """

    schema_version: Literal[1] = 1
    name: str
    law: LawName
    coefficients: dict[str, float]
    coefficient_intervals: dict[str, tuple[float, float]]
    reference: ReferenceSection
    preset: str
    parameters_digest: str
    engine: str
    engine_version: str
    blast_env_version: str
    facade_width_m: Annotated[float, Field(ge=0.01, le=2000.0)]
    ball_radius_m: Annotated[float, Field(ge=1e-6, le=100.0)]
    simulated: SimulatedQuantity = "impulse"
    tnt_kg: Annotated[float, Field(ge=0.01, le=100_000.0)]
    tnt_range_kg: tuple[float, float] | None = None
    distances_m: Annotated[tuple[float, ...], Field(min_length=2)]
    seeds: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)]
    i_sim: tuple[Amount, ...]
    i_sim_ci95: tuple[Amount, ...]
    i_reference_psi_s: tuple[Amount, ...]
    metrics: MetricsSection

    @model_validator(mode="after")
    def _check_parts(self) -> "Calibration":
        """Reject inconsistent parts."""
        names = {field.name for field in fields(LAWS[self.law])}
        for key in ("coefficients", "coefficient_intervals"):
            if set(getattr(self, key)) != names:
                raise ValueError(f"{key} must be {alternatives(sorted(names))} of a {self.law} law")
        count = len(self.distances_m)
        for key in ("i_sim", "i_sim_ci95", "i_reference_psi_s"):
            if len(getattr(self, key)) != count:
                raise ValueError(f"{key} must have {count} values, one for each of distances_m")
        pairs = zip(self.distances_m, self.distances_m[1:], strict=False)
        if self.distances_m[0] <= 0.0 or not all(before < after for before, after in pairs):
            raise ValueError("distances_m must be above 0 and ascending")
        low_kg, high_kg = self.tnt_range_kg or (self.tnt_kg, self.tnt_kg)
        if not 0.0 < low_kg <= self.tnt_kg <= high_kg:
            raise ValueError("tnt_range_kg must be around tnt_kg, and above 0")
        self.scaling_law  # noqa: B018  # rejects invalid coefficients
        return self

    @cached_property
    def scaling_law(self) -> ScalingLaw:
        """The law from i_sim on the reference facade to psi*s."""
        return LAWS[self.law](**self.coefficients)

    @property
    def digest(self) -> str:
        """SHA-256 of all of it, which distinguishes versions of the same name."""
        return sha256(self.model_dump_json().encode()).hexdigest()

    def check(self, parameters: SimulationParameters, engine: str) -> None:
        """Reject a simulation for which the calibration was not made.

        Raises:
            CalibrationError: If the engine or any parameter of the blast model differs.
        """
        if engine != self.engine:
            raise CalibrationError(
                f"calibration {value_text(self.name)} was made with engine"
                f" {value_text(self.engine)}, the simulation ran on {engine!r}"
            )
        digest = parameters_digest(parameters, engine)
        if digest != self.parameters_digest:
            raise CalibrationError(
                f"calibration {value_text(self.name)} was made with the parameters of preset "
                f"{value_text(self.preset)} ({self.parameters_digest[:12]}), the simulation has "
                f"others ({digest[:12]}): use that preset without overrides, or calibrate anew"
            )

    def convert(
        self, impulse_sim: float, seen_width_m: float, distance_m: float, tnt_kg: float
    ) -> ScaledImpulse:
        """Convert the impulse on a structure.

        The law holds for the impulse on the reference facade. The impulse of another structure is
        first scaled by the ratio of the collecting widths, that of the reference over its own,
        because more balls hit a wider building without loading it more per area. The collecting
        width is the width seen from the charge plus a ball radius on either side.

        With `tnt_range_kg`, distance and impulse are divided by the cube root of the charge's mass
        over `tnt_kg` before the law, and the result is multiplied by it (Hopkinson-Cranz).

        Args:
            impulse_sim: The sum `simulated` on the structure, simulation units.
            seen_width_m: Its width as seen from the charge; see `seen_width_m`.
            distance_m: Distance from the charge's centre to the structure.
            tnt_kg: TNT-equivalent mass of the charge.
        """
        # 1. The impulse that the reference facade would have collected.
        margin_m = 2.0 * self.ball_radius_m
        share = (self.facade_width_m + margin_m) / (seen_width_m + margin_m)
        low_kg, high_kg = self.tnt_range_kg or (self.tnt_kg, self.tnt_kg)
        # 2. The law at the reference mass: impulse and distance over the cube root of the ratio of
        # masses (Hopkinson & Cranz), and the result times it.
        scale = 1.0 if self.tnt_range_kg is None else (tnt_kg / self.tnt_kg) ** (1.0 / 3.0)
        psi_s = scale * self.scaling_law(share * impulse_sim / scale)
        # 3. Whether this is inside what was fitted.
        notes = []
        first_m, last_m = scale * self.distances_m[0], scale * self.distances_m[-1]
        if not first_m <= distance_m <= last_m:
            notes.append(f"distance {distance_m:.2f} m is outside {first_m:.4g} to {last_m:.4g} m")
        if not low_kg <= tnt_kg <= high_kg:
            bounds = (
                f"{low_kg:g} kg" if low_kg == high_kg else f"between {low_kg:g} and {high_kg:g} kg"
            )
            notes.append(f"charge {tnt_kg:g} kg TNT is not {bounds}")
        return ScaledImpulse(psi_s * PA_PER_PSI, not notes, tuple(notes))

    def convert_load(self, obstacle: "ModularObstacle", charge: Charge) -> ScaledImpulse:
        """Convert the load on a structure; see `convert`.

        Args:
            obstacle: The structure, after a blast.
            charge: The charge.
        """
        centre_m = np.array([charge.position_m])
        boxes_m = obstacle.boxes_m
        distance_m = min(float(distance_to_rectangle(centre_m, box)[0]) for box in boxes_m)
        width_m = structure_width_m(obstacle, charge.position_m)
        impulse_sim: float = getattr(obstacle, self.simulated)
        return self.convert(impulse_sim, width_m, distance_m, charge.tnt_kg)


def structure_width_m(obstacle: "ModularObstacle", charge_m: tuple[float, float]) -> float:
    """Return the `seen_width_m` of a structure of any shape."""
    if obstacle.cells is None:
        return seen_width_m(obstacle.rectangle_m, charge_m)
    (x0, y0), (x1, y1) = charge_m, obstacle.rectangle_m.centre
    left, bottom, right, top = np.array(obstacle.boxes_m).T
    x_m, y_m = (
        np.concatenate((left, right, left, right)),
        np.concatenate((bottom, bottom, top, top)),
    )
    # Distances from the line to the centre: the extent of all corners across it.
    across_m = ((x_m - x0) * (y1 - y0) - (y_m - y0) * (x1 - x0)) / hypot(x1 - x0, y1 - y0)
    return float(np.ptp(across_m))


def seen_width_m(structure_m: Rectangle, charge_m: tuple[float, float]) -> float:
    """Return a structure's width perpendicular to the line from the charge to its centre, m."""
    (x0, y0), (x1, y1) = charge_m, structure_m.centre
    along_x, along_y = x1 - x0, y1 - y0
    length = hypot(along_x, along_y)
    width, height = structure_m.right - structure_m.left, structure_m.top - structure_m.bottom
    return (abs(along_y) * width + abs(along_x) * height) / length


SUFFIX: Final = ".json"


def stored_calibrations() -> tuple[str, ...]:
    """Return the names of the calibrations in the package."""
    return tuple(sorted({name for name, _ in _stored_files()}))


def calibrated_engines(name: str) -> tuple[str, ...]:
    """Return the engines for which the package has a calibration of that name."""
    return tuple(sorted(engine for stored, engine in _stored_files() if stored == name))


def load_calibration(name_or_path: str | Path, engine: str | None = None) -> Calibration:
    """Return a calibration by its name in the package, or from a `.json` file.

    Args:
        name_or_path: The name, or the file.
        engine: With a name: the engine of the calibration. By default the reference engine,
            pymunk, if it has one, else the first in alphabetical order.

    Raises:
        UnknownNameError: If there is none of that name.
        CalibrationError: If there is none for that engine, or the file cannot be read, is
            truncated or was edited.
    """
    path = path_of(name_or_path)
    if path.suffix != SUFFIX:
        return _of_the_package(str(name_or_path), engine).model_copy(deep=True)
    try:
        return _parsed(read_text(path))
    except DocumentError as error:
        raise CalibrationError(f"{path}: {error}") from error


@cache
def _of_the_package(name: str, engine: str | None) -> Calibration:
    if engine is None:
        engines = calibrated_engines(name)
        engine = "pymunk" if "pymunk" in engines or not engines else engines[0]
    if (name, engine) in _stored_files():
        folder = files("blast_env.particles.calibration") / "stored"
        return _parsed((folder / f"{name}.{engine}{SUFFIX}").read_text(encoding="utf-8"))
    if not calibrated_engines(name):
        raise UnknownNameError("calibration", name, stored_calibrations())
    raise CalibrationError(
        f"calibration {name!r} was not made for engine {engine!r}, only for "
        f"{', '.join(calibrated_engines(name))}"
    )


def scenario_calibration(scenario: Scenario, engine: str) -> Calibration:
    """Return the calibration of a scenario, checked against its parameters.

    Args:
        engine: Name of the engine that runs its blasts.
    """
    if scenario.calibration is None:
        raise CalibrationError(
            f"scenario {scenario.name!r} names no calibration: set calibration to one of "
            f"{', '.join(stored_calibrations())}"
        )
    calibration = load_calibration(scenario.calibration, engine)
    calibration.check(scenario.parameters, engine)
    return calibration


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration to a file, with a checksum that detects later edits.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    content = calibration.model_dump(mode="json")
    document = {**content, "checksum": _checksum(content)}
    write_text(path, json.dumps(document, indent=2) + "\n")


@cache
def _stored_files() -> tuple[tuple[str, str], ...]:
    """Return name and engine of the calibrations in the package."""
    found = []
    for entry in (files("blast_env.particles.calibration") / "stored").iterdir():
        name, _, engine = entry.name.removesuffix(SUFFIX).rpartition(".")
        if name:
            found.append((name, engine))
    return tuple(found)


def _parsed(text: str) -> Calibration:
    document = parse_json(text)
    if not isinstance(document, dict):
        raise DocumentError("", f"is {type_word(document)}, must be a calibration, a table")
    checksum = document.pop("checksum", None)
    if checksum != _checksum(document):
        raise DocumentError(
            "", "the checksum does not match: the file was edited after it was made"
        )
    return checked_as(Calibration, document)


def _checksum(content: dict[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
