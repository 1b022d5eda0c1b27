"""The published metadata of the blasts; its package is large, so that `make test` leaves it out."""

import json
import re
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from blast_env.benchmark.data import TABLES
from studies import data_card
from studies.blast_table import COLUMNS

WHY = "needs `pip install blast-env[datasets]`: `make matrix-minari` runs it"


def published() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(data_card.CARD.read_text(encoding="utf-8"))
    return found


def test_it_names_each_table_as_it_is() -> None:
    """Else `python -m studies.data_card` was forgotten after a change of a table."""
    files = {item["name"]: item["sha256"] for item in published()["distribution"]}
    assert files == {
        f"{table}.parquet": data_card.digest_of(data_card.FOLDER / f"{table}.parquet")
        for table in TABLES
    }


@pytest.mark.parametrize("table", TABLES)
def test_it_says_what_each_column_is(table: str) -> None:
    (record,) = [item for item in published()["recordSet"] if item["name"] == table]
    names = [field["name"] for field in record["field"]]
    assert names == pq.read_schema(data_card.FOLDER / f"{table}.parquet").names
    for field, column in zip(record["field"], COLUMNS, strict=True):
        assert field["description"].startswith(column.meaning)
        assert f"({column.unit})" in field["description"] or not column.unit


def test_the_page_says_how_much_there_is() -> None:
    """Each number of `contents` stands on the page, so that neither is forgotten."""
    page = Path("docs/researchers/benchmark.md").read_text(encoding="utf-8")
    numbers = re.findall(r"\d[\d,]*", data_card.contents())
    assert len(numbers) == 10
    card = page[page.index("- **Content**") : page.index("- **Metadata**")]
    assert set(numbers) <= set(re.findall(r"\d[\d,]*", card.replace(", ", " ")))


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of its own use of rdflib
def test_its_package_reads_the_rows(tmp_path: Path) -> None:
    mlc = pytest.importorskip("mlcroissant", reason=WHY)
    data_card.main(tmp_path / "croissant.json")
    assert json.loads((tmp_path / "croissant.json").read_text()) == published()
    rows = list(mlc.Dataset(jsonld=str(data_card.CARD)).records("many_site_blasts"))
    table = pq.read_table(data_card.FOLDER / "many_site_blasts.parquet")
    assert len(rows) == table.num_rows
    impulses = [row["many_site_blasts/impulse_pa_s"] for row in rows]
    assert impulses == table["impulse_pa_s"].to_pylist()
    # Texts come as bytes.
    assert rows[0]["many_site_blasts/structure"].decode() == table["structure"][0].as_py()
