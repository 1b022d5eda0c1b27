"""The origin of a result: versions, code and command."""

import platform
import sys
from collections.abc import Collection, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

_NO_INFLUENCE: Final = frozenset(
    {
        "__init__.py",
        "__main__.py",
        "answers",
        "app",
        "atlas",
        "benchmark",
        "cli",
        "design",
        "envs",
        "io",
        "plots",
        "sites",
        "tools",
    }
)
"""Parts of the package that cannot change the loads of a blast."""


def package_version() -> str:
    """Return the version of this package."""
    return version("blast-env")


def versions(engine: str | None = None, packages: Sequence[str] = ("numpy",)) -> dict[str, str]:
    """Return the versions on which a result depends, for its record.

    Args:
        engine: Version of the engine, if one engine made the result.
        packages: Further distributions; a missing one is `"not installed"`.

    Returns:
        Versions of `blast_env`, `engine` if given, `python`, and the packages, by their names.
    """
    own = {"blast_env": package_version()}
    if engine is not None:
        own["engine"] = engine
    own["python"] = platform.python_version()
    return own | {name: _version(name) for name in packages}


def command() -> list[str]:
    """Return the command line of this process, as `blast-env` is called."""
    return ["blast-env", *sys.argv[1:]]


def code_digest(folder: Path, left_out: Collection[str] = ()) -> str:
    """Return 16 hexadecimal digits of a hash of all Python files in a folder.

    Args:
        folder: The folder; its subfolders count too.
        left_out: Names of files and folders directly in it that do not count.
    """
    # Names and contents, so that a file that moves is another digest; sorted, as no folder is.
    digest = sha256()
    for path in sorted(folder.rglob("*.py")):
        name = path.relative_to(folder)
        if name.parts[0] not in left_out:
            digest.update(f"{name.as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def code_version() -> str:
    """Return the version of the package, with a digest of the code on which loads depend.

    The model may change between releases, so the version alone does not identify it.
    """
    digest = code_digest(Path(__file__).resolve().parent, _NO_INFLUENCE)
    return f"{package_version()}+{digest}"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
