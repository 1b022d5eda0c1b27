"""The surrogate in the place of an engine: for training, where blasts are too dear."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Final

import numpy as np

from blast_agents.surrogate.network import Surrogate, load_surrogate, packaged_surrogate
from blast_agents.surrogate.walls import SurrogateSite, site_of
from blast_env.arrays import FloatArray
from blast_env.engines import BlastLoads, Engine, StructureLoad, find_engine
from blast_env.geometry import Element
from blast_env.scenario import AnyCharge, Scenario
from blast_env.scenario.build_scene import charge_against

SURROGATE: Final = "surrogate"
"""Name of the engine that is none."""

_KEPT_SITES: Final = 64
"""What no layout changes is remembered for so many sites: some megabytes each."""

_SITE_BYTES: Final = 2**23
"""Of what is remembered of the pieces on each."""


@dataclass(frozen=True)
class SurrogateEngine(Engine):
    """Tells the loads on each protected structure by guesses: an engine without a blast.

    `gymnasium.make("BlastBarrier-v0", scenario=..., engine=SurrogateEngine())` has episodes of
    milliseconds. What is trained on it has to be judged by gas dynamics. It tells peaks only where
    the objective counts them, and knows no structure that is not protected: nothing arrives there.
    Where the response of facades counts, it is that under triangular loads of the guessed impulse
    and peak, on all bays of a structure alike (`Guess.loads`).

    Attributes:
        surrogate: The surrogate; that of the package unless given.
        digest: Its digest.
    """

    has_peaks: ClassVar[bool] = True
    title: ClassVar[str] = "Surrogate"
    caveat: ClassVar[str] = (
        "These are guesses of gas dynamics, not blasts: judge with engine 'gas'."
    )
    checked_for: ClassVar[str] = "what a blast says: they are guesses"

    surrogate: Surrogate = field(default_factory=packaged_surrogate, repr=False)
    name: str = field(init=False, default=SURROGATE)
    version: str = field(init=False)
    digest: str = field(init=False)
    _sites: OrderedDict[str, SurrogateSite] = field(
        default_factory=OrderedDict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "digest", self.surrogate.digest)
        object.__setattr__(self, "version", f"{SURROGATE} {self.digest}")

    def loads(
        self,
        scenario: Scenario,
        layout: Sequence[Element],
        charge: AnyCharge,
        seed: int = 0,  # noqa: ARG002
    ) -> BlastLoads:
        """Return what the surrogate guesses, a charge and a layout at a time.

        Args:
            scenario: The scenario.
            layout: A legal layout.
            charge: What goes off: where it does, or the vehicle that brings it.
            seed: Changes nothing: guesses have no noise.

        Returns:
            The loads. Those of a structure's modules are all the same, since only their mean is
            known.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        site = self._site(scenario)
        guess = self.surrogate.guess(site, [layout], [charge_against(scenario, layout, charge)])
        names = [each.name for each in site.protected]

        def of_all(on_protected: FloatArray) -> list[float]:
            known = dict(zip(names, on_protected.tolist(), strict=True))
            return [known.get(each.name, 0.0) for each in scenario.structures]

        impulse_pa_s = of_all(guess.impulse_pa_s[0])
        nothing = [None] * len(impulse_pa_s)
        peak_pa = nothing if guess.peak_pa is None else of_all(guess.peak_pa[0])
        structures = tuple(
            StructureLoad.on(*told, notes=("a guess of the surrogate, not a blast",))
            for told in zip(scenario.structures, impulse_pa_s, peak_pa, strict=True)
        )
        modules = [each.rows * each.columns for each in scenario.structures]
        bays = guess.bays(site, 0) if scenario.objective.is_response else ()
        return BlastLoads(structures, np.repeat(impulse_pa_s, modules), bays)

    def _site(self, scenario: Scenario) -> SurrogateSite:
        key = scenario.content_hash
        if key not in self._sites:
            self._sites[key] = site_of(scenario, _SITE_BYTES)
            if len(self._sites) > _KEPT_SITES:
                self._sites.popitem(last=False)
        self._sites.move_to_end(key)
        return self._sites[key]


def is_surrogate(name: str) -> bool:
    """Return whether the name of an engine to train on is that of a surrogate, or of its file."""
    return name == SURROGATE or Path(name).suffix == ".json"


def engine_to_train_on(name: str, cell_m: float | None = None, cells: str | None = None) -> Engine:
    """Return an engine by its name; beside the usual ones there is `"surrogate"`.

    Args:
        name: The name, or a surrogate's file (.json).
        cell_m: Side of the cells of gas dynamics; that of the engine unless given.
        cells: How they grow; as the engine's unless given.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If it has no such cells, or the file is no surrogate.
    """
    if Path(name).suffix == ".json":
        return find_engine(SurrogateEngine(load_surrogate(Path(name))), cell_m, cells=cells)
    return find_engine(name, cell_m, cells=cells)
