"""Settings for the tests of commands."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from blast_env.answers import assess
from blast_env.design.search import advised
from blast_env.evaluation.questions.probability import level_probability
from blast_env.site import save_scenario
from tests.figures import undrawn_package as undrawn_package
from tests.gas_sites import hut


@pytest.fixture(scope="package", autouse=True)
def _probabilities_of_few_draws() -> Iterator[None]:
    """Draw a fiftieth of what commands draw."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (advised, assess):
            patch.setattr(module, "level_probability", partial(level_probability, draws=20))
        yield


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """The file of a site with heights, on which a blast of gas takes a fraction of a second."""
    path = tmp_path / "hut.toml"
    save_scenario(hut(), path)
    return path
