"""The gas blasts of studies, searches and trainings, as one documented data set."""

from blast_env.benchmark.data.gas_blasts import COLUMNS, TABLES, as_tensors, load, sources
from blast_env.benchmark.data.published import remember_published

__all__ = ["COLUMNS", "TABLES", "as_tensors", "load", "remember_published", "sources"]
