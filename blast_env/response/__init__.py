"""From load to consequence: response and damage of facades, barriers, buildings and people."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.bays import Bay, divide
    from blast_env.response.barriers import RigidPiece, Stability, piece_responses
    from blast_env.response.buildings import (
        BuildingDamage,
        building_damage_probability,
        eardrum_peak_pa,
        ground_thresholds,
        level_of_protection,
    )
    from blast_env.response.components import (
        Alternatives,
        FacadeBay,
        GlassKind,
        Glazing,
        Interlayer,
        Wall,
        catalogue,
    )
    from blast_env.response.damage import (
        TriangularLoads,
        bay_damages,
        damage_numbers,
        under_triangle,
    )
    from blast_env.response.facade import (
        FacadeResponse,
        assumption_words,
        force_words,
        peak_corrected,
        peak_factor,
        respond,
    )
    from blast_env.response.glass import (
        GlazingCondition,
        Pane,
        flight_condition,
        glazing_responses,
        pane_of,
    )
    from blast_env.response.levels import LevelOfProtection, fails_from, level_of
    from blast_env.response.plate_table import plate_curve
    from blast_env.response.requirements import Requirement
    from blast_env.response.sdof import Resistance, System, impulses, responses
    from blast_env.response.wall_sections import (
        CONCRETE_LIMITS,
        DamageLevel,
        Masonry,
        ReinforcedConcrete,
        Sheeting,
        Supports,
    )
    from blast_env.response.walls import (
        Panel,
        damage_level,
        load_mass_factors,
        panel_of,
        panel_responses,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "CONCRETE_LIMITS",
    "Alternatives",
    "Bay",
    "BuildingDamage",
    "DamageLevel",
    "FacadeBay",
    "FacadeResponse",
    "GlassKind",
    "Glazing",
    "GlazingCondition",
    "Interlayer",
    "LevelOfProtection",
    "Masonry",
    "Pane",
    "Panel",
    "ReinforcedConcrete",
    "Requirement",
    "Resistance",
    "RigidPiece",
    "Sheeting",
    "Stability",
    "Supports",
    "System",
    "TriangularLoads",
    "Wall",
    "assumption_words",
    "bay_damages",
    "building_damage_probability",
    "catalogue",
    "damage_level",
    "damage_numbers",
    "divide",
    "eardrum_peak_pa",
    "fails_from",
    "flight_condition",
    "force_words",
    "glazing_responses",
    "ground_thresholds",
    "impulses",
    "level_of",
    "level_of_protection",
    "load_mass_factors",
    "pane_of",
    "panel_of",
    "panel_responses",
    "peak_corrected",
    "peak_factor",
    "piece_responses",
    "plate_curve",
    "respond",
    "responses",
    "under_triangle",
]
