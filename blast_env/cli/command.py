"""A command is a dataclass: its fields are the options, its docstring the help, a call the work.

So an option is written once: with its name, type, default and help where the command keeps its
value. Typer gets a function that is made of the fields; its parser, help and completion stay.
"""

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from types import EllipsisType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    NamedTuple,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import typer
from typer.core import TyperCommand, TyperGroup

MARKUP: Final = "markdown"
"""How help is written: Rich's own markup takes [row, column] for a style."""

FOLDER: Final[tuple[str, ...]] = ()
"""Says of an option that the command writes a folder there."""

_TEXT: Final = "text of the command line"
_UNITS: Final = re.compile(r"_(m|m2|deg)$")


@dataclass(frozen=True, kw_only=True)
class Command:
    """Base class of all commands, and of the groups of options that several have in common.

    Each field is an `option` or an `argument`; one of the type `tuple[TYPE, ...]` may be given
    again and again. Help shows the options of a class before those of its bases.
    """

    def __call__(self) -> None:
        """Do the work.

        Raises:
            BlastEnvError: If an option is of no use; the user reads its message.
        """
        raise NotImplementedError

    def how_to_resume(self) -> str:
        """Return how to go on after Ctrl-C, where the command can."""
        return ""

    def targets(self) -> "list[Target]":
        """Return where the command is to write: the options with `Writes` that are given."""
        return [
            Target(each.flag, path, each.text.writes)
            for each in options_of(type(self))
            for path in [getattr(self, each.name)]
            if each.text.writes is not None and path is not None
        ]


class Target(NamedTuple):
    """A file or folder that a command is to write.

    Attributes:
        option: The option that says so.
        path: Where.
        suffixes: Those that the file may have; none for a folder.
    """

    option: str
    path: Path
    suffixes: tuple[str, ...]


class _Text(NamedTuple):
    """What the command line needs to know of a field beside its type and default.

    Attributes:
        info: Makes Typer's description of it from the names on the command line.
        flag: What one writes on the command line, where the field's name does not say it.
        writes: Suffixes of the file that is written there; `FOLDER`; None if nothing is.
        panel: Heading under which help shows it; None for the first.
    """

    info: partial[Any]
    flag: str | None
    writes: tuple[str, ...] | None
    panel: str | None


_Value = TypeVar("_Value")


@overload
def option(
    default: EllipsisType,
    help: str,
    *,
    flag: str | None = None,
    writes: tuple[str, ...] | None = None,
    panel: str | None = None,
    **settings: Any,
) -> Any: ...
@overload
def option(
    default: _Value,
    help: str,
    *,
    flag: str | None = None,
    writes: tuple[str, ...] | None = None,
    panel: str | None = None,
    **settings: Any,
) -> _Value: ...
def option(
    default: Any,
    help: str,  # noqa: A002  # Typer's word
    *,
    flag: str | None = None,
    writes: tuple[str, ...] | None = None,
    panel: str | None = None,
    **settings: Any,
) -> Any:
    """Return a field of a command that is an option.

    Args:
        default: Its default; `...` where it must be given.
        help: What it says of itself.
        flag: What one writes on the command line; `--cell` of a field `cell_m` unless given.
        writes: Suffixes of the file that the command writes there; `FOLDER` for a folder.
        panel: Heading under which help shows it, unless it is the first.
        settings: What else `typer.Option` takes.
    """
    info = partial(typer.Option, help=help, rich_help_panel=panel, **settings)
    return _field(default, _Text(info, flag, writes, panel))


def argument(help: str, *, default: Any = ..., **settings: Any) -> Any:  # noqa: A002
    """Return a field of a command that stands without a name on the command line; see `option`."""
    return _field(default, _Text(partial(typer.Argument, help=help, **settings), None, None, None))


def _field(default: Any, text: _Text) -> Any:
    if default is ...:
        return field(metadata={_TEXT: text})
    return field(default=default, metadata={_TEXT: text})


@dataclass(frozen=True)
class OptionField:
    """A field of a command, as the command line has it.

    Attributes:
        name: The field's name.
        hint: Its type.
        default: Its default; `inspect.Parameter.empty` where it must be given.
        text: What the command line says of it.
    """

    name: str
    hint: Any
    default: Any
    text: _Text

    @property
    def flag(self) -> str:
        """What one writes on the command line: the name without its unit."""
        if self.text.flag is not None:
            return self.text.flag
        return f"--{_UNITS.sub('', self.name).replace('_', '-')}"

    @property
    def is_repeated(self) -> bool:
        """Whether it may be given again and again."""
        return get_origin(self.hint) is tuple and get_args(self.hint)[1:] == (...,)

    @property
    def parameter(self) -> inspect.Parameter:
        """The same for Typer, which has lists where our commands have tuples."""
        hint, default = self.hint, self.default
        if self.is_repeated:
            hint, default = list[get_args(hint)[0]], default or None  # type: ignore[misc]
            if default is None:
                hint = hint | None
        # Of a flag that is set, Typer makes one more that takes it back.
        names = () if default is True or self.text.info.func is typer.Argument else (self.flag,)
        return inspect.Parameter(
            self.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=default,
            annotation=Annotated[hint, self.text.info(*names)],
        )


def options_of(kind: type[Command]) -> Iterator[OptionField]:
    """Yield the options of a command: its own, and then those that it has in common with others."""
    hints, known = get_type_hints(kind), {each.name: each for each in fields(kind)}
    names = (name for each in kind.__mro__ for name in inspect.get_annotations(each))
    for name in dict.fromkeys(names):
        if name not in known:
            continue
        default = known[name].default
        yield OptionField(
            name,
            hints[name],
            inspect.Parameter.empty if default is MISSING else default,
            known[name].metadata[_TEXT],
        )


def function_of(kind: type[Command]) -> Callable[..., None]:
    """Return the function that Typer makes a command of: it has a parameter for each option."""
    options = tuple(options_of(kind))

    def call(**values: Any) -> None:
        for each in options:
            if each.is_repeated:
                values[each.name] = tuple(values[each.name] or ())
        _run(kind, values)

    made: Any = call
    made.__signature__ = inspect.Signature([each.parameter for each in options])
    made.__annotations__ = {each.name: each.parameter.annotation for each in options}
    made.__doc__ = kind.__doc__
    return call


def _run(kind: type[Command], values: Mapping[str, Any]) -> None:
    # Here, because the list of commands is shown without what they need.
    from blast_env.cli.output import user_errors
    from blast_env.cli.targets import FileTarget, checked_targets

    with user_errors():
        command = kind(**values)
    files, folders = {}, {}
    for option, path, suffixes in command.targets():
        if suffixes:
            files[option] = FileTarget(path, suffixes)
        else:
            folders[option] = path
    with user_errors(command.how_to_resume), checked_targets(files, folders):
        command()


class LazyCommand(TyperCommand):
    """A command that is imported when it is called: until then, name and summary are enough.

    Args:
        name: Its name.
        place: Module and class, as `module:Class`.
        summary: The first sentence of its help.
    """

    def __init__(self, name: str, place: str, summary: str) -> None:
        super().__init__(name, help=summary)
        self._place = place

    @cached_property
    def loaded(self) -> TyperCommand:
        """The command itself, imported."""
        module, _, kind = self._place.partition(":")
        application = typer.Typer(rich_markup_mode=MARKUP, add_completion=False)
        found: Any = getattr(import_module(module), kind)
        call = found if inspect.isfunction(found) else function_of(found)
        application.command(self.name)(call)
        command = typer.main.get_command(application)
        assert isinstance(command, TyperCommand)
        return command

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse the command line by the command itself, which then runs."""
        return self.loaded.make_context(*arguments, **options)


class LazyGroup(TyperGroup):
    """A group of commands that are imported one by one, when they are called.

    Attributes:
        places: Of each command where it is, as `module:Class`, and its summary.
    """

    places: ClassVar[Mapping[str, tuple[str, str]]] = {}

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = {name: LazyCommand(name, *each) for name, each in self.places.items()}
