"""Fields of a dataclass that are options of the command line: each says what it is, once.

A dataclass that is an argument in Python can be one of the command line, too: the commands read its
fields. Nothing here knows how they do that (`blast_env.cli.command`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

FOLDER: Final[tuple[str, ...]] = ()
"""Says of an option that a folder is written there."""

TEXT: Final = "option"
"""Key of the text in the metadata of a field."""


@dataclass(frozen=True)
class OptionText:
    """What the command line needs to know of a field beside its name, type and default.

    Attributes:
        help: What it says of itself.
        is_argument: Whether it stands without a name on the command line.
        flag: What one writes there, where the field's name does not say it.
        writes: Suffixes of the file that is written there; `FOLDER`; None if nothing is.
        panel: Heading under which help shows it; None for the first.
        settings: Bounds (`min`, `max`), `metavar`, and `show_default` for a default in words.
    """

    help: str
    is_argument: bool = False
    flag: str | None = None
    writes: tuple[str, ...] | None = None
    panel: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


def option(
    default: Any,
    help: str,  # noqa: A002  # the word for it on command lines
    *,
    flag: str | None = None,
    writes: tuple[str, ...] | None = None,
    panel: str | None = None,
    **settings: Any,
) -> Any:
    """Return a field that is an option; see `OptionText`.

    Args:
        default: Its default; `...` where it must be given.
        help: What it says of itself.
        flag: What one writes on the command line; `--cell` of a field `cell_m` unless given.
        writes: Suffixes of the file that is written there; `FOLDER` for a folder.
        panel: Heading under which help shows it, unless it is the first.
        settings: Bounds, `metavar`, `show_default`.
    """
    return _field(default, OptionText(help, False, flag, writes, panel, settings))


def argument(help: str, *, default: Any = ...) -> Any:  # noqa: A002
    """Return a field that stands without a name on the command line; see `option`."""
    return _field(default, OptionText(help, is_argument=True))


def _field(default: Any, text: OptionText) -> Any:
    if default is ...:
        return field(metadata={TEXT: text})
    return field(default=default, metadata={TEXT: text})
