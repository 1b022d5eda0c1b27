"""From longitude and latitude to metres and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from blast_env.errors import BlastEnvError
from blast_env.io.importing import LocalPlane, rotated, to_map
from blast_env.site import DrawingGeoreference, MapGeoreference

EARTH = Geod(ellps="WGS84")


@given(
    st.floats(-179.0, 179.0), st.floats(-80.0, 80.0), st.floats(-2000, 2000), st.floats(-2000, 2000)
)
def test_metres_are_those_of_the_earth(lon: float, lat: float, x: float, y: float) -> None:
    plane = LocalPlane.around("EPSG:4326", (lon, lat))
    (place,) = plane.to_source(np.array([[x, y]]))
    _, _, distance = EARTH.inv(lon, lat, *place)
    assert distance == pytest.approx(np.hypot(x, y), rel=1e-6, abs=1e-6)
    assert plane.to_metres(place[np.newaxis])[0] == pytest.approx([x, y], abs=1e-6)


def test_mercator_s_metres_are_not_taken_for_metres() -> None:
    """At 54.8 degrees they are 1.7 times too long."""
    to_mercator = Transformer.from_crs("EPSG:4326", "EPSG:3857", always_xy=True)
    here = to_mercator.transform(7.5, 54.8)
    plane = LocalPlane.around("EPSG:3857", here)
    beside = plane.to_metres(np.array([[here[0] + 100.0, here[1]]]))[0]
    assert beside[0] == pytest.approx(100.0 * np.cos(np.radians(54.8)), rel=0.005)


@given(st.floats(-180.0, 180.0), st.floats(-1500, 1500), st.floats(-1500, 1500))
@settings(max_examples=8)
def test_site_lies_where_its_georeference_says(angle: float, x: float, y: float) -> None:
    """Also a corner far from the place around which the map was measured: north turns a little."""
    plane = LocalPlane.around("EPSG:25832", _utm(7.5, 54.8))
    georeference = plane.georeference((x, y), angle)
    assert georeference.crs == "EPSG:25832"
    site = np.array([[0.0, 0.0], [80.0, 0.0], [80.0, 60.0]])
    expected = plane.to_source(rotated(site, angle) + [x, y])
    assert to_map(georeference, site) == pytest.approx(expected, abs=1e-3)


def test_rotation_counts_from_east_counterclockwise() -> None:
    georeference = MapGeoreference(longitude_deg=7.5, latitude_deg=54.8, rotation_deg=90.0)
    north = to_map(georeference, np.array([[50.0, 0.0]]))[0]
    assert north[0] == pytest.approx(7.5, abs=1e-9)
    assert north[1] > 54.8004


def test_drawing_goes_back_to_its_own_units() -> None:
    georeference = DrawingGeoreference(x_m=5.0, y_m=3.0, rotation_deg=90.0, metres_per_unit=0.001)
    assert to_map(georeference, np.array([[1.0, 0.0]]))[0] == pytest.approx([5000.0, 4000.0])


@pytest.mark.parametrize(
    ("crs", "place", "words"),
    [
        (
            "EPSG:4326",
            (565_000.0, 5_980_000.0),
            "is not on the Earth in 'EPSG:4326': say",
        ),
        ("EPSG:25832", (7.5, 54.8), "is for longitudes 6 to 12.01"),
        ("EPSG:25832", (1e12, 1e12), "is not on the Earth"),
        ("EPSG:999999", (0.0, 0.0), "which pyproj does not know"),
        ("nonsense", (0.0, 0.0), "crs is 'nonsense', which pyproj does not know"),
        ("EPSG:5773", (0.0, 0.0), "must be geographic or projected"),
        ("EPSG:4326", (0.0, 89.5), "has the latitude 89.50, must be at most 89"),
    ],
)
def test_wrong_reference_system_is_named(crs: str, place: tuple[float, float], words: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        LocalPlane.around(crs, place)
    assert words in str(caught.value)


def _utm(longitude: float, latitude: float) -> tuple[float, float]:
    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
    x, y = to_utm.transform(longitude, latitude)
    return float(x), float(y)
