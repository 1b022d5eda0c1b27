"""Wall panels and slabs: resistance from the section, damage from ductility and support rotation.

Panels span one way between two supports, per metre of width. Their resistance to a uniform pressure
follows from virtual work, and their load-mass factor from integrals of the deflected shape. A panel
fixed at both ends has an elastic-plastic range, represented by a single slope of equal work (UFC
3-340-02, section 3-13).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.response.components import Wall
from blast_env.response.sdof import Resistance, Responses, System, drawn_responses, responses
from blast_env.response.wall_sections import (
    DamageLevel,
    Masonry,
    ReinforcedConcrete,
    Sheeting,
    Supports,
)

_GRAVITY_M_S2: Final = 9.81


def damage_level(measure: FloatArray) -> list[DamageLevel]:
    """Return the levels of damage measures."""
    return [DamageLevel(int(min(value, 4.0))) for value in measure.tolist()]


_ROTATIONS_DEG: Final = (0.0, 2.0, 2.02, 3.0, 4.0, 5.0, 6.0, 6.06, 8.0, 10.0, 12.0, 20.0)


@dataclass(frozen=True)
class Panel:
    """A wall panel or slab that spans one way.

    Attributes:
        span_m: Distance between its supports; length of a cantilever.
        supports: Its support conditions.
    """

    section: ReinforcedConcrete | Masonry | Sheeting
    span_m: float
    supports: Supports = Supports.SIMPLE

    @cached_property
    def system(self) -> System:
        """The panel as a single-degree-of-freedom system, per area."""
        stiffness_pa_m, cap_pa = self._strength()
        if isinstance(self.section, Masonry):
            resistance = self._rocking(self.section, stiffness_pa_m, cap_pa)
        else:
            resistance = Resistance.elastic_plastic(stiffness_pa_m, cap_pa)
        if isinstance(self.section, ReinforcedConcrete):
            growth_m, growth = self._growth(self.section, cap_pa)
            resistance = replace(resistance, growth_m=growth_m, growth=growth)
        elastic, plastic = load_mass_factors(self.supports)
        return System(self.section.mass_kg_m2, 0.5 * (elastic + plastic), resistance)

    def _strength(self) -> tuple[float, float]:
        """Return stiffness and ultimate resistance per area, Pa/m and Pa.

        For simple, fixed and cantilever supports, the ultimate resistance by virtual work of the
        hinges is 8, 16 and 2 M / L^2, and the elastic stiffness 384 E I / (5 L^4), 384 E I / L^4
        and 8 E I / L^4. A panel fixed at both ends begins to yield at 12 M / L^2 and continues with
        the stiffness of a simple span; a single slope of equal work represents both ranges.
        """
        moment, bending = self.section.moment_n, self.section.bending_stiffness_n_m
        length = self.span_m
        # Static deflections of beams under a uniform load; hinges form where the moment is largest.
        simple = 384.0 * bending / (5.0 * length**4)
        if self.supports is Supports.SIMPLE:
            return simple, 8.0 * moment / length**2
        if self.supports is Supports.CANTILEVER:
            return 8.0 * bending / length**4, 2.0 * moment / length**2
        # Fixed at both ends: (1) elastic to 12 M / L^2, where the ends yield; (2) as a simple span
        # to 16 M / L^2, where the middle yields; (3) one line to the cap with the work of both (UFC
        # 3-340-02, section 3-13).
        cap = 16.0 * moment / length**2
        first_m = (12.0 * moment / length**2) / (5.0 * simple)
        last_m = first_m + (4.0 * moment / length**2) / simple
        work = 0.5 * 0.75 * cap * first_m + 0.5 * (0.75 + 1.0) * cap * (last_m - first_m)
        yield_m = 2.0 * (last_m - work / cap)
        return cap / yield_m, cap

    def _growth(self, section: ReinforcedConcrete, cap_pa: float) -> tuple[FloatArray, FloatArray]:
        """Return deflections, and factors on the yield resistance of concrete at these.

        A membrane of tension T takes over where 8 T x / L^2 exceeds the resistance in bending.
        """
        # Moments grow with the hardening of the steel; a cantilever has nothing to hang from.
        bends = [section.moment_at(value) / section.moment_n for value in _ROTATIONS_DEG]
        arm_m = self.span_m if self.supports is Supports.CANTILEVER else 0.5 * self.span_m
        deflection_m = arm_m * np.tan(np.radians(_ROTATIONS_DEG))
        growth = np.array(bends)
        if self.supports is not Supports.CANTILEVER:
            tension_n = np.array([section.membrane_n(value) for value in _ROTATIONS_DEG])
            growth = np.maximum(growth, 8.0 * tension_n * deflection_m / self.span_m**2 / cap_pa)
        return deflection_m, growth

    def _rocking(self, section: Masonry, stiffness_pa_m: float, cap_pa: float) -> Resistance:
        """Return a resistance that drops at cracking to that of the panel's weight.

        Cracked at mid-height, the halves rock: their resistance falls from 4 m g h / L at zero
        deflection to 0 at a deflection of the thickness h (Paulay & Priestley 1992). It is 0 at
        zero deflection and rises over the first hundredth of the thickness.
        """
        thickness = section.thickness_m
        # Moment equilibrium of one half about its end: its weight acts with the arm of the
        # thickness.
        weight = 4.0 * section.mass_kg_m2 * _GRAVITY_M_S2 * thickness / self.span_m
        first_m = 0.01 * thickness
        return Resistance(
            np.array([0.0, cap_pa / stiffness_pa_m]),
            np.array([0.0, cap_pa]),
            crack_m=cap_pa / stiffness_pa_m,
            cracked_deflection_m=np.array([0.0, first_m, thickness, 100.0 * self.span_m]),
            cracked_pressure_pa=np.array([0.0, 0.99 * weight, 0.0, 0.0]),
        )

    def drawn_damage(
        self,
        time_s: FloatArray,
        pressure_pa: FloatArray,
        draws: tuple[FloatArray, FloatArray, FloatArray],
    ) -> FloatArray:
        """Return the damage in draws, see `drawn_responses` and `Limits.measure` (draws,)."""
        motion = drawn_responses(self.system, time_s, pressure_pa, draws)
        most = np.maximum(motion.peak_m, -motion.rebound_m)
        ductility = most / self.system.resistance.yield_m
        return self.section.limits.measure(ductility, self.rotation_deg(most))

    def rotation_deg(self, deflection_m: FloatArray) -> FloatArray:
        """Return the support rotation at a deflection, degrees."""
        arm = self.span_m if self.supports is Supports.CANTILEVER else 0.5 * self.span_m
        return np.degrees(np.arctan(np.asarray(deflection_m) / arm))


@lru_cache(maxsize=256)
def panel_of(wall: Wall, storey_m: float) -> Panel:
    """Return the panel of a wall in a storey; equal ones share one object."""
    return Panel(wall.section, storey_m if wall.span_m is None else wall.span_m, wall.supports)


def load_mass_factors(supports: Supports) -> tuple[float, float]:
    """Return K_LM = mean(phi^2) / mean(phi) of the elastic and plastic shapes.

    The elastic shape is the static deflection under a uniform load, the plastic one the mechanism
    with straight sides.
    """
    # Means over the span by the midpoint rule.
    s = (np.arange(2000) + 0.5) / 2000.0
    if supports is Supports.SIMPLE:
        elastic, plastic = s - 2.0 * s**3 + s**4, 1.0 - np.abs(2.0 * s - 1.0)
    elif supports is Supports.FIXED:
        elastic, plastic = s**2 * (1.0 - s) ** 2, 1.0 - np.abs(2.0 * s - 1.0)
    else:
        elastic, plastic = 6.0 * s**2 - 4.0 * s**3 + s**4, s
    shapes = (elastic / elastic.max(), plastic / plastic.max())
    first, second = (float((shape**2).mean() / shape.mean()) for shape in shapes)
    return first, second


@dataclass(frozen=True, eq=False)
class PanelResponses:
    """Responses of panels to their histories.

    Attributes:
        ductility: Largest deflection over that at yield (panels,).
        rotation_deg: Largest support rotation (panels,).
        damage: Damage as a number, see `Limits.measure` (panels,).
        support_force_n_m: Force per length of support, N/m, which the connection has to carry: its
            share of the largest resistance (panels,).
    """

    motion: Responses
    ductility: FloatArray
    rotation_deg: FloatArray
    damage: FloatArray
    support_force_n_m: FloatArray

    @property
    def levels(self) -> list[DamageLevel]:
        """Levels of damage, one per panel."""
        return damage_level(self.damage)

    def only(self, panels: slice) -> "PanelResponses":
        """Return those of some of the panels."""
        motion, *others = vars(self).values()
        return PanelResponses(
            Responses(*(own[panels] for own in vars(motion).values())),
            *(own[panels] for own in others),
        )

    def or_worse(self, other: "PanelResponses") -> "PanelResponses":
        """Return for each panel the response with the larger damage."""
        worse = other.damage > self.damage
        motion = Responses(
            *(
                np.where(worse, getattr(other.motion, name), own)
                for name, own in vars(self.motion).items()
            )
        )
        return PanelResponses(
            motion,
            np.where(worse, other.ductility, self.ductility),
            np.where(worse, other.rotation_deg, self.rotation_deg),
            np.where(worse, other.damage, self.damage),
            np.maximum(self.support_force_n_m, other.support_force_n_m),
        )


def panel_responses(
    panels: Sequence[Panel], time_s: FloatArray, pressure_pa: FloatArray
) -> PanelResponses:
    """Return the response of each panel to its history.

    Args:
        time_s: Times of the histories, ascending: (times,), or (panels, times) if they differ.
        pressure_pa: One history per panel, inwards positive (panels, times).

    Raises:
        BlastEnvError: If there is not one history per panel.
    """
    motion = responses([panel.system for panel in panels], time_s, pressure_pa)
    # Rebound outwards damages as deflection inwards does.
    most = np.maximum(motion.peak_m, -motion.rebound_m)
    ductility = most / np.array([panel.system.resistance.yield_m for panel in panels])
    rotation, damage = np.zeros(len(panels)), np.zeros(len(panels))
    # Equal panels together: limits and rotations are evaluated once for all bays of a type.
    of_panels: dict[Panel, list[int]] = {}
    for index, panel in enumerate(panels):
        of_panels.setdefault(panel, []).append(index)
    for panel, own in of_panels.items():
        rotation[own] = panel.rotation_deg(most[own])
        damage[own] = panel.section.limits.measure(ductility[own], rotation[own])
    carried_m = [
        # Each of two supports has half of the load on the span, a single one all of it.
        panel.span_m * (1.0 if panel.supports is Supports.CANTILEVER else 0.5)
        for panel in panels
    ]
    force = motion.largest_resistance_pa * np.array(carried_m)
    return PanelResponses(motion, ductility, rotation, damage, force)
