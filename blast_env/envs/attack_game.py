"""Defender and attacker as a game of PettingZoo: barriers are placed, then the worst place chosen.

`blast_env.envs.attack_game.env(scenario="hotel_forecourt")` follows PettingZoo's API of agents in
turn (AEC).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator, BlastStore, LoadCase
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.record import BlastLoads, StructureLoad
from blast_env.geometry import Element, Layout
from blast_env.layout import LayoutState, charge_against
from blast_env.site import (
    AnyCharge,
    AnyScenario,
    ObjectiveSection,
    Scenario,
    VehicleCharge,
    VehicleSource,
    find_scenario,
)
from blast_env.site.blast_site import Charge
from blast_env.sites.criterion import places_of

with import_extra("games", "game of defender and attacker"):
    from pettingzoo import AECEnv
    from pettingzoo.utils import AssertOutOfBoundsWrapper, OrderEnforcingWrapper

DEFENDER: Final = "defender"
ATTACKER: Final = "attacker"

_SEED: Final = 0
"""Of every blast: the attacker has no second try at a noisy engine."""

_LARGEST_KG: Final = 1000.0


def env(**keywords: Any) -> Any:
    """Return the game with PettingZoo's checks of the order of calls and of actions.

    Args:
        keywords: As for `AttackGame`.

    Raises:
        BlastEnvError: As `AttackGame`.
    """
    return OrderEnforcingWrapper(AssertOutOfBoundsWrapper(AttackGame(**keywords)))


@dataclass(frozen=True)
class _NoBlast(Engine):
    """The engine of the defender's environment, which only places and shows: nothing goes off."""

    name: str = "none"
    version: str = "none 1"

    title: ClassVar[str] = "None"
    validated_range: ClassVar[str] = "any range: there is no blast"

    def loads(
        self,
        scenario: Scenario,
        layout: Sequence[Element],  # noqa: ARG002
        charge: AnyCharge,  # noqa: ARG002
        seed: int,  # noqa: ARG002
    ) -> BlastLoads:
        """Return no loads."""
        loads = tuple(StructureLoad.on(item, 0.0, notes=()) for item in scenario.structures)
        modules = sum(structure.modules for structure in scenario.structures)
        return BlastLoads(loads, np.zeros(modules))


class AttackGame(AECEnv[str, dict[str, Any], int]):  # type: ignore[misc]  # untyped package
    """The defender places barriers one by one; then the attacker chooses where a charge goes off.

    The defender's actions are those of `BlastBarrierEnv` with `action="place"`. When it finishes,
    or nothing more can be placed, the attacker takes one of the places in reach: each charge at a
    point, nine places along a line or in an area, the worst places of each vehicle with the layout
    as it stands. The payoff of the attacker is the load of the objective as a share of the worst
    load without a barrier; that of the defender is minus that.

    Observations are dictionaries: `observation`, the vector `"features"` of the layout so far;
    `places`, the x and y of each place as shares of the site, and the cube root of the charge's
    mass in t (places, 3); `action_mask`, the legal actions.

    Args:
        scenario: The scenario, or its bundled name or path.
        engine: The engine of the blasts; gas dynamics by default.
        cache: Folder or store of the blasts.

    Attributes:
        scenario: The scenario.
        charges: The charge at each place; that of a vehicle depends on the layout (places,).
        evaluator: Runs the blasts.

    Raises:
        BlastEnvError: If the scenario has no build zone, or nothing arrives without a barrier.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "blast_attack_v0",
        "render_modes": [],
        "is_parallelizable": False,
    }

    def __init__(
        self,
        scenario: AnyScenario = "courtyard",
        engine: str | Engine = JUDGE,
        cache: str | Path | BlastStore | None = None,
    ) -> None:
        super().__init__()
        self.scenario = find_scenario(scenario)
        # The defender places in the environment itself, whose engine runs no blast, and so knows no
        # response: the game sets off the charge that the attacker chose.
        self.placing = BlastBarrierEnv(
            self.scenario.model_copy(update={"objective": ObjectiveSection()}),
            observation="features",
            action="place",
            threat="hidden",
            threats=1,
            engine=_NoBlast(),
        )
        self.evaluator = BlastEvaluator(self.scenario, engine, cache=cache)
        self.charges = _charges(self.scenario)
        self.possible_agents = [DEFENDER, ATTACKER]
        self.render_mode = None
        actions = {
            DEFENDER: spaces.Discrete(self.scenario.zone.catalogue.finish + 1),
            ATTACKER: spaces.Discrete(len(self.charges)),
        }
        self._actions: dict[str, spaces.Discrete] = actions
        self._observations = {
            agent: spaces.Dict(
                {
                    "observation": self.placing.observation_space,
                    "places": spaces.Box(0.0, 1.0, (len(self.charges), 3), np.float32),
                    "action_mask": spaces.MultiBinary(int(space.n)),
                }
            )
            for agent, space in actions.items()
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations."""
        return self._observations[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        return self._actions[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Clear the build zone; the defender begins.

        Args:
            seed: Unused but for the order of PettingZoo: nothing is drawn.
            options: `layout`, what stands at first. Others have no effect: PettingZoo's own test
                of an environment passes one.
        """
        layout = {"layout": options["layout"]} if options and "layout" in options else None
        self._vector, _ = self.placing.reset(seed=seed, options=layout)
        self.agents = [*self.possible_agents]
        self.agent_selection = DEFENDER
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos: dict[str, dict[str, Any]] = {agent: {} for agent in self.agents}

    def observe(self, agent: str) -> dict[str, Any]:
        """Return the layout so far, the attacker's places and the legal actions of an agent."""
        if agent == ATTACKER:
            mask = self._in_reach.astype(np.int8)
        else:
            mask = self.placing.action_masks().astype(np.int8)
        return {"observation": self._vector, "places": self._places, "action_mask": mask}

    def step(self, action: int) -> None:
        """Place a piece or finish, as the defender; set off the charge, as the attacker.

        An attacker's place out of reach, of which the mask tells, is that of the vehicle's worst
        place of the same number again.
        """
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)
            return
        self._cumulative_rewards[agent] = 0.0
        self._clear_rewards()
        if agent == DEFENDER:
            self._vector, _, ended, _, _ = self.placing.step(np.int64(action))
            self.agent_selection = ATTACKER if ended else DEFENDER
        else:
            share = float(self.shares([int(action)])[0])
            self.rewards = {DEFENDER: -share, ATTACKER: share}
            self.terminations = dict.fromkeys(self.agents, True)
            self.infos = {agent: {"load_share": share} for agent in self.agents}
            self.agent_selection = DEFENDER
        self._accumulate_rewards()

    @property
    def layout(self) -> Layout:
        """The layout so far."""
        return self._placement.layout

    def shares(self, places: Sequence[int] | None = None) -> FloatArray:
        """Return the attacker's payoff at places, by a blast each (places,).

        That of a layout that hides a building is the payoff without a barrier.

        Args:
            places: Numbers of the places; all unless given.
        """
        chosen = range(len(self.charges)) if places is None else places
        charges = [self.charges[place] for place in chosen]
        found = self._loads(self.layout, charges)
        # A layout that hides a building, whose load is no number, is worth as much as none.
        hides = np.isnan(found)
        if hides.any():
            found[hides] = self._loads((), charges)[hides]
        shares: FloatArray = found / self._worst_unprotected
        return shares

    def best_response(self) -> int:
        """Return the place of the largest load, by a blast at each: the attacker's best answer."""
        return int(np.argmax(np.where(self._in_reach, self.shares(), -np.inf)))

    @property
    def _placement(self) -> LayoutState:
        return self.placing.placement

    @property
    def _places(self) -> NDArray[np.float32]:
        site = self.scenario.site
        rows = []
        for charge in self.charges:
            met = charge_against(self.scenario, self.layout, charge)
            x_m, y_m = met.position_m
            mass = min(np.cbrt(met.tnt_kg / _LARGEST_KG), 1.0)
            rows.append((x_m / site.width_m, y_m / site.height_m, mass))
        return np.array(np.clip(rows, 0.0, 1.0), dtype=np.float32)

    @property
    def _in_reach(self) -> BoolArray:
        """Whether each place is another than all before it (places,)."""
        met = [charge_against(self.scenario, self.layout, charge) for charge in self.charges]
        return np.array([charge not in met[:number] for number, charge in enumerate(met)])

    @cached_property
    def _worst_unprotected(self) -> float:
        worst = float(self._loads((), self.charges).max())
        if not worst > 0.0:
            raise BlastEnvError(f"{self.scenario.name}: nothing arrives without a barrier")
        return worst

    def _loads(self, layout: Layout, charges: Sequence[AnyCharge]) -> FloatArray:
        pairs = [(layout, LoadCase(charge, _SEED)) for charge in charges]
        objective = self.scenario.objective
        return np.array([load.load(objective) for load in self.evaluator.loads_of_many(pairs)])


def _charges(scenario: Scenario) -> tuple[AnyCharge, ...]:
    """Return the charge at each place that the attacker may choose."""
    found: list[AnyCharge] = []
    for source in scenario.charge:
        if isinstance(source, VehicleSource):
            found += [VehicleCharge(source, rank) for rank in range(source.places)]
        else:
            found += [
                Charge(place_m, source.tnt_kg, source.height_m) for place_m in places_of(source)
            ]
    return tuple(found)
