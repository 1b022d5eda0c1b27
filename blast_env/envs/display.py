"""Display of an episode: as text, as a picture, in a window."""

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.envs.episode import Episode
from blast_env.evaluation.cases import LoadCase
from blast_env.evaluation.engines import Blast
from blast_env.geometry import Rectangle
from blast_env.layout import LayoutState
from blast_env.site import AnySource, PointSource, Scenario
from blast_env.site.zone import distances_m
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:
    from blast_env.plots.placing import PlacingPainter
    from blast_env.plots.window import Window

_LEGEND: Final = {
    "P": "protected structure",
    "S": "other structure",
    "M": "barrier module",
    ".": "free cell",
    "x": "cell not available",
    "*": "charge",
    "~": "charge may be here",
}


def placing_text(
    placement: LayoutState, sources: Sequence[AnySource], lines: Sequence[str] = ()
) -> str:
    """Return the site as text: one character per square of 0.5 m, a frame and a legend.

    Args:
        placement: The modules placed so far.
        sources: The place of the charge, if a single point, or its possible places.
        lines: Text above the map, after the scenario's name.
    """
    characters = _map(placement.scenario, placement, sources)
    rule = f"+{'-' * characters.shape[1]}+"
    rows = [f"|{''.join(row)}|" for row in characters[::-1]]
    used = set(np.unique(characters).tolist())
    legend = ", ".join(f"{sign} {text}" for sign, text in _LEGEND.items() if sign in used)
    heading = "; ".join((placement.scenario.name, *lines))
    return "\n".join([heading, rule, *rows, rule, legend])


def _map(
    scenario: Scenario, placement: LayoutState, sources: Sequence[AnySource]
) -> NDArray[np.str_]:
    """Return the characters, (rows, columns), the lower edge of the site first."""
    rows, columns = (
        ceil(length_m / MODULE_SIDE_M - 1e-9)
        for length_m in (scenario.site.height_m, scenario.site.width_m)
    )
    up, right = (np.arange(count, dtype=np.float64) for count in (rows, columns))
    y, x = (up[:, np.newaxis] + 0.5) * MODULE_SIDE_M, (right + 0.5) * MODULE_SIDE_M
    characters = np.full((rows, columns), " ")
    zone, free, taken = scenario.zone, placement.open_ground, set(placement.cells)
    for structure in scenario.structures:
        if structure.carries:
            for box in structure.boxes_m:
                characters[_inside(box, x, y)] = "S"
    for cell in zone.cells():
        sign = "M" if cell in taken else "." if free[cell] else "x"
        characters[_inside(zone.cell_rectangle_m(cell), x, y)] = sign
    known = len(sources) == 1 and isinstance(sources[0], PointSource)
    for source in sources:
        near = distances_m(source, (x, y, x, y)) <= scenario.charge_radius_m
        characters[near] = "*" if known else "~"
    for structure in scenario.structures:
        if not structure.carries:
            sign = "P" if structure.protected else "S"
            for box in structure.boxes_m:
                characters[_inside(box, x, y)] = sign
    return characters


def _inside(rectangle_m: Rectangle, x: FloatArray, y: FloatArray) -> BoolArray:
    """Return the mask of squares whose centre is in a rectangle."""
    left, bottom, right, top = rectangle_m
    inside: BoolArray = (x >= left) & (x < right) & (y >= bottom) & (y < top)
    return inside


Frame = NDArray[np.uint8]
_FRAMES_PER_PLACEMENT: Final = 5  # in the window: 0.2 s, so that a person can follow


class Display:
    """Shows an episode of placing, and the end of the blast.

    Drawing objects are made on demand and not pickled.

    Args:
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`.
        frames_per_s: Frames per second of the window and of films.
    """

    def __init__(self, render_mode: str, frames_per_s: float) -> None:
        self._render_mode = render_mode
        self._frames_per_s = frames_per_s
        self._episode: Episode | None = None
        self._painter: PlacingPainter | None = None
        self._last_frame: Frame | None = None
        self._window: Window | None = None

    def show(self, episode: Episode, placement: LayoutState) -> None:
        """Show the present state in the window, long enough for a person to follow."""
        for _ in range(1 if episode.ended else _FRAMES_PER_PLACEMENT):
            self._show(self._frame(episode, placement))

    def render(self, episode: Episode, placement: LayoutState) -> Frame | str | None:
        """Return the frame or text of the render mode; `"human"` shows a frame instead."""
        if self._render_mode == "rgb_array":
            return self._frame(episode, placement).copy()
        if self._render_mode == "ansi":
            lines = _state_lines(episode, placement)
            lines += [_outcome(episode)] if episode.ended else []
            return placing_text(placement, episode.shown.observable.sources, lines)
        if self._render_mode == "human":
            self._show(self._frame(episode, placement))
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without drawing objects, which do not pickle."""
        return {**self.__dict__, "_painter": None, "_window": None}

    def _frame(self, episode: Episode, placement: LayoutState) -> Frame:
        """Return the present frame."""
        painter, lines = self._placing_painter(episode), _state_lines(episode, placement)
        if not episode.ended:
            return painter.paint(placement, lines)
        if episode.site.evaluator.engine.medium != "particles":  # no state that stays
            return painter.paint(placement, [*lines[:1], _outcome(episode)])
        if self._last_frame is None:
            self._last_frame = _last_frame(episode, painter.size_px)
        return self._last_frame

    def _placing_painter(self, episode: Episode) -> "PlacingPainter":
        """Return the painter of the episode; a new one with a new episode."""
        from blast_env.plots.placing import PlacingPainter

        if self._painter is None or self._episode is not episode:
            if self._episode is not episode:
                self._last_frame = None
            observable = episode.shown.observable
            self._painter = PlacingPainter(observable.scenario, observable.sources)
            self._episode = episode
        return self._painter

    def _show(self, frame: Frame) -> None:
        from blast_env.plots.window import Window

        if self._window is None:
            self._window = Window("blast-env", self._frames_per_s)
        self._window.show(frame)


def _last_frame(episode: Episode, size_px: tuple[int, int]) -> Frame:
    """Return the end of the blast of the worst threat, which runs again for the picture."""
    from blast_env.plots.placing import last_frame

    shown, evaluator = _shown_threat(episode), episode.site.evaluator
    # Sorted as for the assessment: the order may change the last bits.
    layout = tuple(sorted(episode.final or ()))
    charges = len(episode.case.charges)
    remark = f": the worst of {charges} charges" if charges > 1 else ""
    blast = evaluator.engine.blast(evaluator.scenario, layout, shown.seed, shown.charge)
    assert isinstance(blast, Blast)
    return last_frame(blast, _outcome(episode), remark, size_px)


def _shown_threat(episode: Episode) -> LoadCase:
    """Return the worst threat, with its first realisation."""
    case, layout = episode.case, episode.final or ()
    blasts = episode.site.evaluator.loads_of_many([(layout, threat) for threat in case.threats])
    loads = np.array([blast.load(case.scenario.objective) for blast in blasts])
    of_charges = loads.reshape(case.realisations, -1).mean(axis=0)
    return case.threats[int(of_charges.argmax())]


def _outcome(episode: Episode) -> str:
    """Return the loads and the reduction, in words."""
    protected, unprotected = episode.assess()
    reduction_percent = 100.0 * protected.reduction_from(unprotected)
    of_all = "all charges: " if len(episode.case.charges) > 1 else ""
    load = f"{protected.impulse_psi_s:.3g} psi s ({protected.impulse_pa_s:.3g} Pa s)"
    counts = episode.case.scenario.objective
    if counts.needs_peaks:
        load = f"{load}, {counts.noun} {counts.text(protected.load)}"
    return f"{of_all}{load}, reduction {reduction_percent:.0f} %"


def _state_lines(episode: Episode, placement: LayoutState) -> list[str]:
    """Return the remaining stock and budget, the stand-off, and the count of illegal actions."""
    zone = placement.scenario.zone
    what = "pieces" if zone.items else "modules"
    lines = [f"{placement.stock_left} of {zone.stock} {what} left"]
    left = zip(placement.catalogue.names, placement.stocks_left, strict=False)
    extras = [f"{count} {name}" for name, count in left if count]
    if zone.budget is not None:
        extras.append(f"budget: {placement.budget_left:g} of {zone.budget:g} left")
    observable = episode.shown.observable
    if observable.vehicles:
        extras.append(f"stand-off {observable.stand_off_m(placement.layout):.1f} m")
    if episode.invalid_actions:
        plural = "" if episode.invalid_actions == 1 else "s"
        extras.append(f"{episode.invalid_actions} illegal action{plural}")
    return [*lines, ", ".join(extras)] if extras else lines
