"""The consequences of charges, with blasts in a store, so that commands share them.

A content has the histories of the bays, from which the response is computed again, and the other
numbers as they were. Its key has all inputs: those of the blast, and the whole site. Measures that
harden facades are left out: they change the response alone.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import LoadCase
from blast_env.evaluation.consequences import (
    BarrierResponse,
    Consequences,
    Neighbour,
    by_building,
    consequences_of,
)
from blast_env.evaluation.engines.bays import UnjudgedWalls
from blast_env.evaluation.engines.contract import BlastLoads, StructureLoad
from blast_env.evaluation.engines.pieces import PIECE_COLUMNS
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.geometry import Element, Layout
from blast_env.layout.build_site import build_site, charge_against
from blast_env.layout.placement import load_relevant
from blast_env.response.facade import respond
from blast_env.site import AnyCharge, Scenario
from blast_env.tables import table_of


@dataclass(frozen=True)
class _Header:
    """The numbers of a content that are not in its arrays, and the sizes of these."""

    __pydantic_config__: ClassVar = ConfigDict(ser_json_inf_nan="constants")

    bays: tuple[str, ...]
    times: int
    modules: int
    peak_factor: float
    known: dict[str, bool]
    neighbours: tuple[Neighbour, ...]
    pieces: str
    unchecked: tuple[tuple[str, str], ...]
    unjudged: tuple[UnjudgedWalls, ...]
    structures: tuple[StructureLoad, ...]


_HEADER: Final = TypeAdapter(_Header)


def consequences(
    evaluator: BlastEvaluator,
    layout: Sequence[Element],
    charges: Iterable[AnyCharge],
    progress: Callable[[float], None] | None = None,
    *,
    without_fallen: bool = False,
) -> Consequences:
    """Return the consequences of charges for the buildings behind a layout, by a blast for each.

    Those in the store of the evaluator need no blast; others are kept there. `without_fallen`
    removes pieces that overturn before the end of a blast, and repeats the blast until no other
    piece falls; such blasts are not kept.

    Raises:
        BlastEnvError: If no structure has a facade, or the engine computes no overpressure or
            records no bays.
    """
    parts, every = [], list(charges)
    for number, charge in enumerate(every, start=1):
        of_one = _without_fallen if without_fallen else _shared
        parts.append(of_one(evaluator, tuple(layout), charge))
        if progress is not None:
            progress(number / len(every))
    return Consequences.together(parts)


def _shared(evaluator: BlastEvaluator, layout: Layout, charge: AnyCharge) -> Consequences:
    scenario = evaluator.scenario
    decode = partial(decoded, scenario=scenario, layout=layout, charge=charge)
    found = evaluator.store.read(_key(evaluator, layout, charge), decode)
    if found is None:
        where = charge_against(scenario, layout, charge)
        found = consequences_of(scenario, _blasted(evaluator, layout, charge), where)
        keep_consequences(evaluator, layout, charge, found)
        if not scenario.objective.is_response:  # whose loads have the damage of bays
            evaluator.keep(layout, LoadCase(charge), *found.loads)
    return found


def _without_fallen(evaluator: BlastEvaluator, layout: Layout, charge: AnyCharge) -> Consequences:
    fallen: Layout = ()
    where = charge_against(evaluator.scenario, layout, charge)
    result = _blasted(evaluator, layout, charge)
    while result.piece_loads is not None:
        falling = result.piece_loads.fallen(result.time_s)
        if not falling:
            break
        fallen += falling
        standing = tuple(each for each in layout if each not in fallen)
        result = _blasted(evaluator, standing, where)
    return consequences_of(evaluator.scenario, result, where, fallen)


def _blasted(evaluator: BlastEvaluator, layout: Layout, charge: AnyCharge) -> Any:
    """Return the result of a blast, with its bays."""
    scenario, engine = evaluator.scenario, evaluator.engine
    if not scenario.bays:
        raise BlastEnvError(
            f"scenario {scenario.name!r}: no structure has a facade with bays: add "
            "[structures.facade]"
        )
    if not engine.has_peaks:
        raise BlastEnvError(f"engine {engine.name!r} knows no overpressure: must be 'gas'")
    result: Any = engine.blast(scenario, layout, 0, charge).run()
    if getattr(result, "bay_loads", None) is None:
        raise BlastEnvError(f"engine {engine.name!r} records no bays: must be 'gas'")
    return result


def keep_consequences(
    evaluator: BlastEvaluator, layout: Layout, charge: AnyCharge, found: Consequences
) -> None:
    """Keep the consequences of one charge in the store of an evaluator, as the blast has them.

    No piece of the layout was taken away.
    """
    evaluator.store.put(_key(evaluator, layout, charge), encoded(found))


def _key(evaluator: BlastEvaluator, layout: Layout, charge: AnyCharge) -> str:
    inputs = evaluator.scenario.model_dump_json() + repr(load_relevant(layout))
    blast = evaluator.key(layout, LoadCase(charge))
    return json.dumps(("consequences", blast, sha256(inputs.encode()).hexdigest()))


def encoded(found: Consequences) -> bytes:
    """Return the consequences of one charge as bytes; no piece of the layout was taken away."""
    (barrier,), (loads,) = found.barriers, found.loads
    facades = [each.on_cells for each in found.responses]
    time_s = facades[0].time_s if facades else np.zeros(0)
    known = {name: one for each in found.responses for name, one in each.known.items()}
    header = _Header(
        bays=tuple(each.bay.name for facade in facades for each in facade.bays),
        times=len(time_s),
        modules=len(loads.module_impulse),
        peak_factor=found.responses[0].peak_factor if facades else 1.0,
        known=known,
        neighbours=found.neighbours,
        pieces=json.dumps(barrier.pieces.to_dict("records")),  # NaN for numbers that they lack
        unchecked=found.unchecked,
        unjudged=found.unjudged,
        structures=loads.structures,
    )
    line = _HEADER.dump_json(header)
    arrays = [time_s.astype("<f8"), loads.module_impulse.astype("<f8")]
    arrays += [facade.pressure_pa.astype("<f4") for facade in facades]  # as they were recorded
    return b"\n".join((line, b"".join(each.tobytes() for each in arrays)))


def decoded(content: bytes, scenario: Scenario, layout: Layout, charge: AnyCharge) -> Consequences:
    """Return the consequences of `encoded`, with the present panes and walls in the same bays.

    Raises:
        ValueError: If the content is damaged, or of other bays.
    """
    line, _, arrays = content.partition(b"\n")
    header = _HEADER.validate_json(line)
    times, modules = header.times, header.modules
    ends = 8 * times, 8 * (times + modules)
    time_s, impulses, pressure = (
        np.frombuffer(part, dtype=kind).astype(np.float64)
        for part, kind in (
            (arrays[: ends[0]], "<f8"),
            (arrays[ends[0] : ends[1]], "<f8"),
            (arrays[ends[1] :], "<f4"),
        )
    )
    site = build_site(scenario, load_relevant(layout), 0, charge)
    responses = []
    if header.bays:
        bays = {each.bay.name: each for each in scenario.bays_with(layout)}
        if not bays.keys() >= {*header.bays}:
            raise ValueError("the bays are those of another facade")
        own = [bays[name] for name in header.bays]
        facade = respond(own, time_s, pressure.reshape(len(own), times))
        responses = by_building(scenario, facade, site, header.peak_factor, header.known)
    pieces = table_of(json.loads(header.pieces), PIECE_COLUMNS)
    return Consequences(
        tuple(responses),
        header.neighbours,
        (BarrierResponse(site.charge, pieces),),
        header.unchecked,
        header.unjudged,
        (BlastLoads(header.structures, impulses),),
    )
