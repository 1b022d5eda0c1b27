"""Policies with a logit for each cell of the build zone, instead of one dense layer over all."""

from typing import Any

from gymnasium import spaces
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from torch import Tensor, nn

from agents.policies.network import CellLogits, ZoneExtractor, ZoneLatents


class ZonePolicy(BasePolicy):
    """What the spatial policies of both algorithms have in common.

    Args:
        observation_space: Of a `"grid"` observation.
        action_space: Of the environment.
        lr_schedule: Learning rate by the share of the training that is left.
        rows: Rows of the build zone.
        columns: Its columns.
        places: Places that stand for where the charge may be: more than 1 if it is hidden; 1
            unless given.
        width: Number of features of a cell.
        critic_width: Neurons of the critic's hidden layer.
        finish_bias: What the logit of finishing begins with; below 0, modules are placed first.
        **others: For stable-baselines3's policy.
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
        **others: Any,
    ) -> None:
        self.width, self.critic_width, self.finish_bias = width, critic_width, finish_bias
        arguments: dict[str, Any] = {
            "lr_schedule": lr_schedule,
            "features_extractor_class": ZoneExtractor,
            "features_extractor_kwargs": {
                "rows": rows,
                "columns": columns,
                "places": places or 1,
                "width": width,
            },
            "normalize_images": False,  # the extractor does it, for the planes that it needs
        }
        super().__init__(observation_space, action_space, **arguments, **others)

    def extract_features(
        self,
        obs: PyTorchObs,
        features_extractor: BaseFeaturesExtractor | None = None,  # noqa: ARG002
    ) -> Tensor:
        """Return the features, without a conversion of all the planes."""
        features: Tensor = self.features_extractor(obs)
        return features

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = ZoneLatents(self.width, self.critic_width)

    def _replace_action_net(self, learning_rate: float) -> None:
        """Put the logits by cell in the place of the dense layer; the optimizer has to know."""
        self.action_net: nn.Module = CellLogits(self.width, self.finish_bias)
        arguments = {"lr": learning_rate} | self.optimizer_kwargs
        self.optimizer = self.optimizer_class(self.parameters(), **arguments)


class SpatialPolicy(ZonePolicy, ActorCriticPolicy):
    """For stable-baselines3's `PPO`; see `ZonePolicy` for the arguments."""

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self._replace_action_net(lr_schedule(1.0))


class SpatialMaskablePolicy(ZonePolicy, MaskableActorCriticPolicy):
    """For sb3-contrib's `MaskablePPO`; see `ZonePolicy` for the arguments."""

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self._replace_action_net(lr_schedule(1.0))
