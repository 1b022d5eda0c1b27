"""Whether the engines, and finer balls, say the same: loads, single modules, layouts."""
