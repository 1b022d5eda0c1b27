"""Details of a report for its reader: project, client, author, checker, revision, marking."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Final

from pydantic import ConfigDict

from blast_env.documents import DocumentError, checked_as, parse_toml, read_text
from blast_env.errors import BlastEnvError

_MOST: Final = 200


@dataclass(frozen=True)
class ReportDetails:
    """Details of a report; empty ones are left out.

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

    @property
    def given(self) -> dict[str, str]:
        """The details that are not empty, without the marking."""
        return {name: value for name, value in vars(self).items() if value and name != "marking"}


def read_details(path: Path | None) -> ReportDetails:
    """Return details from a TOML file; empty ones without a file.

    Raises:
        BlastEnvError: If the file cannot be read, or has an unknown key or one that is no text.
    """
    if path is None:
        return ReportDetails()
    try:
        return checked_as(ReportDetails, parse_toml(read_text(path)))
    except (DocumentError, ValueError) as error:
        raise BlastEnvError(f"{path}: {error}") from error
