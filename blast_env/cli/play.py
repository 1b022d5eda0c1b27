"""`blast-env play`: place barriers by hand."""

from typing import Annotated

import gymnasium as gym
import typer

from blast_env.cli.output import engine_text, print_line, user_errors
from blast_env.envs.play import KEYS
from blast_env.envs.play import play as play_in_window
from blast_env.geometry import layout_counts
from blast_env.physics.engines import find_engine
from blast_env.scenario import find_scenario


def play(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")] = (
        "courtyard"
    ),
    seed: Annotated[int, typer.Option(min=0, help="Of the first episode.")] = 0,
    threat: Annotated[
        str, typer.Option(help="visible or hidden: whether you see the charge.")
    ] = "visible",
    engine: Annotated[
        str, typer.Option(help="event or pymunk (particles), or gas (gas dynamics).")
    ] = "event",
    film: Annotated[bool, typer.Option(help="Show the blast.")] = True,
) -> None:
    """Place barriers by hand, with mouse and keyboard, and see what the blast makes of them."""
    with user_errors():
        env = gym.make(
            "blast_env:BlastBarrier-v0",
            scenario=scenario,
            threat=threat,
            engine=engine,
            render_mode="rgb_array",
            show_blast=film,
        )
        print_line(engine_text(find_engine(engine), [find_scenario(scenario)]))
        print_line(KEYS)
        for played in play_in_window(env, seed):
            print_line(
                f"seed {played.seed}, {layout_counts(played.layout, 'barrier')}: "
                f"{played.impulse_pa_s:,.0f} Pa s, reduction {played.reduction:.1%}"
            )
        env.close()
