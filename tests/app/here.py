"""The page's work without processes of its own."""

from blast_env.app.jobs import Workers
from blast_env.app.worker import do


class Here(Workers):
    """Does all work at once and in this process."""

    def tick(self) -> None:
        while self._waiting:
            do(self._waiting.popleft())
