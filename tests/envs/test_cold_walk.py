"""How much a reader has to follow: the code entered by `make`, `reset` and the first step."""

import json
import subprocess
import sys
from typing import Final

import pytest

MOST_FILES: Final = {"make": 60, "reset": 15, "step": 30}
MOST_FUNCTIONS: Final = {"make": 477, "reset": 84, "step": 258}  # three more while Numba compiles

_WALK: Final = """
import json, os, sys
import gymnasium as gym
import blast_env

root, walked = os.path.dirname(blast_env.__file__), {}

def walk(name, call):
    entered = walked[name] = set()
    def note(frame, event, _):
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(root):
            entered.add((code.co_filename, code.co_qualname))
    sys.setprofile(note)
    try:
        return call()
    finally:
        sys.setprofile(None)

env = walk("make", lambda: gym.make("BlastBarrier-v0"))
walk("reset", lambda: env.reset(seed=0))
finish = (0, env.action_space.nvec[1] - 1, 0)  # sets off the charge, with and without a barrier
_, _, ended, _, _ = walk("step", lambda: env.step(finish))
assert ended
counts = {name: (len({file for file, _ in code}), len(code)) for name, code in walked.items()}
print(json.dumps(counts))
"""


@pytest.fixture(scope="module")
def walked() -> dict[str, tuple[int, int]]:
    """Files and pieces of code (functions, classes, modules) entered in a fresh process."""
    done = subprocess.run([sys.executable, "-c", _WALK], capture_output=True, text=True, check=True)
    found: dict[str, tuple[int, int]] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize("name", MOST_FILES)
def test_the_walk_is_short(walked: dict[str, tuple[int, int]], name: str) -> None:
    files, functions = walked[name]
    assert files <= MOST_FILES[name]
    assert functions <= MOST_FUNCTIONS[name]
