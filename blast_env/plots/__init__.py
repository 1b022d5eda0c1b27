"""Pictures of blasts: frames, a window, films and figures; needs the extra `render`."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.plots.calibration_figures import calibration_figure
    from blast_env.plots.canvas import Frame
    from blast_env.plots.cost_level import DamagePrice, cheapest
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
    from blast_env.plots.labels import Label, labels_of, settled_labels
    from blast_env.plots.placing import PlacingPainter, sources_text
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
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "AIR",
    "BARRIER",
    "EXPLOSIVE",
    "FREE_CELL",
    "LEVEL_COLOURS",
    "PROTECTED",
    "SITE_KINDS",
    "STRUCTURE",
    "DamagePrice",
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
