"""Commands of Typer that are imported when they are called, and all end in one way.

A command is a function with options of Typer, in a module of its name. `writes` makes the options
that name a file or folder to write: these are checked before the work, and tidied up after it.
"""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from blast_env.errors import BlastEnvError
from blast_env.values import is_plain_number

MARKUP: Final = "markdown"
"""Markup of the help texts: Rich's markup would read [row, column] as a style."""

_TARGETS: Final = "blast_env.targets"
"""Key of the targets of a command in the metadata of its context."""


PICTURES = (".png", ".svg", ".pdf")
"""Suffixes of pictures, equal to `blast_env.plots.figures.FIGURE_SUFFIXES`, without its extra."""


class Target(NamedTuple):
    """A file or folder that a command is to write.

    Attributes:
        suffixes: The allowed suffixes of a file; none for a folder.
    """

    option: str
    path: Path
    suffixes: tuple[str, ...]


@contextmanager
def checked_targets(targets: Sequence[Target]) -> Iterator[None]:
    """Refuse unusable targets before the block, and remove new empty folders after it.

    So no result is lost because it cannot be written, and a command that fails or is interrupted
    leaves no empty folders. Two options may not name one file.
    """
    known: dict[Path, str] = {}
    for option, path, suffixes in targets:
        if not suffixes:
            _check_folder(option, path)
            continue
        _check_file(option, path, suffixes)
        same = known.setdefault(path.resolve(), option)
        if same != option:
            raise BlastEnvError(f"{same} and {option} are the same file, {path}")
    folders = [target.path for target in targets if not target.suffixes]
    before = {folder: _missing_above(folder) for folder in folders}
    present = {path for folder in before for path in _folders_in(folder)}
    try:
        yield
    finally:
        for folder, missing in before.items():
            for path in (*_folders_in(folder), *missing):
                if path not in present:
                    with suppress(OSError):  # it is not empty, or was never created
                        path.rmdir()


def _check_file(option: str, path: Path, suffixes: Sequence[str]) -> None:
    if path.suffix.lower() not in suffixes:
        must_be = suffixes[0] if len(suffixes) == 1 else f"one of {', '.join(suffixes)}"
        raise BlastEnvError(f"{option} {path}: suffix is {path.suffix!r}, must be {must_be}")
    if path.is_dir():
        raise BlastEnvError(f"{option} {path}: is a folder, must be a file")
    folder = path.resolve().parent
    if not folder.is_dir():
        raise BlastEnvError(f"{option} {path}: there is no folder {str(folder)!r} to write it to")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise BlastEnvError(f"{option} {path}: the folder {str(folder)!r} cannot be written to")


def _check_folder(option: str, folder: Path) -> None:
    present = folder.resolve()
    while not present.exists():
        present = present.parent
    if not present.is_dir():
        raise BlastEnvError(f"{option} {folder}: cannot be a folder: {str(present)!r} is a file")
    if not os.access(present, os.W_OK | os.X_OK):
        raise BlastEnvError(f"{option} {folder}: the folder {str(present)!r} cannot be written to")


def _missing_above(folder: Path) -> list[Path]:
    """Return the missing folders among a folder and its parents, the lowest first."""
    path, missing = folder.resolve(), []
    while not path.exists():
        missing.append(path)
        path = path.parent
    return missing


def _folders_in(folder: Path) -> list[Path]:
    """Return a folder and all folders below it, the lowest first."""
    return [Path(place) for place, _, _ in os.walk(folder.resolve(), topdown=False)]


def writes(words: str, *suffixes: str, default: Any = None, panel: str | None = None) -> Any:
    """Return an option that names a file or folder to write.

    Its help is `words` with the allowed suffixes of a file; without any it is a folder.
    """
    shown = f"{words}: {', '.join(suffixes)}." if suffixes else f"{words}."
    callback = checked_first(*suffixes)
    return typer.Option(default, help=shown, callback=callback, rich_help_panel=panel)


def checked_first(*suffixes: str) -> Callable[..., Path | None]:
    """Return the callback of an option whose target is checked before the command runs."""

    def note(
        context: typer.Context, parameter: typer.CallbackParam, value: Path | None
    ) -> Path | None:
        if value is not None:
            note_target(context, Target(parameter.opts[0], value, suffixes))
        return value

    return note


def note_target(context: typer.Context, target: Target) -> None:
    """Add a target to those that are checked before a command runs."""
    context.meta.setdefault(_TARGETS, []).append(target)


_ONE_ALONE: Final = ("--charge", "--layout")
"""Options that read as if several could be given."""


class ShellCommand(TyperCommand):
    """A command that turns errors of the user into messages, and checks its targets first.

    It refuses several charges or layouts where the last one alone would count.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the command line."""
        if not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(args=[*args])
            for parameter, times in Counter(order).items():
                once = isinstance(parameter, TyperOption) and not parameter.multiple
                if times > 1 and once and parameter.opts[0] in _ONE_ALONE:
                    ctx.fail(f"{parameter.opts[0]} is given {times} times, must be given once.")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        # Here, because the list of commands is shown without this import.
        from blast_env.cli.output import plain_notes, user_errors

        with user_errors(), plain_notes(), checked_targets(ctx.meta.get(_TARGETS, ())):
            return super().invoke(ctx)


def _check_numbers(parameter: Any) -> None:
    """Make a parameter refuse numbers that only Python accepts: `1_000`, `nan`."""
    process = parameter.process_value

    def checked(context: Any, given: Any) -> Any:
        for text in _texts(given):
            if not is_plain_number(text):
                message = f"{text!r} is no number such as 1000 or 0.5."
                raise typer.BadParameter(message, context, parameter)
        return process(context, given)

    parameter.process_value = checked


def _texts(given: Any) -> Iterator[str]:
    """Yield the texts given for one option; a default may be no text."""
    if isinstance(given, str):
        yield given
    elif isinstance(given, list | tuple):
        for text in given:
            yield from _texts(text)


def _leaves(kinds: Iterable[Any]) -> Iterator[Any]:
    for kind in kinds:
        yield from _leaves(inner) if (inner := get_args(kind)) else (kind,)


class LazyCommand(TyperCommand):
    """A command that is imported when it is called; until then it has only a name and a summary.

    Args:
        name: Its name.
        module: The module of this package that has it, as a function of the same name.
        summary: The first sentence of its help.
    """

    def __init__(self, name: str, module: str, summary: str) -> None:
        super().__init__(name, help=summary)
        self._module = module

    @cached_property
    def loaded(self) -> TyperCommand:
        """The command itself, imported."""
        function = getattr(import_module(f"{__package__}.{self._module}"), self._module)
        application = typer.Typer(rich_markup_mode=MARKUP, add_completion=False)
        application.command(self.name, cls=ShellCommand)(function)
        command = typer.main.get_command(application)
        assert isinstance(command, TyperCommand)
        hints = get_type_hints(function)
        for parameter in command.params:
            if {int, float} & {*_leaves([hints.get(parameter.name or "")])}:
                _check_numbers(parameter)
        return command

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse the command line with the imported command, which then runs."""
        return self.loaded.make_context(*arguments, **options)


class LazyGroup(TyperGroup):
    """A group of commands that are imported one by one, when they are called.

    Attributes:
        summaries: The first sentence of the help of each command, by its name.
        modules: Modules whose name differs from that of their command, by command.
    """

    summaries: ClassVar[Mapping[str, str]] = {}
    modules: ClassVar[Mapping[str, str]] = {}

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = {
            name: LazyCommand(name, self.modules.get(name, name), summary)
            for name, summary in self.summaries.items()
        }
