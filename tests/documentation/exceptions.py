"""Which commands of the pages do not run just as they stand, and why.

A test fails when one of these no longer stands for a command that a page shows.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Given:
    """What pages take for granted, as from a page read before.

    Attributes:
        pages: The pages.
        path: The file or folder that they name.
        made: The file or folder that it is a copy of.
        command: What makes that; none: every checkout has it.
    """

    pages: tuple[str, ...]
    path: str
    made: str
    command: str = ""


@dataclass(frozen=True)
class Server:
    """How it is known that a program does what it should that ends only when it is told to.

    Attributes:
        port: Where it must answer.
    """

    port: int


_WALL: Final = "blast-env search --scenario courtyard --method wall_near_charge --out wall"
_SITE: Final = (
    "blast-env import docs/data/pump_house.geojson --protect 'Pump House' --out site.toml"
    " && blast-env search --scenario site.toml --method wall_near_building --threat hidden"
    " --threats 1 --held-out 1 --out wall"
)
_TRAIN: Final = (
    "--steps 64 --envs 1 --set n_steps=64 --set batch_size=64 --set evaluation_cases=2"
    " --set evaluation_interval=1"
)
_WARM: Final = "--set imitation_cases=2 --set imitation_updates=1"
_AGENT: Final = f"blast-env train --scenario courtyard --run agent {_TRAIN}"

GIVEN: Final = (
    Given(("docs/start.md",), "depot.toml", "docs/data/depot.toml"),
    Given(
        ("docs/howto/pictures.md", "docs/engineers/gas.md", "docs/howto/cluster.md"),
        "wall.json",
        "wall/layout.json",
        _WALL,
    ),
    Given(
        ("docs/researchers/training.md", "docs/engineers/gas.md"),
        "layout.json",
        "wall/layout.json",
        _WALL,
    ),
    Given(("docs/researchers/benchmark.md",), "own_optimiser.py", "examples/own_optimiser.py"),
    Given(("docs/howto/report.md",), "site.toml", "site.toml", _SITE),
    Given(("docs/howto/report.md",), "layout.json", "wall/layout.json", _SITE),
    Given(("docs/engineers/gas.md",), "my_site.toml", "scenarios/courtyard.toml"),
    Given(("docs/researchers/benchmark.md",), "runs/courtyard", "agent", _AGENT),
)

SERVERS: Final = {
    "blast-env app": Server(8080),
    "blast-env app --port 8090 --folder designs": Server(8090),
    "tensorboard --logdir runs/courtyard/tensorboard": Server(6006),
}

BACKGROUND: Final = {
    "docs/howto/cluster.md": (
        "dask scheduler --host 127.0.0.1 --scheduler-file dask.json --no-dashboard",
        "dask worker --scheduler-file dask.json --nworkers 1 --nthreads 1 --no-dashboard",
    )
}
"""What runs beside all commands of a page, in the place of what a reader has elsewhere."""

_CLUSTER: Final = "--cluster dask.json"


SMALLER: Final[dict[str, str]] = {
    # README.md
    "blast-env evaluate --layout found/layout.json --scenario visitor_entrance --seeds 4": (
        "--seeds 1 --cell 0.5"
    ),
    "blast-env report visitor_entrance --layout found/layout.json --out report.html"
    " --pdf report.pdf": ("--threats 1 --places 1 --no-items"),
    # docs/howto
    "blast-env report site.toml --layout layout.json --out report.html --pdf report.pdf": (
        "--threats 1 --places 1 --no-items"
    ),
    "blast-env report site.toml --layout layout.json --out report.html --limit Pump_House=300,60"
    " --charge 5,9,100": "--places 1 --no-items",
    "blast-env search --engine gas --method genetic --budget 2000 --cache blasts"
    " --cluster tcp://login1:8786": (
        f"--scenario visitor_entrance --budget 4 --held-out 1 {_CLUSTER}"
    ),
    "blast-env evaluate --engine gas --layout wall.json --seeds 1000 --cluster dask.json": (
        "--seeds 1 --cell 0.5"
    ),
    "blast-env train --engine gas --envs 64 --cluster tcp://login1:8786 --run runs/gas": (
        f"{_TRAIN} --engine event {_CLUSTER}"
    ),
    # docs/engineers/gas.md, docs/howto/pictures.md
    "blast-env search --scenario my_site.toml --engine gas --cells coarse --out found": (
        "--budget 2 --held-out 1"
    ),
    "blast-env evaluate --layout wall.json --scenario my_site.toml --engine gas --seeds 8": (
        "--seeds 1 --cell 0.5"
    ),
    # docs/engineers/screening.md
    "blast-env assess site.toml --screen --glazing window_laminated_6 --wall brick_215"
    " --mass backpack --gas --cells coarse": "--cells uniform --cell 0.5",
    "python -m studies.response angles": "--width 12",
    # docs/engineers/atlas.md
    "python -m studies.atlas run --out out/atlas": "--family shadow --groups 1",
    "python -m studies.atlas scaling": "--family posts",
    "python -m studies.atlas cases": "--cell 0.5",
    "python -m studies.atlas sites": "control_room",
    "python -m studies.atlas unseen": "--sites 1",
    "python -m studies.atlas check --groups 3": "--family shadow --groups 1",
    "python -m studies.response peaks": "--cell 0.5",
    "python -m studies.response raised": "--cell 0.5 --distances 10 --heights 0,1.1",
    "python -m studies.response raised --cell 0.25 --distances 5,6.5,8 --heights 0,0.2,2,3,4,5": (
        "--cell 0.5 --distances 8 --heights 0,0.2"
    ),
    # docs/researchers/training.md
    "python -m studies.cluster --engine surrogate": "--budget 8 --workers 1",
    "python -m studies.first_hour --reward relative --action row": (
        "--steps 64 --seeds 1 --algorithm PPO --threats 2 --by-gas 0"
    ),
    "python -m studies.first_hour --engine surrogate --action suggestion --threats 24"
    " --by-gas 6 --scenario courtyard --scenario control_room --scenario visitor_entrance"
    " --scenario hotel_forecourt --scenario school_and_clinic": (
        "--steps 64 --seeds 1 --threats 2 --by-gas 0"
    ),
    "python -m studies.first_hour --engine surrogate --action suggestion --envs 8 --algorithm"
    " MaskablePPO --steps 40960 --seeds 1 --threats 48 --by-gas 24 --scenario item_sites": (
        "--steps 64 --threats 2 --by-gas 0"
    ),
    "python -m studies.first_hour --engine gas --algorithm MaskablePPO --scenario visitor_entrance"
    " --steps 8192 --seeds 1 --threats 0 --by-gas 6": "--steps 64 --by-gas 1",
    "python -m studies.first_hour --engine surrogate --algorithm MaskablePPO --scenario"
    " visitor_entrance --steps 61440 --seeds 1 --threats 0 --by-gas 6": "--steps 64 --by-gas 1",
    "python -m studies.causes --out docs/pictures/causes.png": "--steps 64 --threats 2 --repeats 1",
    # docs/engineers/response.md
    "python -m studies.response cells": "--finest 0.5",
    "python -m studies.gas kingery-bulmash --charges 100": "--charges 20 --distances 4.3",
    "python -m studies.gas corners": "--sizes 0.5",
    "python -m studies.gas peaks": "--facades 1",
    "python -m studies.gas judge --random-layouts 18 --charges 1": (
        "--random-layouts 1 --charges 1 --seeds 1"
    ),
    "python -m studies.gas definition": "--scenario control_room --until 0.05",
    "python -m studies.gas ending": "--generated 0 --times 1.1",
    "python -m studies.gas oblique": "--angles 20 --until 0.02",
    "python -m studies.gas cells --scenario visitor_entrance --random-layouts 0 --finest 0.125": (
        "--sizes 0.5 --finest 0.5"
    ),
    # docs/studies/scenarios.md
    "python -m studies.benchmark headroom visitor_entrance-known": "--blasts 1",
    "blast-env evaluate --scenario visitor_entrance --layout"
    " docs/data/best_found/visitor_entrance.json --engine gas --seeds 3": ("--cell 0.5 --seeds 1"),
    # docs/researchers/sites.md
    "python -m studies.headroom --kind item_sites --kind kerb_sites": "--sites 2 --blasts 2",
    "python -m studies.headroom_sites --first 0 --sites 80 --changes 2000": "--sites 1 --changes 4",
    "python -m studies.headroom_sites --kind kerb_sites --first 0 --sites 80 --changes 2000": (
        "--sites 1 --changes 4"
    ),
    "python -m studies.headroom_sites --first 10000 --sites 40 --changes 2000": (
        "--sites 1 --changes 4"
    ),
    "python -m studies.headroom_sites --kind kerb_sites --first 10000 --sites 40 --changes 2000": (
        "--sites 1 --changes 4"
    ),
    "python -m studies.headroom --kind headroom_sites --first 0 --sites 20": (
        "--sites 2 --blasts 2"
    ),
    # docs/researchers/training.md
    "python -m studies.packaged_agent judge --kind headroom_sites --first 0 --sites 60": (
        "--sites 2"
    ),
    "python -m studies.packaged_agent show --out out/packaged/shown.jsonl": (
        "--count 2 --changes 5"
    ),
    "python -m studies.packaged_agent train out/packaged/shown.jsonl": "--visits 4 --checked 2",
    "python -m studies.packaged_agent train --visits 1500": "--visits 4 --checked 2",
    "python -m studies.packaged_agent train --visits 1500 --first 160 --checked 42 --seeds 3": (
        "--visits 4 --checked 2 --seeds 1"
    ),
    "python -m studies.packaged_agent judge --kind item_sites --kind kerb_sites --sites 60": (
        "--sites 2"
    ),
    "python -m studies.packaged_agent judge control_room school_and_clinic visitor_entrance"
    " hotel_forecourt shopping_street": "--charges 2",
    # docs/researchers/surrogate.md
    "python -m studies.surrogate fit --out surrogate.json": (
        "--data docs/data/close_site_blasts.parquet --epochs 1 --every 4"
    ),
    "python -m studies.surrogate blasts --kind square_sites --sites 100 --layouts 8 --rules 7"
    " --surrogate surrogate.json --favourites 5 --changes 100 --draws 5 --threats 2 --cache"
    " blasts": ("--sites 1 --layouts 1 --rules 1 --favourites 1 --draws 1 --threats 1"),
    "python -m studies.surrogate gap --surrogate surrogate.json --sites 300": (
        "--data docs/data/close_site_blasts.parquet"
    ),
    "python -m studies.learning_curve --epochs 16": (
        "--data docs/data/close_site_blasts.parquet --other docs/data/many_site_blasts.parquet"
        " --epochs 1 --share 1.0"
    ),
    "python -m studies.surrogate judge control_room school_and_clinic visitor_entrance"
    " hotel_forecourt shopping_street --charges 3 --kind kerb_sites --kind item_sites"
    " --kind street_sites --sites 24 --surrogate surrogate.json": (
        "--charges 1 --changes 1 --sites 1"
    ),
    # docs/researchers/benchmark.md
    "python -m studies.benchmark choose": (
        "--kind kerb_sites --sites 1 --blasts 2 --cache out/choice_of_two"
    ),
    "blast-env judge --method genetic --seeds 5 --cache blasts --out entry": (
        "--problem control_room-known-v2 --budget 2 --seeds 1 --cell 0.5"
    ),
    "blast-env judge --method surrogate --method studies.benchmark.methods:surrogate_alone"
    " --cache blasts --out entry": "--problem control_room-known-v2 --budget 2 --cell 0.5",
    "blast-env judge --method own_optimiser:climb --seeds 5 --cache blasts --out entry": (
        "--problem control_room-known-v2 --budget 2 --seeds 1 --cell 0.5"
    ),
    "blast-env judge --scenario courtyard --cases 8 --method rules --method best_rule"
    " --run runs/courtyard --out out/entry": "--cases 1 --budget 2 --cell 0.5",
    "blast-env judge --scenario item_sites --scenario kerb_sites --cases 30 --budget 0 --budget 10"
    " --cell 0.5 --method rules --method agent --method surrogate --out out/entry": (
        "--cases 1 --budget 0"
    ),
    "blast-env judge --scenario headroom_sites --cases 4 --budget 0 --budget 10 --cell 0.5"
    " --method rules --method agent --method surrogate --out out/entry": "--cases 1 --budget 0",
    "blast-env judge --scenario item_sites --scenario kerb_sites --cases 3 --budget 0 --cell 0.5"
    " --method rules --method studies.benchmark.methods:imitation --method"
    " studies.benchmark.methods:ppo --out out/entry": "--cases 1",
    "blast-env judge entry/genetic.json --cache blasts --out entry": "--cell 0.5",
    # docs/paper
    # docs/researchers
    "blast-env search --method genetic --budget 200 --seed 0 --charge 5,12 --out out/search": (
        "--budget 8 --held-out 1"
    ),
    "blast-env search --method nsga2 --threat hidden --threats 16 --budget 1000 --processes 2"
    " --out out/front": "--engine event --budget 40 --held-out 2",
    "blast-env train --algo maskable_ppo --scenario courtyard --run runs/courtyard": _TRAIN,
    "blast-env train --scenario visitor_entrance --engine surrogate --set imitation_updates=200"
    " --run runs/warm": f"{_TRAIN} {_WARM}",
    "blast-env judge --run runs/courtyard --scenario courtyard --cases 64 --budget 0"
    " --method rules --out out/agent": "--cases 1 --cell 0.5",
    "blast-env evaluate --layout layout.json --export layout.dxf": "--seeds 2",
    "python -m studies.check_sites --sites 16 --random-layouts 12 --threats 4": (
        "--sites 2 --random-layouts 2 --threats 1"
    ),
    "python -m studies.check_sites --family item_sites --sites 12 --random-layouts 3 --threats 1"
    " --no-rejected --picture docs/pictures/item_sites.png": "--sites 2 --random-layouts 2",
    "python -m studies.tools_table --problem control_room-known-v2 --problem"
    " hotel_forecourt-known-v2": "--budget 1 --cell 0.5",
    # docs/studies
    "python -m studies.engines": "--seeds 3 --scene courtyard",
    "python -m studies.bench --repeats 3": (
        "--engine event --repeats 1 --no-memory --no-environment"
    ),
    "python -m studies.bench --engine surrogate --scenario control_room --repeats 25": (
        "--repeats 1 --no-memory --environments 2"
    ),
    "blast-env calibrate --name ballistic_kb_100kg --reference reflected_impulse"
    " --distances 8,10,12.5,16,20,25,32,40 --seeds 32": "--seeds 2 --distances 8,16,32",
    "blast-env calibrate --name collisional_kb --preset collisional --reference reflected_impulse"
    " --distances 8,10,12.5,16,20,25,32,40 --seeds 32 --engine event"
    " --simulated transferred_impulse --tnt-range 20,1000": "--seeds 2 --distances 8,16,32",
    "blast-env calibrate --name ballistic_ufc --reference paper_ufc --seeds 32": "--seeds 2",
}
"""Options that are appended to studies and trainings of minutes to hours."""

NOT_RUN: Final[dict[str, str]] = {
    "blast-env serve --mcp --problem control_room-known-v2 --budget 4": (
        "needs mcp; tests/tools/test_mcp_door.py"
    ),
    "blast-env serve --mcp --http --port 8081": "needs mcp; tests/tools/test_mcp_door.py",
    "blast-env serve --openenv --port 8082": ("needs OpenEnv; tests/tools/test_openenv_door.py"),
    "python -m studies.offline_data --scenario control_room --episodes 20": (
        "needs Minari, and so JAX"
    ),
    "python -m studies.bench --site visitor_entrance --site control_room --site school_and_clinic"
    " --site hotel_forecourt --site shopping_street --site courtyard --site street_front"
    " --site large --cells uniform --cells coarse": (
        "a minute of one core; tests/studies/test_bench.py"
    ),
    "blast-env --install-completion": "changes the shell of whoever runs it",
    "blast-env import FILE --out site.toml": "FILE is a placeholder; the page's next commands run",
    "blast-env draw --check-only FILE...": "FILE is a placeholder; docs/start.md has a file",
    "python -m studies.blast_again docs/data/close_site_blasts.parquet --layouts 4": (
        "200 sites; tests/studies/test_blast_table.py"
    ),
    "python -m studies.data_card": "needs a package of `datasets`; tests/studies/test_data_card.py",
    "python -m studies.real_files FOLDER": "FOLDER is a placeholder for maps of your own",
    "python -m studies.blast_table FOLDER --out blasts.parquet": (
        "FOLDER is a placeholder; tests/studies/test_blast_table.py"
    ),
    "python -m rl_zoo3.train --algo ppo --env BlastBarrier-v0 --gym-packages blast_env"
    " -conf agents/blast_agents/hyperparameters/ppo.yml --vec-env subproc"
    """ --env-kwargs 'engine:'"'"'event'"'"'' 'action:'"'"'place'"'"''"""
    """ 'reward:'"'"'relative'"'"'' realisations:1"""
    """ 'observation:'"'"'grid'"'"''""": "needs RL Zoo",
    "python ppo.py --env-id blast_env:BlastBarrier-v0 --total-timesteps 4096": "needs CleanRL",
    "python -m tests.libraries.run_rllib": "needs Ray, in an environment of its own",
}
"""Commands that are parsed only, and why."""

CODE_OF_THE_BUILD: Final = {
    "docs/researchers/benchmark.md": "a dozen blasts of gas dynamics",
    "docs/engineers/gas.md": "three blasts of gas dynamics on a large site",
    "docs/howto/cluster.md": "needs a cluster, which runs beside the page's commands",
    "docs/researchers/training.md": "needs the agent that the page's commands train",
}
"""Pages whose code `make docs` runs and `make test` compiles only, and why."""

CODE_SHORTENED: Final = {
    ("README.md", 1): ("seeds=range(3)", "seeds=range(1), cell_m=0.5"),  # not on final cells
    ("docs/researchers/sites.md", 1): ("held_out(100)", "held_out(5)"),
    ("docs/researchers/index.md", 2): (
        "seed=0)\nmodel.learn(20_480)",
        "seed=0, n_steps=16, batch_size=16)\nmodel.learn(16)",
    ),
    ("docs/researchers/libraries.md", 2): (
        "n_steps=256, seed=0)  # 2,048 steps a rollout\nmodel.learn(20_480)",
        "n_steps=16, batch_size=16, seed=0)\nmodel.learn(128)",
    ),
}
"""Parts of blocks of Python that are replaced to take less time, by page and number."""

CODE_NOT_RUN: Final = {
    ("docs/researchers/libraries.md", 4): "needs SBX, and so JAX",
    ("docs/researchers/libraries.md", 5): "needs PufferLib, which pip cannot build everywhere",
}
"""Blocks of Python, by their number on the page, that are compiled only, and why."""
