"""Code that Numba compiles: kept on disk until any of its sources changes, with a notice first."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from pathlib import Path
from pickle import UnpicklingError
from types import CodeType, FunctionType, ModuleType
from typing import Any, Final

import numpy as np
from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache

_LOGGER: Final = logging.getLogger("blast_env")


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator as `numba.njit` with `cache=True`, whose cache knows all of its sources.

    Numba keeps compiled code until the file of the function changes. Functions and constants of
    other files that it uses go into that code too, and a change of those would go unseen. Here the
    key in the cache has a digest of all of them, and of the options.

    Args:
        options: Options of `numba.njit`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = njit(**options)(function)
        dispatcher._cache = _SourcesCache(function, repr(sorted(options.items())))
        return dispatcher

    return decorate


class _SourcesCache(FunctionCache):
    """Numba's cache of a function, with a digest of its sources in the key of an entry."""

    def __init__(self, function: Callable[..., Any], options: str) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._options = options

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        key = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return *key, self._options, _source_digest(self._py_func)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code of a signature, or `None` if it has to be compiled.

        Numba reads all keys of a function before it compares them, and they name the types of its
        arguments. A type that has another name since, or a file that ends early, raises there.
        """
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except (AttributeError, ImportError, EOFError, UnpicklingError):
            self.flush()  # type: ignore[no-untyped-call]
            return None


@cache
def _source_digest(function: FunctionType) -> str:
    """Return a digest of the sources of a function and of all that it uses of its package."""
    # Files as a whole, since a name in a file may stand for anything else in it; constants by
    # value, since they are in the machine code.
    digest, sources = sha256(), _Sources(function.__module__.partition(".")[0])
    sources.add(function)
    for path in sorted(sources.paths):
        digest.update(path.read_bytes())
    digest.update("\n".join(sources.constants).encode())
    return digest.hexdigest()


@dataclass
class _Sources:
    """The files of functions and types, and the values of constants, that a function uses.

    Attributes:
        package: The top-level package; Numba's version stands for other ones.
        constants: Names and values of the constants, in order of their use.
    """

    package: str
    paths: set[Path] = field(default_factory=set)
    constants: list[str] = field(default_factory=list)
    _seen: set[int] = field(default_factory=set)

    def add(self, value: Any, name: str = "") -> None:
        """Add what a name in a compiled function stands for, and all that this uses in turn."""
        value = getattr(value, "py_func", value)  # a function, where it is compiled
        if id(value) in self._seen:
            return
        if isinstance(value, ModuleType):  # of its names each one may be used
            if value.__name__.partition(".")[0] == self.package:
                self._add_file(value.__name__)
        elif not callable(value):
            held = value.tobytes() if isinstance(value, np.ndarray) else value
            self.constants.append(f"{name} = {held!r}")
        elif str(value.__module__).partition(".")[0] == self.package:
            self._seen.add(id(value))
            self._add_file(value.__module__)
            if isinstance(value, FunctionType):
                # Names come from the closure, from the globals, and from functions inside.
                for used in value.__closure__ or ():
                    self.add(used.cell_contents, name)
                self._add_names(value.__code__, value.__globals__)

    def _add_file(self, module: str) -> None:
        path = sys.modules[module].__file__
        if path is not None:
            self.paths.add(Path(path))

    def _add_names(self, code: CodeType, names: dict[str, Any]) -> None:
        for name in code.co_names:
            if name in names:
                self.add(names[name], name)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._add_names(constant, names)


@dataclass(eq=False)
class _Listener(event.Listener):
    compiled: str

    def on_start(self, _event: Any) -> None:
        _announce(self.compiled)

    def on_end(self, _event: Any) -> None:
        pass


@cache
def _announce(compiled: str) -> None:
    """Log the notice; the cache lets each one pass once per process."""
    _LOGGER.warning("compiling %s, once per installation ...", compiled)


@contextmanager
def compilation_notice(compiled: str) -> Iterator[None]:
    """Warn by the logger `blast_env` if Numba compiles inside the block.

    Args:
        compiled: Name of the compiled code and the time that it takes; announced once per process.
    """
    with event.install_listener("numba:compile", _Listener(compiled)):
        yield
