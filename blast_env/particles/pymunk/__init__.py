"""The engine on pymunk: the paper's model in steps of time."""

from importlib.metadata import version
from typing import Final

VERSION: Final = f"pymunk {version('pymunk')}"
"""Version of the code that does the physics."""
