"""Whatever writes, writes through `blast_env.files`, so that no writer can be forgotten.

`tests/attack/test_full_disk.py` then tries each way of writing once.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]

_WRITERS: Final = frozenset(
    {
        *("write_text", "write_bytes", "savefig", "imwrite", "imsave", "save", "saveas", "savez"),
        *("savez_compressed", "savetxt", "tofile", "memmap", "write_pdf", "write_png"),
        *("write_table", "to_csv", "to_parquet", "to_excel", "to_json", "to_feather", "to_pickle"),
        *("to_hdf", "to_html", "to_sql", "Workbook", "ParquetWriter", "SummaryWriter"),
        *("ExcelWriter", "DataFileWriter", "configure", "connect", "mkdir", "makedirs", "touch"),
        *("rename", "renames", "symlink_to", "hardlink_to", "copyfile", "copy2", "copytree"),
        *("fdopen", "Popen", "FileHandler", "RotatingFileHandler", "TemporaryDirectory"),
        *("TemporaryFile", "NamedTemporaryFile", "SpooledTemporaryFile", "mkstemp", "mkdtemp"),
        *("dump", "extractall", "urlretrieve", "write_gif", "write_videofile", "mimsave"),
    }
)
"""Functions and methods that write to what their first argument, or what they belong to, names."""

_MAY_WRITE: Final = re.compile(rf"\b({'|'.join((*_WRITERS, 'open', 'replace', 'move'))})\(")

_GIVING: Final = frozenset({"write_atomically", "scratch_folder"})
_IN_MEMORY: Final = frozenset({"BytesIO", "StringIO"})

_OWN: Final = frozenset(
    {
        *("folder.save", "self.folder.save", "checkpoint.save", "start.save", "surrogate.save"),
        *("LayoutFile.of(chosen, layout, provenance).save",),
        *("LayoutFile.of(scenario, layout, provenance).save", "save"),
        *("result.to_excel", "result.to_parquet", "protected.to_excel", "evaluation.to_json"),
        *("judged.save", "submission.save", "Submission(each, tuple(own)).save"),
        *("progress.save", "self.progress.save"),
        *("report.to_json", "write_table", "self.work.open", "sessions.work.open"),
    }
)
"""Methods of the project that are named as those of others: they are looked at themselves."""

_ELSEWHERE: Final = {
    "blast_env/files.py": "the one place",
    "blast_env/journal.py: self.path.open": "adds a line, or cuts off a torn one",
    "blast_env/plots/film.py: TemporaryFile": "what ffmpeg says; made in the block of a film",
    "blast_env/plots/film.py: Popen": "ffmpeg writes to the temporary file of its caller",
    "blast_env/plots/film.py: first.save": "to the temporary file of its caller",
    "blast_env/app/jobs.py: subprocess.Popen": "a worker, which is this package",
    "blast_env/app/page/uploads.py: file.save": "an upload, into a scratch folder",
    "blast_env/reading.py: subprocess.Popen": "a worker, which is this package",
    "blast_env/reading.py: os.fdopen": "the worker's standard output",
    "blast_env/particles/workbook.py: table.to_excel": "to the file of `write_atomically`",
    "blast_env/cluster.py: connect": "to a cluster",
    "blast_env/benchmark/data/gas_blasts.py: bare.rename": "the columns of a table",
    "agents/blast_agents/training/train.py: configure": "TensorBoard's; train tells its errors",
    "agents/blast_agents/training/self_labelling.py: configure": "likewise",
    "agents/blast_agents/training/recorder.py: self.logger.dump": "likewise",
    "agents/blast_agents/training/self_labelling.py: self.logger.dump": "likewise",
    "agents/blast_agents/training/run_folder.py: os.replace": "makes the folder a run's",
    "studies/benchmark/methods.py: TemporaryDirectory": "SMAC's own files, which nobody reads",
}
"""What does not write through `blast_env.files`, and why it need not."""


def _name(call: ast.Call) -> str:
    """Return the last part of what is called."""
    match call.func:
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
    return ""


def _writes(call: ast.Call) -> bool:
    """Return whether a call writes, or may."""
    name = _name(call)
    if name == "open":
        return _mode(call) is None or not set(str(_mode(call))).isdisjoint("wax+")
    if name == "replace" and isinstance(call.func, ast.Attribute):
        return len(call.args) == 1 or ast.unparse(call.func) == "os.replace"  # texts take two
    return name in _WRITERS or (name == "move" and ast.unparse(call.func) == "shutil.move")


def _mode(call: ast.Call) -> str | None:
    """Return the mode that a file is opened in, or `None` if the code does not show it."""
    given = [each.value for each in call.keywords if each.arg == "mode"]
    is_builtin = isinstance(call.func, ast.Name)
    given += call.args[1:2] if is_builtin else call.args[:1]
    if not given:
        return "r"
    return str(given[0].value) if isinstance(given[0], ast.Constant) else None


def _names_in(node: ast.AST) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def _safe_names(scope: ast.AST) -> set[str]:
    """Return names for temporary files, what lies in scratch folders, and buffers in memory."""
    safe: set[str] = set()
    for node in ast.walk(scope):
        if isinstance(node, ast.withitem) and isinstance(node.context_expr, ast.Call):
            gives = _name(node.context_expr) in _GIVING
            safe |= _names_in(node.optional_vars) if gives and node.optional_vars else set()
    for node in ast.walk(scope):
        if isinstance(node, ast.Assign):
            is_buffer = isinstance(node.value, ast.Call) and _name(node.value) in _IN_MEMORY
            if is_buffer or _names_in(node.value) & safe:
                safe |= set().union(*map(_names_in, node.targets))
    return safe


def _unsafe_writes(source: str) -> Iterator[str]:
    """Yield the writing calls of a file whose target is not known to be safe."""
    if not _MAY_WRITE.search(source):  # most files: saves their parsing
        return
    tree = ast.parse(source)
    writing = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _writes(node)]
    scopes = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    inside = [(set(map(id, ast.walk(scope))), _safe_names(scope)) for scope in scopes if writing]
    for call in writing:
        if not any(id(call) in nodes and _names_in(call) & safe for nodes, safe in inside):
            yield ast.unparse(call.func)


def test_every_writer_goes_through_one_place() -> None:
    found = set()
    for part in ("blast_env", "agents", "studies"):
        for path in (ROOT / part).rglob("*.py"):
            file = path.relative_to(ROOT).as_posix()
            others = set(_unsafe_writes(path.read_text(encoding="utf-8"))) - _OWN
            found |= {file} if file in _ELSEWHERE else {f"{file}: {each}" for each in others}
    assert found == set(_ELSEWHERE)


@pytest.mark.parametrize(
    "line",
    [
        "path.write_text('x')",
        "open(path, 'w')",
        "open(path, mode=mode)",
        "path.open('ab')",
        "table.to_csv(path)",
        "figure.savefig(path)",
        "np.savez(path, a=1)",
        "path.replace(other)",
        "path.mkdir()",
        "with TemporaryDirectory() as folder: pass",
        "with write_atomically(path) as temporary: path.write_text('x')",
    ],
)
def test_what_writes_elsewhere_is_found(line: str) -> None:
    assert len(list(_unsafe_writes(f"def write(path):\n    {line}"))) == 1


@pytest.mark.parametrize(
    "line",
    [
        "open(path)",
        "open(path, 'rb')",
        "path.open()",
        "text.replace('a', 'b')",
        "replace(record, a=1)",
        "with write_atomically(path) as temporary: temporary.write_text('x')",
        "with scratch_folder() as folder: (folder / 'a').write_text('x')",
        "buffer = BytesIO(); figure.savefig(buffer)",
    ],
)
def test_what_does_not_is_not(line: str) -> None:
    assert list(_unsafe_writes(f"def write(path):\n    {line}")) == []
