"""Scenario files: models, validation, loading and saving."""

from blast_env.geometry import Cell
from blast_env.physics.scene import Charge
from blast_env.scenario.files import (
    AnyScenario,
    ScenarioField,
    bundled_scenarios,
    find_problems,
    find_scenario,
    load_scenario,
    parse_scenario,
    save_scenario,
    scenario_hash,
)
from blast_env.scenario.layout_file import LayoutFile, load_layout, write_layout
from blast_env.scenario.models import (
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
)
from blast_env.scenario.placement import Placement, check_layout, usable_cells
from blast_env.scenario.problems import Problem, ScenarioError
from blast_env.scenario.versions import SCHEMA_VERSION
from blast_env.scenario.zone import AccessWay, BuildZone, CostArea, KeepOut

__all__ = [
    "SCHEMA_VERSION",
    "AccessWay",
    "AnyScenario",
    "AnySource",
    "AnyStructure",
    "BuildZone",
    "Cell",
    "Charge",
    "ConcreteSquareSection",
    "CostArea",
    "GaugeSection",
    "KeepOut",
    "LayoutFile",
    "ModularObstacleSection",
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
    "bundled_scenarios",
    "check_layout",
    "find_problems",
    "find_scenario",
    "load_layout",
    "load_scenario",
    "parse_scenario",
    "save_scenario",
    "scenario_hash",
    "usable_cells",
    "write_layout",
]
