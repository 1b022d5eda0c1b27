"""The spatial policy, which applies the same small network to every cell."""

from typing import Any, Final

import torch
from gymnasium import spaces
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor
from stable_baselines3.common.type_aliases import Schedule
from torch import Tensor, nn

from blast_agents.policies.features import (
    CELL_FEATURES,
    SITE_FEATURES,
    STATIC,
    Planes,
    ZoneGeometry,
)
from blast_env.envs.planes import GridObservation
from blast_env.errors import BlastEnvError

_LOGIT_GAIN: Final = 0.01

_OVERVIEW: Final = (
    *("protected", "other_structures", "charge", "barrier"),
    *("structure_height", "barrier_height", "reach_without_barrier", "reach"),
)
"""Channels of the network's overview of the site, as far as the observation has them."""


def variant_channels(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the planes of legal places, one per variant of a catalogue, in order."""
    return tuple(channel for channel in channels if channel.endswith(":legal"))


class ZoneExtractor(BaseFeaturesExtractor):
    """Convolutions over the build zone and the site: features of every cell and of the site.

    The features of a cell are computed from its position relative to the line of sight
    (`features.ZoneGeometry`), from the 5 x 5 cells around it, and from an overview of the site. The
    result is flat: `width` features of each cell, cell by cell, then `width` features of the site.

    With a catalogue, the surrounding cells also show heights and the legal places of each variant,
    and the features of the site include heights, costs and remaining stock of the items. With
    vehicles, both show the ground within the vehicles' reach.

    Args:
        observation_space: Space of an observation of planes.
        rows: Rows of the build zone.
        columns: Columns of the build zone.
        places: Number of places that represent the charge.
        width: Number of features.
        channels: Names of the planes.

    Raises:
        BlastEnvError: If the space is not of these planes, or the zone does not fit into it.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        rows: int,
        columns: int,
        places: int,
        width: int,
        channels: tuple[str, ...],
    ) -> None:
        self.shape = _planes_shape(observation_space, len(channels), rows, columns)
        super().__init__(observation_space, width * (rows * columns + 1))
        self.channels = tuple(channels)
        self.shown = tuple(name for name in _OVERVIEW if name in self.channels)
        self.rows, self.columns, self.places, self.width = rows, columns, places, width
        self._known: tuple[Tensor, ZoneGeometry] | None = None
        values = (":height", ":cost", ":left")
        self.items = tuple(channel for channel in self.channels if channel.endswith(values))
        variants = variant_channels(self.channels)
        self.around = ("barrier_height", "stops_vehicles", *variants) if variants else ()
        # Posts are useful where they cut off ground within a vehicle's reach.
        self.around += ("reach",) if "reach" in self.channels else ()
        self.near = nn.Conv2d(2 + len(self.around), width, 5, padding=2)
        self.overview = nn.Sequential(
            nn.AvgPool2d(4, ceil_mode=True),
            nn.Conv2d(len(self.shown), 16, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.Conv2d(16, width, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.AdaptiveAvgPool2d(1),
            nn.Flatten(),
        )
        self.cells = nn.Linear(len(CELL_FEATURES), width)
        self.site = nn.Linear(len(SITE_FEATURES) + width + len(self.items), width)
        self.mixed = nn.Linear(width, width)
        self.whole = nn.Linear(3 * width, width)

    def forward(self, observations: Tensor) -> Tensor:
        """Return the features (batch, width * (rows * columns + 1)).

        Args:
            observations: Values from 0 to 1 (batch, channels, height, width).

        Raises:
            BlastEnvError: If their shape is not that of the space.
        """
        if observations.shape[1:] != self.shape:
            raise BlastEnvError(
                f"observations have the shape {tuple(observations.shape[1:])}, must have the "
                f"policy's {self.shape}: (channels, rows, columns)"
            )
        with torch.no_grad():  # this block has no weights
            named = Planes(observations, self.channels)
            geometry = self._geometry(named)
            view = geometry.view(named)
            planes = named.of(self.shown)
            own = [geometry.crop(named[name]) for name in self.around]
            around = torch.stack((view.barrier, view.free, *own), dim=1)
            items = named.of(self.items)[:, :, 0, 0]
        site = self.site(torch.cat((view.site, self.overview(planes), items), dim=1))
        near = self.near(around).permute(0, 2, 3, 1)
        cells = torch.relu(self.cells(view.cells) + near + site[:, None, None, :])
        cells = torch.relu(self.mixed(cells)).flatten(1, 2)
        whole = torch.cat((torch.relu(site), cells.mean(dim=1), cells.amax(dim=1)), dim=1)
        return torch.cat((cells.flatten(1), torch.relu(self.whole(whole))), dim=1)

    def _geometry(self, planes: Planes) -> ZoneGeometry:
        """Return the geometry, cached for equal sites and charges."""
        static = planes.of(STATIC)
        if self._known is None or not torch.equal(self._known[0], static):
            geometry = ZoneGeometry.of(planes, self.rows, self.columns, self.places)
            self._known = static, geometry
        return self._known[1]


def _planes_shape(
    space: spaces.Space[Any], channels: int, rows: int, columns: int
) -> tuple[int, ...]:
    """Return the shape of a space of planes (channels, rows, columns)."""
    shape = tuple(space.shape or ())
    if len(shape) != 3 or shape[0] != channels or shape[1] < rows or shape[2] < columns:
        raise BlastEnvError(
            f"observation_space has the shape {shape}, must have (channels, rows, columns) with "
            f"{channels} channels, at least {rows} rows and at least {columns} columns"
        )
    return shape


class ZoneLatents(MlpExtractor):
    """Forwards all features of `ZoneExtractor` to the actor, and those of the site to the critic.

    Args:
        width: Number of features of a cell, and of the site.
        critic_width: Neurons of the critic's hidden layer.
    """

    def __init__(self, width: int, critic_width: int) -> None:
        super().__init__(width, {"pi": [], "vf": [critic_width]}, nn.ReLU)
        self.width = width

    def forward_actor(self, features: Tensor) -> Tensor:
        """Return all features."""
        return features

    def forward_critic(self, features: Tensor) -> Tensor:
        """Return the critic's hidden layer (batch, critic_width)."""
        return super().forward_critic(features[:, -self.width :])


class CellLogits(nn.Module):
    """Logits of each cell from its features, and one of finishing from those of the site.

    A cell has one logit per variant, for the placement of its lower left cell there.

    Args:
        width: Number of features of a cell, and of the site.
        finish_bias: Initial bias of the logit of finishing; below 0 it favours placing modules.
        variants: Number of variants; 1 without a catalogue.
    """

    def __init__(self, width: int, finish_bias: float, variants: int = 1) -> None:
        super().__init__()
        self.width = width
        self.cell = nn.Linear(width, variants)
        self.finish = nn.Linear(width, 1)
        nn.init.orthogonal_(self.cell.weight, gain=_LOGIT_GAIN)
        nn.init.orthogonal_(self.finish.weight, gain=_LOGIT_GAIN)
        nn.init.constant_(self.cell.bias, 0.0)
        nn.init.constant_(self.finish.bias, finish_bias)

    def forward(self, features: Tensor) -> Tensor:
        """Return the logits (batch, variants * cells + 1), variant by variant."""
        cells = features[:, : -self.width].reshape(len(features), -1, self.width)
        finish = self.finish(features[:, -self.width :])
        return torch.cat((self.cell(cells).transpose(1, 2).flatten(1), finish), dim=1)


class ZonePolicy(BasePolicy):
    """Base class of the spatial policies of both algorithms.

    Args:
        observation_space: Space of an observation of planes.
        action_space: Space of the environment's actions.
        lr_schedule: Learning rate as a function of the remaining share of the training.
        rows: Rows of the build zone.
        columns: Columns of the build zone.
        places: Number of places that represent the charge, more than 1 for a hidden one; 1 by
            default.
        width: Number of features of a cell.
        critic_width: Neurons of the critic's hidden layer.
        finish_bias: Initial bias of the logit of finishing; below 0 it favours placing modules.
        channels: Names of the planes; by default those of a `"grid"` observation.
        **others: Arguments of stable-baselines3's policy.
    """

    mlp_extractor: MlpExtractor

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        lr_schedule: Schedule,
        rows: int,
        columns: int,
        places: int | None = None,
        width: int = 24,
        critic_width: int = 64,
        finish_bias: float = -3.0,
        channels: tuple[str, ...] = GridObservation.channels,
        **others: Any,
    ) -> None:
        self.width, self.critic_width, self.finish_bias = width, critic_width, finish_bias
        self.variants = max(len(variant_channels(tuple(channels))), 1)
        arguments: dict[str, Any] = {
            "lr_schedule": lr_schedule,
            "features_extractor_class": ZoneExtractor,
            "features_extractor_kwargs": {
                "rows": rows,
                "columns": columns,
                "places": places or 1,
                "width": width,
                "channels": channels,
            },
        }
        super().__init__(observation_space, action_space, **arguments, **others)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = ZoneLatents(self.width, self.critic_width)

    def _build(self, lr_schedule: Schedule) -> None:
        """Replace the dense layer by the logits per cell, and rebuild the optimiser for it."""
        super()._build(lr_schedule)  # type: ignore[misc]  # that of the library's policy
        self.action_net: nn.Module = CellLogits(self.width, self.finish_bias, self.variants)
        arguments = {"lr": lr_schedule(1.0)} | self.optimizer_kwargs
        self.optimizer = self.optimizer_class(self.parameters(), **arguments)


class SpatialPolicy(ZonePolicy, ActorCriticPolicy):
    """The policy for stable-baselines3's `PPO`; see `ZonePolicy` for the arguments."""


class SpatialMaskablePolicy(ZonePolicy, MaskableActorCriticPolicy):
    """The policy for sb3-contrib's `MaskablePPO`; see `ZonePolicy` for the arguments."""
