"""The file of a surrogate: JSON, with the weights of its networks in half precision."""

from base64 import b64decode, b64encode
from collections.abc import Sequence
from functools import cache
from math import prod
from pathlib import Path
from typing import Annotated, Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.surrogate.approach import INPUTS
from blast_env.surrogate.ensemble import Surrogate
from blast_env.surrogate.fit_record import Fit
from blast_env.surrogate.network import SHAPES, AnyFloats, Member, Networks

_PACKAGED: Final = Path(__file__).with_name("gas.json")

_MOST_BYTES: Final = 10_000_000
"""Largest file of a surrogate: some eighty networks."""


def load_surrogate(path: str | Path) -> Surrogate:
    """Return a surrogate from its file.

    Raises:
        BlastEnvError: If the file does not exist, is damaged or is not a surrogate.
    """
    path = Path(path)
    try:
        text = read_text(path, _MOST_BYTES)
    except DocumentError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    try:
        content = checked_as(_File, parse_json(text))
    except DocumentError as error:
        raise BlastEnvError(f"{path}: is no surrogate, or damaged: {error}") from error
    mean, scale = np.array(content.mean), np.array(content.scale)
    impulse, peak = (
        Networks([_member(member) for member in members])
        for members in (content.members, content.peak_members)
    )
    return Surrogate(mean, scale, impulse, peak, content.fit)


@cache
def packaged_surrogate() -> Surrogate:
    """Return the bundled surrogate, read once: it takes a tenth of a second.

    It was fitted to generated sites only (see `fit`), so that all bundled sites are valid tests.
    """
    return load_surrogate(_PACKAGED)


def save_surrogate(surrogate: Surrogate, path: str | Path) -> Path:
    """Write the surrogate as a JSON file, weights in half precision.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    path = Path(path)
    content = _File(
        fit=surrogate.fit,
        mean=_numbers(surrogate.mean),
        scale=_numbers(surrogate.scale),
        members=_texts(surrogate.impulse.members),
        peak_members=_texts(surrogate.peak.members),
    )
    with write_atomically(path) as temporary:
        temporary.write_text(f"{content.model_dump_json()}\n", encoding="utf-8")
    return path


_HALF: Final = np.dtype("<f2")
_MOST_WEIGHT: Final = 1e3
_Members = Annotated[list[list[str]], Field(min_length=1, max_length=100)]


class _File(BaseModel):
    """Content of a file: the weights of each network as half-precision numbers in base64.

    There are a hundred thousand in a network, and their rounding is far below its errors.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    fit: Fit
    mean: list[Annotated[float, Field(ge=-1e6, le=1e6)]]
    scale: list[Annotated[float, Field(ge=1e-6, le=1e6)]]
    members: _Members
    peak_members: _Members

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for name, numbers in (("mean", self.mean), ("scale", self.scale)):
            if len(numbers) != INPUTS:
                raise ValueError(f"{name} has {len(numbers)} numbers, must be {INPUTS}")
        for name, members in (("members", self.members), ("peak_members", self.peak_members)):
            for number, texts in enumerate(members):
                if len(texts) != len(SHAPES):
                    raise ValueError(
                        f"{name}: network {number} has {len(texts)} arrays, must be {len(SHAPES)}"
                    )
                for which, (text, shape) in enumerate(zip(texts, SHAPES, strict=True)):
                    try:
                        _array(text, shape)
                    except ValueError as error:
                        raise ValueError(
                            f"{name}: network {number}, array {which}: {error}"
                        ) from error
        return self


def _array(text: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return an array of its text.

    Raises:
        ValueError: If the text is no base64, or has other numbers.
    """
    content = b64decode(text, validate=True)
    if len(content) != prod(shape) * _HALF.itemsize:
        numbers = len(content) / _HALF.itemsize
        raise ValueError(f"has {numbers:g} numbers, must be {prod(shape)}")
    found = np.frombuffer(content, _HALF).astype(np.float64).reshape(shape)
    if not (np.abs(found) <= _MOST_WEIGHT).all():
        raise ValueError(f"a weight is beyond {_MOST_WEIGHT:g}, or no number")
    return found


def _texts(members: Sequence[Member]) -> list[list[str]]:
    """Return the arrays of networks as text; see `_File`."""
    return [[b64encode(array.astype(_HALF).tobytes()).decode() for array in own] for own in members]


def _member(texts: Sequence[str]) -> Member:
    """Return a network from its texts."""
    return Member(*(_array(text, shape) for text, shape in zip(texts, SHAPES, strict=True)))


def _numbers(array: AnyFloats) -> list[float]:
    return [float(f"{value:.5g}") for value in array.ravel()]
