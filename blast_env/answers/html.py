"""The renderer of documents for paper: one self-contained HTML page, and PDF."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, ClassVar, Final
from warnings import catch_warnings, filterwarnings

from pydantic import ConfigDict

from blast_env.answers.document import TYPOGRAPHIC, AnyPart, Document, Line, Picture
from blast_env.documents import DocumentError, checked_as, parse_toml, read_text
from blast_env.errors import BlastEnvError, import_extra
from blast_env.files import write_atomically, write_text

with import_extra("report", "reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined, Template
    from markupsafe import Markup

HTML_SUFFIXES: Final = (".html", ".htm")
_MOST: Final = 200
_NARROW: Final = 0.7
"""Height of a picture, as a share of its width, from which two fit beside each other."""


@dataclass(frozen=True)
class ReportDetails:
    """Details of a report for its reader; empty ones are left out.

    Attributes:
        project: Name or number of the project.
        client: Client.
        author: Author.
        checker: Person who has checked it.
        revision: Revision.
        marking: Marking of every page, as for confidentiality.

    Raises:
        BlastEnvError: If a text is too long or has a line break.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    project: str = ""
    client: str = ""
    author: str = ""
    checker: str = ""
    revision: str = ""
    marking: str = ""

    def __post_init__(self) -> None:
        """Check the texts."""
        for name, value in vars(self).items():
            if len(value) > _MOST or not value.isprintable():
                raise BlastEnvError(
                    f"{name} has {len(value)} characters, must be a line of at most {_MOST}"
                )

    @classmethod
    def read(cls, path: Path | None) -> "ReportDetails":
        """Return details from a TOML file; empty ones without a file.

        Raises:
            BlastEnvError: If the file cannot be read, or has an unknown key or one that is no text.
        """
        if path is None:
            return cls()
        try:
            return checked_as(cls, parse_toml(read_text(path)))
        except (DocumentError, ValueError) as error:
            raise BlastEnvError(f"{path}: {error}") from error

    @property
    def given(self) -> dict[str, str]:
        """The details below the title: those that are not empty, without project and marking."""
        left_out = "project", "marking"
        return {name: text for name, text in vars(self).items() if text and name not in left_out}


def check_targets(html: str | Path, pdf: str | Path | None) -> None:
    """Refuse unusable files before any blast is run: wrong suffixes, a PDF without WeasyPrint."""
    if Path(html).suffix.lower() not in HTML_SUFFIXES:
        raise BlastEnvError(f"{html}: suffix is {Path(html).suffix!r}, must be .html")
    if pdf is not None:
        if Path(pdf).suffix.lower() != ".pdf":
            raise BlastEnvError(f"{pdf}: suffix is {Path(pdf).suffix!r}, must be .pdf")
        _weasyprint()


def write_page(page: str, html: str | Path, pdf: str | Path | None = None) -> list[Path]:
    """Write a page as a file and, if requested, as PDF; return the files.

    Raises:
        BlastEnvError: If a suffix is wrong, a file cannot be written, or WeasyPrint lacks its
            libraries; the page is written before the PDF.
    """
    check_targets(html, pdf)
    write_text(html, page)
    if pdf is None:
        return [Path(html)]
    with write_atomically(pdf) as temporary:
        _weasyprint().HTML(string=page).write_pdf(str(temporary))
    return [Path(html), Path(pdf)]


def _weasyprint() -> Any:
    """Return the package that makes PDF; it needs libraries of the system, Pango above all."""
    with import_extra("report", "PDF"), catch_warnings():
        # WeasyPrint's hint to packagers; without that library, embedded fonts are only larger.
        filterwarnings("ignore", "HarfBuzz-Subset", DeprecationWarning)
        try:
            import weasyprint
        except OSError as error:
            raise BlastEnvError(
                f"no PDF: WeasyPrint lacks a library of the system ({error}); install Pango, or "
                "print the HTML page from a browser"
            ) from error
    return weasyprint


def page_of(document: Document, title: str, details: ReportDetails | None = None) -> str:
    """Return a document as one HTML page with its pictures inside."""
    return _template().render(
        document=document, title=title, details=details or ReportDetails(), signs=TYPOGRAPHIC
    )


@cache
def _template() -> Template:
    """Return the template, which takes longer to compile than to fill in."""
    environment = Environment(
        loader=PackageLoader("blast_env.answers"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"css": _css, "grouped": _grouped}
    environment.tests["narrow"] = lambda picture: _steepness(picture) > _NARROW
    return environment.get_template("page.html.j2")


def _grouped(parts: tuple[AnyPart, ...]) -> Iterator[tuple[str, list[AnyPart]]]:
    """Yield the parts by kind: consecutive items are one list, of pictures the wide ones first."""

    def kind_of(part: AnyPart) -> str:
        is_item = isinstance(part, Line) and part.kind == "item"
        return "list" if is_item else type(part).__name__.lower()

    for kind, own in groupby(parts, kind_of):
        yield kind, sorted(own, key=_steepness)


def _steepness(picture: AnyPart) -> float:
    """Return the height of a picture as a share of its width; 0 of other parts."""
    if not isinstance(picture, Picture):
        return 0.0
    width, height = (int.from_bytes(picture.png[start : start + 4]) for start in (16, 20))
    return height / max(width, 1)


def _css(text: str) -> Markup:
    """Return a text as a string of CSS, which can end neither the string nor the style sheet."""
    safe = "".join(
        letter if letter.isalnum() or letter in " .,-" else f"\\{ord(letter):x} " for letter in text
    )
    return Markup(f'"{safe}"')  # nothing but letters, digits and escapes
