"""Pictures of blasts: frames, a window, films and figures; needs the extra `render`."""

from typing import TYPE_CHECKING, Final

from blast_env.plots.labels import Label, labels_of, settled_labels
from blast_env.plots.plan import (
    BARRIER,
    EXPLOSIVE,
    FREE_CELL,
    PROTECTED,
    SITE_KINDS,
    STRUCTURE,
    Feature,
    FeatureKind,
    Kinds,
    Look,
    area_feature,
    barrier_features,
    on_levels,
    rectangles_of,
    site_features,
    stand_off_text,
    structure_features,
    vehicle_features,
)

if TYPE_CHECKING:
    from blast_env.plots.calibration_figures import calibration_figure
    from blast_env.plots.canvas import Frame
    from blast_env.plots.cost_level import PricedDamage, cheapest
    from blast_env.plots.evaluation_figures import evaluation_figure
    from blast_env.plots.facade import LEVEL_COLOURS, facade_picture
    from blast_env.plots.figures import impulse_over_time, save_figure
    from blast_env.plots.film import write_film
    from blast_env.plots.film_files import FilmPlan, plan_until
    from blast_env.plots.frames import FramePainter
    from blast_env.plots.gas import facades, full_load, gauge_history
    from blast_env.plots.ground_map import (
        ground_recorders,
        ground_values,
        open_distance_m,
        threshold_map,
    )
    from blast_env.plots.heat_map import LoadScale
    from blast_env.plots.placing import PlacingPainter, sources_text
    from blast_env.plots.pressure_film import record_planes, scale_end_kpa
    from blast_env.plots.pressure_frames import (
        PressurePainter,
        PressureShot,
        VerticalSection,
        default_section,
    )
    from blast_env.plots.pressure_impulse import level_bounds, pressure_impulse_diagram
    from blast_env.plots.site_plan import draw_outlines, outline_path
    from blast_env.plots.style import AIR, nice_ceiling, short_number, shown_until_s
    from blast_env.plots.window import Window

__all__ = [
    "AIR",
    "BARRIER",
    "EXPLOSIVE",
    "FREE_CELL",
    "LEVEL_COLOURS",
    "PROTECTED",
    "SITE_KINDS",
    "STRUCTURE",
    "Feature",
    "FeatureKind",
    "FilmPlan",
    "Frame",
    "FramePainter",
    "Kinds",
    "Label",
    "LoadScale",
    "Look",
    "PlacingPainter",
    "PressurePainter",
    "PressureShot",
    "PricedDamage",
    "VerticalSection",
    "Window",
    "area_feature",
    "barrier_features",
    "calibration_figure",
    "cheapest",
    "default_section",
    "draw_outlines",
    "evaluation_figure",
    "facade_picture",
    "facades",
    "full_load",
    "gauge_history",
    "ground_recorders",
    "ground_values",
    "impulse_over_time",
    "labels_of",
    "level_bounds",
    "nice_ceiling",
    "on_levels",
    "open_distance_m",
    "outline_path",
    "plan_until",
    "pressure_impulse_diagram",
    "record_planes",
    "rectangles_of",
    "save_figure",
    "scale_end_kpa",
    "settled_labels",
    "short_number",
    "shown_until_s",
    "site_features",
    "sources_text",
    "stand_off_text",
    "structure_features",
    "threshold_map",
    "vehicle_features",
    "write_film",
]

_CALIBRATION_FIGURES: Final = frozenset({"calibration_figure"})
_CANVAS: Final = frozenset({"Frame"})
_COST_LEVEL: Final = frozenset({"PricedDamage", "cheapest"})
_EVALUATION_FIGURES: Final = frozenset({"evaluation_figure"})
_FACADE: Final = frozenset({"LEVEL_COLOURS", "facade_picture"})
_FIGURES: Final = frozenset({"impulse_over_time", "save_figure"})
_FILM: Final = frozenset({"write_film"})
_FILM_FILES: Final = frozenset({"FilmPlan", "plan_until"})
_FRAMES: Final = frozenset({"FramePainter"})
_GAS: Final = frozenset({"facades", "full_load", "gauge_history"})
_GROUND_MAP: Final = frozenset(
    {"ground_recorders", "ground_values", "open_distance_m", "threshold_map"}
)
_HEAT_MAP: Final = frozenset({"LoadScale"})
_PLACING: Final = frozenset({"PlacingPainter", "sources_text"})
_PRESSURE_FILM: Final = frozenset({"record_planes", "scale_end_kpa"})
_PRESSURE_FRAMES: Final = frozenset(
    {"PressurePainter", "PressureShot", "VerticalSection", "default_section"}
)
_PRESSURE_IMPULSE: Final = frozenset({"level_bounds", "pressure_impulse_diagram"})
_SITE_PLAN: Final = frozenset({"draw_outlines", "outline_path"})
_STYLE: Final = frozenset({"AIR", "nice_ceiling", "short_number", "shown_until_s"})
_WINDOW: Final = frozenset({"Window"})


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _CALIBRATION_FIGURES:
        from blast_env.plots import calibration_figures

        return getattr(calibration_figures, name)
    if name in _CANVAS:
        from blast_env.plots import canvas

        return getattr(canvas, name)
    if name in _COST_LEVEL:
        from blast_env.plots import cost_level

        return getattr(cost_level, name)
    if name in _EVALUATION_FIGURES:
        from blast_env.plots import evaluation_figures

        return getattr(evaluation_figures, name)
    if name in _FACADE:
        from blast_env.plots import facade

        return getattr(facade, name)
    if name in _FIGURES:
        from blast_env.plots import figures

        return getattr(figures, name)
    if name in _FILM:
        from blast_env.plots import film

        return getattr(film, name)
    if name in _FILM_FILES:
        from blast_env.plots import film_files

        return getattr(film_files, name)
    if name in _FRAMES:
        from blast_env.plots import frames

        return getattr(frames, name)
    if name in _GAS:
        from blast_env.plots import gas

        return getattr(gas, name)
    if name in _GROUND_MAP:
        from blast_env.plots import ground_map

        return getattr(ground_map, name)
    if name in _HEAT_MAP:
        from blast_env.plots import heat_map

        return getattr(heat_map, name)
    if name in _PLACING:
        from blast_env.plots import placing

        return getattr(placing, name)
    if name in _PRESSURE_FILM:
        from blast_env.plots import pressure_film

        return getattr(pressure_film, name)
    if name in _PRESSURE_FRAMES:
        from blast_env.plots import pressure_frames

        return getattr(pressure_frames, name)
    if name in _PRESSURE_IMPULSE:
        from blast_env.plots import pressure_impulse

        return getattr(pressure_impulse, name)
    if name in _SITE_PLAN:
        from blast_env.plots import site_plan

        return getattr(site_plan, name)
    if name in _STYLE:
        from blast_env.plots import style

        return getattr(style, name)
    if name in _WINDOW:
        from blast_env.plots import window

        return getattr(window, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
