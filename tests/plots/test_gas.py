"""Pictures of gas dynamics show the numbers of their results, with units, on one scale."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image

from blast_env import Charge
from blast_env.curves import kingery_bulmash
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.gas import GroundMap
from blast_env.plots import (
    PressurePainter,
    PressureShot,
    VerticalSection,
    default_section,
    facades,
    full_load,
    gauge_history,
    ground_recorders,
    ground_values,
    plan_until,
    record_planes,
    scale_end_kpa,
    write_film,
)
from blast_env.plots.ground_map import ground_map
from blast_env.site import Scenario
from tests.gas_sites import WALL, hut

HEIGHT_M, CUT = 0.75, VerticalSection("y", 4.25)


@pytest.fixture(scope="module")
def blast() -> GasBlast:
    return GasBlast(hut(), (), engine=GasEngine(margin_m=1.0))


@pytest.fixture(scope="module")
def barrier_blast(blast: GasBlast) -> GasBlast:
    return replace(blast, layout=WALL)


@pytest.fixture(scope="module")
def unprotected(blast: GasBlast) -> GasResult:
    return blast.run(recorders=ground_recorders)


@pytest.fixture(scope="module")
def protected(barrier_blast: GasBlast) -> GasResult:
    return barrier_blast.run(recorders=ground_recorders)


@pytest.fixture(scope="module")
def shots(blast: GasBlast, barrier_blast: GasBlast) -> list[PressureShot]:
    return [record_planes(case, CUT, height_m=HEIGHT_M) for case in (blast, barrier_blast)]


def images_of(figure: Figure) -> list[AxesImage]:
    return [image for axes in figure.axes for image in axes.get_images()]


def values_of(image: AxesImage) -> np.ndarray:
    values = image.get_array()
    assert isinstance(values, np.ma.MaskedArray)
    return values.filled(np.nan)


def bar_of(figure: Figure) -> Axes:
    return figure.axes[-1]


def assert_all_is_on_the_page(figure: Figure) -> None:
    figure.draw_without_rendering()
    page = figure.bbox
    boxes = [figure.get_tightbbox().transformed(figure.dpi_scale_trans)]
    boxes += [text.get_window_extent() for axes in figure.axes for text in axes.texts]
    for box in boxes:
        assert box.x0 >= page.x0 - 1.0
        assert box.y0 >= page.y0 - 1.0
        assert box.x1 <= page.x1 + 1.0
        assert box.y1 <= page.y1 + 1.0


# The ground.


def test_the_ground_has_what_gauges_have(unprotected: GasResult) -> None:
    """Also where the front passed before the grid took over."""
    for name in ("front", "behind"):
        row = unprotected.gauges.set_index("name").loc[name]
        (x_m, y_m, z_m) = (float(row[f"{axis}_m"]) for axis in "xyz")  # type: ignore[arg-type]
        x, y, _ = unprotected.run.grid.cell_at((x_m, y_m, z_m))
        impulse = ground_values(unprotected, "impulse")[x, y]
        assert impulse == pytest.approx(row["impulse_pa_s"], rel=0.05)
        assert ground_values(unprotected, "peak")[x, y] == pytest.approx(row["peak_pa"], rel=0.03)


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize(
    ("quantity", "factor", "label"),
    [("peak", 1e-3, "peak overpressure (kPa)"), ("impulse", 1.0, "peak specific impulse (Pa·s)")],
)
def test_maps_show_the_ground_of_the_site_on_one_scale(
    unprotected: GasResult, protected: GasResult, quantity: Any, factor: float, label: str
) -> None:
    figure = ground_map(protected, quantity, beside=unprotected)
    left, right = images_of(figure)
    for image, result in ((left, unprotected), (right, protected)):
        values = ground_values(result, quantity)[2:-2, 2:-2]  # the margin
        np.testing.assert_allclose(values_of(image), factor * values.T)
    assert left.norm is right.norm
    assert bar_of(figure).get_ylabel() == label
    assert [axes.get_title() for axes in figure.axes[:2]] == ["no barrier", "barrier of 6 modules"]
    assert figure.axes[0].get_xlabel() == "x (m)"
    assert figure.axes[0].get_ylabel() == "y (m)"
    assert_all_is_on_the_page(figure)


def test_walls_of_their_own_can_have_the_scale_of_another(
    unprotected: GasResult, protected: GasResult
) -> None:
    full = full_load(unprotected, "hut", "impulse")
    for result in (unprotected, protected):
        images = images_of(facades(result, "hut", "impulse", full=full))
        assert {image.get_clim() for image in images} == {(0.0, full)}
    loads = np.concatenate(
        [values_of(image).ravel() for image in images_of(facades(unprotected, "hut"))]
    )
    loads = loads[np.isfinite(loads)]
    assert np.mean(loads > full) <= 0.01  # the cells before the charge alone
    assert full <= 1.3 * loads.max()


@pytest.mark.usefixtures("laid_out")
def test_a_map_names_what_stands_and_numbers_contours(protected: GasResult) -> None:
    figure = ground_map(protected, "impulse")
    words = {text.get_text() for text in figure.axes[0].texts}
    assert "hut\n2 m" in words
    assert words & {"50", "70", "100", "150", "200"}
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"charge", "protected structure", "build zone"} <= set(labels)
    assert any(label.startswith("barrier module, ") for label in labels)
    assert_all_is_on_the_page(figure)


def test_a_map_needs_its_recorder(blast: GasBlast, protected: GasResult) -> None:
    run = replace(blast, engine=GasEngine(margin_m=1.0, until=1e-3)).run()
    with pytest.raises(BlastEnvError, match="recorders=ground_recorders"):
        ground_map(run)
    assert any(isinstance(recorder, GroundMap) for recorder in protected.run.solver.recorders)
    with pytest.raises(UnknownNameError, match="did you mean 'peak'"):
        ground_map(protected, "peek")


def test_only_the_same_charge_can_stand_beside(unprotected: GasResult) -> None:
    other = replace(unprotected, blast=replace(unprotected.blast, charge=Charge((2.0, 5.0), 5.0)))
    for draw in (ground_map, facades):
        with pytest.raises(BlastEnvError, match="different charges"):
            draw(unprotected, beside=other)


# Facades.


@pytest.mark.usefixtures("laid_out")
def test_walls_show_the_loads_on_their_faces(protected: GasResult) -> None:
    figure = facades(protected, "hut", "peak")
    images = images_of(figure)
    for image, wall in zip(images, ("west", "south", "east", "north"), strict=True):
        faces = protected.faces
        own = faces[(faces["structure"] == "hut") & (faces["face"] == wall)]
        along = "y_m" if wall in ("west", "east") else "x_m"
        expected = own.pivot_table(index="z_m", columns=along, values="peak_pa").to_numpy()
        np.testing.assert_allclose(values_of(image), expected / 1000.0)
        assert f"largest {expected.max() / 1000.0:.3g} kPa" in image.axes.get_title()
    assert bar_of(figure).get_ylabel() == "peak overpressure (kPa)"
    assert figure.axes[0].get_ylabel() == "z (m)"
    assert_all_is_on_the_page(figure)


def test_a_building_of_two_parts_is_unfolded_as_one(
    blast: GasBlast, unprotected: GasResult
) -> None:
    """The same walls in the same place, on which the same gas arrives."""
    document = blast.scenario.model_dump(exclude_none=True)
    (whole,) = document["structures"]
    part = {**whole, "rows": whole["rows"] // 2, "building": whole["name"]}
    left, bottom = whole["corner_m"]
    north = {**part, "name": "north_half", "corner_m": (left, bottom + 0.5 * part["rows"])}
    document["structures"] = [{**part, "name": "south_half"}, north]
    halves = replace(blast, scenario=Scenario.from_document(document, "halves")).run()
    for images in zip(*(map(images_of, map(facades, (unprotected, halves)))), strict=True):
        one, two = map(values_of, images)
        np.testing.assert_array_equal(one, two)
    words = {facades(case).get_suptitle() for case in (unprotected, halves)}
    assert all("walls of hut" in text for text in words)
    assert len(values_of(images_of(facades(halves, "north_half"))[0])[0]) == part["rows"]


@pytest.mark.usefixtures("laid_out")
def test_walls_with_and_without_a_barrier_have_one_scale(
    unprotected: GasResult, protected: GasResult
) -> None:
    figure = facades(protected, beside=unprotected)
    images = images_of(figure)
    assert len(images) == 8
    assert len({id(image.norm) for image in images}) == 1
    largest = max(float(np.nanmax(values_of(image))) for image in images)
    full = images[0].get_clim()[1]
    assert full is not None
    assert largest <= full <= 1.3 * largest
    ratio = values_of(images[4]).mean() / values_of(images[0]).mean()  # on the west wall
    title = figure.axes[4].get_title().replace("\N{MINUS SIGN}", "-")
    assert f"({100.0 * (ratio - 1.0):+.0f} %)" in title
    assert "Pa·s" in title
    assert figure.axes[0].get_ylabel() == "no barrier\nz (m)"
    assert figure.axes[4].get_ylabel() == "barrier of 6 modules\nz (m)"
    assert_all_is_on_the_page(figure)


def test_a_wall_that_does_not_count_says_so(unprotected: GasResult) -> None:
    section = {**hut().model_dump()["structures"][0], "faces": ["west"]}
    scenario = hut(structures=[section])
    short = GasEngine(margin_m=1.0, until=1e-3)
    figure = facades(GasBlast(scenario, engine=short).run())
    marked = ["does not count" in axes.get_title() for axes in figure.axes[:4]]
    assert marked == [False, True, True, True]
    with pytest.raises(UnknownNameError, match="did you mean 'hut'"):
        facades(unprotected, "hat")


# Gauges.


@pytest.mark.usefixtures("laid_out")
def test_a_history_ends_at_the_impulse_of_its_gauge(
    unprotected: GasResult, protected: GasResult
) -> None:
    figure = gauge_history(protected, "behind", beside=unprotected)
    upper, lower = figure.axes
    assert upper.get_ylabel() == "overpressure (kPa)"
    assert lower.get_ylabel() == "impulse up to then (Pa·s)"
    assert lower.get_xlabel() == "time since the detonation (ms)"
    for k, result in enumerate((unprotected, protected)):
        row = result.gauges.set_index("name").loc["behind"]
        pressure = np.asarray(upper.lines[k].get_ydata())
        impulse = np.asarray(lower.lines[k].get_ydata())
        assert 1000.0 * pressure.max() == pytest.approx(row["peak_pa"])
        assert impulse.max() == pytest.approx(row["impulse_pa_s"], rel=1e-6)
    assert_all_is_on_the_page(figure)


def test_the_free_field_is_kingery_bulmashs_at_the_gauges_distance(unprotected: GasResult) -> None:
    figure = gauge_history(unprotected, "front", free_field=True)
    distance_m = np.sqrt(3.75**2 + 2 * 0.25**2)
    peak_kpa = np.asarray(figure.axes[0].lines[1].get_ydata()).max()
    impulse = np.asarray(figure.axes[1].lines[1].get_ydata())[-1]
    assert 1000.0 * peak_kpa == pytest.approx(
        kingery_bulmash("incident_overpressure", distance_m, 5.0), rel=1e-3
    )
    assert impulse == pytest.approx(kingery_bulmash("incident_impulse", distance_m, 5.0))
    legend = figure.axes[0].get_legend()
    assert legend is not None
    words = legend.get_texts()[1].get_text()
    assert words.startswith("Kingery-Bulmash, free field, incident at 3.8 m: peak ")
    with pytest.raises(UnknownNameError, match="did you mean 'front'"):
        gauge_history(unprotected, "frost")


# Films.


def test_pictures_are_those_of_the_gas(shots: list[PressureShot]) -> None:
    shot = shots[1]
    frame = shot.planes[0].frames[3]
    np.testing.assert_array_equal(shot.at(frame.time_s, 0), frame.overpressure_pa)
    assert shot.at(0.5 * shot.opening.end_s, 0) is None
    assert (shot.layer_m(0), shot.layer_m(1)) == (HEIGHT_M, 4.25)


@pytest.mark.usefixtures("laid_out")
def test_frames_show_front_wall_and_time(shots: list[PressureShot]) -> None:
    painter = PressurePainter(shots, 200.0, 960)
    start, later = (painter.paint(time_s, "slow").astype(int) for time_s in (0.0, 0.006))
    assert start.shape == later.shape
    assert start.shape[1] == 960
    assert start.shape[0] % 2 == 0
    colours = []
    for axes in (painter.sheet.figure.axes[0], painter.sheet.figure.axes[2]):  # the plans
        x, y = axes.transData.transform((4.25, 3.25))  # a module of the wall
        colours.append(later[start.shape[0] - 1 - round(y), round(x)])
        assert axes.get_title(loc="left") == "plan at z = 0.75 m"
    assert colours[1].max() < 40  # black
    assert colours[0].max() > 100
    assert np.abs(later - start)[:40, 700:].max() > 100  # the clock
    assert painter.sheet.figure.texts[-3].get_text() == "6.0 ms"
    assert_all_is_on_the_page(painter.sheet.figure)


def test_the_blast_goes_out_from_the_charge(shots: list[PressureShot]) -> None:
    """Also before the grid has taken over."""
    painter = PressurePainter(shots[:1], 200.0, 480)
    end_s = shots[0].opening.end_s
    frames = [painter.paint(share * end_s).astype(int) for share in (0.1, 0.5, 1.0, 1.5)]
    red = [(frame[..., 0] - frame[..., 2] > 60).sum() for frame in frames]
    assert all(before < after for before, after in pairwise(red))


@pytest.mark.parametrize(("x_m", "most_share"), [(2.0, 1.5), (5.5, 0.5)])
def test_the_scale_of_a_film_shows_most_of_the_facade(x_m: float, most_share: float) -> None:
    """A few cells beside a near charge have many times the peak of the others."""
    blast = GasBlast(hut(), charge=Charge((x_m, 4.0), 5.0), engine=GasEngine(until=0.02))
    result = blast.run()
    peaks_kpa = result.faces["peak_pa"].to_numpy() / 1000.0
    end_kpa = scale_end_kpa([result])
    assert np.median(peaks_kpa) < end_kpa < most_share * peaks_kpa.max()


def test_the_section_points_to_what_is_protected(blast: GasBlast) -> None:
    assert default_section(blast.site) == VerticalSection("y", 4.0)
    north = replace(blast, scenario=hut(), charge=Charge((7.0, 1.0), 5.0))
    assert default_section(north.site) == VerticalSection("x", 7.0)
    with pytest.raises(UnknownNameError, match="'z'"):
        VerticalSection("z", 1.0)  # type: ignore[arg-type]


@pytest.fixture
def short(blast: GasBlast) -> tuple[GasBlast, GasBlast]:
    """Blasts that end soon after the grid has taken over."""
    engine = GasEngine(margin_m=1.0, until=8e-3)
    return replace(blast, engine=engine), replace(blast, engine=engine, layout=WALL)


def test_a_film_has_the_planned_frames(short: tuple[GasBlast, GasBlast], tmp_path: Path) -> None:
    shares: list[float] = []
    results = write_film(
        short[1],
        tmp_path / "film.gif",
        beside=short[0],
        section=VerticalSection("x", 4.25),
        frames_per_s=10.0,
        slow_motion=100.0,
        width_px=640,
        progress=shares.append,
    )
    assert [len(result.blast.layout) for result in results] == [0, 6]
    assert results[1].digest == short[1].run().digest
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]
    plan = plan_until(max(result.time_s for result in results), 10.0, 100.0)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == plan.frame_count  # type: ignore[attr-defined]
        assert film.size[0] == 640
        assert b"1/100 of real time" in film.info["comment"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width_px": 100}, "width_px is 100, must be 480"),
        ({"section": VerticalSection("y", 90.0)}, "y = 90.0 m is outside the grid"),
        ({"path": "film.avi"}, "suffix '.avi'"),
    ],
)
def test_what_is_no_film_is_refused(
    blast: GasBlast, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    options: dict[str, Any] = {"path": "film.mp4", **changes}
    path = tmp_path / options.pop("path")
    with pytest.raises(BlastEnvError, match=words):
        write_film(blast, path, **options)
    assert list(tmp_path.iterdir()) == []
