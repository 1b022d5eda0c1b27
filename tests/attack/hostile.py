"""Files of the wrong kind, numbers out of all bounds, and texts for terminals and pages."""

import json
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from copy import deepcopy
from functools import partial
from io import StringIO
from pathlib import Path
from stat import S_IFSOCK
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import tomli_w
from blast_agents.training.checkpoint import Checkpoint

from blast_env.benchmark import JudgedSubmission, Submission, make, standings_page, standings_tables
from blast_env.benchmark.methods import find_method
from blast_env.benchmark.standings import StandingsTable
from blast_env.calibration import load_calibration
from blast_env.cli.output import print_table
from blast_env.design.surrogate.network import Surrogate, load_surrogate
from blast_env.design.surrogate.walls import site_of
from blast_env.documents import read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasResult
from blast_env.io.importing import import_site
from blast_env.layout import LayoutFile
from blast_env.particles.parquet import read_parquet
from blast_env.response.facade import respond
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.store import Store
from blast_env.tables import markdown_table
from blast_env.values import STEERING, markup_text
from tests.design.test_surrogate import YARD, by_hand

Document = dict[str, Any]
Place = tuple[str | int, ...]

NUMBERS: Final = ("1.0", True, 5e-324, 1e-300, 1e38, 1e300, -1.0, [1.0])
"""In the place of a number."""

TEXTS: Final = (
    *("\x1b]0;title\x07", "\x1b[31mred", "a\0b", "\u202eright to left", "\u2066\u200f", "\x9b2J"),
    *("a\n\n# Heading", "<script>alert(1)</script>", "[here](javascript:alert(1))", "{raw}`x`"),
    *("x" * 900_000, 1.0),
)
"""In the place of a text."""

_COMPONENTS: Final[Document] = {
    "window": {
        "kind": "glazing",
        "title": "Window",
        "source": "a test",
        "cost_m2": 100.0,
        "width_m": 1.2,
        "height_m": 1.5,
        "thickness_mm": 6.0,
        "outer_thickness_mm": 4.0,
        "interlayer": {"tension_n_m": 16e3, "tear_share": 0.15},
    },
    "concrete": {
        "kind": "wall",
        "title": "Concrete",
        "source": "a test",
        "span_m": 3.0,
        "section": {
            "kind": "reinforced_concrete",
            "thickness_m": 0.2,
            "steel_share": 0.003,
            "cover_m": 0.03,
            "concrete_pa": 30e6,
            "steel_pa": 500e6,
            "dynamic_increase": 1.2,
        },
    },
    "brick": {
        "kind": "wall",
        "title": "Brick",
        "source": "a test",
        "supports": "fixed",
        "section": {
            "kind": "masonry",
            "thickness_m": 0.2,
            "density_kg_m3": 1900.0,
            "flexural_pa": 7e5,
            "young_pa": 6e9,
        },
    },
    "sheet": {
        "kind": "wall",
        "title": "Sheet",
        "source": "a test",
        "section": {
            "kind": "sheeting",
            "material": "steel",
            "moment_n": 5e3,
            "mass_kg_m2": 30.0,
            "bending_stiffness_n_m": 4e5,
        },
    },
}


def site_document() -> Document:
    """Return a small site with components of all kinds, costs, weights and references."""
    parts = [{"walls": [w], "wall": c} for w, c in (("east", "brick"), ("north", "sheet"))]
    house = {
        "kind": "ModularObstacle",
        "name": "house",
        "corner_m": [20.0, 8.0],
        "rows": 8,
        "columns": 8,
        "protected": True,
        "weight": 3.0,
        "peak_weight": 2.0,
        "height_m": 3.0,
        "title": "The house",
        "facade": {"glazing": "window", "wall": "concrete", "parts": parts},
    }
    item = {"name": "wall", "description": "A wall", "length_modules": 4, "height_m": 2.0}
    return {
        "schema_version": 2,
        "name": "site",
        "description": "A site",
        "site": {"width_m": 30.0, "height_m": 20.0},
        "charge": [{"kind": "point", "position_m": [2.0, 10.0], "tnt_kg": 50.0, "weight": 2.0}],
        "structures": [house],
        "components": deepcopy(_COMPONENTS),
        "build_zone": {
            "corner_m": [8.0, 5.0],
            "rows": 20,
            "columns": 10,
            "budget": 40.0,
            "items": [item | {"cost": 2.0, "stock": 3, "mass_kg": 4000.0, "base_width_m": 0.5}],
        },
        "objective": {
            "quantity": "both",
            "reference_impulse_pa_s": 500.0,
            "reference_peak_pa": 5e4,
        },
    }


def _run() -> Document:
    return {"problem": "control_room-known-v2", "budget": 0, "seed": 0, "blasts": 0, "layout": []}


def submission_document() -> Document:
    """Return a submission."""
    text = {"method": "mine", "note": "a note", "format": "blast-env submission 1"}
    return {**text, "runs": [_run()]}


def judged_document() -> Document:
    """Return a judged submission."""
    text = {"method": "mine", "note": "a note", "format": "blast-env judged 1", "engine": "gas"}
    return {**text, "cell_m": 0.5, "runs": [_run() | {"share": 0.5, "rule": 0.6, "best": 0.4}]}


def layout_document() -> Document:
    """Return a layout with all keys."""
    piece = {"item": "wall", "row": 0, "column": 0, "turned": False}
    words = {"scenario": "site", "site_hash": "0" * 64, "provenance": {"method": "mine"}}
    return {"version": 1, "pieces": [piece], "hardening": ["glass"], **words}


def map_document() -> Document:
    """Return a map of one house."""
    ring = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0], [0.0, 0.0]]
    house = {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"building": "yes", "name": "House", "protected": True, "height": 6.0},
    }
    charge = {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [12.0, 2.0]},
        "properties": {"kind": "charge_place"},
    }
    features = {"type": "FeatureCollection", "features": [house, charge]}
    return {**features, "coordinate_system": "local site metres"}


def leaves(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield the place and the value of each number and text of a document; of long lists, few."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from leaves(each, (*place, key))
    elif isinstance(value, list):
        for index, each in enumerate(value[:2]):
            yield from leaves(each, (*place, index))
    else:
        yield place, value


def replaced(document: Document, place: Place, value: Any) -> Document:
    """Return a document with another value at a place."""
    changed: Any = deepcopy(document)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return dict(changed)


def message_problem(message: str) -> str:
    """Return what is wrong with the message of an error; empty if nothing is."""
    if not message:
        return "an error without a message"
    if len(message) > 10_000 or "x" * 81 in message:
        return f"a message of {len(message):,} characters"
    return ""


def outcome(read: Callable[[], Any], use: Callable[[Any], str] = lambda _: "") -> str:
    """Read a file and use what it says; return what is wrong with that, empty if nothing is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return use(read())
    except BlastEnvError as error:
        return message_problem(str(error))
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:80]}"


def _use_site(scenario: Scenario) -> str:
    """Compute the response of the facades and the objective; return what is not finite."""
    bays = scenario.bays
    time_s = np.linspace(0.0, 0.02, 41)
    pressure_pa = np.outer(np.ones(len(bays)), 3e4 * np.exp(-time_s / 0.004))
    found, house = respond(bays, time_s, pressure_pa), scenario.structures[0]
    load = scenario.objective.load(300.0, 3e4, house.weight, house.counted_peak_weight)
    numbers = [
        found.broken_panes,
        load,
        1.0 / load,
        *(1.0 / each.weight for each in scenario.charge),
    ]
    return "" if np.isfinite(numbers).all() else f"the numbers {numbers}"


def _use_surrogate(surrogate: Surrogate) -> str:
    loads = surrogate.guess(site_of(YARD), [()], [Charge((1.5, 4.0), 5.0)]).impulse_pa_s
    return "" if np.isfinite(loads).all() else f"the loads {loads.tolist()}"


def _use_submission(submission: Submission) -> str:
    rows = ((submission.method, submission.note),)
    table = StandingsTable(submission.method, ("method", "note"), rows)
    return shown([table], markdown_table(("note",), [(markup_text(submission.note),)]))


def _use_judged(judged: JudgedSubmission) -> str:
    return shown(standings_tables([judged]), standings_page([judged]))


def shown(tables: Iterable[StandingsTable], page: str) -> str:
    """Print tables; return what of the texts in them gets to the terminal or the page as it is."""
    with redirect_stdout(StringIO()) as printed:
        for each in tables:
            print_table(each.title, each.headers, each.rows)
    if STEERING.search(printed.getvalue()):
        return "control characters on the terminal"
    marks = ("<script", "[here](javascript", "\n# Heading", "{raw}`", "\x1b", "\u202e")
    return next((f"{mark!r} on the page" for mark in marks if mark in page), "")


def _surrogate_document() -> Document:
    with TemporaryDirectory() as folder:
        path = by_hand(members=1).save(Path(folder) / "surrogate.json")
        document: Document = json.loads(path.read_text(encoding="utf-8"))
    return document


Reader = Callable[[Path], Any]

DOCUMENTS: Final[Mapping[str, tuple[Callable[[], Document], Reader, Callable[[Any], str]]]] = (
    MappingProxyType(
        {
            "site.toml": (site_document, load_scenario, _use_site),
            "layout.json": (layout_document, LayoutFile.load, lambda _: ""),
            "surrogate.json": (_surrogate_document, load_surrogate, _use_surrogate),
            "submission.json": (submission_document, Submission.load, _use_submission),
            "judged.json": (judged_document, JudgedSubmission.load, _use_judged),
            "map.geojson": (map_document, import_site, lambda _: ""),
        }
    )
)
"""By the name of the file: a sound document, its reader, and what is done with the result."""

Tries = Iterator[tuple[str, str]]
"""What was tried, and what is wrong with the outcome; empty if nothing is."""


def _replacements(folder: Path, values: Sequence[Any], kind: Callable[[Any], bool]) -> Tries:
    """Yield the outcome of each document with each number or text replaced by each value."""
    for name, (sound, read, use) in DOCUMENTS.items():
        path, document = folder / name, sound()
        for place, old in leaves(document):
            for value in values if kind(old) else ():
                changed = replaced(document, place, value)
                dumps = tomli_w.dumps if path.suffix == ".toml" else json.dumps
                path.write_text(dumps(changed), encoding="utf-8")
                where = f"{name}: {'.'.join(map(str, place))} = {str(value)[:30]!r}"
                yield where, outcome(partial(read, path), use)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(folder: Path) -> Tries:
    return _replacements(folder, NUMBERS, _is_number)


def _texts(folder: Path) -> Tries:
    return _replacements(folder, TEXTS, lambda value: isinstance(value, str))


READERS: Final[Mapping[str, Reader]] = MappingProxyType(
    {
        **{name: read for name, (_, read, _) in DOCUMENTS.items()},
        "map.osm": import_site,
        "map.dxf": import_site,
        "calibration.json": load_calibration,
        "checkpoint.pt": Checkpoint.load,
        "collisions.parquet": read_parquet,
        "front.csv": partial(read_text, most_bytes=1_000_000),
        "runs.sqlite": Store,
    }
)
"""What reads a file, by its name."""


def special(path: Path, kind: str) -> None:
    """Make a file that is none of the usual kind."""
    path.unlink(missing_ok=True)
    if kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a device":
        path.symlink_to("/dev/full")
    elif kind == "a socket":
        os.mknod(path, S_IFSOCK | 0o600)
    else:
        with path.open("wb") as file:
            file.truncate(20_000_000_000)  # takes no room on the disk


SPECIAL: Final = ("a pipe", "a device", "a socket", "a sparse file of 20 GB")
"""Kinds of `special`."""


def _special(folder: Path) -> Tries:
    for kind in SPECIAL:
        for name, read in READERS.items():
            special(folder / name, kind)
            found = outcome(partial(read, folder / name), lambda _: "was read")
            yield f"{name}: {kind}", found


METHODS: Final = (
    *("os:system", "os:getcwd", "builtins:len", "builtins:pow", "math:pi", "os:nothing"),
    *("nothing:at_all", ":", "x:", "json:dumps", "builtins:memoryview"),
)
"""In the place of a method."""


def method_outcome(name: str) -> str:
    """Play a benchmark problem with something that is no method; return what is wrong then."""
    problem = make("control_room-known-v2", 0)
    return outcome(lambda: find_method(name)(problem, 0), lambda _: "was a method")


def _methods(_: Path) -> Tries:
    yield from ((name, method_outcome(name)) for name in METHODS)


def gauge_site(position_m: Sequence[float]) -> Scenario:
    """Return a small site with one solid 0.5 m high and a gauge."""
    document = site_document()
    document["structures"][0]["height_m"] = 0.5
    del document["structures"][0]["facade"]
    document["gauges"] = [{"name": "gauge", "position_m": list(position_m)}]
    return Scenario.from_document(document, "gauge")


def gauge_outcome(position_m: Sequence[float]) -> str:
    """Run a blast with a gauge; return what is wrong, such as a gauge moved in silence."""

    def run() -> GasResult:
        found = simulate(gauge_site(position_m), engine="gas", cell_m=0.5, until=0.001)
        assert isinstance(found, GasResult)
        return found

    left, bottom, right, top = gauge_site(position_m).structures[0].rectangle_m
    x_m, y_m, z_m = position_m
    inside = left < x_m < right and bottom < y_m < top and z_m < 0.5
    wrong = "was moved in silence" if inside else "has a note, although it is in the air"
    return outcome(run, lambda found: "" if bool(found.moved_gauges) == inside else wrong)


def _gauges(_: Path) -> Tries:
    left, bottom, right, top = gauge_site((1.0, 1.0, 1.0)).structures[0].rectangle_m
    for x_m in np.linspace(left - 0.75, right + 0.75, 6):
        for y_m in np.linspace(bottom - 0.75, top + 0.75, 6):
            for z_m in (0.2, 0.4, 0.7):
                place = (float(x_m), float(y_m), z_m)
                yield f"gauge at {place}", gauge_outcome(place)


FAMILIES: Final[Mapping[str, Callable[[Path], Tries]]] = MappingProxyType(
    {
        "pipes, devices, sockets, sparse files": _special,
        "numbers that are none or out of bounds": _numbers,
        "texts that control, mark up or are long": _texts,
        "functions in the place of methods": _methods,
        "gauges in and beside a solid": _gauges,
    }
)
"""By names for a table."""
