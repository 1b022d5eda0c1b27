"""'import blast_env' is light, offers what is asked for, and says its versions."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import blast_env
from blast_env.provenance import code_digest, code_version, versions

HEAVY = ("joblib", "numba", "pandas", "pyarrow", "pydantic", "pymunk", "scipy", "torch")
"""What takes a hundredth of a second or more to import, beside Gymnasium and NumPy."""


def modules_after(statement: str) -> set[str]:
    """Return what is imported in a fresh process after a statement."""
    code = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_package_imports_nothing_heavy() -> None:
    """Whoever imports it to have the environments registered waits for Gymnasium alone."""
    modules = modules_after("import blast_env")
    assert modules.isdisjoint(HEAVY)
    own = {name for name in modules if name.split(".")[0] == "blast_env"}
    light = {"blast_env.bundled", "blast_env.envs", "blast_env.lazy", "blast_env.provenance"}
    assert own == {"blast_env", *light}


def test_engines_import_neither_pandas_nor_numba_before_a_blast() -> None:
    statement = "import blast_env\nblast_env.GasResult, blast_env.simulate"
    assert modules_after(statement).isdisjoint({"numba", "pandas", "pymunk", "scipy"})


def test_guesses_need_no_torch() -> None:
    modules = modules_after("import blast_env.surrogate as room; room.packaged_surrogate()")
    assert "blast_env.surrogate.ensemble" in modules
    assert not {"torch", "pandas"} & modules


def test_no_name_of_a_room_is_that_of_a_file_beside_it() -> None:
    """Importing the file would put it in the place of a name that comes on first use."""
    root = Path(blast_env.__file__).parent
    for room in root.rglob("__init__.py"):
        text = room.read_text(encoding="utf-8")
        if "on_first_use(__name__)" in text:
            lazy = [
                node
                for part in ast.parse(text).body
                if isinstance(part, ast.If)
                for node in part.body
            ]
            imports = [node for node in lazy if isinstance(node, ast.ImportFrom)]
            names = {alias.name for node in imports for alias in node.names}
            assert names.isdisjoint(file.stem for file in room.parent.iterdir()), room


@pytest.mark.parametrize("name", blast_env.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(blast_env, name) is not None
    assert name in dir(blast_env)


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(blast_env.__file__).read_text(encoding="utf-8"))
    typed = {
        alias.name
        for node in tree.body
        if isinstance(node, ast.If)
        for statement in node.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    assert typed == set(blast_env.__all__) - {"bundled_scenarios"}
    assert typed <= set(dir(blast_env))


def test_another_name_is_an_error_as_of_any_module() -> None:
    with pytest.raises(AttributeError, match="module 'blast_env' has no attribute 'explode'"):
        blast_env.explode  # type: ignore[attr-defined]  # noqa: B018


def inner_names() -> set[tuple[str, str]]:
    """Return the names that tests import from modules instead of from a room, by module."""
    repository, found = Path(__file__).parents[1], set()
    for path in sorted((repository / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("blast_env."):
                module = str(node.module)
                place = repository / module.replace(".", "/")
                found |= {
                    (module, alias.name)
                    for alias in node.names
                    if not place.is_dir() or (place / f"{alias.name}.py").exists()
                }
    return found


def test_tests_leave_the_inside_of_rooms_free_to_move() -> None:
    """Who deletes or renames a helper rewrites no tests: they import from rooms."""
    assert 10 < len(inner_names()) <= 350


# --- What records say of the versions and the code.


def test_versions_are_those_that_run() -> None:
    record = versions("event 1", ("numpy", "no-such-package"))
    assert record["blast_env"] == blast_env.__version__
    assert record["engine"] == "event 1"
    assert record["numpy"] == np.__version__
    assert record["no-such-package"] == "not installed"
    assert "engine" not in versions()


def test_the_digest_of_code_knows_its_parts(tmp_path: Path) -> None:
    """A change of what loads depend on is noticed, one of a picture is not."""
    for name in ("physics", "rendering"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "code.py").write_text("1\n")
    before = code_digest(tmp_path, {"rendering"})
    (tmp_path / "rendering" / "code.py").write_text("2\n")
    assert code_digest(tmp_path, {"rendering"}) == before
    (tmp_path / "physics" / "code.py").write_text("2\n")
    assert code_digest(tmp_path, {"rendering"}) != before


def test_the_version_of_the_code_begins_with_the_packages() -> None:
    assert code_version().startswith(f"{blast_env.__version__}+")
