"""Training of agents with stable-baselines3, in run folders that survive any interruption."""

from agents.training.agent import TrainedAgent, load_agent, load_archive
from agents.training.hyperparameters import Hyperparameters, load_hyperparameters
from agents.training.settings import TrainingSettings
from agents.training.train import resume, train

__all__ = [
    "Hyperparameters",
    "TrainedAgent",
    "TrainingSettings",
    "load_agent",
    "load_archive",
    "load_hyperparameters",
    "resume",
    "train",
]
