"""Small errors put into the rules of the core, to see whether the tests notice: `make mutants`.

Cosmic Ray says what can be changed: an operator, a comparison, a number, a condition. Places are
drawn by a seed, and at each place one change. The tests that belong to a module run in a process
that has the imports already, on a copy of the tree.
"""

import ast
import difflib
import importlib
import os
import resource
import shutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Annotated, Final

import pytest
import typer
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT: Final = Path(__file__).parents[1]

_PARTS: Final = ("blast_env", "agents", "docs", "scenarios", "tests", "pyproject.toml")
_IMPORTS: Final = ("numba", "pandas", "pydantic", "gymnasium", "scipy.stats")
_MOST_CPU_S: Final = 120
"""Processor time after which a change counts as noticed: something has no end."""

_ARITHMETIC: Final = ("Add", "Sub", "Mul", "Div")
_BITS: Final = ("BitOr", "BitAnd", "BitXor")
_CHANGES: Final = (
    *(
        f"ReplaceBinaryOperator_{a}_{b}"
        for kind in (_ARITHMETIC, _BITS)
        for a in kind
        for b in kind
    ),
    *("ReplaceBinaryOperator_Pow_Mul", "ReplaceBinaryOperator_FloorDiv_Div"),
    *("ReplaceComparisonOperator", "ReplaceUnaryOperator", "AddNot"),
    *("ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue"),
    *("NumberReplacer", "ReplaceBreakWithContinue", "ReplaceContinueWithBreak"),
    "ZeroIterationForLoop",
)
_NO_CHANGES: Final = ("_Is_Eq", "_IsNot_NotEq", "_Eq_Is", "_NotEq_IsNot", "UAdd_")
"""What changes nothing, or nearly so."""


@dataclass(frozen=True)
class Part:
    """A module of the core, and the tests that belong to it, relative to the root."""

    module: str
    tests: tuple[str, ...]


def _parts(folder: str, tests: tuple[str, ...], *modules: str) -> list[Part]:
    return [Part(f"blast_env/{folder}/{name}.py", tests) for name in modules]


_RULES: Final = (
    *("tests/particles/test_event_rules.py", "tests/particles/test_event_friction.py"),
    *("tests/particles/test_event_by_hand.py", "tests/particles/test_event_contacts.py"),
    *("tests/particles/test_event_walls.py", "tests/particles/test_event_conservation.py"),
)
_LAWS: Final = tuple(
    f"tests/particles/calibration/test_{name}.py"
    for name in ("laws", "metrics", "references", "friedlander")
)
_COMPARISON: Final = (
    *("tests/evaluation/test_statistics.py", "tests/evaluation/test_objective.py"),
    *("tests/evaluation/test_evaluate.py", "tests/design/test_evaluation.py"),
)
_PLACES: Final = (
    *("tests/layout/test_placement.py", "tests/layout/test_layout.py"),
    *(
        f"tests/site/test_{name}.py"
        for name in (
            *("conditions", "zone_checks", "access_way", "checks"),
            *("catalogue", "vehicles", "item_scenarios"),
        )
    ),
)

AREAS: Final[Mapping[str, list[Part]]] = MappingProxyType(
    {
        "calibration": _parts("particles/calibration", _LAWS, "laws", "metrics", "references"),
        "comparison": [
            Part("blast_env/statistics.py", _COMPARISON),
            *_parts("evaluation", _COMPARISON, "comparison"),
        ],
        "placement": [*_parts("layout", _PLACES, "placement"), *_parts("site", _PLACES, "zone")],
        "physics rules": _parts("particles/event", _RULES, "contacts"),
    }
)


@dataclass(frozen=True)
class Mutant:
    """A changed module."""

    part: Part
    line: int
    source: str
    original: str

    def __str__(self) -> str:
        lines = difflib.ndiff(self.original.splitlines(), self.source.splitlines())
        changed = [f"{each[0]} {each[2:].strip()}" for each in lines if each[0] in "+-"]
        return f"{self.part.module}:{self.line}\n" + "\n".join(
            f"        {each}" for each in changed
        )


def drawn(parts: list[Part], count: int, rng: Random) -> tuple[int, Iterator[Mutant]]:
    """Return at how many places the modules of an area can be changed, and some of the changes."""
    places = [
        (part, place, changes)
        for part in parts
        for place, changes in sorted(_changes(_source(part)).items())
    ]
    chosen = rng.sample(places, min(count, len(places)))
    return len(places), (
        mutant
        for part, (line, _), changes in chosen
        if (mutant := _mutant(part, line, *rng.choice(changes)))
    )


def _source(part: Part) -> str:
    return (ROOT / part.module).read_text(encoding="utf-8")


def _changes(source: str) -> dict[tuple[int, int], list[tuple[str, int]]]:
    """Return operators and their occurrences by the line and column of what they change."""
    found: dict[tuple[int, int], list[tuple[str, int]]] = {}
    nodes, others = list(ast_nodes(get_ast(source))), _left_alone(source)
    for name in operator_names():
        if not name.partition("/")[2].startswith(_CHANGES) or any(no in name for no in _NO_CHANGES):
            continue
        operator, occurrence = get_operator(name)(), 0
        for node in nodes:
            for place, _ in operator.mutation_positions(node):
                if not any(first <= place < last for first, last in others):
                    found.setdefault(place, []).append((name, occurrence))
                occurrence += 1
    return found


def _left_alone(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return where types and decorators are written: they are no rules."""
    found = []
    for node in ast.walk(ast.parse(source)):
        types = (getattr(node, "annotation", None), getattr(node, "returns", None))
        for each in (*types, *getattr(node, "decorator_list", ())):
            if isinstance(each, ast.expr):
                assert each.end_lineno is not None
                assert each.end_col_offset is not None
                end = (each.end_lineno, each.end_col_offset)
                found.append(((each.lineno, each.col_offset), end))
    return found


def _mutant(part: Part, line: int, name: str, occurrence: int) -> Mutant | None:
    source = _source(part)
    changed = mutate_code(source, get_operator(name)(), occurrence)
    return None if changed in (None, source) else Mutant(part, line, changed, source)


def _passes(tree: Path, tests: tuple[str, ...]) -> bool:
    """Run tests in a copy of the tree, in a process of their own; return whether all pass."""
    child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        return status == 0
    resource.setrlimit(resource.RLIMIT_CPU, (_MOST_CPU_S, _MOST_CPU_S))
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    os.chdir(tree)
    sys.path[:0] = [str(tree), str(tree / "agents")]
    for name in [each for each in sys.modules if each.partition(".")[0] == "tests"]:
        del sys.modules[name]
    options = ("-x", "-p", "no:cacheprovider", "-m", "not slow", "--hypothesis-profile=ci")
    os._exit(pytest.main([*options, *tests]))


def main(
    count: Annotated[int, typer.Option(help="Changes in each area.")] = 50,
    seed: Annotated[int, typer.Option(help="Decides which.")] = 0,
    only: Annotated[str, typer.Option(help="Areas with this in their names.")] = "",
) -> None:
    """Change modules of the core and run their tests; print what no test noticed."""
    with TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = str(Path(folder, "numba"))
        for name in _IMPORTS:
            importlib.import_module(name)
        tree = Path(folder, "tree")
        tree.mkdir()
        for each in _PARTS:
            copy = shutil.copytree if (ROOT / each).is_dir() else shutil.copy
            copy(ROOT / each, tree / each)
        print("| area | places | changes | noticed |\n|---|---|---|---|")
        for area, parts in AREAS.items():
            if only not in area:
                continue
            for tests in {part.tests for part in parts}:
                if not _passes(tree, tests):
                    raise SystemExit(f"{area}: the tests fail as it is")
            places, mutants = drawn(parts, count, Random(f"{seed} {area}"))
            survivors, tried = [], 0
            for mutant in mutants:
                tried += 1
                (tree / mutant.part.module).write_text(mutant.source, encoding="utf-8")
                if _passes(tree, mutant.part.tests):
                    survivors.append(mutant)
                    print(f"    {mutant}", flush=True)
                (tree / mutant.part.module).write_text(mutant.original, encoding="utf-8")
            noticed = tried - len(survivors)
            print(f"| {area} | {places} | {tried} | {noticed} |", flush=True)


if __name__ == "__main__":
    typer.run(main)
