"""The film and the pictures of one blast by either engine, or of two side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blast_env.errors import BlastEnvError, UnknownNameError, import_extra
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.runner import ProgressCallback, share_of

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasBlast, GasResult
    from blast_env.gas.engine import Recorders


@dataclass(frozen=True, kw_only=True)
class BlastFiles:
    """Paths of the film and the pictures of a blast, `None` for those not wanted.

    Attributes:
        film: Film of the spread of the blast, .mp4 or .gif.
        heat_map: Load over the protected facades.
        history: Load over time; by gas dynamics at a gauge.
        impulse_map: Impulse over the ground, by gas dynamics.
        peak_map: Peak overpressure over the ground.
        risk_map: Risks to windows and eardrums.
        quantity: Quantity of the heat map by gas dynamics: impulse, unless peak.
        gauge: Gauge of the history; by default the scenario's first.
        further: What else records the blast, by gas dynamics.
    """

    film: Path | None = None
    heat_map: Path | None = None
    history: Path | None = None
    impulse_map: Path | None = None
    peak_map: Path | None = None
    risk_map: Path | None = None
    quantity: str | None = None
    gauge: str | None = None
    further: "Recorders | None" = None

    def check(self, blast: "Blast | GasBlast") -> None:
        """Refuse files that cannot be made, before the blast.

        Raises:
            BlastEnvError: If an option is invalid, or lacks its history or gauge.
            MissingExtraError: If the extra `render` is missing for one of them.
        """
        if isinstance(blast, Blast):
            return
        if self.heat_map is not None:
            with import_extra("render", "pictures and films"):
                from blast_env.plots.gas import kind_of
            kind_of(self.quantity or "impulse")
        names = [gauge.name for gauge in blast.site.gauges]
        if self.history is None:
            if self.gauge is not None:
                raise BlastEnvError("--gauge is for --history: no history is to be drawn")
        elif not names:
            raise BlastEnvError(
                f"--history: {blast.scenario.name} has no gauges ([[gauges]]), and gas dynamics "
                "keeps the load over time at gauges only"
            )
        elif self.gauge is not None and self.gauge not in names:
            raise UnknownNameError("gauge", self.gauge, names)

    def run(self, blasts: Sequence[Any], progress: ProgressCallback) -> tuple[Any, ...]:
        """Run one or two blasts by one engine, and write their film; return their results.

        Args:
            blasts: The blasts, from left to right.
            progress: Called with the finished share.
        """
        *beside, blast = blasts
        if self.film is None:
            recorders = () if isinstance(blast, Blast) else (self._recorders(),)
            count = len(blasts)
            return tuple(
                blast.run(share_of(progress, number, count), *recorders)
                for number, blast in enumerate(blasts)
            )
        # Here, because films need the extra `render`.
        from blast_env.plots.film import write_film

        return write_film(
            blast,
            self.film,
            beside=beside[0] if beside else None,
            recorders=self._recorders(),
            progress=progress,
        )

    def draw(self, results: Sequence[Any]) -> list[Path]:
        """Draw the pictures of the results of `run`; return their files.

        Pictures of gas dynamics have two blasts side by side. Those by particles go into files of
        their own, that of the first blast with `_without` at the end of its name.
        """
        every = (self.heat_map, self.history)
        if not any((*every, self.impulse_map, self.peak_map, self.risk_map)):
            return []
        if isinstance(results[-1], BlastResult):
            return self._draw_particles(results)
        return self._draw_gas(*reversed(results))

    def _draw_particles(self, results: Sequence[BlastResult]) -> list[Path]:
        # Here, because pictures need the extra `render`.
        from blast_env.plots import figures

        written = []
        for number, result in enumerate(reversed(results)):
            if self.heat_map is not None:
                figure = figures.heat_map(result, results)
                written.append(figures.save_figure(figure, _named(self.heat_map, number)))
            if self.history is not None:
                figure = figures.impulse_over_time(result)
                written.append(figures.save_figure(figure, _named(self.history, number)))
        return written

    def _draw_gas(self, result: "GasResult", unprotected: "GasResult | None" = None) -> list[Path]:
        # Here, because pictures need the extra `render`.
        from blast_env.plots import gas
        from blast_env.plots.figures import save_figure
        from blast_env.plots.ground_map import ground_map, threshold_map

        quantity = self.quantity or "impulse"
        gauge = self.gauge or next((gauge.name for gauge in result.run.site.gauges), "")
        history = partial(gas.gauge_history, result, gauge, free_field=True, beside=unprotected)
        pictures = (
            (self.heat_map, partial(gas.facades, result, quantity=quantity, beside=unprotected)),
            (self.history, history),
            (self.impulse_map, partial(ground_map, result, "impulse", unprotected)),
            (self.peak_map, partial(ground_map, result, "peak", unprotected)),
            (self.risk_map, partial(threshold_map, result, unprotected)),
        )
        return [save_figure(draw(), path) for path, draw in pictures if path is not None]

    def _recorders(self) -> "Recorders":
        """Return the recorders of the ground, if a map of it is wanted, and further ones."""
        found = [] if self.further is None else [self.further]
        if any((self.impulse_map, self.peak_map, self.risk_map)):
            from blast_env.plots.ground_map import ground_recorders

            found.append(ground_recorders)
        return lambda grid: tuple(recorder for made in found for recorder in made(grid))


def _named(path: Path, number: int) -> Path:
    """Return the path of a picture, that of the site without a barrier beside it."""
    return path.with_name(f"{path.stem}_without{path.suffix}") if number else path
