"""Files that are wrong in every way that we could think of, made from sound ones."""

import random
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Final

_TOKEN: Final = re.compile(rb'"[^"\n]*"|[-+0-9.][-+0-9.eE_]*|[A-Za-z_][A-Za-z0-9_.]*|[\[\]{}(),:=]')

_VALUES: Final = (
    *b"0 -1 1.5 -0.0 1e308 -1e308 1e-320 1e999 9223372036854775808 nan inf -inf NaN".split(),
    *b"Infinity .inf true null None ~ 2026-01-01 2026-01-01T00:00:00Z 12:30:00 0x1f".split(),
    *b"0o17 0b1 1_000 [] {} [[]] !!python/x # // $(x) % \\ \" '".split(),
    *(b'""', b"''", b'"x"', b"[1, 2, 3]", b'{"a": 1}', b"&a *a"),
    *(b'"\x1b[31m"', b'"\\u0000"', b'"\\ud800"', b'"\\u202e"', b'"[/x]"', b"\xc3\xa9", b"\xff"),
    *(b'"' + b"x" * 5000 + b'"', b"x" * 5000, b"9" * 400, b"9" * 6000, b"0." + b"3" * 6000),
    *(b"[" * 1000, b"{" * 1000, b'{"a":' * 1000, b"[[" * 40 + b"]]" * 40, b"a." * 1000 + b"a"),
    *(b"\t", b"\n", b"\r", b"\0", b" " * 100),
)
"""What stands in the place of a token."""

_ENCODINGS: Final = ("utf-16", "utf-32", "utf-16-be", "latin-1", "cp500")

_MOST_ADDED: Final = 20_000  # bytes

Mutation = Callable[[bytes, random.Random], bytes]


def _flipped(content: bytes, rng: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 8))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _overwritten(content: bytes, rng: random.Random) -> bytes:
    place, length = rng.randrange(len(content)), rng.choice((1, 2, 4, 16, 64))
    return content[:place] + rng.randbytes(length) + content[place + length :]


def _truncated(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content))]


def _cut_at_a_line(content: bytes, rng: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    return b"".join(lines[: rng.randrange(len(lines))])


def _shortened(content: bytes, rng: random.Random) -> bytes:
    first, last = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    return content[:first] + content[min(last, first + rng.choice((1, 10, 1000))) :]


def _doubled(content: bytes, rng: random.Random) -> bytes:
    first, last = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    piece = content[first : min(last, first + 2000)]
    return content[:last] + piece * _times(rng.choice((1, 1, 2, 50)), piece) + content[last:]


def _repeated_line(content: bytes, rng: random.Random) -> bytes:
    """Keys and rows occur twice, or a thousand times."""
    lines = content.splitlines(keepends=True)
    number, place = rng.randrange(len(lines)), rng.randrange(len(lines) + 1)
    times = _times(rng.choice((1, 1, 1, 20, 1000)), lines[number])
    return b"".join((*lines[:place], *[lines[number]] * times, *lines[place:]))


def _times(wanted: int, piece: bytes) -> int:
    """Return how often a piece is repeated: as wanted, unless it is large."""
    return max(min(wanted, _MOST_ADDED // (len(piece) or 1)), 1)


def _swapped_lines(content: bytes, rng: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[first], lines[second] = lines[second], lines[first]
    return b"".join(lines)


def _other_value(content: bytes, rng: random.Random) -> bytes:
    """A token is another: of another type, enormous, deep, without an end."""
    changed = content
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = [match.span() for match in _TOKEN.finditer(changed)]
        if not places:
            return changed
        first, last = rng.choice(places)
        changed = changed[:first] + rng.choice(_VALUES) + changed[last:]
    return changed


def _other_token(content: bytes, rng: random.Random) -> bytes:
    """A token is one of the same file: values in places of others, keys that are there twice."""
    places = [match.span() for match in _TOKEN.finditer(content)]
    if not places:
        return content
    (first, last), (begin, end) = rng.choice(places), rng.choice(places)
    return content[:first] + content[begin:end] + content[last:]


def _other_number(content: bytes, rng: random.Random) -> bytes:
    """A number is ten or a million times as large or small, or negative."""
    places = [match.span() for match in re.finditer(rb"\d+(\.\d+)?", content)]
    if not places:
        return content
    first, last = rng.choice(places)
    value = float(content[first:last]) * rng.choice((-1.0, 0.0, 0.1, 10.0, 1e6, 1e-6, 1e18))
    whole = b"." not in content[first:last] and abs(value) <= 1e300  # nan, inf: as they are
    text = str(round(value)) if whole else repr(value)
    return content[:first] + text.encode() + content[last:]


def _inserted(content: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(content) + 1)
    return content[:place] + rng.choice(_VALUES) + content[place:]


def _encoded(content: bytes, rng: random.Random) -> bytes:
    text = content.decode("utf-8", "surrogateescape")
    kind = rng.randrange(3)
    if kind == 0:
        return text.encode(rng.choice(_ENCODINGS), "replace")
    mark = rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"))
    return (
        mark + content if kind == 1 else content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"")))
    )


def _nothing_of_it(content: bytes, rng: random.Random) -> bytes:
    return rng.choice((b"", b"\n", b"\0" * 1000, rng.randbytes(200), *_VALUES))


_MUTATIONS: Final[Sequence[tuple[Mutation, int]]] = (
    *((_flipped, 3), (_overwritten, 1), (_truncated, 1), (_cut_at_a_line, 1), (_shortened, 1)),
    *((_doubled, 1), (_repeated_line, 2), (_swapped_lines, 1), (_other_value, 8)),
    *((_other_token, 3), (_other_number, 4), (_inserted, 1), (_encoded, 1)),
)
"""With how often each is taken."""


def mutants(samples: Sequence[bytes], count: int, seed: int = 0) -> Iterator[bytes]:
    """Yield wrong files; a few may be sound after all.

    Args:
        samples: Sound files, none of them empty.
        count: How many to yield.
        seed: Decides everything.
    """
    rng = random.Random(seed)
    kinds, weights = zip(*_MUTATIONS, strict=True)
    for number in range(count):
        content = samples[number % len(samples)]
        if rng.random() < 0.005:
            yield _nothing_of_it(content, rng)
            continue
        for mutation in rng.choices(kinds, weights, k=rng.choice((1, 1, 1, 2, 3))):
            content = mutation(content, rng) if content else content
        yield content
