"""The errors that a user can cause, each with a message that says what to change."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches


class BlastEnvError(ValueError):
    """Base class: something that the user gave is not usable."""


class LayoutError(BlastEnvError):
    """A cell cannot take a module: because of site, modules, stock, budget or access way."""


class MissingExtraError(BlastEnvError):
    """Something needs a package of an optional extra that is not installed."""


class UnknownNameError(BlastEnvError):
    """A name (preset, engine, structure, bundled scenario) that does not exist.

    Args:
        kind: What was named, e.g. `"preset"`.
        name: The name given.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        names = sorted(known)
        super().__init__(f"no {kind} {name!r}{suggestion(name, names)}; known: {', '.join(names)}")
        self._arguments = (kind, name, names)

    def __reduce__(self) -> tuple[type["UnknownNameError"], tuple[str, str, list[str]]]:
        return type(self), self._arguments


class UnknownArgumentError(BlastEnvError, TypeError):
    """A keyword argument that does not exist.

    A `TypeError` with Python's own words, which other libraries look for, and made from a message
    alone, as Gymnasium makes it anew; `of` names the nearest argument in it.
    """

    @classmethod
    def of(cls, function: str, name: str, known: Iterable[str]) -> "UnknownArgumentError":
        """Return the error.

        Args:
            function: Name of what was called.
            name: The argument given.
            known: The arguments that exist.
        """
        names = sorted(known)
        return cls(
            f"{function}() got an unexpected keyword argument {name!r}"
            f"{suggestion(name, names)}; known: {', '.join(names)}"
        )


@contextmanager
def import_extra(extra: str, what: str) -> Iterator[None]:
    """Import packages of an optional extra in this block.

    Args:
        extra: Name of the extra, or names with commas.
        what: What cannot be had without it, e.g. `"genetic search"`.

    Raises:
        MissingExtraError: If a package is not installed; the message says how to get it.
    """
    try:
        yield
    except ImportError as error:
        missing = error.name or str(error)
        if missing.startswith(("blast_env", "blast_agents")):
            raise  # no extra would help
        raise MissingExtraError(
            f"no {what} without {missing!r}: pip install blast-env[{extra}]"
        ) from error


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return `", did you mean 'x'?"` for the nearest known name, or an empty string."""
    nearest = get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f", did you mean {nearest[0]!r}?" if nearest else ""
