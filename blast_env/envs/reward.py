"""When an episode of placing pays for the impulse."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

from blast_env.envs.objective import Objective
from blast_env.scenario import Cell


@dataclass(frozen=True)
class Transition:
    """What one action changed.

    Attributes:
        initial: The layout at `reset`.
        before: The layout before the action.
        after: The layout after it; the same, unless the action placed a module.
        ended: Whether the charge goes off now.
        objective: Assesses layouts under the threats of the episode.
    """

    initial: tuple[Cell, ...]
    before: tuple[Cell, ...]
    after: tuple[Cell, ...]
    ended: bool
    objective: Objective


class Reward(Protocol):
    """Pays for an action, in named terms."""

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the terms; the reward is their sum.

        Always the same names, and none that the environment uses itself (`illegal_actions`).
        """


@dataclass(frozen=True)
class TerminalReward:
    """Minus the impulse of the whole layout, paid when the charge goes off."""

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the term `impulse`, psi*s; 0 before the end."""
        if not transition.ended:
            return {"impulse": 0.0}
        return {"impulse": -transition.objective.assess(transition.after).impulse_psi_s}


@dataclass(frozen=True)
class IncrementalReward:
    """What each module takes off the impulse, paid at once; a set of blasts per module.

    A placement earns I(before) - I(after). The last step also pays -I(initial), the impulse of the
    layout at `reset`, which is the one without a barrier unless an option says otherwise. So the
    sum over an episode is that of `TerminalReward`.
    """

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the term `impulse`, psi*s."""
        impulse = 0.0
        assess = transition.objective.assess
        if transition.after != transition.before:
            before, after = assess(transition.before), assess(transition.after)
            impulse += before.impulse_psi_s - after.impulse_psi_s
        if transition.ended:
            impulse -= assess(transition.initial).impulse_psi_s
        return {"impulse": impulse}


REWARDS: Final[Mapping[str, Reward]] = MappingProxyType(
    {"terminal": TerminalReward(), "incremental": IncrementalReward()}
)
"""The rewards that have names."""
