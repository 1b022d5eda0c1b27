"""Scenario files: models, validation, loading and saving."""

from blast_env.bundled import bundled_scenarios
from blast_env.geometry import Cell, Element, Layout, Piece
from blast_env.problems import Problem, ScenarioError
from blast_env.sections import Site
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Catalogue, Item, PlacedModule, StockBarrier, stock_barriers
from blast_env.site.content import SCHEMA_VERSION
from blast_env.site.files import (
    AnyScenario,
    find_problems,
    find_scenario,
    load_scenario,
    parse_scenario,
    save_scenario,
    scenario_hash,
)
from blast_env.site.models import Scenario
from blast_env.site.objective import ObjectiveSection
from blast_env.site.sections import GaugeSection, SimulationSection
from blast_env.site.sources import (
    AnyCharge,
    AnySource,
    PointSource,
    RectangleSource,
    SegmentSource,
    VehicleCharge,
    VehicleSource,
)
from blast_env.site.structures import AnyStructure, ConcreteSquareSection, ModularObstacleSection
from blast_env.site.zone import BuildZone, CostArea, KeepOut
from blast_env.vehicles.access_way import AccessWay

__all__ = [
    "SCHEMA_VERSION",
    "AccessWay",
    "AnyCharge",
    "AnyScenario",
    "AnySource",
    "AnyStructure",
    "BuildZone",
    "Catalogue",
    "Cell",
    "Charge",
    "ConcreteSquareSection",
    "CostArea",
    "Element",
    "GaugeSection",
    "Item",
    "KeepOut",
    "Layout",
    "ModularObstacleSection",
    "ObjectiveSection",
    "Piece",
    "PlacedModule",
    "PointSource",
    "Problem",
    "RectangleSource",
    "Scenario",
    "ScenarioError",
    "SegmentSource",
    "SimulationSection",
    "Site",
    "StockBarrier",
    "VehicleCharge",
    "VehicleSource",
    "bundled_scenarios",
    "find_problems",
    "find_scenario",
    "load_scenario",
    "parse_scenario",
    "save_scenario",
    "scenario_hash",
    "stock_barriers",
]
