"""The scenario, and its files.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site;
heights are above the ground.
"""

import os
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import tomli_w
from pydantic import TypeAdapter, ValidationError, model_validator

from blast_env.bundled import SCENARIO_SUFFIX, bundled_scenarios, scenario_folder
from blast_env.documents import DocumentError, parse_toml, read_text
from blast_env.errors import BlastEnvError, UnknownNameError, value_text
from blast_env.files import write_text
from blast_env.geometry import Element, Measure
from blast_env.problems import Problem, ScenarioError, problems_from, unknown_name
from blast_env.response.components import Alternatives, FacadeBay, Glazing, Wall, catalogue
from blast_env.sections import HashMark, digest_of, fields_with, hashed_content
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Hardening
from blast_env.site.checks import check_sections, check_sources, particle_problems
from blast_env.site.content import Content, Sources
from blast_env.site.facade import BayComponents, named_bays
from blast_env.site.sources import (
    AnyCharge,
    AnySource,
    PointSource,
    VehicleCharge,
    VehicleSource,
    ranked,
)
from blast_env.site.structures import AnyStructure, PolygonSection
from blast_env.site.zone import BuildZone
from blast_env.units import MODULE_SIDE_M
from blast_env.values import path_of


class Scenario(Content):
    """A protective-layout problem, without layout and seed.

    Attributes:
        schema_version: Version of the file format.
        name: Short name, as in `load_scenario("courtyard")`.
        description: Description for readers.
        import_notes: Changes that an import made to a map or drawing, for readers.
        site: The simulated area.
        charge: Sources of the charge: one, or several with weights.
        structures: Structures, protected or not.
        build_zone: The zone for barriers; without one, there are none.
        simulation: Parameters of the particle model.
        calibration: Name of the calibration that converts impulses by particles to Pa s.
        gauges: Gauges of overpressure, for the engine `gas`.
        objective: The objective of layouts.
        georeference: Place of the site on a map or drawing; no result depends on it.
        components: Components of facades by name, beside those of the catalogue.
    """

    def structures_with(self, layout: Iterable[Element]) -> tuple[AnyStructure, ...]:
        """Return the structures that remain with a layout."""
        zone = self.build_zone
        if zone is None or not zone.removable:
            return self.structures
        away = zone.taken_away(layout)
        return tuple(structure for structure in self.structures if structure.name not in away)

    @property
    def bays(self) -> tuple[FacadeBay, ...]:
        """The bays of all facades with their components."""
        return self.bays_with(())

    def bays_with(self, layout: Iterable[Element]) -> tuple[FacadeBay, ...]:
        """Return the bays of all facades with the measures of a layout taken."""
        return tuple(bay.filled(self._known) for bay in self.named_bays(layout))

    def named_bays(self, layout: Iterable[Element] = ()) -> tuple[BayComponents, ...]:
        """Return the bays with the names of their components, with a layout's measures taken."""
        taken = {element.item for element in layout if isinstance(element, Measure)}
        measures = [hardening for hardening in self._hardening if hardening.name in taken]
        return tuple(
            bay.hardened(measures) for structure in self.structures for bay in named_bays(structure)
        )

    @property
    def alternatives(self) -> tuple[Alternatives, ...]:
        """The bays of all facades with their components and those of the measures."""
        return tuple(bay.alternatives(self._hardening, self._known) for bay in self.named_bays())

    @property
    def _known(self) -> dict[str, Glazing | Wall]:
        """All components by name."""
        return {**catalogue(), **self.components}

    @property
    def _hardening(self) -> tuple[Hardening, ...]:
        return () if self.build_zone is None else self.build_zone.hardening

    @property
    def zone(self) -> BuildZone:
        """The build zone, for callers that need one.

        Raises:
            BlastEnvError: If there is none.
        """
        if self.build_zone is None:
            raise BlastEnvError(
                f"scenario {self.name!r} has no build zone, so nothing can be placed in it"
            )
        return self.build_zone

    @property
    def particle_problems(self) -> tuple[Problem, ...]:
        """The reasons why particle engines cannot run the scenario; `gas` has no such limits."""
        return tuple(particle_problems(self))

    def check_for_particles(self) -> None:
        """Refuse a scenario that particle engines cannot run.

        Raises:
            ScenarioError: If there are `particle_problems`; it has all of them.
        """
        problems = self.particle_problems
        if problems:
            raise ScenarioError(self.name, problems)

    @property
    def without_budget(self) -> "Scenario":
        """The scenario with any budget, on which no load depends."""
        return self if self.build_zone is None or self.build_zone.budget is None else self.unlimited

    @cached_property
    def unlimited(self) -> "Scenario":
        """A copy without a budget."""
        zone = self.zone.model_copy(update={"budget": None})
        return self.model_copy(update={"build_zone": zone})

    @cached_property
    def content_hash(self) -> str:
        """SHA-256 of all that affects results, without texts for readers.

        It does not depend on name, description, notes of an import, reasons of areas, names of
        buildings, data for the stability of barriers, georeference, order of keys, or the form
        (preset or overrides) of the simulation parameters.
        """
        left_out = () if self.objective.is_response else (HashMark.IF_RESPONSE,)
        content = hashed_content(self, *left_out)
        content["schema_version"] = 1
        content["parameters"] = self.parameters.model_dump(mode="json")
        if self.site.air_height_m in (None, self.default_air_height_m):
            del content["site"]["air_height_m"]
        return digest_of(content)

    @property
    def site_hash(self) -> str:
        """SHA-256 of build zone, catalogue and structures, which give a layout its meaning.

        It does not depend on charges, objective, budget and facades, nor on protection, weights
        and faces of structures.
        """
        zone = self.build_zone
        built = [
            structure.model_dump(
                mode="json", include=fields_with(type(structure), HashMark.OF_PLACES)
            )
            for structure in self.structures
        ]
        content = None if zone is None else hashed_content(zone, HashMark.NOT_OF_PLACES)
        return digest_of({"build_zone": content, "structures": built})

    @classmethod
    def from_document(cls, document: Mapping[str, Any], source: str) -> "Scenario":
        """Return the scenario of a parsed file.

        Args:
            document: Nested like the models.
            source: Name of the file, for the error.

        Raises:
            ScenarioError: If it is invalid; the error has all problems of the sections or, if each
                is valid, all problems between them.
        """
        try:
            return cls.model_validate(document)
        except ValidationError as error:
            problems = problems_from(error, cls)
        raise ScenarioError(source, problems)

    def at_stand_off(self, distance_m: float) -> "Scenario":
        """Return the scenario with the structure at another distance from the charge.

        The structure moves along x, and the site's right border with it: the strip behind the
        structure keeps its width.

        Args:
            distance_m: Distance from the charge's centre to the near face of the structure.

        Raises:
            BlastEnvError: If there is not exactly one structure, to the right of a charge at one
                fixed point, or if the distance is not positive.
            ScenarioError: If the scenario would be out of bounds.
        """
        source, structure = self.charge[0], self.structures[0]
        single = len(self.charge) == len(self.structures) == 1
        if not (single and isinstance(source, PointSource)):
            raise BlastEnvError(f"{self.name}: needs one point charge and one structure to move")
        if isinstance(structure, PolygonSection):
            raise BlastEnvError(f"{self.name}: the structure to move must be a rectangle")
        x_m, near_m = source.position_m[0], structure.rectangle_m.left
        if near_m <= x_m:
            raise BlastEnvError(f"{self.name}: the structure must stand to the right of the charge")
        if not distance_m > 0.0:
            raise BlastEnvError(f"stand-off is {distance_m} m, must be greater than 0")
        strip_m = self.site.width_m - structure.rectangle_m.right
        corner_m = (x_m + distance_m, structure.corner_m[1])
        document = self.model_dump()
        document["structures"][0]["corner_m"] = corner_m
        document["site"]["width_m"] = corner_m[0] + structure.columns * MODULE_SIDE_M + strip_m
        return Scenario.from_document(document, f"{self.name} at {distance_m:g} m")

    def with_charge(self, charge: Charge) -> "Scenario":
        """Return the scenario with the charge at one fixed point.

        Raises:
            ScenarioError: If the charge would not be clear of a structure or the border.
        """
        if not isinstance(charge, Charge):
            raise BlastEnvError(f"charge is {value_text(charge)}, must be a Charge")
        return self._with_points((), (charge,))

    def check_charge(self, charge: AnyCharge) -> None:
        """Refuse a known charge that could not be on the site.

        Raises:
            ScenarioError: If it is out of bounds, or not clear of a structure or the border.
        """
        if not isinstance(charge, VehicleCharge) and not self.may_have(charge):
            self.with_charge(charge)

    def may_have(self, charge: Charge) -> bool:
        """Return whether a charge is one of the scenario's own, at a place that was checked."""
        try:
            own = PointSource.at(charge)
        except ValidationError:
            return False
        return any(
            not isinstance(source, VehicleSource)
            and (source.tnt_kg, source.height_m) == (own.tnt_kg, own.height_m)
            and source.has_place(own.position_m)
            for source in self.charge
        )

    def with_possible_charges(self, charges: Sequence[AnyCharge]) -> "Scenario":
        """Return the scenario with further possible charges.

        Modules must keep clear of these charges, too.

        Raises:
            ScenarioError: If a charge is out of bounds, or not clear of a structure or the border.
        """
        return self._with_points(self.charge, tuple(dict.fromkeys(charges)))

    def _with_points(
        self, sources: tuple[AnySource, ...], charges: tuple[AnyCharge, ...]
    ) -> "Scenario":
        """Return the scenario with the given sources and those of the charges.

        The other sections are valid, so only the sources are checked against them.
        """
        document = [
            {"kind": "point", **charge._asdict()}
            if isinstance(charge, Charge)
            else charge.source.model_dump()
            for charge in charges
        ]
        try:
            together = _SOURCES.validate_python((*sources, *document))
        except ValidationError:  # the error of the whole document has all problems
            own = [source.model_dump() for source in sources]
            return Scenario.from_document(
                self.model_dump() | {"charge": [*own, *document]}, self.name
            )
        changed = self.model_copy(update={"charge": together})
        problems = check_sources(changed)
        if problems:
            raise ScenarioError(self.name, problems)
        return changed

    def with_simulation(
        self, preset: str | None = None, overrides: Mapping[str, Mapping[str, Any]] | None = None
    ) -> "Scenario":
        """Return the scenario with other parameters of the particle model.

        Args:
            preset: Name of another preset; the scenario's overrides stay.
            overrides: Added to the scenario's: `{"air": {"spacing_units": 3.0}}`.

        Raises:
            ScenarioError: If there is no such preset or parameter, or a value is out of bounds.
        """
        document = self.model_dump()
        simulation = document["simulation"]
        simulation["preset"] = preset or simulation["preset"]
        for group, values in (overrides or {}).items():
            old = simulation["overrides"].get(group, {})
            simulation["overrides"][group] = {**old, **values}
        return Scenario.from_document(document, self.name)

    def with_facades(self, glazing: str | None, wall: str | None) -> "Scenario":
        """Return the scenario with a facade on each protected structure that has none.

        Args:
            glazing: Name of the glazing, if any.
            wall: Name of the wall, if any.

        Raises:
            BlastEnvError: If a component is given, but each protected structure has a facade.
            UnknownNameError: If a component does not exist.
            ScenarioError: If a structure has no height, or a component does not fit.
        """
        facade = {key: name for key, name in (("glazing", glazing), ("wall", wall)) if name}
        if not facade:
            return self
        document = self.model_dump(mode="json", exclude_none=True)
        without = [s for s in document["structures"] if s["protected"] and "facade" not in s]
        if not without:
            given = " and ".join(f"{key} {name!r}" for key, name in facade.items())
            raise BlastEnvError(
                f"{given}: each protected structure of {self.name} has a facade already"
            )
        known = self._known
        for kind, name in facade.items():  # here, once for all structures
            names = [item for item, component in known.items() if component.kind == kind]
            if name not in names:
                raise UnknownNameError(kind, name, names)
        for structure in without:
            structure["facade"] = facade
        return Scenario.from_document(document, self.name)

    @property
    def building_names(self) -> dict[str, str]:
        """Name of each structure's building, by the structure's name."""
        return {structure.name: structure.building_name for structure in self.structures}

    def title_of(self, name: str) -> str:
        """Return the title of a structure or building, else its name."""
        parts = (
            structure
            for structure in self.structures
            if name in (structure.name, structure.building_name)
        )
        return next((part.title for part in parts if part.title), name)

    def sample_charges(self, rng: np.random.Generator, count: int) -> tuple[AnyCharge, ...]:
        """Draw independent charges: a source by its weight, then a place in it.

        Charges of one vehicle have rising ranks: its worst place, its second worst, and so on.
        """
        return ranked(self.sample_charge(rng) for _ in range(count))

    def sample_charge(self, rng: np.random.Generator) -> AnyCharge:
        """Draw a charge: a source by its weight, then a place in it, or a vehicle's worst place."""
        # Drawn also for a single source, so that adding one does not shift the stream.
        chosen = bisect_right(self._charge_shares, rng.random())
        source = self.charge[chosen]
        if isinstance(source, VehicleSource):
            return VehicleCharge(source)
        return Charge(source.sample_position_m(rng), source.tnt_kg, source.height_m)

    @cached_property
    def _charge_shares(self) -> list[float]:
        """Cumulative probabilities of the sources, as by `Generator.choice` (sources,)."""
        weights = np.array([source.weight for source in self.charge])
        sums = (weights / weights.sum()).cumsum()
        shares: list[float] = (sums / sums[-1]).tolist()
        return shares

    @model_validator(mode="after")
    def _check_sections_together(self) -> Self:
        """Refuse a scenario with inconsistent sections."""
        problems = check_sections(self)
        if problems:
            raise ScenarioError(self.name, problems)
        return self


_SOURCES: Final = TypeAdapter(Sources)


SUFFIX: Final = SCENARIO_SUFFIX


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Return a scenario.

    Args:
        name_or_path: The name of a bundled scenario, or the path of a `.toml` file. A text with
            neither a suffix nor a folder is a name.

    Raises:
        ScenarioError: If there is no such scenario, or it is invalid; the error has all problems.
    """
    path = _located(name_or_path)
    try:
        text = read_text(path)
    except DocumentError as error:
        raise ScenarioError(str(path), [Problem(error.place, error.message)]) from error
    return parse_scenario(text, str(path))


AnyScenario = Scenario | str | Path | Mapping[str, Any]
"""A scenario, its bundled name, the path of its file, or the file's content as plain data."""


def find_scenario(scenario: AnyScenario) -> Scenario:
    """Return a scenario from any of its forms.

    Args:
        scenario: A scenario, which is returned unchanged, an argument of `load_scenario`, or plain
            data of the form of `Scenario.model_dump(mode="json", exclude_none=True)`.

    Raises:
        ScenarioError: If there is no such scenario, or it is invalid.
        BlastEnvError: If the argument has another type.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return Scenario.from_document(scenario, str(scenario.get("name", "scenario")))
    if not isinstance(scenario, str | Path):
        raise BlastEnvError(f"scenario is {scenario!r}, must be a name, a path or a Scenario")
    return load_scenario(scenario)


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario of the text of a file.

    Args:
        text: TOML.
        source: Name of the file, for the error.

    Raises:
        ScenarioError: If it is invalid; the error has all problems.
    """
    try:
        document = parse_toml(text)
    except DocumentError as error:
        raise ScenarioError(source, [Problem(error.place, error.message)]) from error
    return Scenario.from_document(document, source)


def find_problems(name_or_path: str | Path) -> tuple[Problem, ...]:
    """Return the problems of a scenario; none if it is valid.

    Args:
        name_or_path: As for `load_scenario`.
    """
    try:
        load_scenario(name_or_path)
    except ScenarioError as error:
        return error.problems
    return ()


def save_scenario(scenario: AnyScenario, path: str | Path) -> None:
    """Write a scenario to a file that `load_scenario` reads back as an equal scenario.

    An existing file is replaced as a whole, and stays unchanged if there is an error.

    Args:
        scenario: The scenario, or its bundled name or path, for a copy as a starting point.
        path: The `.toml` file.

    Raises:
        ScenarioError: If there is no such scenario, or it could not be read back: it is invalid
            after `model_copy`, or the path has another suffix.
        BlastEnvError: If the file cannot be written.
    """
    if path_of(path).suffix != SUFFIX:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    document = find_scenario(scenario).model_dump(mode="json", exclude_none=True)
    Scenario.from_document(document, str(path))
    write_text(path, tomli_w.dumps(document))


def scenario_hash(scenario: AnyScenario) -> str:
    """Return the SHA-256 of all parts of a scenario that affect results.

    Args:
        scenario: The scenario, or its bundled name or path.
    """
    return find_scenario(scenario).content_hash


def _located(name_or_path: str | Path) -> Path:
    """Return the path of the file of a name or path."""
    try:
        path = path_of(name_or_path)
    except BlastEnvError as error:
        raise ScenarioError("scenario", [Problem("", str(error))]) from error
    is_folder = os.path.isdir(path)
    if path.name == str(name_or_path) and not path.suffix:
        bundled = scenario_folder() / f"{path.name}{SUFFIX}"
        if os.path.isfile(bundled):
            return bundled
        if not is_folder:
            message = unknown_name("bundled scenario", path.name, bundled_scenarios())
            raise ScenarioError(path.name, [Problem("", message)])
    if path.suffix != SUFFIX and not is_folder:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    return path
