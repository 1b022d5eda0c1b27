"""Scenario files: models, validation, loading and saving."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.bundled import bundled_scenarios
    from blast_env.geometry import OUTWARDS, WALLS, Cell, Element, Layout, Piece
    from blast_env.problems import Problem, ScenarioError
    from blast_env.sections import DrawingGeoreference, GaugeSection, MapGeoreference, Site
    from blast_env.site.blast_site import BlastSite, Charge, Gauge, in_sight
    from blast_env.site.catalogue import (
        Catalogue,
        Hardening,
        Item,
        ModulePlace,
        StockBarrier,
        stock_barriers,
    )
    from blast_env.site.content import SCHEMA_VERSION, highest_top_m
    from blast_env.site.models import (
        AnyScenario,
        Scenario,
        find_problems,
        find_scenario,
        load_scenario,
        parse_scenario,
        save_scenario,
        scenario_hash,
    )
    from blast_env.site.objective import (
        ConditionalValueAtRisk,
        MeanRisk,
        ObjectiveSection,
        WorstRisk,
    )
    from blast_env.site.parameters import (
        ExplosiveParameters,
        SimulationParameters,
        SimulationSection,
        for_charge,
        parameters_digest,
        preset,
        with_overrides,
        with_resolution,
    )
    from blast_env.site.sources import (
        AnyCharge,
        AnySource,
        ChargeSource,
        MassPreset,
        PointSource,
        RectangleSource,
        SegmentSource,
        VehicleCharge,
        VehicleSource,
        ranked,
        tnt_equivalent_kg,
    )
    from blast_env.site.structures import (
        AnyStructure,
        ConcreteSquareSection,
        ModularObstacleSection,
        PolygonSection,
        StructureOutline,
        loaded_walls,
    )
    from blast_env.site.zone import BuildZone, CostArea, KeepOut, distance_m, source_bounds_m
    from blast_env.vehicles.vehicle import AccessWay
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "OUTWARDS",
    "SCHEMA_VERSION",
    "WALLS",
    "AccessWay",
    "AnyCharge",
    "AnyScenario",
    "AnySource",
    "AnyStructure",
    "BlastSite",
    "BuildZone",
    "Catalogue",
    "Cell",
    "Charge",
    "ChargeSource",
    "ConcreteSquareSection",
    "ConditionalValueAtRisk",
    "CostArea",
    "DrawingGeoreference",
    "Element",
    "ExplosiveParameters",
    "Gauge",
    "GaugeSection",
    "Hardening",
    "Item",
    "KeepOut",
    "Layout",
    "MapGeoreference",
    "MassPreset",
    "MeanRisk",
    "ModularObstacleSection",
    "ModulePlace",
    "ObjectiveSection",
    "Piece",
    "PointSource",
    "PolygonSection",
    "Problem",
    "RectangleSource",
    "Scenario",
    "ScenarioError",
    "SegmentSource",
    "SimulationParameters",
    "SimulationSection",
    "Site",
    "StockBarrier",
    "StructureOutline",
    "VehicleCharge",
    "VehicleSource",
    "WorstRisk",
    "bundled_scenarios",
    "distance_m",
    "find_problems",
    "find_scenario",
    "for_charge",
    "highest_top_m",
    "in_sight",
    "load_scenario",
    "loaded_walls",
    "parameters_digest",
    "parse_scenario",
    "preset",
    "ranked",
    "save_scenario",
    "scenario_hash",
    "source_bounds_m",
    "stock_barriers",
    "tnt_equivalent_kg",
    "with_overrides",
    "with_resolution",
]
