"""The picture of a layout that every command draws which finds or judges one."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from blast_env.geometry import Element
from blast_env.scenario import Scenario

LAYOUT_PICTURE: Final = "layout.png"
"""File of the picture in the folder of `--out`."""


def save_layout_picture(scenario: Scenario, layout: Sequence[Element], path: Path) -> Path:
    """Draw a layout on its site, from above and obliquely; return the file.

    Raises:
        MissingExtraError: If the extra `render` is not installed.
        BlastEnvError: If the file cannot be written.
    """
    # Here, because pictures need the extra `render`.
    from blast_env.rendering.figures import save_figure
    from blast_env.rendering.site_picture import site_picture

    return save_figure(site_picture(scenario, layout), path)
