"""Marks of OpenStreetMap XML that osmium does not read: deletions and positions in members.

Overpass writes the positions of ways into their relations (`out geom`), which osmium refuses, and
JOSM marks objects as deleted instead of leaving them out.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

from blast_env.files import scratch_folder, write_atomically

_CENTRE: Final = "center"
"""The element of `out center`, which osmium refuses; it is no outline."""

_OBJECTS: Final = ("node", "way", "relation")


@dataclass
class Marks:
    """The finds of a first reading of an extract.

    Attributes:
        deleted: Kinds and ids of the objects that are marked as deleted.
        shapes: Longitude and latitude of the nodes of ways in relations, by the id of the way.
        cuts: Parts of the file that osmium refuses, in bytes: start and end.
    """

    deleted: set[tuple[str, int]] = field(default_factory=set)
    shapes: dict[int, list[tuple[float, float] | None]] = field(default_factory=dict)
    cuts: list[tuple[int, int]] = field(default_factory=list)


def marks_of(path: Path) -> Marks:
    """Return the marks of a file; none of PBF, or where it is damaged."""
    marks = Marks()
    if path.suffix.lower() != ".pbf":
        with suppress(expat.ExpatError, ValueError), path.open("rb") as file:
            _Parser(marks).parser.ParseFile(file)  # osmium refuses a damaged file
    return marks


@contextmanager
def readable(path: Path, marks: Marks) -> Iterator[Path]:
    """Yield the path of the file without what osmium refuses; the file itself if it has none."""
    if not marks.cuts:
        yield path
        return
    content = path.read_bytes()
    starts = [0, *(_after(content, end) for _, end in marks.cuts)]
    ends = [*(start for start, _ in marks.cuts), len(content)]
    with scratch_folder() as folder:
        plain = folder / "plain.osm"
        with write_atomically(plain, durable=False) as target, target.open("wb") as file:
            for start, end in zip(starts, ends, strict=True):
                file.write(content[start:end])
        yield plain


def _after(content: bytes, end: int) -> int:
    """Return where a part ends: after the end tag of an element that may not stay."""
    closing = f"</{_CENTRE}".encode()
    return content.index(b">", end) + 1 if content.startswith(closing, end) else end


class _Parser:
    """Collects the marks of a file while expat reads it.

    Args:
        marks: To be filled.
    """

    def __init__(self, marks: Marks) -> None:
        self._marks = marks
        self._way: list[tuple[float, float] | None] | None = None
        self._member = 0
        self._cut: tuple[str, int] | None = None
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end

    def _start(self, kind: str, attributes: dict[str, str]) -> None:
        if kind in _OBJECTS and (
            attributes.get("action") == "delete" or attributes.get("visible") == "false"
        ):
            self._marks.deleted.add((kind, int(attributes.get("id", "0"))))
        elif kind == "member":
            self._way = []
            is_way = attributes.get("type") == "way"
            self._member = int(attributes.get("ref", "0")) if is_way else 0
        elif kind == "nd" and self._way is not None:
            place = attributes.get("lon"), attributes.get("lat")
            is_known = None not in place
            self._way.append((float(place[0] or 0), float(place[1] or 0)) if is_known else None)
            self._open("member")
        elif kind == _CENTRE:
            self._open(kind)

    def _open(self, kind: str) -> None:
        """Begin a part that osmium refuses, unless one has begun; an element ends it."""
        if self._cut is None:
            self._cut = kind, self.parser.CurrentByteIndex

    def _end(self, kind: str) -> None:
        if self._cut is not None and self._cut[0] == kind:
            self._marks.cuts.append((self._cut[1], self.parser.CurrentByteIndex))
            self._cut = None
        if kind == "member":
            if self._way and self._member:
                self._marks.shapes[self._member] = self._way
            self._way = None
