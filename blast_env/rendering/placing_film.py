"""The blast that ends an episode of placing: its film and its last frame."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from blast_env.rendering.film import plan_film
from blast_env.rendering.frames import Frame, FramePainter
from blast_env.rendering.placing import charge_text
from blast_env.rendering.style import nice_ceiling
from blast_env.simulation import Blast, BlastResult

_LEAST_FULL_IMPULSE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class BlastScreening:
    """Shows one blast, with a text about what came of it.

    The blast is simulated again, since assessments of layouts keep only its loads.

    Attributes:
        blast: The blast.
        outcome: What came of it; in every frame.
        remark: About which blast is shown; after the scenario's name.
        width_px: Width of the frames, as for `FramePainter`.
    """

    blast: Blast
    outcome: str
    remark: str = ""
    width_px: int = 960

    def last_frame(self) -> Frame:
        """Return the state at the end, uint8 (height, width, 3)."""
        result = self.blast.run()
        painter = self._painter(result)
        balls, obstacles = result.final_balls, result.obstacles
        return painter.paint(balls, obstacles, result.time_s, self.outcome)

    def frames(self, frames_per_s: float) -> Iterator[Frame]:
        """Yield the frames of a film of 8 to 12 s, as `write_film` plans it.

        Args:
            frames_per_s: Frames in a second of the film.
        """
        result = self.blast.run()
        plan = plan_film(result, frames_per_s)
        painter = self._painter(result)
        note = f"{self.outcome}; {plan.real_time_factor}"
        run = self.blast.start()
        for frame in range(plan.frame_count):
            time_s = plan.time_s(frame)
            run.advance(time_s)
            balls = run.balls()
            # The engine's steps do not end at the frames: in between, balls fly on straight.
            moved = balls.position + (time_s - run.time_s) * balls.velocity
            yield painter.paint(replace(balls, position=moved), run.obstacles, time_s, note)

    def _painter(self, result: BlastResult) -> FramePainter:
        loads = [part.impulse for each in result.obstacles if each.protected for part in each.parts]
        return FramePainter(
            self.blast.scene,
            title=f"{self.blast.scenario.name}{self.remark}",
            subtitle=charge_text(self.blast.scene.charge),
            width_px=self.width_px,
            full_impulse=nice_ceiling(max(*loads, _LEAST_FULL_IMPULSE)),
            build_zone=self.blast.scenario.build_zone,
        )
