"""Any attribute of a drawing or model is read, or refused: never a traceback."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from ezdxf.filemanagement import readfile
from ezdxf.lldxf.const import DXFError
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.io.importing import ImportOptions, import_site

CASES = Path(__file__).parent / "cases"
NUMBERS = st.sampled_from((0, 1, -1, 2, 7, 255, 0.0, -9.0, 1e-9, 1e9, 1e308, 431.0))
POINTS = st.tuples(*[st.sampled_from((0.0, 1.0, -1.0, 20.0, 1e9))] * 3)
VALUES = st.one_of(NUMBERS, POINTS, st.text(max_size=5), st.none())
KEYS = st.sampled_from(
    (
        *("elevation", "thickness", "extrusion", "invisible", "flags", "layer", "insert", "start"),
        *("end", "xscale", "zscale", "rotation", "row_count", "column_count", "name", "vtx0"),
        *("vtx3", "text", "halign", "height", "align_point", "const_width", "linetype", "color"),
    )
)


def attempt(path: Path, **options: Any) -> None:
    """Import a file, or see a refusal."""
    asked: dict[str, Any] = {"charge_at": ((-6.0, 3.0),), "protect_near": (10.0, 5.0)}
    with suppress(BlastEnvError):
        import_site(path, ImportOptions(**asked | options))


@given(
    st.sampled_from(sorted(CASES.glob("d_*.dxf"))),
    st.lists(st.tuples(st.integers(0, 9), KEYS, VALUES), min_size=1, max_size=4),
)
def test_any_attribute_of_an_entity(
    tmp_path_factory: pytest.TempPathFactory,
    case: Path,
    changes: list[tuple[int, str, Any]],
) -> None:
    document = readfile(case)
    blocks = [entity for block in document.blocks for entity in block]
    entities = [*document.modelspace(), *blocks]
    for number, key, value in changes:
        with suppress(DXFError, TypeError, ValueError, AttributeError, OverflowError):
            entities[number % len(entities)].dxf.set(key, value)
    path = tmp_path_factory.mktemp("any") / "any.dxf"
    try:
        document.saveas(path)
    except Exception:
        return
    attempt(path, buildings_from=("BLD",))


@given(
    st.sampled_from(sorted(CASES.glob("i_*.ifc"))),
    st.lists(st.tuples(st.integers(0, 400), st.integers(0, 9), VALUES), min_size=1, max_size=5),
)
def test_any_attribute_of_an_element(
    tmp_path_factory: pytest.TempPathFactory,
    case: Path,
    changes: list[tuple[int, int, Any]],
) -> None:
    ifcopenshell = pytest.importorskip("ifcopenshell")
    model = ifcopenshell.open(str(case))
    entities = list(model)
    for number, index, value in changes:
        entity = entities[number % len(entities)]
        with suppress(Exception):
            entity[index % len(entity)] = value
    path = tmp_path_factory.mktemp("any") / "any.ifc"
    model.write(str(path))
    attempt(path)
