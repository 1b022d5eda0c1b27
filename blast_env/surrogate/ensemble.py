"""The surrogate: ensembles of networks that predict the loads of layouts and their spread."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.gas.settings import GasSettings
from blast_env.geometry import Element
from blast_env.response.facade import peak_factor
from blast_env.site.blast_site import Charge
from blast_env.surrogate.approach import FEATURES, INPUTS
from blast_env.surrogate.fit_record import Check, Fit
from blast_env.surrogate.guess import Guess, guess_of, joined
from blast_env.surrogate.intervals import widened
from blast_env.surrogate.load_arrays import NetworkLayers, Scales
from blast_env.surrogate.loads import mean_and_spread
from blast_env.surrogate.network import (
    IMPULSE_POWER,
    MOST_SPREADS,
    PEAK_POWER,
    Networks,
    bounded,
)
from blast_env.surrogate.pieces import PieceKnowledge, log_loads_of
from blast_env.surrogate.relations import RELATIONS
from blast_env.surrogate.rooms import Room, in_lines
from blast_env.surrogate.walls import SurrogateSite

GuessRequest = tuple[SurrogateSite, Sequence[Sequence[Element]], Sequence[Charge]]
"""A site, its layouts, and the charge against each of them."""

_FEW: Final = 4
"""Most layouts against a charge for which nothing of their pieces is kept when it is met first."""

_CELL_M: Final = GasSettings().cell_m
"""Side of the cells of the blasts that it is fitted to."""


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Networks fitted to blasts.

    Attributes:
        mean: Mean of each feature, each relation and each trait (INPUTS,).
        scale: Their standard deviations (INPUTS,).
        impulse: The networks for impulses.
        peak: The networks for peak overpressures.
        fit: Their provenance.
    """

    mean: FloatArray
    scale: FloatArray
    impulse: Networks
    peak: Networks
    fit: Fit

    @property
    def digest(self) -> str:
        """Digest of all numbers, which identifies the surrogate."""
        members = (*self.impulse.members, *self.peak.members)
        arrays = (self.mean, self.scale, *(item for member in members for item in member))
        numbers = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
        return sha256(numbers).hexdigest()[:16]

    def guess(
        self, site: SurrogateSite, layouts: Sequence[Sequence[Element]], charges: Sequence[Charge]
    ) -> Guess:
        """Return the predicted loads of layouts.

        Args:
            site: The site.
            layouts: Legal layouts.
            charges: The charge against each layout (layouts,).

        Raises:
            LayoutError: If the catalogue has no such piece.
        """
        return self.guesses([(site, layouts, charges)])[0]

    def guesses(self, asked: Sequence[GuessRequest]) -> list[Guess]:
        """Return the predicted loads of layouts on several sites; see `guess`.

        Args:
            asked: A site, its layouts and the charge against each of them.
        """
        if not any(site.lets_go for site, *_ in asked):
            return self._guesses(asked)
        # Layouts by the structures that they leave, all at once, and back in their order.
        parts = [site.by_structures(layouts) for site, layouts, _ in asked]
        of_parts = [
            (left, [layouts[k] for k in own], [charges[k] for k in own])
            for (_, layouts, charges), of_site in zip(asked, parts, strict=True)
            for left, own in of_site
        ]
        made = iter(self._guesses(of_parts))
        orders = [np.argsort(np.concatenate([own for _, own in of_site])) for of_site in parts]
        return [
            joined([next(made) for _ in of_site], order)
            for of_site, order in zip(parts, orders, strict=True)
        ]

    def _guesses(self, asked: Sequence[GuessRequest]) -> list[Guess]:
        """Return the same for layouts that take no structure away."""
        found: list[list[FloatArray]] = [[], []]
        places = [self._put_logs(*one, found) for one in asked]
        # ln load by each network; the prediction and its spread over the networks, which were
        # fitted from different beginnings (deep ensembles, Lakshminarayanan et al. 2017).
        both = [mean_and_spread(np.concatenate(logs, axis=1)) if logs else () for logs in found]
        guesses, firsts = [], [0, 0]
        for (site, layouts, charges), place in zip(asked, places, strict=True):
            own: list[FloatArray] = []
            for which in range(1 + site.counts_peaks):
                first = firsts[which]
                firsts[which] += len(layouts) * site.columns
                own += [
                    item[first : firsts[which]].reshape(len(layouts), -1)[place]
                    for item in both[which]
                ]
            guess = guess_of(own, slice(len(site.protected)))
            if site.alternatives:
                on_bays = guess_of(own, slice(len(site.protected), None))
                factors = [peak_factor(_CELL_M, charge.tnt_kg) for charge in charges]
                guess = guess._replace(on_bays=on_bays, peak_factors=np.array(factors))
            hidden = site.hidden(layouts)
            guesses.append(guess if hidden is None else guess.without(hidden))
        return guesses

    def _put_logs(
        self,
        site: SurrogateSite,
        layouts: Sequence[Sequence[Element]],
        charges: Sequence[Charge],
        found: Sequence[list[FloatArray]],
    ) -> IntArray:
        """Append the logarithms of both kinds of loads on a site (members, loads).

        Returns:
            Where each layout is among those of the site.
        """
        # 1. Layouts by their charge, whose paths and relations they share.
        of_charges: dict[Charge, list[int]] = {}
        for number, charge in enumerate(charges):
            of_charges.setdefault(charge, []).append(number)
        # 2. What structures and pieces say to each point: sums of messages (Gilmer et al. 2017,
        # Neural message passing for quantum chemistry), as the order of solids has no meaning.
        layers, parts, order = self._stacks[site.counts_peaks], list[FloatArray](), list[int]()
        fresh: list[Charge] = []
        boxes_of_fresh, room = [], site.memory.take_room()
        for charge, numbers in of_charges.items():
            key, boxes = (self, site, charge), [site.boxes(layouts[number]) for number in numbers]
            if len(numbers) <= _FEW and site.memory.is_first(key):
                fresh.append(charge)
                boxes_of_fresh.append(boxes)
                continue

            def make(room: Room, charge: Charge = charge) -> PieceKnowledge:
                return PieceKnowledge(charge, site.arrays, self._scales, layers, room)

            parts.append(site.memory.known(key, make, room).log_loads(boxes, room))
            order += numbers
        # 3. The charges that are met for the first time, all at once.
        if fresh:
            arrays = site.arrays, self._scales, layers
            parts.append(log_loads_of(*arrays, fresh, boxes_of_fresh, room))
            order += [number for charge in fresh for number in of_charges[charge]]
        site.memory.return_room(room)
        members = len(self.impulse.members)
        for logs in parts:
            logs = site.with_structures(logs, layers.powers)
            found[0].append(logs[:members].reshape(members, -1))
            if site.counts_peaks:
                found[1].append(logs[members:].reshape(len(logs) - members, -1))
        place = np.empty(len(layouts), dtype=np.int64)
        place[order] = np.arange(len(place))
        return place

    @property
    def has_intervals(self) -> bool:
        """Whether its fit has set intervals of both kinds of loads."""
        return self.fit.impulse is not None and self.fit.peak is not None

    def upper_ends(self, guess: Guess, half_widths: float = 1.0) -> Guess:
        """Return predicted loads at the upper ends of their 95 % intervals.

        Args:
            guess: The prediction.
            half_widths: How far above it, in half-widths of the intervals.

        Raises:
            BlastEnvError: If the surrogate has no intervals.
        """
        return self._moved(guess, half_widths)

    def lower_ends(self, guess: Guess) -> Guess:
        """Return predicted loads at the lower ends of their 95 % intervals.

        Raises:
            BlastEnvError: If the surrogate has no intervals.
        """
        return self._moved(guess, -1.0)

    def _moved(self, guess: Guess, half_widths: float) -> Guess:
        """Return predicted loads moved by a number of half-widths of their intervals."""

        def moved(loads: FloatArray, spread: FloatArray, check: Check | None) -> FloatArray:
            if check is None:
                raise BlastEnvError(
                    "this surrogate has no intervals: `python -m studies.surrogate fit` writes one "
                    "that has"
                )
            width = check.spreads * widened(spread, check.least_spread)
            found: FloatArray = loads * np.exp(width * half_widths)
            return found

        impulse_pa_s = moved(guess.impulse_pa_s, guess.spread, self.fit.impulse)
        if guess.on_bays is not None:
            guess = guess._replace(on_bays=self._moved(guess.on_bays, half_widths))
        if guess.peak_pa is None or guess.peak_spread is None:
            return guess._replace(impulse_pa_s=impulse_pa_s)
        peak_pa = moved(guess.peak_pa, guess.peak_spread, self.fit.peak)
        return guess._replace(impulse_pa_s=impulse_pa_s, peak_pa=peak_pa)

    @cached_property
    def _stacks(self) -> tuple[NetworkLayers, NetworkLayers]:
        """The networks of impulses alone, and those of impulses and of peaks."""
        alone = self.impulse.layers(0, IMPULSE_POWER)
        of_peaks = self.peak.layers(1, PEAK_POWER)
        pairs: list[tuple[NDArray[Any], NDArray[Any]]] = list(zip(alone, of_peaks, strict=True))
        stacks: tuple[list[Any], list[Any]] = list(alone), list(map(np.concatenate, pairs))
        for arrays in stacks:
            for number, array in enumerate(arrays):
                arrays[number] = in_lines(array.shape, array.dtype)
                arrays[number][...] = array
        return NetworkLayers(*stacks[0]), NetworkLayers(*stacks[1])

    @cached_property
    def _scales(self) -> Scales:
        return Scales(self.mean, 1.0 / self.scale, MOST_SPREADS)

    def scaled(self, features: FloatArray) -> FloatArray:
        """Return the scaled and bounded features of points (points, FEATURES)."""
        return bounded(features, self.mean[:FEATURES], self.scale[:FEATURES])

    def related(self, relations: FloatArray) -> FloatArray:
        """Return the scaled and bounded relations (solids x points, RELATIONS)."""
        own = slice(FEATURES, FEATURES + RELATIONS)
        return bounded(relations, self.mean[own], self.scale[own])

    def told(self, traits: FloatArray) -> FloatArray:
        """Return the scaled and bounded traits (pieces, TRAITS)."""
        own = slice(FEATURES + RELATIONS, INPUTS)
        return bounded(traits, self.mean[own], self.scale[own])
