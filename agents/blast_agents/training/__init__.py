"""Training of agents with stable-baselines3, in run folders that survive interruptions."""

from blast_agents.training.agent import PolicyAgent, load_agent, load_archive
from blast_agents.training.environments import BatchVecEnv
from blast_agents.training.hyperparameters import Hyperparameters, load_hyperparameters
from blast_agents.training.run_folder import TrainingSettings
from blast_agents.training.train import resume, train

__all__ = [
    "BatchVecEnv",
    "Hyperparameters",
    "PolicyAgent",
    "TrainingSettings",
    "load_agent",
    "load_archive",
    "load_hyperparameters",
    "resume",
    "train",
]
