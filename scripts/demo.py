"""`make demo`; see `studies.demo`."""

import typer

from studies.demo import main

if __name__ == "__main__":
    typer.run(main)
