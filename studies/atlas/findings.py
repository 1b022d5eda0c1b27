"""Tables of the atlas: what the blasts show, what the laws say, and how far off they are."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.atlas import Law, Laws
from blast_env.atlas.between import around_of, numbers_between, rows_between
from blast_env.atlas.echoes import fronts_among, numbers_of_echoes
from blast_env.atlas.laws import TOLERATED
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.site import Scenario
from studies.atlas.families import FAMILIES
from studies.atlas.fitting import RECIPES
from studies.atlas.samples import Bays, Group, less_echoes, numbers_of, rows_of, scenes_with_loads
from studies.atlas.sites import LARGE, SiteLoads

Row = tuple[str, ...]

_SHARES: Final = (0.05, 0.5, 0.95)
_KINDS: Final = ("a canopy", "storeys that project", "a podium before the wall")


def spread_rows(scenes: Sequence[Bays]) -> Iterator[Row]:
    """Yield one row per family: its blasts, and the factors on impulse and peak of its bays."""
    groups: dict[str, list[Bays]] = {}
    for bays in scenes:
        title = FAMILIES[bays.family].title
        if bays.family == "canopy":
            title = _KINDS[int(bays.numbers["kind"])]
        groups.setdefault(title, []).append(bays)
    for title, own in groups.items():
        change = np.exp(np.concatenate([_out_of_sight(bays) for bays in own]))
        yield (
            title,
            str(len(own)),
            *(f"{value:.2f}" for value in np.quantile(change[:, 0], _SHARES)),
            *(f"{value:.2f}" for value in np.quantile(change[:, 1], _SHARES)),
        )


def _out_of_sight(bays: Bays) -> FloatArray:
    """Return the changes of all bays, of a block those on walls that face away (bays, 2)."""
    if bays.family != "shadow":
        return bays.log_change
    away = ((bays.charge - bays.middles) * bays.normals).sum(axis=1) < 0.0
    return np.asarray(bays.log_change[away])


def raised_rows(groups: Iterable[Mapping[str, Any]]) -> Iterator[Row]:
    """Yield the load of raised charges over that of a charge on the ground, by height."""
    heights, ratios = [], []
    for group in groups:
        if group["family"] == "raised":
            raised, ground = group["scenes"][:2]
            heights.append(raised["up"] / 12.0)
            ratios.append(
                [np.sum(raised[load]) / np.sum(ground[load]) for load in ("impulse", "peak")]
            )
    order, found = np.array(heights), np.array(ratios)
    for low, high in ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 1.3)):
        own = found[(order > low) & (order <= high)]
        if len(own):
            impulse, peak = own.mean(axis=0)
            ends = f"{own[:, 0].min():.2f} to {own[:, 0].max():.2f}"
            yield f"{low:g} to {high:g}", str(len(own)), f"{impulse:.2f}", ends, f"{peak:.2f}"


def error_rows(known: Laws) -> Iterator[Row]:
    """Yield one row per law and family: error of ln(factor) on groups left out of the fit."""
    for name in RECIPES:
        law: Law = getattr(known, name)
        for family in law.families.values():
            yield (
                name,
                family.title,
                str(family.blasts),
                str(family.bays),
                *(
                    f"{before:.2f} -> {error:.2f}"
                    for before, error in zip(family.before, family.error, strict=True)
                ),
                *(f"{100.0 * share:.0f} %" for share in family.inside),
            )


def inside_rows(groups: Sequence[Group], known: Laws, families: Collection[str]) -> Iterator[Row]:
    """Yield one row per family: error of ln(factor), and the bays in the intervals."""
    totals = []
    laws: dict[str, Law] = {name: getattr(known, name) for name in RECIPES}
    judged: set[str] = set()  # a family by the first law that has it
    for name, recipe in RECIPES.items():
        law = laws[name]
        for family in (own for own in recipe.families if own in {*families} - judged):
            judged.add(family)
            own = recipe.samples(groups, laws, [family])
            found, ratio = own.with_known(law.factors(own.numbers)), np.exp(own.log_change)
            inside = (found.low <= ratio) & (ratio <= found.high)
            over = ratio / found.counted > TOLERATED
            kept = found.in_range
            off = (own.log_change - np.log(found.middle))[kept]
            blasts = len(np.unique(own.scene))
            totals.append((blasts, off, inside[kept], over[kept]))
            yield (FAMILIES[family].title, *_inside_cells(blasts, off, inside[kept], over[kept]))
    blasts = sum(count for count, *_ in totals)
    errors = np.concatenate([errors for _, errors, _, _ in totals])
    held = np.concatenate([held for _, _, held, _ in totals])
    low = np.concatenate([low for _, _, _, low in totals])
    yield ("all", *_inside_cells(blasts, errors, held, low))


def _inside_cells(blasts: int, off: FloatArray, inside: BoolArray, over: BoolArray) -> Row:
    return (
        str(blasts),
        str(len(off)),
        *(f"{value:.2f}" for value in np.sqrt((off**2).mean(axis=0))),
        *(f"{100.0 * share:.0f} %" for share in inside.mean(axis=0)),
        *(f"{100.0 * share:.0f} %" for share in over.mean(axis=0)),
    )


def cell_rows(
    coarse: Iterable[Mapping[str, Any]], fine: Iterable[Mapping[str, Any]]
) -> Iterator[Row]:
    """Yield one row per family: factors on halved cells over those on the cells of the atlas."""
    wide = {(own.family, own.group, own.scene): own for own in scenes_with_loads(coarse)}
    found: dict[str, list[FloatArray]] = {}
    for own in scenes_with_loads(fine):
        other = wide.get((own.family, own.group, own.scene))
        if other is not None:
            found.setdefault(own.family, []).append(own.log_change - other.log_change)
    everything = [own for parts in found.values() for own in parts]
    for title, parts in [
        *((FAMILIES[name].title, own) for name, own in found.items()),
        ("all", everything),
    ]:
        ratio = np.concatenate(parts)
        mean, spread = np.exp(ratio.mean(axis=0)), np.sqrt((ratio**2).mean(axis=0))
        yield (
            title,
            str(len(parts)),
            *(f"{value:.3f}" for value in mean),
            *(f"{value:.3f}" for value in spread),
        )


def rule_rows(scenes: Sequence[Bays], known: Laws) -> Iterator[Row]:
    """Yield one row per rule for two rows of obstacles: error of ln(factor) and its mean."""
    factors, together, measured = [], [], []
    for bays in scenes:
        rows = rows_of(bays) if bays.family in ("wall", "rows", "pieces") else []
        if len(rows) == 2:
            factors_of_rows = [known.between.log_factors(numbers_of(bays, [row])) for row in rows]
            factors.append(np.stack(factors_of_rows))
            together.append(known.between.log_factors(numbers_of(bays, rows)))
            (less,) = less_echoes([bays], [known.opposite, known.beside])
            measured.append(less.log_change)
    both, target = np.concatenate(factors, axis=1), np.concatenate(measured)
    for name, found in (
        ("the product", both.sum(axis=0)),
        ("the one that takes most", both.min(axis=0)),
        ("the law of both", np.concatenate(together)),
    ):
        off = found - target
        errors = np.sqrt((off**2).mean(axis=0))
        mean = off.mean(axis=0)
        yield (
            name,
            str(len(factors)),
            *(f"{value:.2f}" for value in errors),
            *(f"{value:+.2f}" for value in mean),
        )


def site_rows(found: Sequence[SiteLoads]) -> Iterator[Row]:
    """Yield one row per site, without and with a layout: errors without and with the atlas."""
    for own in found:
        yield _site_row(own.site, "best known" if own.has_layout else "none", [own])
    for title, large in (
        ("all small ones", [False]),
        ("all large ones", [True]),
        ("all", [False, True]),
    ):
        for has_layout in (False, True):
            parts = [
                own
                for own in found
                if own.has_layout == has_layout and (own.site in LARGE) in large
            ]
            if parts:
                yield _site_row(title, "best known" if has_layout else "none", parts)


def _site_row(name: str, layout: str, parts: Sequence[SiteLoads]) -> Row:
    gas = np.concatenate([own.gas for own in parts])
    cells = []
    for loads in ([own.without for own in parts], [own.atlas for own in parts]):
        off = np.log(np.concatenate(loads) / gas)
        cells.append((np.sqrt((off**2).mean(axis=0)), np.exp(-off).max(axis=0)))
    (before, low_before), (after, low_after) = cells
    likely = np.log(np.concatenate([own.likely for own in parts]) / gas)
    return (
        name,
        layout,
        str(len(gas)),
        *(f"{error:.2f}" for error in np.sqrt((likely**2).mean(axis=0))),
        *(f"{a:.2f} -> {b:.2f}" for a, b in zip(before, after, strict=True)),
        *(f"{a:.2f} -> {b:.2f}" for a, b in zip(low_before, low_after, strict=True)),
    )


# Cases of an engineer: 100 kg on the ground, a facade of 12 x 6 m at 10 m, by the laws.

_KG: Final = 100.0
_FACADE_M: Final = ((-4.5, 1.5), (-1.5, 1.5), (1.5, 1.5), (4.5, 1.5), (-4.5, 4.5), (-1.5, 4.5),
                    (1.5, 4.5), (4.5, 4.5))  # fmt: skip


def _scaled_bays() -> tuple[FloatArray, FloatArray, FloatArray]:
    scale = float(np.cbrt(_KG))
    bays = np.array([(10.0, across, up) for across, up in _FACADE_M]) / scale
    return np.zeros(3), bays, np.array([-1.0, 0.0, 0.0])


def wall_case(known: Laws, boxes_m: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Return the mean factor of the facade behind boxes in m, and the ends of its interval."""
    charge, bays, normal = _scaled_bays()
    scale = float(np.cbrt(_KG))
    boxes, high = np.array(boxes_m, dtype=float) / scale, np.full(len(bays), 6.0 / scale)
    everything = numbers_of_echoes(charge, bays, normal, boxes, high)
    none = numbers_of_echoes(charge, bays, normal, boxes[:0], high)
    fronts = fronts_among(everything, none)
    rows = rows_between(charge, bays, normal, boxes)
    none_is = np.zeros(len(boxes), dtype=bool)
    around = around_of(bays, normal, boxes, none_is, ~none_is)
    numbers = numbers_between(rows, charge, bays, normal, high, fronts, everything, around)
    factors = known.between.factors(numbers).where_known()
    for law in (known.opposite, known.beside):
        factors = factors.times(law.factors(fronts))
    middle, low, high_end = (float(part[:, 0].mean()) for part in factors[:3])
    return middle, low, high_end


def _wall(at_m: float, high_m: float, long_m: float = 20.0) -> tuple[float, ...]:
    return (at_m, -0.5 * long_m, at_m + 0.5, 0.5 * long_m, 0.0, high_m)


def _posts(at_m: float, high_m: float, gap_m: float) -> list[tuple[float, ...]]:
    pitch_m = 0.5 + gap_m
    count = int(20.0 / pitch_m)
    return [
        (at_m, y, at_m + 0.5, y + 0.5, 0.0, high_m)
        for y in (pitch_m * (k - 0.5 * count) for k in range(count))
    ]


CASES: Final[Mapping[str, Sequence[tuple[float, ...]]]] = {
    "wall 3 m high, 3 m from the charge": [_wall(3.0, 3.0)],
    "the same, 7.5 m from the charge": [_wall(7.5, 3.0)],
    "the same, 1 m before the facade": [_wall(8.5, 3.0)],
    "2 m high": [_wall(3.0, 2.0)],
    "4 m high": [_wall(3.0, 4.0)],
    "1 m high": [_wall(3.0, 1.0)],
    "3 m high, 10 m long": [_wall(3.0, 3.0, 10.0)],
    "with a gap of 2 m in the middle": [
        (3.0, -10.0, 3.5, -1.0, 0.0, 3.0),
        (3.0, 1.0, 3.5, 10.0, 0.0, 3.0),
    ],
    "posts 0.5 m wide, 3 m high, gaps of 0.5 m": _posts(3.0, 3.0, 0.5),
    "the same, gaps of 1 m": _posts(3.0, 3.0, 1.0),
    "two walls of 2 m, at 3 and 7 m": [_wall(3.0, 2.0), _wall(7.0, 2.0)],
}
"""Obstacles before the facade: low x, y, high x, y, base and top, m from the charge."""


def case_rows(known: Laws, by_gas: Mapping[str, float]) -> Iterator[Row]:
    """Yield one row per case: what is left of the facade's impulse, by the law and by gas."""
    for name, boxes in CASES.items():
        middle, low, high = wall_case(known, boxes)
        yield name, f"{middle:.2f}", f"{low:.2f} to {high:.2f}", f"{by_gas[name]:.2f}"


def street_rows(known: Laws) -> Iterator[Row]:
    """Yield the factor on the lowest bays of a front along a street of two fronts, by its width.

    100 kg on the axis; the front alone is 1.
    """
    scale = float(np.cbrt(_KG))
    for width_m in (6.0, 8.0, 10.0, 12.0):
        half_m = 0.5 * width_m
        cells = []
        for along_m in (5.0, 10.0, 15.0, 20.0):
            bay = np.array([[along_m, half_m, 1.5]]) / scale
            other = np.array([[-10.0, -half_m - 2.0, 35.0, -half_m, 0.0, 8.0]]) / scale
            numbers = numbers_of_echoes(
                np.zeros(3), bay, np.array([0.0, -1.0, 0.0]), other, np.array([8.0 / scale])
            )
            own = known.opposite.factors(numbers)
            mark = "" if own.in_range[0] else " (outside)"
            cells.append(
                f"{own.middle[0, 0]:.2f} ({own.low[0, 0]:.2f} to {own.high[0, 0]:.2f}){mark}"
            )
        yield f"{width_m:g} m", *cells


def cases_by_gas(cell_m: float) -> dict[str, float]:
    """Return what is left of the facade's impulse behind each case's boxes, by gas dynamics."""
    alone = _facade_impulse([], cell_m)
    return {name: _facade_impulse(boxes, cell_m) / alone for name, boxes in CASES.items()}


def _facade_impulse(boxes_m: Sequence[Sequence[float]], cell_m: float) -> float:
    """Return the mean impulse of the facade of the cases, Pa s."""

    def block(name: str, box: Sequence[float], **more: Any) -> dict[str, Any]:
        left, bottom, right, top, _, high_m = box
        return {
            "kind": "ModularObstacle",
            "name": name,
            "corner_m": [left + 4.0, bottom + 14.0],
            "rows": round(2.0 * (top - bottom)),
            "columns": round(2.0 * (right - left)),
            "height_m": high_m,
            **more,
        }

    house = (10.0, -6.0, 12.0, 6.0, 0.0, 6.0)
    structures = [block("house", house, protected=True, faces=["west"])]
    structures += [block(f"wall{k}", box) for k, box in enumerate(boxes_m)]
    document = {
        "schema_version": 2,
        "name": "case",
        "site": {"width_m": 20.0, "height_m": 28.0, "air_height_m": 12.0},
        "charge": [{"kind": "point", "position_m": [4.0, 14.0], "tnt_kg": _KG}],
        "structures": structures,
    }
    site = Scenario.from_document(document, "case")
    return GasBlast(site, engine=GasEngine(cell_m=cell_m)).run().impulse("house").pa_s
