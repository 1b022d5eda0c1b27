#!/usr/bin/env bash
# Houses of a second district are appended to a file of the first (`to_file(..., mode="a")`). The
# file says in which coordinate system it is, and so do the houses. GeoPandas refuses to join two
# frames in different systems, and warns when they are compared, so one would guess that it refuses
# here as well, or converts. It writes the numbers as they are, into a GeoPackage, a shapefile or
# GeoJSON: houses in degrees are then at 9 m east and 49 m north of the origin of the map, and 0.1
# mm wide.
# There is no message. Two zones of UTM are worse, for there the houses keep their size and are
# merely somewhere else.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq geopandas==1.2.0 pyogrio==0.13.0 shapely==2.2.0 pyproj==3.7.2 \
    pandas==3.1.1 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys
import warnings

import geopandas
import pandas
import pyogrio
from shapely.geometry import box

FORMATS = ("gpkg", "shp", "geojson")
first = geopandas.GeoDataFrame(geometry=[box(500000, 5400000, 500010, 5400010)], crs=32632)
second = geopandas.GeoDataFrame(geometry=[box(500200, 5400000, 500210, 5400010)], crs=32632)
degrees, next_zone = second.to_crs(4326), second.to_crs(32633)


def lower_left(extension, houses):
    """Return the system of the file, and the lower left corner of its second house."""
    name = f"from_{houses.crs.to_epsg()}.{extension}"
    first.to_file(name)
    houses.to_file(name, mode="a")
    back = geopandas.read_file(name)
    return back.crs.to_epsg(), back.geometry.bounds.iloc[1, :2].round(1).tolist()


with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    seen = {name: [lower_left(name, houses) for houses in (second, degrees, next_zone)]
            for name in FORMATS}
try:
    pandas.concat([first, degrees])
    joined = "joined"
except ValueError:
    joined = "refused"
about = [str(one.message) for one in caught if "crs" in str(one.message).lower()]
print("geopandas", geopandas.__version__, "pyogrio", pyogrio.__version__)
print("expected: a lower left corner at 500200, 5400000 in EPSG:32632 from all three, or an error")
for name, found in seen.items():
    print("seen,", name, "- from EPSG:32632, 4326 and 32633:", *found)
print("seen: pandas.concat of both:", joined, "- messages about systems:", about)
right = (32632, [500200.0, 5400000.0])
as_found = joined == "refused" and not about
for found in seen.values():
    as_found = as_found and found[0] == right and found[1] == (32632, [9.0, 48.8])
    as_found = as_found and found[2][0] == 32632 and found[2][1][0] < 100000.0
sys.exit(0 if as_found else "changed")
PYTHON
