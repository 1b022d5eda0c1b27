"""The heap of events, against sorting."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.particles.event.prediction import schedule, unschedule
from blast_env.particles.event.state import BALL, HEAP_ENTRY, NOBODY, RecordArray

BALLS = 24


class Schedule:
    """The heap and a plain dictionary of the same times."""

    def __init__(self) -> None:
        self.balls: RecordArray = np.zeros(BALLS, dtype=BALL)
        self.balls["contact_s"] = self.balls["crossing_s"] = np.inf
        self.balls["partner"] = NOBODY
        self.heap: RecordArray = np.zeros(BALLS + 1, dtype=HEAP_ENTRY)
        self.times: dict[int, float] = {}

    def put(self, ball: int, time_s: float, partner: int) -> None:
        """Schedule a contact with a partner: a ball if it is not negative, else a wall."""
        self.balls[ball]["contact_s"], self.balls[ball]["partner"] = time_s, partner
        schedule(self.heap, self.balls, ball, time_s)
        self.times[ball] = time_s

    def take(self, ball: int) -> None:
        unschedule(self.heap, self.balls, ball)
        self.times.pop(ball, None)

    def key(self, ball: int) -> tuple[float, int, int]:
        """Return what the order follows: the time, walls first, then the numbers of the pair."""
        partner = int(self.balls[ball]["partner"])
        if partner < 0:
            return self.times[ball], -1, ball
        return self.times[ball], min(ball, partner), max(ball, partner)

    def check(self) -> None:
        """Fail unless the heap holds exactly the times of the dictionary, in a heap's order."""
        size = int(self.heap[0]["ball"])
        entries = self.heap[1 : size + 1]
        held = dict(zip(entries["ball"].tolist(), entries["time_s"].tolist(), strict=True))
        assert held == self.times
        places = self.heap["place"]  # by the number of the ball
        assert all(places[ball] == 1 + place for place, ball in enumerate(entries["ball"].tolist()))
        assert (places > 0).sum() == size
        for place in range(2, size + 1):
            above, below = (int(self.heap[p]["ball"]) for p in (place // 2, place))
            assert self.key(above) <= self.key(below)

    def drain(self) -> list[int]:
        """Return the balls in the order in which they come out."""
        order = []
        while self.heap[0]["ball"]:
            order.append(int(self.heap[1]["ball"]))
            unschedule(self.heap, self.balls, order[-1])
        return order


NUMBERS = st.integers(0, BALLS - 1)
TIMES = st.one_of(st.floats(0.0, 1e3), st.sampled_from((0.0, 1.0, 2.0, np.inf)))
PARTNERS = st.integers(-4, BALLS - 1)
STEPS = st.one_of(
    st.tuples(st.just("put"), NUMBERS, TIMES, PARTNERS), st.tuples(st.just("take"), NUMBERS)
)


@given(st.lists(STEPS, max_size=120))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_the_heap_gives_what_sorting_gives(steps: list[tuple]) -> None:
    """Balls are put in, moved to earlier and later times, and taken out of the middle; many times
    are equal, and then walls come first and pairs follow their numbers.
    """
    mine = Schedule()
    for step in steps:
        if step[0] == "put":
            mine.put(*step[1:])
        else:
            mine.take(step[1])
        mine.check()
    wanted = [mine.key(ball) for ball in sorted(mine.times, key=mine.key)]
    assert [mine.key(ball) for ball in mine.drain()] == wanted
    mine.times.clear()
    mine.check()


def test_moving_to_another_cell_comes_before_what_happens_at_the_same_time() -> None:
    """The neighbours of the new cell have to be known first."""
    mine = Schedule()
    mine.put(3, 1.0, -3)
    mine.put(2, 1.0, 1)
    mine.balls[5]["crossing_s"] = 1.0
    schedule(mine.heap, mine.balls, 5, 1.0)
    assert mine.drain() == [5, 3, 2]


def test_taking_out_what_is_not_in_does_nothing() -> None:
    mine = Schedule()
    mine.put(1, 0.5, NOBODY)
    mine.take(2)
    mine.check()
