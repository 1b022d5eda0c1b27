"""The table of formats in the docs has what the code reads and writes, and no more."""

import re
import tomllib
from pathlib import Path

from blast_env.io.export import BLAST_SUFFIXES, SUFFIXES
from blast_env.io.importing import SUFFIXES as READ

PAGE = Path("docs/reference/formats.md")
SUFFIX = re.compile(r"`(\.[a-z.0-9]+)`")


def rows() -> list[dict[str, str]]:
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    names, _, *others = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    return [dict(zip(names, cells, strict=True)) for cells in others]


def suffixes(column: str, word: str) -> set[str]:
    words = re.compile(rf"(?<!\[)\b{word}\b")
    chosen = [row["suffix"] for row in rows() if words.search(row[column])]
    return {suffix for text in chosen for suffix in SUFFIX.findall(text)}


def test_the_table_has_all_formats_that_are_read() -> None:
    assert suffixes("read", "import") == set(READ)


def test_the_table_has_all_formats_that_are_written() -> None:
    assert suffixes("written", "layout") - {".toml"} == set(SUFFIXES)
    assert suffixes("written", "blast") - {".bill.csv"} == set(BLAST_SUFFIXES)


def test_the_table_names_libraries_and_extras_of_the_package() -> None:
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    for row in rows():
        own = re.findall(r"`(\w+)`", row["extra"])
        needed = [name for extra in own for name in extras[extra]] + project["dependencies"]
        for library in row["by"].split(", "):
            assert any(re.match(rf"{library}\b", name) for name in needed), (library, own)
