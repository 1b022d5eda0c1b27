"""Packages whose names are imported on first use, since a part is often wanted without the rest."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def on_first_use(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package that imports its names on first use.

    The names are those that the file of the package imports `if TYPE_CHECKING`: they are written
    once, and editors, type checkers and the check of layers read them there.

    Args:
        package: `__name__` of the package.
    """
    module = sys.modules[package]
    places: dict[str, str] = {}

    def read() -> dict[str, str]:
        if not places:
            tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom) and node.module:
                    for alias in node.names:
                        places[alias.name] = node.module
        return places

    def get(name: str) -> object:
        place = None if name.startswith("__") else read().get(name)
        if place is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value: object = getattr(import_module(place), name)
        setattr(module, name, value)  # found without this function from now on
        return value

    return get, lambda: sorted({*vars(module), *read()})
