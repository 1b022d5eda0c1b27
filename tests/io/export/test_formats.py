"""glTF, IFC, VTK and CSV of layouts and blasts, read back by other readers."""

import json
import zlib
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import trimesh

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.io.export import (
    HISTORY_COLUMNS,
    LayoutPlan,
    blast_recorders,
    export_blast,
    export_layout,
    history_table,
)
from blast_env.io.importing import Fate, ImportOptions, import_site
from blast_env.layout import draw_threat
from blast_env.site import Charge, Scenario
from tests.builders import block, point, site
from tests.catalogue_sites import ITEMS, WALL, yard
from tests.gas_sites import WALL as MODULES
from tests.gas_sites import column, glazed_hut, hut, site_document
from tests.vehicle_sites import gate_site, vehicle_document

RATING = "V/7200[N2A]/64/90:1.2"


@cache
def blast(name: str = "glazed") -> GasResult:
    scenario = glazed_hut() if name == "glazed" else hut()
    engine = GasEngine(cell_m=0.5)
    made = engine.blast(scenario, MODULES, 0, draw_threat(scenario, 0))
    result: GasResult = made.run(lambda _: None, blast_recorders(Path("folder")))
    return result


def scene_of(path: Path) -> Any:
    """Return a scene by the reader of trimesh, its axes turned back: z upwards."""
    scene: Any = trimesh.load_scene(path)
    scene.apply_transform([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return scene


def bodies(path: Path) -> dict[str, Any]:
    scene = scene_of(path)
    names = scene.graph.nodes_geometry
    return {
        name: scene.geometry[scene.graph[name][1]].copy().apply_transform(scene.graph[name][0])
        for name in names
    }


# Layouts.


def test_a_scene_has_every_body_of_the_site_with_its_volume(tmp_path: Path) -> None:
    plan = LayoutPlan(yard(), WALL, Charge((2.0, 6.0), 5.0))
    found = bodies(export_layout(plan, tmp_path / "layout.glb"))
    volumes = {"hut": 3.0 * 3.0 * 2.5, "wall_x4.250_y5.750": 1.5 * 0.5 * 2.0}
    assert set(found) == {
        *("ground", "hut", "charge"),
        *("wall_x4.250_y5.750", "wall_x4.250_y7.250", "post_x4.250_y4.750"),
    }
    for name, volume_m3 in volumes.items():
        body = found[name]
        body.merge_vertices(merge_norm=True, merge_tex=True)
        assert body.is_watertight
        assert body.volume == pytest.approx(volume_m3, rel=1e-5)  # above 0: seen from outside
    assert np.allclose(found["hut"].bounds, [[7.5, 4.5, 0.0], [10.5, 7.5, 2.5]], atol=1e-5)


def test_a_body_of_a_polygon_has_its_walls(tmp_path: Path) -> None:
    document = site_document()
    ring = [[6.0, 2.0], [9.0, 2.0], [9.5, 5.0], [6.5, 6.0]]
    yard_ring = [[7.0, 3.0], [8.0, 3.0], [8.0, 4.0], [7.0, 4.0]]
    document["structures"] = [
        {
            "kind": "polygon",
            "name": "hall",
            "outline_m": ring,
            "courtyards_m": [yard_ring],
            "height_m": 3.0,
            "protected": True,
        },
        column("post", 5.25, 7.25, 0.7) | {"height_m": 2.0},
    ]
    scenario = Scenario.from_document(document, "hall")
    found = bodies(export_layout(LayoutPlan(scenario, ()), tmp_path / "hall.glb"))
    hall = found["hall"]
    hall.merge_vertices(merge_norm=True, merge_tex=True)
    area_m2 = 0.5 * abs(
        sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, [*ring[1:], ring[0]], strict=True))
    )
    assert hall.is_watertight
    assert hall.volume == pytest.approx(3.0 * (area_m2 - 1.0), rel=1e-5)


def test_barriers_in_ifc_are_imported_as_the_same_boxes(tmp_path: Path) -> None:
    pytest.importorskip("ifcopenshell")
    rated = [ITEMS[0] | {"crash_rating": RATING, "mass_kg": 2500.0}, *ITEMS[1:]]
    plan = LayoutPlan(yard(items=rated), WALL)
    path = export_layout(plan, tmp_path / "layout.ifc")
    options = ImportOptions(
        protect=("hut",), charge_at=((2.0, 6.0),), rotation_deg=0.0, least_area_m2=0.25
    )
    site = import_site(path, options)
    corner_m = site.site.to_site(np.array([(0.0, 0.0)]))[0]
    found = {}
    for building in site.buildings:
        bounds = np.array(building.outline.bounds).reshape(2, 2) - corner_m
        found[building.title] = (
            *bounds.round(3).ravel().tolist(),
            building.base_m,
            building.height_m,
        )
    assert found == {
        "hut": (7.5, 4.5, 10.5, 7.5, 0.0, 2.5),
        "wall_x4.250_y5.750": (4.0, 5.0, 4.5, 6.5, 0.0, 2.0),
        "wall_x4.250_y7.250": (4.0, 6.5, 4.5, 8.0, 0.0, 2.0),
        "post_x4.250_y4.750": (4.0, 4.5, 4.5, 5.0, 0.0, 1.0),
    }


def test_structures_in_ifc_come_back_as_they_are_low_ones_and_terraces_too(tmp_path: Path) -> None:
    pytest.importorskip("ifcopenshell")
    structures = (
        block("podium", 6.0, 2.0, 16, 14, height_m=1.0, carries=True),
        block("hall", 8.5, 3.5, 10, 8, base_m=1.0, height_m=4.0, protected=True),
        block("planter", 16.0, 5.0, 4, 4, height_m=1.0),
        block("tower", 20.0, 5.0, 8, 8, height_m=6.0, building="B"),
        block("wing", 24.0, 5.0, 8, 4, height_m=5.0, building="B"),
        block("canopy", 18.0, 12.0, 4, 6, base_m=3.0, height_m=3.5),
    )
    scenario = site("mixed", (30.0, 20.0, 8.0), point(2.0, 6.0, 5.0), *structures)
    path = export_layout(LayoutPlan(scenario, ()), tmp_path / "mixed.ifc")
    found = import_site(path, ImportOptions(charge_at=((2.0, 6.0),))).scenario.structures
    named = {structure.name: structure for structure in found}
    moved_m = np.subtract(named["hall"].rectangle_m, (8.5, 3.5, 12.5, 8.5))
    for own in scenario.structures:
        back = named[own.name]
        assert np.subtract(back.rectangle_m, own.rectangle_m).tolist() == moved_m.tolist()
        assert (back.base_m, back.height_m) == (own.base_m, own.height_m)
        assert (back.carries, back.protected) == (own.carries, own.protected)
    assert named["tower"].building_name == named["wing"].building_name


@pytest.mark.parametrize("suffix", [".geojson", ".dxf", ".ifc"])
def test_raised_structures_and_protected_terraces_come_back(suffix: str, tmp_path: Path) -> None:
    if suffix == ".ifc":
        pytest.importorskip("ifcopenshell")
    structures = (
        block("podium", 6.0, 2.0, 16, 14, height_m=1.0, carries=True, protected=True),
        block("hall", 8.5, 3.5, 10, 8, base_m=1.0, height_m=4.0),
        block("bridge", 16.0, 12.0, 8, 8, base_m=6.0, height_m=9.0),
    )
    scenario = site("raised", (30.0, 20.0, 12.0), point(2.0, 6.0, 5.0), *structures)
    path = export_layout(LayoutPlan(scenario, ()), tmp_path / f"raised{suffix}")
    found = import_site(path, ImportOptions(charge_at=((2.0, 6.0),))).scenario.structures
    heights = {(own.modules, own.base_m, own.height_m, own.carries, own.protected) for own in found}
    assert heights == {
        (224, 0.0, 1.0, True, True),
        (80, 1.0, 4.0, False, False),
        (64, 6.0, 9.0, False, False),
    }


@pytest.mark.parametrize("suffix", [".geojson", ".dxf"])
def test_walls_that_count_and_weights_are_named_where_they_are_lost(
    suffix: str, tmp_path: Path
) -> None:
    front = block("front", 6.0, 2.0, 8, 8, height_m=3.0, protected=True, faces=["west"], weight=2.0)
    plain = block("plain", 16.0, 2.0, 8, 8, height_m=3.0, protected=True)
    scenario = site("fronts", (30.0, 20.0, 8.0), point(2.0, 6.0, 5.0), front, plain)
    path = export_layout(LayoutPlan(scenario, ()), tmp_path / f"fronts{suffix}")
    guesses = import_site(path).ledger.of(Fate.GUESSED)
    walls, weight = (
        [own.detail for own in guesses if words in own.kind] for words in ("all walls", "weights")
    )
    assert (walls, weight) == (["only 'west' counted"], ["2"])


@pytest.mark.parametrize("suffix", [".geojson", ".dxf"])
def test_an_exported_vehicle_is_named_where_it_is_not_imported(suffix: str, tmp_path: Path) -> None:
    other = gate_site(charge=[vehicle_document(), point(7.0, 1.0, 5.0)])
    path = export_layout(LayoutPlan(other, ()), tmp_path / f"gate{suffix}")
    found = import_site(path)
    assert len(found.scenario.charge) == 1
    (entry,) = (own for own in found.ledger.of(Fate.LEFT_OUT) if "vehicle" in own.kind)
    assert entry.kind.startswith("entries of vehicles, which an import does not make")
    export_layout(LayoutPlan(gate_site(), ()), path)
    with pytest.raises(BlastEnvError, match="entries of vehicles"):
        import_site(path)


def test_barriers_in_ifc_have_mass_rating_and_cost(tmp_path: Path) -> None:
    ifcopenshell = pytest.importorskip("ifcopenshell")
    from ifcopenshell.util.element import get_psets

    rated = [ITEMS[0] | {"crash_rating": RATING, "mass_kg": 2500.0}, *ITEMS[1:]]
    plan = LayoutPlan(yard(items=rated), WALL)
    path = export_layout(plan, tmp_path / "layout.ifc")
    model = ifcopenshell.open(str(path))
    sets = {
        element.Name: own["BlastEnv_Barrier"] | {"class": element.is_a()}
        for element in model.by_type("IfcElement")
        if "BlastEnv_Barrier" in (own := get_psets(element))
    }
    wall, post = sets["wall_x4.250_y5.750"], sets["post_x4.250_y4.750"]
    assert (wall["Item"], wall["Cost"], wall["MassKg"]) == ("wall", 6.0, 2500.0)
    assert (wall["CrashRating"], wall["CrashSpeedKmH"]) == (RATING, 64.0)
    assert (wall["class"], post["class"]) == ("IfcWall", "IfcBuildingElementProxy")
    assert wall["MassIsStated"] is True
    assert post["MassIsStated"] is False
    assert "CrashRating" not in post
    again = export_layout(plan, tmp_path / "again.ifc")
    same = [text.read_text().split("DATA;")[1] for text in (path, again)]
    assert same[0] == same[1]


def test_modules_in_ifc_are_blocks_of_concrete(tmp_path: Path) -> None:
    ifcopenshell = pytest.importorskip("ifcopenshell")
    from ifcopenshell.util.element import get_psets

    path = export_layout(LayoutPlan(hut(), MODULES), tmp_path / "modules.ifc")
    model = ifcopenshell.open(str(path))
    blocks = model.by_type("IfcBuildingElementProxy")
    assert len(blocks) == len(MODULES)
    own = get_psets(blocks[0])["BlastEnv_Barrier"]
    assert own["MassKg"] == pytest.approx(2400.0 * 0.5 * 0.5 * 1.5)
    assert own["MassIsStated"] is False


# Blasts.


def test_bays_have_the_colour_of_their_impulse(tmp_path: Path) -> None:
    result = blast()
    path = tmp_path / "blast.glb"
    assert export_blast(result, path) == [path]
    length = int.from_bytes(path.read_bytes()[12:16], "little")
    document = json.loads(path.read_bytes()[20 : 20 + length])
    legend = document["scenes"][0]["extras"]["legend"]
    nodes = {node["name"]: node.get("extras", {}) for node in document["nodes"]}
    impulses = dict(zip(result.bays["bay"], result.bays["impulse_pa_s"], strict=True))
    assert len(impulses) > 3
    assert legend["high"] >= max(impulses.values())
    shown_bodies: Any = trimesh.load_scene(path).geometry
    found = bodies(path)
    areas = dict(zip(result.bays["bay"], result.bays["area_m2"], strict=True))
    stops = np.array(legend["colours"]) / 255.0
    for name, impulse_pa_s in impulses.items():
        assert nodes[name]["impulse_pa_s"] == pytest.approx(impulse_pa_s)
        assert found[name].area == pytest.approx(areas[name], rel=1e-5)
        share = impulse_pa_s / legend["high"] * (len(stops) - 1)
        shown = [np.interp(share, range(len(stops)), stops[:, k]) for k in range(3)]
        light = np.where(
            np.array(shown) <= 0.04045,
            np.array(shown) / 12.92,
            ((np.array(shown) + 0.055) / 1.055) ** 2.4,
        )
        colours = shown_bodies[name].visual.vertex_attributes["color"]
        assert np.allclose(colours[:, :3], 255.0 * light, atol=1.0)
    hut_m = found["hut"].bounds
    for name in impulses:  # just outside of the wall, and turned away from it
        middle = found[name].triangles_center.mean(axis=0)
        outward = found[name].face_normals[0]
        inside = middle - 0.05 * outward
        assert ((hut_m[0] <= inside) & (inside <= hut_m[1])).all()
        assert not ((hut_m[0] <= middle) & (middle <= hut_m[1])).all()


def test_histories_end_with_the_loads_of_the_tables(tmp_path: Path) -> None:
    result = blast()
    (path,) = export_blast(result, tmp_path / "histories.csv")
    table = pd.read_csv(path)
    assert list(table.columns) == [column.name for column in HISTORY_COLUMNS]
    largest = table.groupby(["kind", "name"])["impulse_pa_s"].max()
    peaks = table.groupby(["kind", "name"])["overpressure_pa"].max()
    for bay, impulse_pa_s, peak_pa in result.bays[["bay", "impulse_pa_s", "peak_pa"]].itertuples(
        index=False
    ):
        assert largest["bay", bay] == pytest.approx(impulse_pa_s, rel=1e-4)
        assert peaks["bay", bay] == pytest.approx(peak_pa, rel=1e-4)
    gauges = result.gauges.set_index("name")
    for name in ("front", "behind"):
        assert peaks["gauge", name] == pytest.approx(gauges.loc[name, "peak_pa"], rel=1e-4)
    assert set(table["kind"]) <= {"bay", "gauge", "piece"}
    assert len(history_table(blast("plain"))) > 0


def image_of(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the attributes of an image and its arrays (nx, ny, nz), by the description of VTK."""
    head, _, rest = path.read_bytes().partition(b'<AppendedData encoding="raw">\n_')
    root = ElementTree.fromstring(head + b"</VTKFile>")
    image = root.find("ImageData")
    assert image is not None
    shape = [int(end) for end in image.attrib["WholeExtent"].split()[1::2]]
    arrays = {}
    for array in image.iter("DataArray"):
        start = int(array.attrib["offset"])
        kind = {"Float32": "f4", "UInt8": "u1"}[array.attrib["type"]]
        blocks, size, part, packed = np.frombuffer(rest[start : start + 32], "<u8").tolist()
        assert (blocks, part) == (1, 0)
        content = zlib.decompress(rest[start + 32 : start + 32 + packed])
        assert len(content) == size
        values = np.frombuffer(content, kind)
        arrays[array.attrib["Name"]] = values.reshape(shape, order="F")
    return dict(image.attrib), arrays


def test_a_field_has_the_peaks_of_the_gauges(tmp_path: Path) -> None:
    result = blast()
    (path,) = export_blast(result, tmp_path / "field.vti")
    image, arrays = image_of(path)
    origin, spacing = (
        np.array([float(value) for value in image[key].split()]) for key in ("Origin", "Spacing")
    )
    for gauge in result.gauges.itertuples():
        place = np.array([gauge.x_m, gauge.y_m, gauge.z_m])
        cell = tuple(np.floor((place - origin) / spacing).astype(int))
        assert arrays["is_solid"][cell] == 0
        assert arrays["peak_overpressure_pa"][cell] == pytest.approx(gauge.peak_pa, rel=1e-4)
        assert arrays["impulse_pa_s"][cell] == pytest.approx(gauge.impulse_pa_s, rel=0.02)
    centre = tuple(np.floor((np.array([7.0, 4.0, 1.0]) - origin) / spacing).astype(int))
    assert arrays["is_solid"][centre] == 1
    assert arrays["peak_overpressure_pa"][centre] == 0.0


def test_a_field_is_read_by_vtk(tmp_path: Path) -> None:
    reader = pytest.importorskip("vtkmodules.vtkIOXML", reason="the wheel of VTK has 100 MB")
    (path,) = export_blast(blast(), tmp_path / "field.vti")
    _, arrays = image_of(path)
    xml = reader.vtkXMLImageDataReader()
    xml.SetFileName(str(path))
    xml.Update()
    image = xml.GetOutput()
    shape = arrays["is_solid"].shape
    assert image.GetDimensions() == tuple(count + 1 for count in shape)
    data = image.GetCellData().GetArray("peak_overpressure_pa")
    number = int(np.argmax(arrays["peak_overpressure_pa"].ravel(order="F")))
    assert data.GetValue(number) == pytest.approx(arrays["peak_overpressure_pa"].max())


def series(tmp_path: Path, most_times: int) -> tuple[GasResult, list[tuple[float, Path]]]:
    """Return a blast, and the times and files of its series."""
    path = tmp_path / "field.pvd"
    made = GasEngine(cell_m=0.5).blast(hut(), MODULES, 0, draw_threat(hut(), 0))
    result: GasResult = made.run(lambda _: None, blast_recorders(path, most_times))
    assert export_blast(result, path) == [path]
    entries = ElementTree.parse(path).getroot().iter("DataSet")
    found = [(entry.attrib["timestep"], entry.attrib["file"]) for entry in entries]
    return result, [(float(time), tmp_path / name) for time, name in found]


def test_a_series_has_the_histories_of_the_gauges(tmp_path: Path) -> None:
    """At each of its times, which are about equally far apart, until the end."""
    result, found = series(tmp_path, 12)
    times_s = np.array([time_s for time_s, _ in found])
    assert 6 <= len(times_s) <= 12
    steps_s = np.diff(times_s)
    assert 0.5 * steps_s.mean() < steps_s.min() <= steps_s.max() < 1.5 * steps_s.mean()
    assert times_s[-1] > result.run.time_s - 1.5 * steps_s.mean()
    for time_s, path in found:
        image, arrays = image_of(path)
        assert set(arrays) == {"overpressure_pa", "is_solid"}
        origin, spacing = (np.array(image[key].split(), float) for key in ("Origin", "Spacing"))
        for gauge in result.gauges.itertuples():
            place = np.array([gauge.x_m, gauge.y_m, gauge.z_m])
            cell = tuple(np.floor((place - origin) / spacing).astype(int))
            history = result.history(str(gauge.name))
            at = int(np.argmin(np.abs(history["time_s"] - time_s)))
            assert history["time_s"][at] == pytest.approx(time_s)
            expected_pa = history["overpressure_pa"][at]
            assert arrays["overpressure_pa"][cell] == pytest.approx(expected_pa, rel=1e-5, abs=0.1)
        assert (arrays["overpressure_pa"][arrays["is_solid"] == 1] == 0.0).all()


def test_a_series_has_a_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    from blast_env.io.export import fields

    scenario = hut()
    made = GasEngine(cell_m=0.5).blast(scenario, MODULES, 0, draw_threat(scenario, 0))
    monkeypatch.setattr(fields, "MOST_SERIES_BYTES", 1_000_000)
    for target, times, words in (
        ("a.pvd", 40, "must have at most 1,000,000: ask for fewer times or larger cells"),
        ("a.pvd", 1, "times is 1, must be an integer from 2 to 1000"),
        ("a.vti", 40, r"is for a series \(.pvd\): target is 'a.vti'"),
    ):
        with pytest.raises(BlastEnvError, match=words):
            made.run(lambda _: None, blast_recorders(Path(target), times))


def test_a_folder_gets_all_and_wrong_targets_are_named(tmp_path: Path) -> None:
    names = {path.name for path in export_blast(blast(), tmp_path / "out")}
    assert names == {"blast.glb", "histories.csv", "field.vti"}
    with pytest.raises(BlastEnvError, match=r"suffix is '.vtk', did you mean '.vti'\?"):
        export_blast(blast(), tmp_path / "a.vtk")
    engine = GasEngine(cell_m=0.5)
    bare = engine.blast(hut(), (), 0, draw_threat(hut(), 0)).run(lambda _: None)
    for name in ("field", "series"):
        suffix = {"field": ".vti", "series": ".pvd"}[name]
        with pytest.raises(BlastEnvError, match=f"has no {name}: run it with"):
            export_blast(bare, tmp_path / f"field{suffix}")
