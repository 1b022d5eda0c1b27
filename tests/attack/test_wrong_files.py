"""Damaged files of every format: refused with the documented error and at once, or sound."""

import re
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from tests.attack.formats import FORMATS, Format

TOKEN = re.compile(rb'"[^"\n]*"|[-+0-9.][-+0-9.eE_]*|[A-Za-z_][A-Za-z0-9_.]*|[\[\]{}(),:=]')
VALUES = (
    *b"0 -1 1.5 -0.0 1e308 1e-320 1e999 9223372036854775808 nan inf -inf Infinity .inf".split(),
    *b"true null None ~ 2026-01-01 12:30:00 0x1f 1_000 [] {} !!python/x # // % \\ \" '".split(),
    *(b'""', b'"x"', b"[1, 2, 3]", b'{"a": 1}', b"&a *a", b"x" * 5000, b'"' + b"x" * 5000 + b'"'),
    *(b'"\x1b[31m"', b'"\\u0000"', b'"\\ud800"', b'"\\u202e"', b'"[/x]"', b"\xc3\xa9", b"\xff"),
    *(b"9" * 6000, b"0." + b"3" * 6000, b"[" * 1000, b'{"a":' * 1000, b"a." * 1000 + b"a"),
    *(b"\n", b"\r", b"\0", b"\xef\xbb\xbf", b"\xff\xfe"),
)
"""In the place of a token of a file."""


@st.composite
def damaged(draw: st.DrawFn, samples: tuple[bytes, ...]) -> bytes:
    """A sound file with tokens replaced, repeated or cut out, or without its end."""
    content = draw(st.sampled_from(samples))
    for _ in range(draw(st.integers(0, 3))):
        places = [each.span() for each in TOKEN.finditer(content)] or [(0, len(content))]
        first, last = draw(st.sampled_from(places))
        another = content[slice(*draw(st.sampled_from(places)))]
        old = content[first:last]
        part = st.sampled_from((*VALUES, b"", 2 * old, 1000 * old[:20], another, old + b"0"))
        content = content[:first] + draw(part | st.binary(max_size=64)) + content[last:]
    if draw(st.booleans()):
        return content
    place = draw(st.integers(0, max(len(content) - 1, 0)))
    flipped = content[place : place + 1].translate(bytes(each ^ 1 for each in range(256)))
    return content[:place] + draw(st.sampled_from((b"", flipped + content[place + 1 :])))


@pytest.fixture(scope="module", params=FORMATS)
def form(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Format:
    return FORMATS[request.param](tmp_path_factory.mktemp("format"))


@settings(deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_damaged_file_is_refused_or_read(form: Format, data: st.DataObject) -> None:
    content = data.draw(damaged(form.samples))
    with suppress(BlastEnvError):
        found = form.read(content)
        if form.has_checksum and found is not None:
            assert found in [form.read(each) for each in form.samples]


def test_a_sound_file_is_read(form: Format) -> None:
    for each in form.samples:
        assert form.read(each) is not None
