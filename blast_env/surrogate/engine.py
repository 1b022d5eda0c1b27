"""The surrogate as an engine, for training, where simulated blasts are too expensive."""

from collections import OrderedDict
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from math import isnan, nan
from pathlib import Path
from typing import ClassVar, Final

from blast_env.compilation import compilation_notice
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.evaluation.record import BlastLoads, StructureLoad
from blast_env.evaluation.validation import Validation, ValidationStatus
from blast_env.geometry import Element
from blast_env.layout.build_site import charge_against
from blast_env.site import AnyCharge, Scenario
from blast_env.surrogate.ensemble import Surrogate
from blast_env.surrogate.guess import Guess
from blast_env.surrogate.pieces import Memory
from blast_env.surrogate.surrogate_file import load_surrogate, packaged_surrogate
from blast_env.surrogate.walls import SurrogateSite, site_of

SURROGATE: Final = "surrogate"
"""Name of the surrogate as an engine."""

_NOTES: Final = ("a prediction of the surrogate, not a blast",)
_GUESSED: Final = Validation(ValidationStatus.APPROXIMATE, "a guess of gas dynamics")
_NOT_GUESSED: Final = Validation(ValidationStatus.OUTSIDE, "not protected, so not predicted")
_NAMED: Final = 5  # structures in one sentence
_KEPT_SITES: Final = 64
"""Number of cached sites, of some megabytes each."""


_SiteKey = tuple[str, tuple[str, ...]]


def _key_of(scenario: Scenario) -> _SiteKey:
    """Return what the loads on a site depend on: the content, and how parts are buildings."""
    return scenario.content_hash, tuple([own.building_name for own in scenario.structures])


def _no_loads(site: SurrogateSite) -> list[StructureLoad]:
    """Return the loads before a prediction: none on structures that are not protected.

    As where no air touches a wall, such a load is NaN, and the area that it is the mean of 0.
    """
    areas_m2 = dict(zip((own.name for own in site.protected), site.areas_m2.tolist(), strict=True))
    return [
        StructureLoad.on(
            own,
            nan,
            notes=_NOTES,
            area_m2=areas_m2.get(own.name, 0.0),
            validation=_GUESSED if own.protected else _NOT_GUESSED,
        )
        for own in site.scenario.structures
    ]


class _SiteLoads:
    """A site, with what the loads of all its predictions have in common."""

    def __init__(self, site: SurrogateSite) -> None:
        self.site = site
        self._no_loads = _no_loads(site)
        place = {own.name: number for number, own in enumerate(site.scenario.structures)}
        self._places = [place[structure.name] for structure in site.protected]

    def loads(self, guess: Guess, layouts: Sequence[Sequence[Element]]) -> list[BlastLoads]:
        """Return the loads of each layout of a prediction."""
        impulses_pa_s = guess.impulse_pa_s.tolist()
        nothing = [[None] * len(self._places)] * len(impulses_pa_s)
        peaks_pa = nothing if guess.peak_pa is None else guess.peak_pa.tolist()
        # Predictions of protected structures at their places; with the response of bays, where the
        # objective asks for it.
        responds, found = self.site.scenario.objective.is_response, []
        for index, predicted in enumerate(zip(impulses_pa_s, peaks_pa, strict=True)):
            loads = list(self._no_loads)
            for place, impulse_pa_s, peak_pa in zip(self._places, *predicted, strict=True):
                loads[place] = loads[place].with_load(impulse_pa_s, peak_pa)
                if isnan(impulse_pa_s):
                    loads[place] = replace(loads[place], area_m2=0.0)
            bays = guess.bays(self.site, index) if responds else ()
            found.append(BlastLoads(self._left(loads, layouts[index]), bays=bays))
        return found

    def _left(
        self, loads: Sequence[StructureLoad], layout: Sequence[Element]
    ) -> tuple[StructureLoad, ...]:
        """Return the loads on the structures that a layout leaves."""
        if not self.site.lets_go:
            return tuple(loads)
        names = {own.name for own in self.site.scenario.structures_with(layout)}
        return tuple(load for load in loads if load.name in names)


@dataclass(frozen=True)
class SurrogateEngine(Engine):
    """An engine that predicts the loads on protected structures without simulating a blast.

    `gymnasium.make("BlastBarrier-v0", scenario=..., engine=SurrogateEngine())` has episodes of
    milliseconds. Agents trained on it must be judged by gas dynamics. It predicts peaks only if
    the objective counts them. Structures that are not protected have no load. The response of
    facades is that to triangular loads of the predicted impulse and peak on each bay
    (`Guess.loads`).

    Attributes:
        surrogate: The surrogate; by default the bundled one.
        digest: Its digest.
    """

    has_peaks: ClassVar[bool] = True
    at_once: ClassVar[int] = 256
    title: ClassVar[str] = "Surrogate"
    validated_range: ClassVar[str] = "a validated range: they are predictions of the surrogate"

    surrogate: Surrogate = field(default_factory=packaged_surrogate, repr=False)
    name: str = field(init=False, default=SURROGATE)
    version: str = field(init=False)
    digest: str = field(init=False)
    _sites: OrderedDict[_SiteKey, _SiteLoads] = field(
        default_factory=OrderedDict, init=False, repr=False, compare=False
    )
    _memory: Memory = field(default_factory=Memory, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "digest", self.surrogate.digest)
        object.__setattr__(self, "version", f"{SURROGATE} {self.digest}")

    def loads(
        self,
        scenario: Scenario,
        layout: Sequence[Element],
        charge: AnyCharge,
        seed: int = 0,
    ) -> BlastLoads:
        """Return the predicted loads of one charge and layout.

        Args:
            scenario: The scenario.
            layout: A legal layout.
            charge: The charge, or the vehicle that carries it.
            seed: Ignored: predictions have no noise.

        Returns:
            The loads on protected structures; none on others and on modules.

        Raises:
            BlastEnvError: If no structure is protected.
        """
        return self.loads_at_once([EngineBlast(scenario, layout, charge, seed)])[0]

    def gives_peaks(self, scenario: Scenario) -> bool:
        """Return whether the objective counts overpressures, else none are predicted."""
        return scenario.objective.needs_peaks

    def caveats(self, scenario: Scenario) -> tuple[str, ...]:
        """Return that these are no blasts, and which structures have no prediction."""
        no_blasts = "These are predictions of a surrogate, not blasts: judge with engine 'gas'."
        others = [own.name for own in scenario.structures if not own.protected]
        if not others:
            return (no_blasts,)
        names = ", ".join(others[:_NAMED]) + ", ..." * (len(others) > _NAMED)
        return no_blasts, f"{names}: not protected, so not predicted"

    def doubts(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge
    ) -> tuple[str, ...]:
        """Return the 95 % intervals of the loads without a barrier and with a layout.

        A surrogate that was not checked on held-out sites has none.
        """
        site, fit = self._site(scenario).site, self.surrogate.fit
        if fit.impulse is None or (site.counts_peaks and fit.peak is None):
            return ("the surrogate has no intervals: its errors are not known",)
        layouts = [(), layout]
        charges = [charge_against(scenario, own, charge) for own in layouts]
        guess = self.surrogate.guess(site, layouts, charges)
        low, high = (
            ends.loads(site, layouts).tolist()
            for ends in (self.surrogate.lower_ends(guess), self.surrogate.upper_ends(guess))
        )
        text = scenario.objective.text
        without, behind = (
            f"{text(one)} to {text(other)}" for one, other in zip(low, high, strict=True)
        )
        said = (
            f"95 % intervals of the predictions under the worst threat: {without} without barrier, "
            f"{behind} with"
        )
        return (f"{said}; set on whole buildings: bays err more" if site.alternatives else said,)

    def loads_at_once(self, blasts: Sequence[EngineBlast]) -> list[BlastLoads]:
        """Return the same for several blasts, by one pass of the networks."""
        found: list[BlastLoads | None] = [None] * len(blasts)
        # Layouts of one site pass through the networks together.
        of_sites: dict[_SiteKey, list[int]] = {}
        keys: dict[int, _SiteKey] = {}  # by identity: mostly one scenario has all blasts
        for number, blast in enumerate(blasts):
            scenario = blast.scenario
            key = keys.get(id(scenario)) or keys.setdefault(id(scenario), _key_of(scenario))
            of_sites.setdefault(key, []).append(number)
        # The first site compiles everything; to listen takes longer than a prediction.
        numbers_of_sites = [*of_sites.values()]
        compiled = "the surrogate (some 20 s)"
        with nullcontext() if self._sites else compilation_notice(compiled):
            of_all = self._loads_of_sites(blasts, numbers_of_sites)
            for numbers, loads in zip(numbers_of_sites, of_all, strict=True):
                for number, one in zip(numbers, loads, strict=True):
                    found[number] = one
        return [blast_loads for blast_loads in found if blast_loads is not None]

    def _loads_of_sites(
        self, blasts: Sequence[EngineBlast], sites: Sequence[Sequence[int]]
    ) -> list[list[BlastLoads]]:
        """Return the loads of the numbered blasts of each of some sites."""
        served, asked = [], []
        for numbers in sites:
            own = [blasts[number] for number in numbers]
            served.append(self._site(own[0].scenario))
            charges = [charge_against(*blast[:3]) for blast in own]
            asked.append((served[-1].site, [blast.layout for blast in own], charges))
        guesses = self.surrogate.guesses(asked)
        return [
            item.loads(guess, layouts)
            for item, guess, (_, layouts, _) in zip(served, guesses, asked, strict=True)
        ]

    def _site(self, scenario: Scenario) -> _SiteLoads:
        key = _key_of(scenario)
        if key not in self._sites:
            self._sites[key] = _SiteLoads(site_of(scenario, self._memory))
            if len(self._sites) > _KEPT_SITES:
                self._sites.popitem(last=False)
        self._sites.move_to_end(key)
        return self._sites[key]


def is_surrogate(name: str) -> bool:
    """Return whether an engine name is `"surrogate"` or a surrogate's file (.json)."""
    return name == SURROGATE or Path(name).suffix == ".json"


def engine_to_train_on(name: str, cell_m: float | None = None, cells: str | None = None) -> Engine:
    """Return an engine by its name, which may be that of a surrogate.

    Args:
        name: The name of an engine, or a surrogate's file (.json).
        cell_m: Side of the cells of gas dynamics; by default the engine's.
        cells: Rule of their growth; by default the engine's.

    Raises:
        UnknownNameError: If no engine has that name.
        BlastEnvError: If the engine does not support the cells, or the file is not a surrogate.
    """
    if not is_surrogate(name):
        return find_engine(name, cell_m, cells=cells)
    surrogate = packaged_surrogate() if name == SURROGATE else load_surrogate(Path(name))
    return find_engine(SurrogateEngine(surrogate), cell_m, cells=cells)
