"""Texts of docstrings that pages repeat, between the marks of a page.

A page has `<!-- docstring of NAME -->`, the text, and `<!-- end of NAME -->`. The text is the
docstring without its sections for code (Attributes and below). `python -m studies.page_texts`
writes them anew; a test compares them.
"""

import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Final

from blast_env.answers.terminal import print_line

ROOT: Final = Path(__file__).parents[1]

_TEXT: Final = re.compile(
    r"^<!-- docstring of (?P<name>[\w.]+) -->\n.*?^<!-- end of (?P=name) -->$",
    re.MULTILINE | re.DOTALL,
)
_CODE: Final = re.compile(r"^(Attributes|Args|Returns|Raises):$", re.MULTILINE)

_EXAMPLE: Final = re.compile(r"^>>> .*\n(?:^(?!$|#).*\n)*", re.MULTILINE)
"""A doctest, up to an empty line or a heading."""


def docstring_text(path: str) -> str:
    """Return the docstring of a class or function, without its sections for code.

    Args:
        path: Module and name.
    """
    module, _, name = path.rpartition(".")
    text = inspect.getdoc(getattr(import_module(module), name)) or ""
    return _EXAMPLE.sub(r"\n```pycon\n\g<0>```\n", f"{_CODE.split(text)[0].strip()}\n").strip()


def with_texts(page: str) -> str:
    """Return a page with the present texts between its marks."""

    def text(mark: re.Match[str]) -> str:
        name = mark["name"]
        return f"<!-- docstring of {name} -->\n\n{docstring_text(name)}\n\n<!-- end of {name} -->"

    return _TEXT.sub(text, page)


def pages() -> list[Path]:
    """Return the pages that have such a text."""
    found = sorted((ROOT / "docs").rglob("*.md"))
    return [page for page in found if _TEXT.search(page.read_text(encoding="utf-8"))]


def main() -> None:
    """Write the texts anew."""
    for page in pages():
        page.write_text(with_texts(page.read_text(encoding="utf-8")), encoding="utf-8")
        print_line(f"wrote {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
