"""The picture of a map in which a building is chosen."""

from pathlib import Path

import pytest
import shapely

from blast_env.app.plan import SketchView
from blast_env.errors import BlastEnvError
from blast_env.io.importing import ImportOptions, import_site, sketch_of
from tests.io.importing.maps import BLOCK, charge, written


def test_a_click_on_a_building_protects_it() -> None:
    sketch = sketch_of(BLOCK, ImportOptions())
    view = SketchView(sketch)
    assert view.svg(None).count("Z") == len(sketch.outlines) > 5
    width_px, height_px = view.size_px
    assert max(width_px, height_px) == 500
    for outline in sketch.outlines[1:3]:
        middle = shapely.Polygon(outline).representative_point()
        x_px, y_px = view._pixel((middle.x, middle.y))
        assert 0 <= x_px <= width_px
        assert 0 <= y_px <= height_px
        place = view.place(round(x_px), round(y_px))
        site = import_site(BLOCK, ImportOptions(protect_near=place, size_m=(80, 80), centre=place))
        (chosen,) = (building for building in site.buildings if building.protected)
        assert chosen.outline.contains(shapely.Point(40.0, 40.0).buffer(1.0))


def test_a_map_has_the_proportions_of_the_ground() -> None:
    """At 54.8 degrees a degree of longitude is 0.58 times as long as one of latitude."""
    assert sketch_of(BLOCK, ImportOptions()).stretch == pytest.approx(0.576, abs=0.002)


def test_a_map_without_a_building_says_so(tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match="has no building; define them with --buildings-from"):
        sketch_of(written(tmp_path, charge(1.0, 2.0)), ImportOptions())
