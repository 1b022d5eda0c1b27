"""Fields of a dataclass that are options of the command line, each described once.

A dataclass that is an argument in Python can also be one on the command line: commands read its
fields. `blast_env.cli.command` does that; this module does not depend on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

FOLDER: Final[tuple[str, ...]] = ()
"""Value of `writes` for an option that names a folder to write."""

TEXT: Final = "option"
"""Key of the text in the metadata of a field."""


@dataclass(frozen=True)
class OptionText:
    """Description of a field for the command line, beside its name, type and default.

    Attributes:
        help: Help text.
        is_argument: Whether it is a positional argument.
        flag: Name of the option, if not derived from the field's name.
        writes: Suffixes of the file that it names for writing; `FOLDER` for a folder; None if
            nothing is written.
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
        default: Its default; `...` for a required option.
        help: Help text.
        flag: Name of the option; by default `--cell` for a field `cell_m`.
        writes: Suffixes of the file that it names for writing; `FOLDER` for a folder.
        panel: Heading under which help shows it; None for the first.
        settings: Bounds, `metavar`, `show_default`.
    """
    return _field(default, OptionText(help, False, flag, writes, panel, settings))


def argument(help: str, *, default: Any = ...) -> Any:  # noqa: A002
    """Return a field that is a positional argument; see `option`."""
    return _field(default, OptionText(help, is_argument=True))


def _field(default: Any, text: OptionText) -> Any:
    if default is ...:
        return field(metadata={TEXT: text})
    return field(default=default, metadata={TEXT: text})
