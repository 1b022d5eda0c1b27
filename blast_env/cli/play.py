"""`blast-env play`: place barriers by hand."""

from dataclasses import dataclass

from blast_env.cli.command import Command, argument, option
from blast_env.cli.options import BY_SITE, ENGINE_HELP, SCENARIO_HELP
from blast_env.cli.output import print_line
from blast_env.engines import default_engine, find_engine
from blast_env.geometry import layout_counts
from blast_env.scenario import load_scenario


@dataclass(frozen=True, kw_only=True)
class PlayCommand(Command):
    """Place barriers by hand, with mouse and keyboard, and watch their effect on the blast."""

    scenario: str = argument(SCENARIO_HELP, default="courtyard")
    seed: int = option(0, "Of the first episode.", min=0)
    threat: str = option("visible", "visible or hidden: whether you see the charge.")
    engine: str | None = option(None, ENGINE_HELP, show_default=BY_SITE)
    film: bool = option(True, "Show the blast.")

    def __call__(self) -> None:
        """Open the window, and print each blast."""
        # Here, because they take half a second to import.
        import gymnasium as gym

        from blast_env.envs.play import KEYS, play

        site = load_scenario(self.scenario)
        engine = find_engine(self.engine or default_engine(site, particles="event"))
        env = gym.make(
            "blast_env:BlastBarrier-v0",
            scenario=site,
            threat=self.threat,
            engine=engine,
            render_mode="rgb_array",
            show_blast=self.film,
        )
        print_line(engine.describe([site]))
        print_line(KEYS)
        for played in play(env, self.seed):
            print_line(
                f"seed {played.seed}, {layout_counts(played.layout, 'barrier')}: "
                f"{played.impulse_pa_s:,.0f} Pa s, reduction {played.reduction:.1%}"
            )
        env.close()
