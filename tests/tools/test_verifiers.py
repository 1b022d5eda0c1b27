"""The OpenEnv task set of verifiers, from another installation, against the door by OpenEnv."""

import json
import os
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("openenv", reason="needs the extra openenv: `make matrix-verifiers`")

from blast_env.tools import Episode, Tasks, played_in
from blast_env.tools.scripts import rules_guesses_blasts
from tests.tools.serving import scripted_model, served

VF_EVAL = os.environ.get("BLAST_ENV_VF_EVAL", "")
"""The command of verifiers, which cannot be installed beside the door."""

CONFIGURATION = """\
model = "script"
push = false
output_dir = "out"
run = {{ name = "doors" }}
client = {{ base_url = "{model}", api_key_var = "NONE" }}
[env]
taskset = {{ id = "openenv", base_url = "{address}", resets = [{resets}] }}
player = {{ harness = {{ id = "null" }}, runtime = {{ type = "subprocess" }} }}
"""


@pytest.mark.skipif(not VF_EVAL, reason="needs verifiers elsewhere: `make matrix-verifiers`")
def test_rewards_that_verifiers_sums_are_the_scores_that_python_gets(tmp_path: Path) -> None:
    resets = Tasks().resets("benchmark", 2, budget=1)
    with served("--openenv") as (_, line), scripted_model(rules_guesses_blasts) as model:
        tables = [", ".join(f"{key} = {json.dumps(own[key])}" for key in own) for own in resets]
        text = CONFIGURATION.format(
            model=model,
            address=line.split()[-1],
            resets=", ".join(f"{{ {table} }}" for table in tables),
        )
        (tmp_path / "eval.toml").write_text(text, encoding="utf-8")
        command = [VF_EVAL, "@", "eval.toml", "--no-rich"]
        run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    lines = (tmp_path / "out/doors/traces.jsonl").read_text(encoding="utf-8").splitlines()
    found = {}
    for episode in map(json.loads, lines):
        assert episode["ok"], run.stderr
        (trace,) = episode["traces"]
        found[episode["task"]["data"]["idx"]] = trace["rewards"]["openenv_reward"]["score"]
    for number, own in enumerate(resets):
        score = played_in(rules_guesses_blasts(), Tasks().begin(Episode.model_validate(own)))
        assert found[number] == score > 0.0
