"""From load to consequence: response and damage of facades, barriers, buildings and people."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.response.barriers import RigidPiece, Stability, piece_responses
    from blast_env.response.buildings import (
        BuildingDamage,
        LevelOfProtection,
        building_damage_probability,
        eardrum_peak_pa,
        eardrum_rupture_probability,
        ground_thresholds,
        level_of_protection,
    )
    from blast_env.response.components import Glazing, Wall, catalogue, find_component
    from blast_env.response.damage import (
        Alternatives,
        TriangularLoads,
        bay_damages,
        damage_number,
        fails_from,
        level_of,
        under_triangle,
    )
    from blast_env.response.facade import (
        Bay,
        FacadeBay,
        FacadeResponse,
        assumption_words,
        divide,
        force_words,
        peak_corrected,
        peak_factor,
        respond,
    )
    from blast_env.response.glass import (
        GlassKind,
        GlazingCondition,
        Interlayer,
        Pane,
        flight_condition,
        glazing_responses,
    )
    from blast_env.response.plate_table import plate_curve
    from blast_env.response.requirements import Requirement
    from blast_env.response.sdof import Resistance, System, impulses, responses
    from blast_env.response.walls import (
        CONCRETE_LIMITS,
        DamageLevel,
        Masonry,
        Panel,
        ReinforcedConcrete,
        Sheeting,
        Supports,
        damage_level,
        load_mass_factors,
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
    "damage_number",
    "divide",
    "eardrum_peak_pa",
    "eardrum_rupture_probability",
    "fails_from",
    "find_component",
    "flight_condition",
    "force_words",
    "glazing_responses",
    "ground_thresholds",
    "impulses",
    "level_of",
    "level_of_protection",
    "load_mass_factors",
    "panel_responses",
    "peak_corrected",
    "peak_factor",
    "piece_responses",
    "plate_curve",
    "respond",
    "responses",
    "under_triangle",
]
