"""A command is a dataclass: its fields are the options, its docstring the help, its call the work.

So each option is written once, as a field with its name, type, default and help. Typer gets a
function made from the fields, and still provides the parser, the help and the completion.
"""

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, UnionType
from typing import Annotated, Any, ClassVar, Final, Union, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from blast_env.cli.targets import Target, checked_targets
from blast_env.errors import BlastEnvError
from blast_env.option_fields import FOLDER as FOLDER
from blast_env.option_fields import TEXT, OptionText
from blast_env.option_fields import argument as argument
from blast_env.option_fields import option as option
from blast_env.values import is_plain_number, plain_number

MARKUP: Final = "markdown"
"""Markup of the help texts: Rich's markup would read [row, column] as a style."""

_UNITS: Final = re.compile(r"_(m|m2|deg)$")
_COUNTS: Final = MappingProxyType({2: "two", 3: "three", 4: "four"})


_TARGETS: Final = "blast_env.targets"
"""Key of the targets of a command in the metadata of its context."""


def writes(*suffixes: str) -> Callable[..., Path | None]:
    """Return the callback of an option that names a file or folder to write.

    Args:
        suffixes: The allowed suffixes of a file; none for a folder.
    """

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


class ShellCommand(TyperCommand):
    """A command that turns errors of the user into messages, and checks its targets first."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        # Here, because the list of commands is shown without this import.
        from blast_env.cli.output import user_errors

        with user_errors(), checked_targets(ctx.meta.get(_TARGETS, ())):
            return super().invoke(ctx)


@dataclass(frozen=True, kw_only=True)
class Command:
    """Base class of all commands, and of the groups of options that several share.

    Each field is an `option` or an `argument` (`blast_env.option_fields`); one of the type
    `tuple[TYPE, ...]` may be repeated, and several numbers in a value have commas between them.
    Help lists the options of a class before those of its bases.
    """

    def __call__(self) -> None:
        """Run the command.

        Raises:
            BlastEnvError: If an option is invalid or does not apply; the user reads its message.
        """
        raise NotImplementedError

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C; empty if there is none."""
        return ""

    def targets(self) -> list[Target]:
        """Return the targets of the command: the values of the given options with `writes`."""
        return [
            Target(each.flag, path, each.text.writes)
            for each in options_of(type(self))
            for path in [getattr(self, each.name)]
            if each.text.writes is not None and path is not None
        ]


@dataclass(frozen=True, eq=False)
class OptionField:
    """A field of a command, as an option of the command line.

    Attributes:
        name: The field's name.
        hint: Its type.
        default: Its default; `inspect.Parameter.empty` if it is required.
        text: Its help, flag and settings on the command line.
    """

    name: str
    hint: Any
    default: Any
    text: OptionText

    @property
    def flag(self) -> str:
        """The flag on the command line: the name without its unit, unless set otherwise."""
        if self.text.flag is not None:
            return self.text.flag
        return f"--{_UNITS.sub('', self.name).replace('_', '-')}"

    @property
    def is_repeated(self) -> bool:
        """Whether it may be repeated."""
        return get_origin(self.hint) is tuple and get_args(self.hint)[1:] == (...,)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Possible counts of comma-separated numbers in a value; empty for other values."""
        kinds = _alternatives(get_args(self.hint)[0] if self.is_repeated else self.hint)
        numbers = {int, float}
        return tuple(
            len(get_args(each))
            for each in kinds
            if get_origin(each) is tuple and set(get_args(each)) <= numbers
        )

    @property
    def is_number(self) -> bool:
        """Whether its values are single numbers; values of several numbers are texts."""
        return not self.numbers and bool({int, float} & {*_leaves([self.hint])})

    @property
    def parameter(self) -> inspect.Parameter:
        """The parameter for Typer, which has lists in place of the commands' tuples."""
        text, hint, default = self.text, self.hint, self.default
        if self.is_repeated:
            hint = list[str if self.numbers else get_args(hint)[0]]  # type: ignore[misc]
            default = default or None
            hint = hint if default else hint | None
        elif self.numbers:
            hint = str | None
        # For a flag that is on by default, Typer adds one that turns it off.
        names = () if default is True or text.is_argument else (self.flag,)
        kind = typer.Argument if text.is_argument else typer.Option
        info = kind(*names, help=text.help, rich_help_panel=text.panel, **text.settings)
        keyword = inspect.Parameter.KEYWORD_ONLY
        return inspect.Parameter(
            self.name, keyword, default=default, annotation=Annotated[hint, info]
        )

    def value(self, given: Any) -> Any:
        """Return the value of the field from that of Typer.

        Raises:
            BlastEnvError: If a text does not consist of comma-separated numbers.
        """
        if not self.is_repeated:
            return self._numbers_of(given) if self.numbers and given is not None else given
        return tuple(self._numbers_of(each) if self.numbers else each for each in given or ())

    def _numbers_of(self, text: str) -> tuple[float, ...]:
        with suppress(ValueError):
            found = tuple(plain_number(self.flag, part) for part in text.split(","))
            if len(found) in self.numbers:
                return found
        count = " or ".join(_COUNTS[each] for each in self.numbers)
        form = self.text.settings.get("metavar", "numbers with commas")
        raise BlastEnvError(f"{self.flag} is {text!r}, must be {count} numbers as {form}")


def _leaves(kinds: Iterable[Any]) -> Iterator[Any]:
    for each in kinds:
        yield from _leaves(inner) if (inner := get_args(each)) else (each,)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    """Return the types of a union, or the single type."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def options_of(kind: type[Command]) -> Iterator[OptionField]:
    """Yield the options of a command, those of the class before those of its bases."""
    hints, known = get_type_hints(kind), {each.name: each for each in fields(kind)}
    names = (name for each in kind.__mro__ for name in inspect.get_annotations(each))
    for name in dict.fromkeys(names):
        if name not in known or TEXT not in known[name].metadata:
            continue
        default = known[name].default
        yield OptionField(
            name,
            hints[name],
            inspect.Parameter.empty if default is MISSING else default,
            known[name].metadata[TEXT],
        )


def function_of(kind: type[Command]) -> Callable[..., None]:
    """Return the function from which Typer makes a command, with one parameter per option."""
    options = tuple(options_of(kind))

    def call(**values: Any) -> None:
        _run(kind, {each: values[each.name] for each in options})

    made: Any = call
    made.__signature__ = inspect.Signature([each.parameter for each in options])
    made.__annotations__ = {each.name: each.parameter.annotation for each in options}
    made.__doc__ = kind.__doc__
    return call


def _run(kind: type[Command], values: Mapping[OptionField, Any]) -> None:
    # Here, because the list of commands is shown without these imports.
    from blast_env.cli.output import user_errors

    with user_errors():
        command = kind(**{each.name: each.value(given) for each, given in values.items()})
    with user_errors(command.how_to_resume), checked_targets(command.targets()):
        command()


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
        for each in given:
            yield from _texts(each)


class LazyCommand(TyperCommand):
    """A command that is imported when it is called; until then it has only a name and a summary.

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
        if inspect.isfunction(found):
            application.command(self.name, cls=ShellCommand)(found)
            hints = get_type_hints(found)
            numbers = {name for name in hints if {int, float} & {*_leaves([hints[name]])}}
        else:
            application.command(self.name)(function_of(found))
            numbers = {each.name for each in options_of(found) if each.is_number}
        command = typer.main.get_command(application)
        assert isinstance(command, TyperCommand)
        for parameter in command.params:
            if parameter.name in numbers:
                _check_numbers(parameter)
        return command

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse the command line with the imported command, which then runs."""
        return self.loaded.make_context(*arguments, **options)


class LazyGroup(TyperGroup):
    """A group of commands that are imported one by one, when they are called.

    Each is a class in a module of this package, both named after it: `SearchCommand` in `search`.

    Attributes:
        summaries: The first sentence of the help of each command, by its name.
        modules: Modules whose name differs from that of their command, by command.
    """

    summaries: ClassVar[Mapping[str, str]] = {}
    modules: ClassVar[Mapping[str, str]] = {}
    functions: ClassVar[tuple[str, ...]] = ()

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = {
            name: LazyCommand(
                name,
                f"{__package__}.{self.modules.get(name, name)}:{name.capitalize()}Command"
                if name not in self.functions
                else f"{__package__}.{self.modules.get(name, name)}:{self.modules.get(name, name)}",
                summary,
            )
            for name, summary in self.summaries.items()
        }
