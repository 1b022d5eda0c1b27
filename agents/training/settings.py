"""What a training run is about, as its run folder keeps it."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from agents.training.hyperparameters import ALGORITHMS, Hyperparameters
from agents.training.set_options import described
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError

CONFIGURATION_FORMAT: Final = 1
SITES: Final = "sites"
"""Name of the generated sites, where a scenario is asked for."""

THREATS: Final = ("visible", "hidden")

SETTING_KEYS: Final = (
    "hidden_threats",
    "evaluation_interval",
    "evaluation_cases",
    "evaluation_first_seed",
    "torch_threads",
)
"""Settings that `--set` changes, beside the hyperparameters."""


class TrainingSettings(BaseModel):
    """What is trained on what; how is for the hyperparameters.

    Attributes:
        algorithm: `"ppo"` or `"maskable_ppo"`.
        scenario: Bundled name, path of a scenario file, or `"sites"` for generated ones.
        steps: Steps to train for; a rollout is always finished.
        seed: Decides everything: weights, episodes, actions, minibatches.
        threat: `"visible"`: the agent sees the charge; `"hidden"`: it sees where it may be.
        engine: Engine that runs the blasts.
        hidden_threats: Charges in an episode where they are hidden. The mean over episodes is the
            same for any number; with few, more layouts are tried for the same number of blasts.
        evaluation_interval: Rollouts from one evaluation to the next.
        evaluation_cases: Held-out threats that the layouts are evaluated on.
        evaluation_first_seed: The seeds of these threats count from here.
        torch_threads: Threads for the network.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    algorithm: Literal["ppo", "maskable_ppo"]
    scenario: str
    steps: Annotated[int, Field(ge=1, le=10**10)]
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    threat: Literal["visible", "hidden"] = "visible"
    engine: str = "event"
    hidden_threats: Annotated[int, Field(ge=1, le=1000)] = 2
    evaluation_interval: Annotated[int, Field(ge=1)] = 5
    evaluation_cases: Annotated[int, Field(ge=2, le=100)] = 16
    evaluation_first_seed: Annotated[int, Field(ge=0)] = 1_000_000
    torch_threads: Annotated[int, Field(ge=1, le=256)] = 1


class RunConfiguration(BaseModel):
    """All that a run needs to be repeated, with the file of its scenario.

    Attributes:
        format: Version of this form.
        settings: What is trained on what.
        hyperparameters: How.
        scenario_hash: Content hash of the scenario; of sites, that of the first one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = CONFIGURATION_FORMAT
    settings: TrainingSettings
    hyperparameters: Hyperparameters
    scenario_hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]

    def document(self) -> dict[str, Any]:
        """Return plain data."""
        return self.model_dump(mode="json")


def settings_from(values: Mapping[str, Any]) -> TrainingSettings:
    """Return settings from plain values.

    Raises:
        UnknownNameError: If there is no such algorithm or threat; the message names the nearest.
        BlastEnvError: If a value is of no use; the message names its bound.
    """
    check_names("algorithm", [values.get("algorithm", ALGORITHMS[0])], ALGORITHMS)
    check_names("threat", [values.get("threat", THREATS[0])], THREATS)
    try:
        return TrainingSettings.model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(described(error, "training")) from error
