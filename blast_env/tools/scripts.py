"""Scripted agents: what plays through a door without a model, to check it and to compare with.

A script is a generator of calls, (name of the tool, arguments), which is sent each result as plain
JSON values and returns the score. So the same script plays through every door.
"""

from collections.abc import Callable, Generator, Mapping
from types import MappingProxyType
from typing import Any, Final

from blast_env.tools.session import Session
from blast_env.tools.table import call_tool

Values = dict[str, Any]
Script = Generator[tuple[str, Values], Values, float]


def submitted(layout: list[Values]) -> Script:
    """Submit a layout."""
    found = yield from _waited("submit", layout)
    score: float = found["score"]["score"]
    return score


def nothing() -> Script:
    """Submit no barrier."""
    return (yield from submitted([]))


def random() -> Script:
    """Submit the random layout."""
    found = yield "rules", {}
    return (yield from submitted(found["proposals"][-1]["layout"]))


def rules() -> Script:
    """Blast what the rules propose, in their order; submit the best."""
    layouts = yield from _of_rules()
    return (yield from _best_of_blasts(layouts))


def guesses() -> Script:
    """Guess what the rules propose, and submit the best by guess."""
    layouts = yield from _by_guess()
    return (yield from submitted(layouts[0]))


def rules_guesses_blasts() -> Script:
    """Guess what the rules propose, blast the best by guess, submit the best by blast."""
    layouts = yield from _by_guess()
    return (yield from _best_of_blasts(layouts))


SCRIPTS: Final[Mapping[str, Callable[[], Script]]] = MappingProxyType(
    {
        "nothing": nothing,
        "random": random,
        "rules": rules,
        "guesses": guesses,
        "rules, guesses, blasts": rules_guesses_blasts,
    }
)
"""The scripts by name."""


def played(script: Script, call: Callable[[str, Values], Values]) -> float:
    """Return the score of a script, with a function that calls tools."""
    try:
        asked = next(script)
        while True:
            asked = script.send(call(*asked))
    except StopIteration as end:
        score: float = end.value
        return score


def played_in(script: Script, session: Session) -> float:
    """Return the score of a script in a session."""
    return played(
        script, lambda name, given: call_tool(session, name, given).model_dump(mode="json")
    )


def _of_rules() -> Generator[tuple[str, Values], Values, list[list[Values]]]:
    """Return the layouts of the rules that have one, without the random one."""
    found = yield "rules", {}
    layouts = [proposal["layout"] for proposal in found["proposals"][:-1]]
    return [layout for layout in layouts if layout]


def _by_guess() -> Generator[tuple[str, Values], Values, list[list[Values]]]:
    """Return the layouts of the rules, the least predicted share first."""
    ranked = []
    for layout in (yield from _of_rules()):
        found = yield "guess", {"layout": layout}
        ranked.append((found["share"], layout))
    return [layout for _, layout in sorted(ranked, key=lambda pair: float(pair[0]))]


def _best_of_blasts(layouts: list[list[Values]]) -> Script:
    """Blast layouts until the budget is used up, and submit the best."""
    site = yield "look", {}
    best, best_share, left = layouts[:1], 1.0, site["blasts_left"]
    for layout in layouts:
        if left < site["blasts_per_layout"]:
            break
        found = yield from _waited("blast", layout)
        left, share = found["blasts_left"], found["blast"]["share"]
        if share < best_share:
            best, best_share = [layout], share
    return (yield from submitted(best[0] if best else []))


def _waited(tool: str, layout: list[Values]) -> Generator[tuple[str, Values], Values, Values]:
    """Call a tool with a layout, and poll until its work is done."""
    found = yield tool, {"layout": layout}
    while found["running"]:
        found = yield "poll", {"ticket": found["ticket"]}
    return found
