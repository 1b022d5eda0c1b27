"""How Sphinx builds the site: `make docs`, to out/docs."""

import inspect
import os
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import typer
from docutils import nodes

from blast_env.provenance import package_version

project = "blast-env"
author = "The blast-env authors"
copyright = author  # noqa: A001  # Sphinx reads this name
version = release = package_version()

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["data", "pictures"]

html_theme = "furo"
html_title = "blast-env"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
smartquotes = False  # they make dashes of --options

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4

# Notebooks run when they have changed, each in a folder that is thrown away.
nb_execution_mode = "cache"
nb_execution_in_temp = True
nb_execution_timeout = 900
nb_execution_raise_on_error = True
nb_merge_streams = True
os.environ["BLAST_ENV_DOCS"] = str(Path(__file__).parent)  # where notebooks find docs/data

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
default_role = "code"  # docstrings write `name` for code
napoleon_include_init_with_doc = True
napoleon_use_ivar = True

PUBLIC: Final = (
    "blast_env",
    "blast_env.evaluation",
    "blast_env.calibration",
    "blast_env.io.importing",
    "blast_env.answers.report",
    "blast_env.benchmark",
    "blast_agents.training",
)
"""Packages whose `__all__` is documented; a name of several of them, with the first."""

_MAGIC: Final = "%%bash\n"
_MARK: Final = re.compile(r"^<!-- (names|commands) of ([\w.]+) -->$", re.MULTILINE)


def _names(package: str) -> str:
    """Return the autodoc directives for the public names of a package."""
    module = import_module(package)
    before = [import_module(name).__all__ for name in PUBLIC[: PUBLIC.index(package)]]
    lines = ["```{eval-rst}", f".. currentmodule:: {package}"]
    for name in module.__all__:
        if any(name in names for names in before):
            continue
        value = getattr(module, name)
        if inspect.isclass(value):
            lines += ["", f".. autoclass:: {name}", "   :members:"]
        elif callable(value):
            lines += ["", f".. autofunction:: {name}"]
        else:
            lines += ["", f".. autodata:: {name}", "   :no-value:"]
    return "\n".join([*lines, "```"])


def _commands(package: str) -> str:
    """Return the help text and options of every command of a Typer application."""
    commands = typer.main.get_command(import_module(package).app).commands
    lines: list[str] = []
    for name, lazy in commands.items():
        command = lazy.loaded
        lines += [f"## {name}", "", inspect.cleandoc(command.help), ""]
        lines += ["| option | meaning |", "|---|---|"]
        for option in command.params:
            lines.append(f"| `{'`, `'.join(option.opts)}` | {_cell(option.help)} |")
        lines.append("")
    return "\n".join(lines)


def _cell(text: str | None) -> str:
    """Return a text for a cell of a table."""
    return (text or "").replace("|", r"\|").replace("\n", " ")


_WRITERS: Final[dict[str, Callable[[str], str]]] = {
    "names": _names,
    "commands": _commands,
}


def _fill_in(_app: Any, _page: str, source: list[str]) -> None:
    """Fill in marks such as `<!-- names of PACKAGE -->` with texts from the code."""
    source[0] = _MARK.sub(lambda mark: _WRITERS[mark[1]](mark[2]), source[0])


def _to_restructured_text(
    _app: Any, _what: str, _name: str, _value: Any, _options: object, lines: list[str]
) -> None:
    """Let docstrings say m|v|, and leave chapters in Markdown to the pages that show them."""
    chapters = [number for number, line in enumerate(lines) if line.startswith("## ")]
    if chapters:
        del lines[chapters[0] :]
    for number, line in enumerate(lines):
        if "``" not in line:
            lines[number] = re.sub(r"(`[^`]+`)(?=\w)", r"\1\ ", line.replace("|", r"\|"))


def _show_as_commands(_app: Any, doctree: nodes.document) -> None:
    """Show cells of commands without the magic that runs them."""
    for cell in doctree.findall(nodes.literal_block):
        text = cell.astext()
        if text.startswith(_MAGIC):
            cell.children = [nodes.Text(text.removeprefix(_MAGIC))]
            cell["language"] = "sh"


def setup(app: Any) -> None:
    """Connect the functions above."""
    app.connect("doctree-read", _show_as_commands)
    app.connect("source-read", _fill_in)
    app.connect("autodoc-process-docstring", _to_restructured_text, priority=400)
