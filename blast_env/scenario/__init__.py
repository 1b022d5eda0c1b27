"""Scenario files: models, validation, loading and saving."""

from blast_env.bundled import bundled_scenarios
from blast_env.geometry import Cell, Element, Layout, Piece
from blast_env.physics.scene import Charge
from blast_env.scenario.access_way import AccessWay
from blast_env.scenario.catalogue import Catalogue, Item, PlacedModule, StockBarrier, stock_barriers
from blast_env.scenario.files import (
    AnyScenario,
    ScenarioField,
    find_problems,
    find_scenario,
    load_scenario,
    parse_scenario,
    save_scenario,
    scenario_hash,
)
from blast_env.scenario.layout_file import LayoutFile, load_layout, write_layout
from blast_env.scenario.models import (
    SCHEMA_VERSION,
    AnySource,
    AnyStructure,
    ConcreteSquareSection,
    GaugeSection,
    ModularObstacleSection,
    PointSource,
    RectangleSource,
    Scenario,
    SegmentSource,
    SimulationSection,
    Site,
    VehicleSource,
)
from blast_env.scenario.objective import ObjectiveSection
from blast_env.scenario.placement import Placement, check_layout, usable_cells
from blast_env.scenario.problems import Problem, ScenarioError
from blast_env.scenario.vehicles import AnyCharge, VehicleCharge
from blast_env.scenario.zone import BuildZone, CostArea, KeepOut

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
    "LayoutFile",
    "ModularObstacleSection",
    "ObjectiveSection",
    "Piece",
    "PlacedModule",
    "Placement",
    "PointSource",
    "Problem",
    "RectangleSource",
    "Scenario",
    "ScenarioError",
    "ScenarioField",
    "SegmentSource",
    "SimulationSection",
    "Site",
    "StockBarrier",
    "VehicleCharge",
    "VehicleSource",
    "bundled_scenarios",
    "check_layout",
    "find_problems",
    "find_scenario",
    "load_layout",
    "load_scenario",
    "parse_scenario",
    "save_scenario",
    "scenario_hash",
    "stock_barriers",
    "usable_cells",
    "write_layout",
]
