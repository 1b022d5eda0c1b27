"""The surrogate: small networks that predict the load at each point of a wall and its spread.

Each solid sends a message to each point, computed from their relations. Those of pieces are
weighted, number by number, by how a piece stands to the others. The prediction at a point is a
function of the features of the point and the sum of all messages.
"""

from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from itertools import zip_longest
from math import isnan, nan, prod
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from blast_env.arrays import BoolArray, FloatArray
from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.gas.settings import GasSettings
from blast_env.geometry import Element
from blast_env.response.facade import peak_factor
from blast_env.response.levels import BayDamage
from blast_env.site.blast_site import Charge
from blast_env.surrogate.approach import FEATURES, INPUTS
from blast_env.surrogate.intervals import widened
from blast_env.surrogate.layers import SingleArray, two_layers
from blast_env.surrogate.loads import (
    LEAST_OVER,
    MOST_OVER,
    NetworkLayers,
    Scales,
    mean_and_spread,
)
from blast_env.surrogate.neighbours import TRAITS
from blast_env.surrogate.pieces import PieceKnowledge, log_loads_of
from blast_env.surrogate.relations import IN_PLAN, RELATIONS, RISING
from blast_env.surrogate.rooms import Room, in_lines
from blast_env.surrogate.views import VIEW
from blast_env.surrogate.walls import SurrogateSite
from blast_env.surrogate.ways import SHARES

IntArray = NDArray[np.int64]
AnyFloats = NDArray[np.floating[Any]]
_PACKAGED: Final = Path(__file__).with_name("gas.json")

GuessRequest = tuple[SurrogateSite, Sequence[Sequence[Element]], Sequence[Charge]]
"""A site, its layouts, and the charge against each of them."""

_FEW: Final = 4
"""Most layouts against a charge for which nothing of their pieces is kept when it is met first."""

_CELL_M: Final = GasSettings().cell_m
"""Side of the cells of the blasts that it is fitted to."""

HIDDEN: Final = (96, 64)
"""Widths of the two hidden layers."""

MESSAGE: Final = 32
"""Length of a message, and width of its hidden layer."""

SIGHT: Final = 48
"""Length of what a view says."""

IMPULSE_POWER: Final = 1.0
"""Exponent of the power mean over the walls for impulses: the arithmetic mean."""

PEAK_POWER: Final = 16.0
"""Exponent of the power mean over the walls for peaks: close to the maximum."""

_MOST_BYTES: Final = 10_000_000
"""Largest file of a surrogate: some eighty networks."""

MOST_SPREADS: Final = 4.0
"""Bound on the distance of inputs from their mean, in units of their scale."""

_SENDING: Final = ((RELATIONS, MESSAGE), (MESSAGE,), (MESSAGE, MESSAGE), (MESSAGE,))
_WEIGHING: Final = ((TRAITS, MESSAGE), *_SENDING[1:])

VIEWS: Final = ((VIEW, SIGHT), (VIEW, SIGHT))

SHAPES: Final = (*_SENDING, *_SENDING, *_WEIGHING, *VIEWS) + (
    (FEATURES + 2 * MESSAGE + 2 * SIGHT, HIDDEN[0]),
    (HIDDEN[0],),
    HIDDEN,
    (HIDDEN[1],),
    (HIDDEN[1], 1),
    (1,),
)
"""Shapes of the arrays of a network, in the order of `Member`."""


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


class Guess(NamedTuple):
    """Predicted loads of layouts.

    Attributes:
        impulse_pa_s: Mean impulse on each protected structure, NaN if no air touches its assessed
            walls (layouts, structures).
        spread: Standard deviation of its logarithm among the members (layouts, structures).
        peak_pa: Largest overpressure on each protected structure, NaN as of the impulse (layouts,
            structures); `None` if the objective counts no peaks.
        peak_spread: Standard deviation of its logarithm among the members (layouts, structures).
        on_bays: The same of the bays of all structures, the loads by which facades respond, in the
            order of `SurrogateSite.alternatives`; `None` if the response does not count.
        peak_factors: What makes these peaks as sharp as in the open, against the charge of each
            layout (layouts,); see `response.facade.peak_factor`.
    """

    impulse_pa_s: FloatArray
    spread: FloatArray
    peak_pa: FloatArray | None = None
    peak_spread: FloatArray | None = None
    on_bays: "Guess | None" = None
    peak_factors: FloatArray | None = None

    def loads(self, site: SurrogateSite, layouts: Sequence[Sequence[Element]] = ()) -> FloatArray:
        """Return the load of each layout, in the objective's unit (layouts,).

        That of a building is the mean over the area of its parts. It is NaN if a building has no
        load. If the objective counts the response of facades, each bay has a triangular load with
        its own predicted impulse and peak, or a sharper one, as by gas dynamics. The peak is the
        largest one on the bay, not that of the mean over it.

        Args:
            site: The site of the prediction.
            layouts: The layouts; required if the objective counts the response of facades.
        """
        load, structures = site.scenario.objective.load, site.protected
        if site.scenario.objective.is_response:
            return np.array(
                [self._response(site, index, layout) for index, layout in enumerate(layouts)]
            )
        peak_pa = np.zeros_like(self.impulse_pa_s) if self.peak_pa is None else self.peak_pa
        both = np.stack(site.of_buildings(self.impulse_pa_s, peak_pa), axis=2).tolist()
        return np.array(
            [
                sum(
                    load(impulse, peak, structure.weight, structure.counted_peak_weight)
                    for structure, (impulse, peak) in zip(structures, of_layout, strict=True)
                )
                for of_layout in both
            ]
        )

    def without(self, hidden: BoolArray) -> "Guess":
        """Return no loads, which are NaN, on hidden structures (layouts, structures)."""
        impulse_pa_s = np.where(hidden, nan, self.impulse_pa_s)
        peak_pa = None if self.peak_pa is None else np.where(hidden, nan, self.peak_pa)
        return self._replace(impulse_pa_s=impulse_pa_s, peak_pa=peak_pa)

    def bays(self, site: SurrogateSite, index: int) -> tuple[BayDamage, ...]:
        """Return the damage of the bays behind a layout, by its index, under triangular loads."""
        loads = self._bay_loads(index)
        found: list[BayDamage] = []
        for structure, on_it_pa_s in zip(site.protected, self.impulse_pa_s[index], strict=True):
            if not isnan(on_it_pa_s):
                found += site.bay_damages(structure.name, *loads)
        return tuple(found)

    def _response(self, site: SurrogateSite, index: int, layout: Sequence[Element]) -> float:
        assert self.peak_pa is not None
        loads = self._bay_loads(index)
        # A building without a load has no response. A part of another one counts as 0.
        of_buildings, _ = site.of_buildings(self.impulse_pa_s[index : index + 1], self.peak_pa[:1])
        if np.isnan(of_buildings).any():
            return nan
        return sum(
            structure.weight * site.response(structure.name, layout, *loads)
            for structure, on_it_pa_s in zip(site.protected, self.impulse_pa_s[index], strict=True)
            if not isnan(on_it_pa_s)
        )

    def _bay_loads(self, index: int) -> tuple[FloatArray, FloatArray, float]:
        """Return peaks, Pa, and impulses, Pa s, on bays (bays,), and the factor on the peaks."""
        assert self.on_bays is not None
        assert self.on_bays.peak_pa is not None
        assert self.peak_factors is not None
        factor = float(self.peak_factors[index])
        return self.on_bays.peak_pa[index], self.on_bays.impulse_pa_s[index], factor


def _guess_of(loads: Sequence[FloatArray], columns: slice) -> Guess:
    """Return some columns of impulses, their spreads and, if there are any, the same of peaks."""
    impulse_pa_s, spread, *of_peaks = (own[:, columns] for own in loads)
    if not of_peaks:
        return Guess(impulse_pa_s, spread)
    peak_pa, peak_spread = of_peaks
    return Guess(impulse_pa_s, spread, peak_pa, peak_spread)


def _joined(made: Sequence[Guess], order: IntArray) -> Guess:
    """Return the guess of all layouts of several guesses, in another order."""

    def whole(parts: Sequence[Any]) -> Any:
        if parts[0] is None:
            return None
        return (
            _joined(parts, order) if isinstance(parts[0], Guess) else np.concatenate(parts)[order]
        )

    return Guess(*(whole(parts) for parts in zip(*made, strict=True)))


class Member(NamedTuple):
    """A network: weights and biases of its layers, in the order of their use.

    The first two layers compute the messages of structures, the next two those of pieces, the next
    two the weights of these by the traits of pieces, the others the prediction at a point from
    features and the sums of both.
    """

    send: AnyFloats
    send_bias: AnyFloats
    message: AnyFloats
    message_bias: AnyFloats
    piece_send: AnyFloats
    piece_send_bias: AnyFloats
    piece_message: AnyFloats
    piece_message_bias: AnyFloats
    trait: AnyFloats
    trait_bias: AnyFloats
    weight: AnyFloats
    weight_bias: AnyFloats
    structure_view: AnyFloats
    piece_view: AnyFloats
    first: AnyFloats
    first_bias: AnyFloats
    second: AnyFloats
    second_bias: AnyFloats
    last: AnyFloats
    last_bias: AnyFloats


class Networks:
    """An ensemble of networks fitted to the same loads from different initial weights.

    They use single precision: its rounding is far below their errors.

    Args:
        members: The networks.

    Attributes:
        members: The networks.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self.members = tuple(members)
        stacked = [
            np.stack(arrays) if members else np.empty((0, *shape))
            for arrays, shape in zip_longest(zip(*members, strict=True), SHAPES)
        ]
        single = [np.ascontiguousarray(item, dtype=np.float32) for item in stacked]
        self._layers = Member(*single)

    def messages(self, scaled: FloatArray, *, of_pieces: bool) -> SingleArray:
        """Return the message of each solid to each point (members, solids x points, MESSAGE).

        Args:
            scaled: Their relations, less the mean, over the scale (solids x points, RELATIONS).
            of_pieces: Whether they are pieces, not structures.
        """
        layers = self._layers[len(_SENDING) :] if of_pieces else self._layers
        given = np.ascontiguousarray(scaled, dtype=np.float32)[np.newaxis]
        found: SingleArray = two_layers(given, *layers[: len(_SENDING)])
        return found

    def weights(self, scaled: FloatArray) -> SingleArray:
        """Return the weights of the numbers of the messages of pieces (members, pieces, MESSAGE).

        Args:
            scaled: Their traits, less the mean, over the scale (pieces, TRAITS).
        """
        given = np.ascontiguousarray(scaled, dtype=np.float32)[np.newaxis]
        first = 2 * len(_SENDING)
        found: SingleArray = two_layers(given, *self._layers[first : first + len(_WEIGHING)])
        return found

    def __call__(
        self, scaled: FloatArray, heard: SingleArray, seen: Sequence[AnyFloats]
    ) -> FloatArray:
        """Return the predicted differences of logarithmic loads from Kingery and Bulmash's.

        Args:
            scaled: Features of points, less the mean, over the scale (points, FEATURES).
            heard: Sums of the messages of structures and of pieces to each point (members, points,
                2 MESSAGE).
            seen: The views of structures and of pieces from each point (points, VIEW).

        Returns:
            (members, points).
        """
        layers = self._layers
        members, points, _ = heard.shape
        told = np.broadcast_to(scaled.astype(np.float32), (members, points, FEATURES))
        weights = layers.structure_view, layers.piece_view
        of_views = [
            views.astype(np.float32) @ own for views, own in zip(seen, weights, strict=True)
        ]
        # Two hidden layers, then a linear one to a single number per point.
        inputs = np.concatenate((told, heard, *of_views), axis=2)
        second = two_layers(
            inputs, layers.first, layers.first_bias, layers.second, layers.second_bias
        )
        found: FloatArray = np.einsum("mpi,mi->mp", second, layers.last[..., 0])
        return np.clip(found + layers.last_bias, LEAST_OVER, MOST_OVER)

    def layers(self, kind: int, power: float) -> NetworkLayers:
        """Return the layers as compiled code takes them.

        Args:
            kind: 0 for networks of impulses, 1 for those of peaks.
            power: Exponent of the mean over the walls.
        """
        layers, members, length = self._layers, len(self.members), self._layers.message.shape[2]
        ends = np.cumsum((FEATURES - SHARES, SHARES, length, length, SIGHT))
        constants, shares, structures, pieces, seen, seen_pieces = np.split(
            layers.first, ends, axis=1
        )
        # Sums over relations in plan are made first.
        in_order = np.concatenate((IN_PLAN, RISING))
        arrays: list[Any] = [
            *(layers.send[:, in_order], *layers[1 : len(_SENDING)]),
            *(layers.piece_send[:, in_order], *layers[len(_SENDING) + 1 : 2 * len(_SENDING)]),
            *layers[2 * len(_SENDING) : 2 * len(_SENDING) + len(_WEIGHING)],
            *(layers.structure_view, layers.piece_view),
            np.concatenate((constants, structures, seen), axis=1),
            layers.first_bias,
            np.concatenate((shares, pieces, seen_pieces), axis=1),
            *(layers.second, layers.second_bias),
            np.ascontiguousarray(layers.last[..., 0]),
            np.ascontiguousarray(layers.last_bias[:, 0]),
            *(np.full(members, kind), np.full(members, power)),
        ]
        return NetworkLayers(*arrays)


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
            _joined([next(made) for _ in of_site], order)
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
            guess = _guess_of(own, slice(len(site.protected)))
            if site.alternatives:
                on_bays = _guess_of(own, slice(len(site.protected), None))
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

    def save(self, path: str | Path) -> Path:
        """Write the surrogate as a JSON file, weights in half precision.

        Raises:
            BlastEnvError: If the file cannot be written.
        """
        path = Path(path)
        content = _File(
            fit=self.fit,
            mean=_numbers(self.mean),
            scale=_numbers(self.scale),
            members=_texts(self.impulse.members),
            peak_members=_texts(self.peak.members),
        )
        with write_atomically(path) as temporary:
            temporary.write_text(f"{content.model_dump_json()}\n", encoding="utf-8")
        return path

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


def bounded(numbers: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
    """Return numbers less their mean, over their scale, clipped to the range of a fit (rows, n).

    A wall of 60 m has points much farther from its edges than the sites of a fit, and predictions
    so far outside that range are unbounded.
    """
    found: FloatArray = np.clip((numbers - mean) / scale, -MOST_SPREADS, MOST_SPREADS)
    return found


def agreed(logs: FloatArray) -> FloatArray:
    """Return the mean over the networks without the highest and the lowest (members, n) -> (n,).

    A single network may be far off on layouts unlike those of the fit.
    """
    middle: FloatArray = np.sort(logs, axis=0)[1:-1] if len(logs) > 2 else logs
    mean: FloatArray = middle.mean(axis=0)
    return mean


def log_loads(
    differs: FloatArray, known: FloatArray, area_m2: FloatArray, starts: IntArray, power: float
) -> FloatArray:
    """Return the logarithm of the load on each structure, by each network (members, structures).

    It is the power mean of the loads at its points, weighted by area.

    Args:
        differs: Predictions at all points, from `Networks` (members, points).
        known: Logarithm of Kingery and Bulmash's load (points,).
        area_m2: Wall area represented by each point (points,).
        starts: Index of the first point of each structure (structures,).
        power: Exponent of the mean.
    """
    # L = (sum of A L_i^p / sum of A)^(1 / p): p = 1 is the mean, a large p nearly the largest.
    area_of_all_m2 = np.add.reduceat(area_m2, starts)
    loads = area_m2 * np.exp(power * (known + differs))
    logs: FloatArray = np.log(np.add.reduceat(loads, starts, axis=1) / area_of_all_m2) / power
    return logs


def load_surrogate(path: str | Path) -> Surrogate:
    """Return a surrogate from its file.

    Raises:
        BlastEnvError: If the file does not exist, is damaged or is not a surrogate.
    """
    path = Path(path)
    try:
        text = read_text(path, _MOST_BYTES)
    except DocumentError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    try:
        content = checked_as(_File, parse_json(text))
    except DocumentError as error:
        raise BlastEnvError(f"{path}: is no surrogate, or damaged: {error}") from error
    mean, scale = np.array(content.mean), np.array(content.scale)
    impulse, peak = (
        Networks([_member(member) for member in members])
        for members in (content.members, content.peak_members)
    )
    return Surrogate(mean, scale, impulse, peak, content.fit)


@cache
def packaged_surrogate() -> Surrogate:
    """Return the bundled surrogate, read once: it takes a tenth of a second.

    It was fitted to generated sites only (see `fit`), so that all bundled sites are valid tests.
    """
    return load_surrogate(_PACKAGED)


_HALF: Final = np.dtype("<f2")
_MOST_WEIGHT: Final = 1e3
_Members = Annotated[list[list[str]], Field(min_length=1, max_length=100)]


class _File(BaseModel):
    """Content of a file: the weights of each network as half-precision numbers in base64.

    There are a hundred thousand in a network, and their rounding is far below its errors.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    fit: Fit
    mean: list[Annotated[float, Field(ge=-1e6, le=1e6)]]
    scale: list[Annotated[float, Field(ge=1e-6, le=1e6)]]
    members: _Members
    peak_members: _Members

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for name, numbers in (("mean", self.mean), ("scale", self.scale)):
            if len(numbers) != INPUTS:
                raise ValueError(f"{name} has {len(numbers)} numbers, must be {INPUTS}")
        for name, members in (("members", self.members), ("peak_members", self.peak_members)):
            for number, texts in enumerate(members):
                if len(texts) != len(SHAPES):
                    raise ValueError(
                        f"{name}: network {number} has {len(texts)} arrays, must be {len(SHAPES)}"
                    )
                for which, (text, shape) in enumerate(zip(texts, SHAPES, strict=True)):
                    try:
                        _array(text, shape)
                    except ValueError as error:
                        raise ValueError(
                            f"{name}: network {number}, array {which}: {error}"
                        ) from error
        return self


def _array(text: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return an array of its text.

    Raises:
        ValueError: If the text is no base64, or has other numbers.
    """
    content = b64decode(text, validate=True)
    if len(content) != prod(shape) * _HALF.itemsize:
        numbers = len(content) / _HALF.itemsize
        raise ValueError(f"has {numbers:g} numbers, must be {prod(shape)}")
    found = np.frombuffer(content, _HALF).astype(np.float64).reshape(shape)
    if not (np.abs(found) <= _MOST_WEIGHT).all():
        raise ValueError(f"a weight is beyond {_MOST_WEIGHT:g}, or no number")
    return found


def _texts(members: Sequence[Member]) -> list[list[str]]:
    """Return the arrays of networks as text; see `_File`."""
    return [[b64encode(array.astype(_HALF).tobytes()).decode() for array in own] for own in members]


def _member(texts: Sequence[str]) -> Member:
    """Return a network from its texts."""
    return Member(*(_array(text, shape) for text, shape in zip(texts, SHAPES, strict=True)))


def _numbers(array: AnyFloats) -> list[float]:
    return [float(f"{value:.5g}") for value in array.ravel()]
