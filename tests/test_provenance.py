"""What records say of the versions and the code."""

from pathlib import Path

import numpy as np

import blast_env
from blast_env.provenance import code_digest, code_version, versions


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
