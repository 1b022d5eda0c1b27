"""Settings for all tests."""

import os

# Windows of render_mode="human" need no screen here. Set before pygame is imported.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Two threads for the small sums of these networks cost many times what one does where workers share
# the cores. Set before torch is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Tables are as wide as in a pipe, whatever the terminal that runs the tests.
os.environ.pop("COLUMNS", None)
