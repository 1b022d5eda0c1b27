"""Colours, numbers and texts of pictures, and the import of their optional packages."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import ceil, floor, log10, pi
from typing import Final

import numpy as np

from blast_env.errors import import_extra
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.geometry import Element, distance_to_rectangle, layout_counts
from blast_env.particles.objects import CollisionType, Colour
from blast_env.particles.run import Scene
from blast_env.site.blast_site import Charge
from blast_env.units import MODULE_SIDE_M


@contextmanager
def render_extra() -> Iterator[None]:
    """Import packages of the extra `render` in this block.

    Raises:
        MissingExtraError: If one of them is not installed; the message has the command to install
            it.
    """
    # pygame prints a greeting to standard output, which belongs to the importing program.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    with import_extra("render", "pictures and films"):
        yield


AIR: Final[Colour] = (30, 46, 122)
_NICE_STEPS: Final = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def nice_numbers(lowest: float, highest: float) -> list[float]:
    """Return the numbers of few digits between two positive bounds."""
    powers = range(floor(log10(lowest)), ceil(log10(highest)) + 1)
    numbers = {float(f"{step * 10.0**power:.3g}") for power in powers for step in _NICE_STEPS}
    return sorted(number for number in numbers if lowest <= number <= highest)


def nice_ceiling(value: float) -> float:
    """Return a positive value rounded up to few digits."""
    return nice_numbers(value * (1.0 - 1e-9), 2.0 * value)[0]


def nice_floor(value: float) -> float:
    """Return a positive value rounded down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** floor(log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9))


def short_number(value: float, digits: int = 2) -> str:
    """Return a number with at most the given significant digits, and k, M or G as a suffix."""
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits}g}")
    for size, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if rounded >= size:
            return f"{rounded / size:g}{suffix}"
    return f"{rounded:g}" if rounded >= 0.01 else f"{rounded:.0e}"


def number_on_axis(value: float, position: int | None) -> str:  # noqa: ARG001
    """Return the number at a tick, for matplotlib's `FuncFormatter`."""
    return short_number(value, digits=4)


def free_flight_impulse(scene: Scene) -> float:
    """Return a typical load per module from the scene alone, simulation units.

    It is the impulse of an undisturbed fan on a module at the point of the structures nearest to
    the charge. The barrier does not count, so that all layouts have the same value.
    """
    balls = scene.balls
    explosive = balls.kind == CollisionType.ExplosionBall
    speed = (balls.velocity[explosive] ** 2).sum(axis=1) ** 0.5
    momentum = float((balls.mass[explosive] * speed).sum())
    centre_m = np.array([scene.charge.position_m])
    distance_m = min(
        float(distance_to_rectangle(centre_m, box)[0])
        for outline in scene.structures
        if not outline.is_barrier
        for box in outline.boxes_m
    )
    share = min(MODULE_SIDE_M / (2.0 * pi * max(distance_m, MODULE_SIDE_M)), 1.0)
    return momentum * share


def barrier_text(layout: Sequence[Element]) -> str:
    """Return the barrier of a layout, in words."""
    return f"barrier of {layout_counts(layout)}" if layout else "no barrier"


def charge_text(charge: Charge) -> str:
    """Return mass and place of a charge, in words."""
    x_m, y_m = charge.position_m
    return f"{charge.tnt_kg:g} kg TNT at ({x_m:.1f} m, {y_m:.1f} m)"


def blast_title(blast: Blast) -> tuple[str, str]:
    """Return the heading of a picture of a blast, and the line under it."""
    charge, barrier = charge_text(blast.scene.charge), barrier_text(blast.layout)
    return blast.scenario.name, f"charge {charge}, {barrier}, seed {blast.seed}"


def unit_interval(colour: Colour) -> tuple[float, float, float]:
    """Return a colour with channels between 0 and 1, for matplotlib."""
    red, green, blue = (part / 255.0 for part in colour)
    return red, green, blue


# Pairs of a share of the impulse and a factor on its arrival time. The span ends at the earliest
# product: a late single hit must not compress the blast into the first tenth of a picture.
_ENDS = ((0.999, 1.1), (0.95, 2.0))


def shown_until_s(result: BlastResult) -> float:
    """Return the simulated time at the end of a film or a history.

    It is a little after 99.9 % of the impulse on the protected structures has arrived (on all
    structures, if none is protected or hit), but at the latest at twice the arrival time of 95 %.
    """
    table = result.collisions
    protected = [obstacle.name for obstacle in result.obstacles if obstacle.protected]
    on_protected = table[table["structure"].isin(protected)]
    chosen = on_protected if len(on_protected) else table
    if not len(chosen):
        return result.time_s
    arrived = np.cumsum(chosen["impulse_sim"].to_numpy())
    times_s = chosen["time_s"].to_numpy()
    ends_s = (
        factor * float(times_s[np.searchsorted(arrived, share * arrived[-1])])
        for share, factor in _ENDS
    )
    return min(result.time_s, *ends_s)
